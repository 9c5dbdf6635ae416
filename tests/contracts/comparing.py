"""How contract tests look at a vector environment: step by step, in a form that can be compared."""

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

#: What `reset` and `step` return, reset masks included.
Step = tuple[Any, ...]


def random_actions(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    return rng.uniform(-1.0, 1.0, (count, 1)).astype(np.float32)


def play(envs: VectorEnv[Any, Any, Any], steps: int, *, seed: int, act: Callable[[], NDArray[Any]]) -> list[Step]:
    """Return what `reset` and every step handed out; with autoreset disabled, ended episodes are reset by mask."""
    disabled = envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED
    played: list[Step] = [envs.reset(seed=seed)]
    for _ in range(steps):
        played.append(envs.step(act()))
        ended = played[-1][2] | played[-1][3]
        if disabled and ended.any():
            played.append((*envs.reset(options={"reset_mask": ended}), ended))
    return played


def unmasked(infos: dict[str, Any]) -> dict[str, Any]:
    """Return the infos without the keys that no environment has, which may be left out or not."""
    kept: dict[str, Any] = {}
    for key, value in infos.items():
        if key.startswith("_") or not infos[f"_{key}"].any():
            continue
        kept[key] = unmasked(value) if isinstance(value, dict) else value
        if key == "final_obs" and value.dtype == object:  # ours are numbers, as most pipelines want them
            kept[key] = np.stack(
                [np.zeros_like(value[infos["_final_obs"]][0]) if row is None else row for row in value]
            )
        kept[f"_{key}"] = infos[f"_{key}"]
    return kept


def assert_same(ours: Any, theirs: Any, where: str = "") -> None:  # noqa: ANN401 - anything that a step hands out
    """Assert equality in type, dtype and every bit, through dictionaries and arrays of objects."""
    assert type(ours) is type(theirs), where
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys(), where
        for key, value in ours.items():
            assert_same(value, theirs[key], f"{where}[{key!r}]")
    elif isinstance(ours, np.ndarray) and ours.dtype == object:
        assert ours.shape == theirs.shape, where
        for index, value in enumerate(ours):
            assert_same(value, theirs[index], f"{where}[{index}]")
    elif isinstance(ours, np.ndarray):
        assert ours.dtype == theirs.dtype, where
        np.testing.assert_array_equal(ours, theirs, where)
    else:
        assert ours == theirs, where


def assert_same_steps(ours: list[Step], theirs: list[Step]) -> None:
    assert len(ours) == len(theirs)
    for index, (mine, reference) in enumerate(zip(ours, theirs, strict=True)):
        for part, (value, expected) in enumerate(zip(mine, reference, strict=True)):
            where = f"step {index}, part {part}"
            if isinstance(value, dict):
                assert_same(unmasked(value), unmasked(expected), where)
            else:
                assert_same(value, expected, where)
