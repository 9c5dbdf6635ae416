"""What takes long shows that it goes on, with whole numbers; what is quick, or goes into a log, shows nothing."""

import threading
import time
from io import StringIO

import pytest
from rich.console import Console

from prosthesis_gym import progress
from prosthesis_gym.progress import progress_bar, waiting


def terminal(width: int = 80) -> tuple[Console, StringIO]:
    text = StringIO()
    return Console(file=text, width=width, force_terminal=True, color_system=None), text


def until_shown(text: StringIO, wanted: str) -> bool:
    """Whether something is shown while the caller does nothing."""
    deadline = time.monotonic() + 60.0
    while wanted not in text.getvalue() and time.monotonic() < deadline:
        time.sleep(0.01)
    return wanted in text.getvalue()


def test_a_single_call_that_takes_long_is_not_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_PATIENCE_S", 0.05)
    console, text = terminal()
    with waiting("drawing walk.png", console=console):
        assert until_shown(text, "drawing walk.png")
    console, text = terminal()
    with progress_bar("simulating", 40.0, "s", console=console):
        assert until_shown(text, "0 of 40 s")


@pytest.mark.parametrize(("total", "unit"), [(2000, "frames"), (10_000_000_000, "env steps")])
def test_totals_are_whole_at_80_columns(total: int, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_PATIENCE_S", 0.0)
    console, text = terminal()
    with progress_bar("torturing", total, unit, console=console) as show:
        show(total - 1)
        assert until_shown(text, f"{total - 1:,} of {total:,} {unit}")
    assert "…" not in text.getvalue()


def test_what_is_quick_shows_nothing_and_leaves_no_thread() -> None:
    before = set(threading.enumerate())
    console, text = terminal()
    with progress_bar("simulating", 1.0, "s", console=console) as show:
        show(1.0)
    assert text.getvalue() == ""
    assert set(threading.enumerate()) <= before


def test_a_log_gets_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_PATIENCE_S", 0.0)
    text = StringIO()
    with waiting("drawing", console=Console(file=text, force_terminal=False)):
        time.sleep(0.05)
    assert text.getvalue() == ""
