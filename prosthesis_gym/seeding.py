"""Seeds: which ones there are, and how runs get some of their own."""

from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from prosthesis_gym.arguments import check_whole

_WORDS: Final = 2**64


def check_seed(seed: object, name: str = "seed") -> int:
    """Return a seed, of any size, as an int, or raise a ValueError: no integer, or negative."""
    number = check_whole(seed, name)
    if number < 0:
        raise ValueError(f"{name} = {number} must not be negative")
    return number


def core_seed(seed: int) -> int:
    """Return the 64 bits that a seed stands for: itself below 2^64, else what NumPy's SeedSequence makes of it."""
    if seed < _WORDS:
        return seed
    return int(np.random.SeedSequence(seed).generate_state(1, np.uint64)[0])


def core_seeds(first: int, count: int) -> NDArray[np.uint64]:
    """Return the core's seeds (count,) of `first`, `first + 1`, ..."""
    if first + count <= _WORDS:
        return np.uint64(first) + np.arange(count, dtype=np.uint64)
    return np.array([core_seed(first + index) for index in range(count)], dtype=np.uint64)


def fresh_seed() -> int:
    """Return a seed below 2^63 from the system's randomness."""
    return int(np.random.SeedSequence().generate_state(1, np.uint64)[0] >> np.uint64(1))


def run_seed(run: int, part: int = 0) -> int:
    """Return the seed of a run's first environment, which keeps the runs 0, 1, 2, ... apart.

    Environment i of `envs.reset(seed=s)` has the seed s + i, and so have stable-baselines3's after `env.seed(s)`: runs
    with the seeds 0 and 1 share all environments but one. Seeds of this function lie so far apart that two runs of a
    million environments meet with a probability of 2e-12, and all of them from 2^63 on, above those of evaluations.

    Args:
        run: number of the run: any integer that is not negative.
        part: the same for parts of a run that must not repeat each other, such as what follows a resumption.

    Raises:
        ValueError: a number that is not an integer, or negative.

    """
    sequence = np.random.SeedSequence(check_seed(run, "run"), spawn_key=(check_seed(part, "part"),))
    # The lowest 2^24 are left to the environments: no sum s + i leaves 64 bits.
    return 2**63 + int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1)) // 2**24 * 2**24


def first_seed(env: gymnasium.Env[Any, Any] | VectorEnv[Any, Any, Any]) -> int:
    """Return the seed of an environment that nobody has given one: its `np_random_seed`, which replays it."""
    if env._np_random is None:
        env._np_random, env._np_random_seed = np_random(fresh_seed())
    seed = env.np_random_seed
    # Gymnasium knows no seed of a generator that was put in place.
    return int(env.np_random.integers(2**63)) if seed is None or seed < 0 else seed
