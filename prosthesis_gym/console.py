"""Output that no terminal dies of: characters that its encoding lacks are spelt in ASCII."""

import codecs
import io
import sys
import unicodedata
from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import contextmanager

_HANDLER = "prosthesis_gym.spelt"
_SPELT = {
    "²": "^2",
    "³": "^3",
    "°": "deg",
    "µ": "u",
    "μ": "u",
    "±": "+-",
    "×": "x",
    "·": "*",
    "−": "-",
    "–": "-",
    "—": "-",
    "…": "...",
    "→": "->",
    "≤": "<=",
    "≥": ">=",
    "‘": "'",
    "’": "'",
    "“": '"',
    "”": '"',
}


def _spell(error: UnicodeError) -> tuple[str, int]:
    """Spell what cannot be encoded: by the table, without its accents, as a line of a table, or else as a "?"."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_ascii, error.object[error.start : error.end])), error.end


def _ascii(character: str) -> str:
    if character in _SPELT:
        return _SPELT[character]
    name = unicodedata.name(character, "")
    if name.startswith("BOX DRAWINGS"):
        return "+" if " AND " in name else "-" if name.endswith("HORIZONTAL") else "|"
    bare = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return bare or "?"


codecs.register_error(_HANDLER, _spell)


def spell_what_cannot_be_encoded() -> None:
    """Let standard output and standard error spell what their encoding lacks, instead of raising UnicodeEncodeError."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)


@contextmanager
def clean_exit(parser: ArgumentParser) -> Iterator[None]:
    """Let a command end with one line and exit code 2 where the user is to blame, and with 130 at Ctrl-C."""
    try:
        yield
    except (ValueError, OSError, ModuleNotFoundError) as error:
        parser.exit(2, f"{parser.prog}: error: {error}\n")
    except KeyboardInterrupt:
        parser.exit(130)
