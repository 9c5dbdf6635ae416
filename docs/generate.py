"""Writes the tables of the documentation pages from the code: `python -m docs.generate`.

A table stands between the lines `<!-- begin generated: NAME -->` and `<!-- end generated: NAME -->`, NAME being a key
of `docs.tables.TABLES`. What stands outside is written by hand and stays as it is.
"""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from docs.tables import TABLES
from prosthesis_gym.files import atomic_write

COMMAND = "python -m docs.generate"
"""What brings the pages up to date, from the root of the repository."""

PAGES = tuple(sorted(Path(__file__).parent.glob("*.md")))

_MARKER = re.compile(r"^<!-- (begin|end) generated: (\S+) -->$", re.MULTILINE)


def generate(page: str) -> str:
    """Return the text of a page with its tables up to date.

    Raises:
        ValueError: a table is unknown, or its markers are not in pairs.

    """
    parts: list[str] = []
    written = 0
    markers = list(_MARKER.finditer(page))
    for begin, end in zip(markers[::2], [*markers[1::2], None], strict=False):
        name = begin[2]
        if begin[1] != "begin" or end is None or end[1] != "end" or end[2] != name:
            raise ValueError(f"marker {begin[0]!r} has no partner: markers are pairs of begin and end with one name")
        if name not in TABLES:
            raise ValueError(f"generated table {name!r} must be one of {', '.join(sorted(TABLES))}")
        parts += [page[written : begin.end()], f"\n\n{TABLES[name]()}\n\n"]
        written = end.start()
    return "".join([*parts, page[written:]])


def stale_pages() -> list[Path]:
    """Return the pages that `main` would change."""
    return [page for page in PAGES if _updated(page) is not None]


def _updated(page: Path) -> str | None:
    """Return the new text of a page, None if it is up to date."""
    text = page.read_text(encoding="utf-8")
    try:
        new = generate(text)
    except ValueError as error:
        raise ValueError(f"{page}: {error}") from None
    return None if new == text else new


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command. Exit code 1 with --check if a page is out of date, 2 for wrong markers."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Write the tables of the pages in docs/ from the code.")
    parser.add_argument("--check", action="store_true", help="change nothing; fail if a page is out of date")
    check = parser.parse_args(argv).check
    try:
        updates = {page: text for page in PAGES if (text := _updated(page)) is not None}
    except ValueError as error:
        print(f"{COMMAND}: error: {error}", file=sys.stderr)
        return 2
    for page, text in updates.items():
        if check:
            print(f"{page} is out of date: {COMMAND}", file=sys.stderr)
            continue
        with atomic_write(page) as temporary:
            temporary.write_text(text, encoding="utf-8")
        print(f"wrote {page}")
    return 1 if check and updates else 0


if __name__ == "__main__":
    sys.exit(main())
