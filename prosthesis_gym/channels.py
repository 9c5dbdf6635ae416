"""The channels that functions of one's own read by name: which observation group each belongs to."""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import resolve
from prosthesis_gym.devices import DEVICES


def call_with_channels(
    function: Callable[[Any], Any], channels: Mapping[str, NDArray[np.float64]], who: str, remedy: str
) -> Any:  # noqa: ANN401 - whatever somebody's function returns
    """Return `function(channels)`.

    Raises:
        ValueError: the function reads a channel that is not there; says which observation group has it, for `remedy`.

    """
    try:
        return function(channels)
    except KeyError as error:
        name = error.args[0] if error.args else None
        if name in channels:
            raise
        raise ValueError(f"{who} reads {name!r}, which is not there: {_whereabouts(name, channels, remedy)}") from error


def _whereabouts(name: object, channels: Mapping[str, Any], remedy: str) -> str:
    group = _groups().get(str(name))
    if group is None:
        return f"no such channel; here are {', '.join(channels)}"
    if group == "motor":
        return "only a motor knee has it"
    return remedy.format(group=group)


@functools.cache
def _groups() -> dict[str, str]:
    """Group of every channel that some knee unit has."""
    allowed = next(row["range"] for row in _core.parameters() if row["key"] == "observation.groups")
    groups = allowed.removeprefix("list of ").split(", ")
    found: dict[str, str] = {}
    for kind in DEVICES:
        config = resolve({"device": {"kind": kind}, "observation": {"groups": groups}})
        names = (channel[0] for channel in _core.channels(config))
        found |= dict(zip(names, _core.channel_groups(config), strict=True))
    return found
