"""Signs of life from what takes long: on stderr, and only once somebody may have begun to wonder."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

#: What takes longer than this shows a bar.
_PATIENCE_S = 1.5


@contextmanager
def progress_bar(
    activity: str, total: float, unit: str, *, shown: bool = True, console: Console | None = None
) -> Iterator[Callable[[float], None]]:
    """Yield a function that takes what is done of `total`; a bar shows it after a while, called or not."""
    amount = TextColumn("{task.completed:,.0f} of {task.total:,.0f} " + unit)
    columns = (TextColumn(activity), BarColumn(None), amount, TimeRemainingColumn())
    with _patient(columns, total, console, shown=shown) as show:
        yield show


@contextmanager
def waiting(activity: str, *, shown: bool = True, console: Console | None = None) -> Iterator[None]:
    """Show after a while that `activity` goes on, of which nobody knows how long it takes."""
    with _patient((TextColumn(activity), BarColumn(20), TimeElapsedColumn()), None, console, shown=shown):
        yield


@contextmanager
def _patient(
    columns: tuple[ProgressColumn, ...], total: float | None, console: Console | None, *, shown: bool
) -> Iterator[Callable[[float], None]]:
    # Bars fill what the other columns leave of the width: none of them is cut off.
    bar = Progress(*columns, console=console or Console(stderr=True), transient=True, expand=total is not None)
    task = bar.add_task("", total=total)
    # A timer, because what takes long may be a single call.
    timer = threading.Timer(_PATIENCE_S, bar.start)
    timer.daemon = True
    # In a log, a bar would leave empty lines alone.
    shown = shown and (bar.console.is_terminal or bar.console.is_jupyter)
    if shown:
        timer.start()
    try:
        yield lambda done: bar.update(task, completed=done)
    finally:
        timer.cancel()
        if shown:
            timer.join()
        if bar.live.is_started:
            bar.stop()
