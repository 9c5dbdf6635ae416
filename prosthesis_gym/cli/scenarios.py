"""`prosthesis-gym scenarios`: which there are, and how often the state machine falls in them."""

import argparse

from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from prosthesis_gym.cli.parsers import Commands, new_parser
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.scenarios import SCENARIOS, read_scenario, scenario_description

_EXAMPLES = """\
examples:
  prosthesis-gym scenarios                               what they are for
  prosthesis-gym scenarios --episodes 256                falls of each knee's state machine in each
  prosthesis-gym scenarios my_scenario.toml --episodes 512 --device damper

A cell is the share of held-out episodes that ended in a fall, with its 95 % interval in per cent.
"""


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "scenarios", "list the scenarios, and count falls in them", _EXAMPLES)
    add = parser.add_argument
    add("scenario", nargs="*", metavar="NAME|FILE", help="presets or files (default: all presets)")
    add("--episodes", type=int, metavar="N", help="count the falls of the state machine in N episodes of each")
    add("--device", nargs="+", choices=list(DEVICES), help="knee units whose falls to count (default: all)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """List or evaluate, then print."""
    if arguments.episodes is None and arguments.device is not None:
        raise ValueError(f"--device {' '.join(arguments.device)} needs --episodes: without, nobody walks")
    names = arguments.scenario or list(SCENARIOS)
    for name in names:
        read_scenario(name)
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    table.add_column("scenario")
    if arguments.episodes is None:
        table.add_column("what for")
        for name in names:
            table.add_row(name, scenario_description(name) if name in SCENARIOS else "")
    else:
        devices = arguments.device or list(DEVICES)
        for device in devices:
            table.add_column(device, justify="right")
        for name in track(names, "walking", console=Console(stderr=True), transient=True):
            table.add_row(name, *(_falls(name, device, arguments.episodes) for device in devices))
    Console().print(table)


def _falls(scenario: str, device: str, episodes: int) -> str:
    result = evaluate(None, {"device": {"kind": device}}, scenario=scenario, episodes=episodes)
    low, high = result.interval
    return f"{result.fall_rate:.1%} ({100 * low:.0f}-{100 * high:.0f})"
