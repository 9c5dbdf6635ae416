"""`prosthesis-gym walk`: one trial, as a table, as data and as a figure."""

import argparse
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from prosthesis_gym.cli.parsers import Commands, check_overwrite, new_parser
from prosthesis_gym.cli.trial_options import add_controller_option, add_trial_options, configure
from prosthesis_gym.config import resolve
from prosthesis_gym.draws import drawn_line, left_to_chance
from prosthesis_gym.gait import Stride, mean_powers, stride_json, stride_table
from prosthesis_gym.plotting import check_plot_path, plot_trial
from prosthesis_gym.progress import waiting
from prosthesis_gym.trial import Trial, check_trial_path, run_trial, save_trial

_EXAMPLES = """\
examples:
  prosthesis-gym walk                                  from standing to 1.1 m/s, 10 s
  prosthesis-gym walk --scenario trial40 --plot trial40.png
  prosthesis-gym walk --speed 1.3 --duration 20 --set knee.spring_nm_rad=1
  prosthesis-gym walk --mass 60 --height 1.65 --set ground.slope_deg=2
  prosthesis-gym walk --start cyclic --controller constant:0 --out no_damper.csv
  prosthesis-gym walk --scenario my_speeds.csv --json > strides.json
  prosthesis-gym walk --device motor --duration 12 --window 3.52 9.24
  prosthesis-gym walk --device friction --controller constant:4

A scenario file is a TOML file with [scenario] and other sections of what a walker meets, or a CSV
with the columns time_s, speed_m_s, walk; `prosthesis-gym scenarios` lists the presets. What is
given later in this list counts: the defaults of this command, --config, --scenario (in place of
the defaults' scenario), the other options, --set (keys: `prosthesis-gym parameters`).
"""

#: Columns of the printed table: heading, measure, decimals.
_COLUMNS = (
    ("time\ns", "heel_strike_s", 2),
    ("speed\nm/s", "speed_m_s", 3),
    ("length\nm", "stride_length_m", 3),
    ("stride\ns", "stride_time_s", 3),
    ("stance\nres. %", "residual_stance_percent", 1),
    ("\nint. %", "intact_stance_percent", 1),
    ("knee\nswing °", "peak_swing_knee_deg", 1),
    ("\nload °", "peak_stance_knee_deg", 1),
    ("hip\nres. m", "hip_peak_residual_stance_m", 3),
    ("\nint. m", "hip_peak_intact_stance_m", 3),
    ("stop\nN m", "peak_extension_stop_nm", 0),
)


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "walk", "simulate one walking trial", _EXAMPLES)
    add_controller_option(add_trial_options(parser))
    add = parser.add_argument_group("what comes out").add_argument
    add("--out", type=Path, metavar="FILE", help="every signal at 200 Hz, as .parquet or .csv")
    add("--plot", type=Path, metavar="FILE", help="figure of the trial, as .png, .pdf or .svg")
    add("--json", action="store_true", help="the strides as JSON on standard output, and nothing else")
    add(
        "--window",
        nargs=2,
        type=float,
        metavar=("START", "END"),
        help="mean powers of a motor knee from START to END (s), such as two heel strikes",
    )
    add("--force", action="store_true", help="overwrite existing files")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, then write and print."""
    _check_outputs(arguments)
    config, policy = configure(arguments)
    if arguments.window is not None and (device := resolve(config)["device"]["kind"]) != "motor":
        raise ValueError(f"--window is for a motor knee, and this one is {device!r}; choose it with --device motor")
    trial = run_trial(config, policy=policy, seed=arguments.seed)
    powers = None if arguments.window is None else mean_powers(trial, *arguments.window)
    if arguments.out:
        with waiting(f"writing {arguments.out}"):
            save_trial(trial, arguments.out)
    if arguments.plot:
        with waiting(f"drawing {arguments.plot}"):
            plot_trial(trial, arguments.plot)
    if arguments.json:
        print(stride_json(trial, powers))
    else:
        _print(trial, [path for path in (arguments.out, arguments.plot) if path])
        if powers is not None:
            _print_powers(powers, *arguments.window)


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Raise the errors that would otherwise come only after the simulation."""
    for path, check in ((arguments.out, check_trial_path), (arguments.plot, check_plot_path)):
        if path is not None:
            check(path)
            check_overwrite(path, arguments.force)


def _print(trial: Trial, written: list[Path]) -> None:
    strides = stride_table(trial)
    if strides:
        Console().print(_table(strides))
    if drawn := left_to_chance(trial):
        print(drawn_line(trial.seed, drawn))
    print(f"{trial.outcome} after {trial.end_s:.2f} s, {len(strides)} full strides")
    for path in written:
        print(f"wrote {path}")


def _print_powers(powers: dict[str, float], begin_s: float, end_s: float) -> None:
    table = Table(box=box.SIMPLE_HEAD, padding=0, title=f"mean power from {begin_s:.2f} to {end_s:.2f} s")
    table.add_column("")
    table.add_column("W", justify="right")
    for name, power_w in powers.items():
        table.add_row(name.removesuffix("_w").replace("_", " "), f"{power_w:.1f}")
    Console().print(table)


def _table(strides: list[Stride]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for heading, _, _ in _COLUMNS:
        table.add_column(heading, justify="right")
    for stride in strides:
        table.add_row(*(f"{getattr(stride, measure):.{decimals}f}" for _, measure, decimals in _COLUMNS))
    return table
