"""What the documentation shows, works: its Python runs, its commands parse, its tables are those of the code."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from _pytest.mark import ParameterSet

from docs.generate import COMMAND, generate, stale_pages
from docs.tables import TABLES
from prosthesis_gym.cli import new_parser
from prosthesis_gym.trial import Trial

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[tuple[str, str]]:
    """Return (file:line, text) of every fenced block in a language."""
    found = []
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        for match in re.finditer(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
            line = text.count("\n", 0, match.start()) + 2
            found.append((f"{path.relative_to(ROOT)}:{line}", match[1]))
    return found


def example(place: str, code: str) -> ParameterSet:
    """Return the parameters of a test; RLlib, which not everybody has, warns of its own plans."""
    marks = [pytest.mark.filterwarnings("ignore")] if "ray.rllib" in code else []
    return pytest.param(place, code, id=place, marks=marks)


PYTHON = blocks("python")
COMMANDS = [
    (f"{place}: {line}", shlex.split(line, comments=True))
    for place, text in blocks("sh")
    for line in map(str.strip, text.splitlines())
    if line.startswith(("prosthesis-gym ", "python "))
]


def test_documents_show_code() -> None:
    assert len(PYTHON) >= 2
    assert len(COMMANDS) >= 10


@pytest.mark.parametrize(("place", "code"), [example(*block) for block in PYTHON])
def test_python_runs(place: str, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if "ray.rllib" in code:
        pytest.importorskip("ray.rllib", reason="RLlib is in the virtual environment of .ci/contracts")
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(code, place, "exec"), names)
    if isinstance(names.get("trial"), Trial):
        assert names["trial"].outcome == "walking", "a document shows a walker that falls"


@pytest.mark.parametrize("command", [words for _, words in COMMANDS], ids=[line for line, _ in COMMANDS])
def test_command_parses_and_its_files_exist(command: list[str]) -> None:
    if command[0] == "prosthesis-gym":
        # Shell redirection is not the command's.
        arguments = command[1 : command.index(">")] if ">" in command else command[1:]
        assert callable(new_parser().parse_args(arguments).run)
    for word in command:
        if word.startswith(("configs/", "examples/")):
            assert (ROOT / word).exists()


def test_generated_tables_are_up_to_date() -> None:
    stale = [str(page.relative_to(ROOT)) for page in stale_pages()]
    assert not stale, f"out of date: {', '.join(stale)}; run: {COMMAND}"


def test_every_generated_table_stands_in_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in DOCUMENTS)
    assert sorted(re.findall(r"^<!-- begin generated: (\S+) -->$", text, re.MULTILINE)) == sorted(TABLES)


def test_generation_replaces_what_is_between_the_markers_alone() -> None:
    page = "above\n<!-- begin generated: reward -->\nold\n<!-- end generated: reward -->\nbelow\n"
    new = generate(page)
    assert new.startswith("above\n<!-- begin")
    assert new.endswith("<!-- end generated: reward -->\nbelow\n")
    assert "old" not in new
    assert "`stance_buckling`" in new
    assert generate(new) == new


@pytest.mark.parametrize(
    ("page", "named"),
    [
        ("<!-- begin generated: reward -->\n", "reward"),
        ("<!-- begin generated: reward -->\n<!-- end generated: reasons -->\n", "reward"),
        ("<!-- end generated: reward -->\n<!-- begin generated: reward -->\n", "reward"),
        ("<!-- begin generated: weather -->\n<!-- end generated: weather -->\n", "weather"),
    ],
)
def test_wrong_markers_are_named(page: str, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        generate(page)
