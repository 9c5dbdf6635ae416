"""A progress bar for what takes long."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

#: What takes longer than this shows a bar.
_PATIENCE_S = 2.0


@contextmanager
def progress_bar(activity: str, total: float, unit: str, *, shown: bool = True) -> Iterator[Callable[[float], None]]:
    """Yield a function that takes what is done of `total`, and shows a bar on stderr, but only when it takes long."""
    bar = Progress(
        TextColumn(activity),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} " + unit),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task("", total=total)
    began = time.perf_counter()

    def show(done: float) -> None:
        if shown and not bar.live.is_started and time.perf_counter() - began > _PATIENCE_S:
            bar.start()
        bar.update(task, completed=done)

    try:
        yield show
    finally:
        if bar.live.is_started:
            bar.stop()
