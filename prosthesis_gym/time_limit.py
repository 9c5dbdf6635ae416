"""How long episodes are at most: `scenario.duration_s`, or an argument in its place."""

from __future__ import annotations

from prosthesis_gym import _core
from prosthesis_gym.arguments import check_whole

#: `max_episode_steps` for episodes without a limit.
UNLIMITED = -1


def set_limit(batch: _core.Batch, max_episode_steps: object) -> None:
    """End the episodes of a batch after so many env steps; None leaves its limit, `UNLIMITED` takes it away.

    Raises:
        ValueError: another number, or none.

    """
    if max_episode_steps is None:
        return
    steps = check_whole(max_episode_steps, "max_episode_steps")
    if steps < 1 and steps != UNLIMITED:
        raise ValueError(f"max_episode_steps = {steps} must be at least 1, or {UNLIMITED} for no limit")
    batch.max_episode_steps = None if steps == UNLIMITED else min(steps, 2**63)
