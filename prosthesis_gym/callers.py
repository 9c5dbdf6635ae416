"""What Gymnasium does not tell an environment, read from the calls that are under way.

`gymnasium.make` keeps `max_episode_steps` to itself and wraps the environment in a TimeLimit, of which the environment
hears nothing: its episodes could neither be longer than its own limit, nor say why a TimeLimit ends them. What somebody
sets on a wrapper in place of the environment never arrives either. The names of `make`'s locals are not promised by
Gymnasium; tests/contracts fail if they change.
"""

import sys
from collections.abc import Iterator
from types import FrameType
from typing import Any

import gymnasium


def _frames() -> Iterator[FrameType]:
    """Yield the calls under way, the innermost first."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        yield frame
        frame = frame.f_back


def limit_of_make() -> int | None:
    """Return the `max_episode_steps` of the `gymnasium.make` that is making an environment; None if there is none."""
    for frame in _frames():
        if frame.f_code is gymnasium.make.__code__:
            given, spec = frame.f_locals.get("max_episode_steps"), frame.f_locals.get("env_spec")
            limit: int | None = getattr(spec, "max_episode_steps", None) if given is None else given
            return limit
    return None


def wrappers_of_reset(env: gymnasium.Env[Any, Any]) -> list[gymnasium.Wrapper[Any, Any, Any, Any]]:
    """Return the wrappers of an environment through which it is being reset, the innermost first."""
    around = (frame.f_locals.get("self") for frame in _frames() if frame.f_code.co_name == "reset")
    wrappers = (wrapper for wrapper in around if isinstance(wrapper, gymnasium.Wrapper) and wrapper.unwrapped is env)
    return list(dict.fromkeys(wrappers))  # a class whose `reset` calls its parent's is there twice
