"""What the commands' argument parsers share."""

import argparse
from pathlib import Path
from typing import TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def new_parser(commands: Commands, name: str, summary: str, examples: str) -> argparse.ArgumentParser:
    """Add a subcommand whose help ends with examples."""
    return commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=examples,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def check_overwrite(path: Path, force: bool) -> None:
    """Raise a ValueError if the file exists, unless `--force` was given."""
    if path.exists() and not force:
        raise ValueError(f"{path} exists; --force overwrites it")
