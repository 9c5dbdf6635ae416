"""`prosthesis-gym parameters`: every configuration key."""

import argparse
import json
import textwrap

from rich.console import Console
from rich.text import Text

from prosthesis_gym import _core
from prosthesis_gym.cli.parsers import Commands, new_parser

_EXAMPLES = """\
examples:
  prosthesis-gym parameters
  prosthesis-gym parameters knee. spring
  prosthesis-gym parameters --json
"""
_INDENT = 4 * " "


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(
        commands, "parameters", "list every configuration key with default, unit, range and meaning", _EXAMPLES
    )
    parser.add_argument("words", nargs="*", metavar="WORD", help="only keys whose name or meaning contains every word")
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print the keys."""
    words = [word.lower() for word in arguments.words]
    rows = [row for row in _core.parameters() if all(word in f"{row['key']} {row['doc']}".lower() for word in words)]
    if not rows:
        raise ValueError(f"no parameter contains {' and '.join(map(repr, words))}")
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    console = Console(highlight=False)
    for row in rows:
        console.print(
            Text(row["key"], "bold"), f"= {row['default']} {row['unit']}".rstrip(), f"in {row['range']}", markup=False
        )
        console.print(
            textwrap.fill(row["doc"], console.width, initial_indent=_INDENT, subsequent_indent=_INDENT), markup=False
        )
