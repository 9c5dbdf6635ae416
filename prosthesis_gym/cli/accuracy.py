"""`prosthesis-gym accuracy`: how far a solver is from the converged reference, and at what cost."""

import argparse
import csv
import math
import time
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from prosthesis_gym.accuracy import EPISODES, HALF_REFERENCE, GaitError, falls, gait_errors
from prosthesis_gym.cli.parsers import Commands, new_parser
from prosthesis_gym.config import FAST_SOLVER, REFERENCE_SOLVER, Config, merge, resolve
from prosthesis_gym.files import atomic_write

_EXAMPLES = """\
examples:
  prosthesis-gym accuracy
  prosthesis-gym accuracy --solver two_stage_w:5 two_stage_w:10 linearly_implicit_euler:5 --out errors.csv
  prosthesis-gym accuracy --devices motor --speeds 1.1 --episodes 512
"""


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    summary = "compare solvers with the converged reference (rk4; 200 steps for steady gait, 50 for falls)"
    parser = new_parser(commands, "accuracy", summary, _EXAMPLES)
    add = parser.add_argument
    add("--solver", nargs="+", metavar="STEPPER[:STEPS]", help="default: the configuration's")
    add("--devices", nargs="+", default=["damper", "motor"], metavar="KNEE", help="default: damper motor")
    add("--speeds", nargs="+", type=float, default=[0.9, 1.1, 1.3], metavar="M/S", help="default: 0.9 1.1 1.3")
    add(
        "--episodes",
        type=int,
        default=2048,
        metavar="N",
        help="disturbed episodes for falls (default: 2048, 0 for none)",
    )
    add("--out", metavar="FILE.csv", help="write every gait measure")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    if arguments.episodes < 0:
        raise ValueError(f"--episodes = {arguments.episodes} must be 0 or more")
    solvers = [_solver(text) for text in arguments.solver or [FAST_SOLVER["solver"]["stepper"]]]
    console = Console()
    errors: list[tuple[str, GaitError]] = []
    walks = [
        (solver, device, speed) for solver in solvers for device in arguments.devices for speed in arguments.speeds
    ]
    for solver, device, speed in track(walks, "walking", console=console, transient=True):
        errors += [(_name(solver), error) for error in gait_errors(solver, [device], [speed])]
    if arguments.out:
        _save(errors, arguments.out)
    for solver in solvers:
        console.print(_gait_table(_name(solver), [error for name, error in errors if name == _name(solver)]))
    if arguments.episodes:
        console.print(_falls_table(solvers, arguments.devices, arguments.episodes))


def _solver(text: str) -> Config:
    stepper, colon, steps = text.partition(":")
    if colon and not steps.isdigit():
        raise ValueError(f"--solver {text!r} must have the form STEPPER or STEPPER:STEPS, like two_stage_w:5")
    solver: Config = {"solver": {"stepper": stepper, "steps": int(steps or 0)}}
    resolve(solver)
    return solver


def _name(solver: Config) -> str:
    stepper, steps = solver["solver"]["stepper"], solver["solver"]["steps"]
    return f"{stepper}:{steps}" if steps else str(stepper)


def _gait_table(name: str, errors: list[GaitError]) -> Table:
    columns = sorted({(error.device, error.speed_m_s) for error in errors})
    table = Table(title=f"{name}: error of steady gait, %, by speed in m/s", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("measure", no_wrap=True)
    for device, speed in columns:
        table.add_column(f"{device}\n{speed:g}", justify="right")
    cells = {(error.measure, error.device, error.speed_m_s): error for error in errors}
    for measure in dict.fromkeys(error.measure for error in errors):
        row = [cells.get((measure, *column)) for column in columns]
        table.add_row(measure, *("" if error is None else _percent(error.error_percent) for error in row))
    return table


def _percent(value: float) -> str:
    return "fell" if math.isnan(value) else f"{value:+.2f}"


def _falls_table(solvers: list[Config], devices: list[str], episodes: int) -> Table:
    title = f"falls in {episodes} disturbed episodes of 10 s, and agreement with the reference"
    table = Table("solver", title=title, box=box.SIMPLE_HEAD)
    cases = [(kind, device) for kind in EPISODES for device in devices]
    for kind, device in cases:
        table.add_column(f"{device}, {kind}", justify="right")
    table.add_column("wall time", justify="right")
    references: dict[tuple[str, str], Any] = {}
    for solver in track([REFERENCE_SOLVER, HALF_REFERENCE, *solvers], "falling", transient=True):
        cells, began = [], time.perf_counter()
        for kind, device in cases:
            fell = falls(merge(merge(EPISODES[kind], {"device": {"kind": device}}), solver), episodes)
            reference = references.setdefault((kind, device), fell)
            agrees = "" if reference is fell else f", agrees in {100.0 * (fell == reference).mean():.2f} %"
            cells.append(f"{100.0 * fell.mean():.1f} %{agrees}")
        table.add_row(_name(solver), *cells, f"{time.perf_counter() - began:.1f} s")
    return table


def _save(errors: list[tuple[str, GaitError]], path: str) -> None:
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["solver", "device", "speed_m_s", "measure", "reference", "found", "error_percent"])
        for name, e in errors:
            writer.writerow([name, e.device, e.speed_m_s, e.measure, e.reference, e.found, e.error_percent])
