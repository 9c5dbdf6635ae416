"""What arguments of public functions must be; whatever is wrong with one, the error is a ValueError that names it."""

import operator
import os
from pathlib import Path
from typing import SupportsIndex

import numpy as np


def check_whole(number: object, name: str) -> int:
    """Return a number as an int, or raise a ValueError: True, 1.0 and arrays of several numbers are no integers."""
    if isinstance(number, SupportsIndex) and not isinstance(number, bool | np.bool_):
        try:
            return operator.index(number)
        except TypeError:  # arrays have the method, but not all of them an integer
            pass
    raise ValueError(f"{name} = {number!r} must be an integer")


def whole_number(name: str, value: object, low: int, high: int, shown_high: str | None = None) -> int:
    """Return `value` if it is a whole number in [low, high].

    Raises:
        ValueError: names the argument, its value and the range, whose end may be shown as `shown_high`.

    """
    allowed = f"[{low}, {high if shown_high is None else shown_high}]"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise ValueError(f"{name} = {value!r} must be a whole number in {allowed}")  # noqa: TRY004 - as all bad values
    if not low <= value <= high:
        raise ValueError(f"{name} = {value} is outside its allowed range {allowed}")
    return int(value)


def file_path(name: str, value: object) -> Path:
    """Return `value` as a path, or raise a ValueError that names the argument."""
    if not isinstance(value, str | os.PathLike):
        raise ValueError(f"{name} = {value!r} must be the path of a file")  # noqa: TRY004 - as all bad values
    return Path(value)
