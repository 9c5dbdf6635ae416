"""`prosthesis-gym torture`: the walkers under the worst of everything, for as long as one likes."""

import argparse
import time
from collections import Counter

from rich import box
from rich.console import Console
from rich.table import Table

from prosthesis_gym import _core
from prosthesis_gym.cli.parsers import Commands, new_parser
from prosthesis_gym.progress import progress_bar
from prosthesis_gym.torture import Report, torture

_EXAMPLES = """\
examples:
  prosthesis-gym torture
  prosthesis-gym torture --steps 10000000
  prosthesis-gym torture --steps 100000000 --walkers 4096 --seed 7

Every step is checked: outputs finite and within their spaces, flags and reasons consistent, and after
all of them that resident memory did not grow. Exit code 1 says that something did not hold.
"""


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "torture", "step walkers with adversarial actions and check every step", _EXAMPLES)
    add = parser.add_argument
    add("--steps", type=int, default=1_000_000, metavar="N", help="env steps in all (default: %(default)s)")
    add("--walkers", type=int, default=1024, metavar="N", help="of a batch (default: %(default)s)")
    add("--seed", type=int, default=0, metavar="N", help="default: %(default)s")
    add("--threads", type=int, metavar="N", help="worker threads (default: one per core)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Torture, print, and fail if anything was wrong."""
    began = time.perf_counter()
    with progress_bar("torturing", arguments.steps, "env steps") as show:
        report = torture(
            arguments.steps,
            walkers=arguments.walkers,
            seed=arguments.seed,
            threads=arguments.threads,
            progress=show,
        )
    console = Console()
    console.print(_table(report))
    seconds = time.perf_counter() - began
    console.print(f"{report.env_steps:,} env steps in {report.rounds} rounds, {seconds:.1f} s", highlight=False)
    finer, reference, diverged = report.repeated_periods
    repeated = f"{finer:,} settled in finer steps, {reference:,} by the reference, {diverged:,} by none"
    console.print(f"control periods integrated again: {repeated}", highlight=False)
    growth = f"{report.memory_growth_mib:+.1f} MiB from the first half of the rounds to the second"
    console.print(f"memory {report.memory_mib[-1]:.0f} MiB, {growth}", highlight=False)
    if report.violations:
        raise SystemExit("\n".join(f"{violation}: {where}" for violation, where in report.violations.items()))
    console.print("no violations")


def _table(report: Report) -> Table:
    table = Table("episodes ended by", *report.ends, "all", box=box.SIMPLE_HEAD)
    for column in table.columns[1:]:
        column.justify = "right"
    total: Counter[str] = sum(report.ends.values(), Counter())
    for reason in _core.REASONS[1:]:
        counts = [ends[reason] for ends in (*report.ends.values(), total)]
        table.add_row(reason, *(f"{count:,}" for count in counts))
    return table
