"""Command line: `prosthesis-gym walk | render | scenarios | bodies | accuracy | bench | torture | parameters`."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

from prosthesis_gym.cli import accuracy, bench, bodies, parameters, render, scenarios, torture, walk
from prosthesis_gym.console import spell_what_cannot_be_encoded

_EXAMPLES = """\
examples:
  prosthesis-gym walk
  prosthesis-gym walk --scenario trial40 --plot trial40.png --out trial40.parquet
  prosthesis-gym render --scenario trial40 --out trial40.mp4
  prosthesis-gym bodies --out bodies.csv
  prosthesis-gym accuracy --episodes 512
  prosthesis-gym bench --walkers 1 4096
  prosthesis-gym torture --steps 10000000
  prosthesis-gym parameters knee
"""


def new_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line; what it parses has a function `run`."""
    parser = argparse.ArgumentParser(
        prog="prosthesis-gym",
        description="Simulate walking with a lower-limb prosthesis.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {version('prosthesis-gym')}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for command in (walk, render, scenarios, bodies, accuracy, bench, torture, parameters):
        command.add_parser(commands)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command. Exit code 0 for success, 1 for what a check found wrong, 2 for bad input, 130 for Ctrl-C."""
    spell_what_cannot_be_encoded()
    arguments = new_parser().parse_args(argv)
    try:
        arguments.run(arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader (head, less) has what it wanted; keep the interpreter's last flush from complaining.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, OSError, ModuleNotFoundError) as error:
        print(f"prosthesis-gym: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0
