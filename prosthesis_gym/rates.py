"""Speeds that hold on machines which others use too: settings take turns, and the median of their turns counts."""

import statistics
import time
from collections.abc import Callable, Sequence

#: Turns of each setting.
TURNS = 11


def median_rates(
    settings: Sequence[Callable[[], int]], seconds: float, show: Callable[[float], None] | None = None
) -> list[float]:
    """Return the rate of each setting, 1/s: the median of turns that it takes with the others.

    What slows the machine for a while falls on all settings about alike, so ratios hold better than the rates.

    Args:
        settings: do some work, and return how much.
        seconds: time of each setting; a turn takes its share of it, or one call if that takes longer.
        show: is told how many turns are done.

    """
    for work in settings:
        for _ in range(2):  # the first calls fill caches and start threads
            work()
    rates: list[list[float]] = [[] for _ in settings]
    for turn in range(TURNS):
        for index, work in enumerate(settings):
            rates[index].append(_rate(work, seconds / TURNS))
            if show is not None:
                show(turn * len(settings) + index + 1)
    return [statistics.median(turns) for turns in rates]


def _rate(work: Callable[[], int], seconds: float) -> float:
    done, began = 0, time.perf_counter()
    while True:
        done += work()
        elapsed = time.perf_counter() - began
        if elapsed >= seconds:
            return done / elapsed
