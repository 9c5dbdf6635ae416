"""Threads of Python that share environments: they take turns, see whole states only, and change no trajectory."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisVectorEnv, _core

# A deadlock is a failure.
pytestmark = pytest.mark.timeout(120)

CONFIG: dict[str, Any] = {
    "scenario": {
        "duration_s": 1.0,
        "push_n": 400.0,
        "push_s": [0.2, 0.8],
        "randomise": {"ground.slope_deg": [-2.0, 2.0]},
    }
}
WALKERS, STEPS = 64, 300


def steps(batch: _core.Batch) -> list[NDArray[Any]]:
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (STEPS, WALKERS))
    told: list[NDArray[Any]] = [batch.reset(np.arange(WALKERS, dtype=np.uint64))]
    for action in actions:
        step = batch.step(action)
        told += [step.observations.copy(), step.rewards.copy(), step.terms.copy(), step.reasons.copy()]
    return told


def hammer(calls: list[Callable[[], object]], work: Callable[[], Any]) -> Any:  # noqa: ANN401 - of any work
    """Do `work` while a thread per call makes that call over and over, at least once; return its result."""
    done = threading.Event()
    faults: list[BaseException] = []
    counts = [0] * len(calls)

    def repeat(index: int) -> None:
        try:
            while not done.is_set():
                calls[index]()
                counts[index] += 1
        except BaseException as fault:  # a panic too
            faults.append(fault)

    threads = [threading.Thread(target=repeat, args=(index,)) for index in range(len(calls))]
    for thread in threads:
        thread.start()
    try:
        result = work()
        while min(counts) == 0 and not faults:  # on a busy machine
            time.sleep(0.001)
    finally:
        done.set()
        for thread in threads:
            thread.join()
    assert not faults
    return result


@pytest.mark.parametrize("threads", [1, 2])
def test_readers_wait_and_change_nothing(threads: int) -> None:
    expected = steps(_core.Batch(WALKERS, CONFIG, "same_step", threads))
    batch = _core.Batch(WALKERS, CONFIG, "same_step", threads)
    batch.reset(np.arange(WALKERS, dtype=np.uint64))
    batch.record(3)
    place = np.linspace(0.0, 3.0, 7)
    readers: list[Callable[[], object]] = [
        lambda: (batch.difficulty, batch.num_envs, batch.observation_size, batch.bytes, batch.solver_steps),
        lambda: setattr(batch, "difficulty", 1.0),
        lambda: batch.get_state([0, 63, 7]),
        lambda: batch.snapshot(5),
        lambda: (batch.recording(), batch.events()),
        lambda: (batch.episodes(), batch.ground_height(9, place)),
    ]
    told = hammer(readers, lambda: steps(batch))
    for ours, theirs in zip(told, expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_states_and_recordings_taken_meanwhile_are_whole() -> None:
    """A state goes on as the walker did that it was taken of, and columns of a recording have one length."""
    batch = _core.Batch(8, CONFIG, "disabled", 1)
    batch.reset(np.full(8, 7, dtype=np.uint64))
    batch.record(2)
    batch.reset(np.full(8, 7, dtype=np.uint64))
    states: list[bytes] = []

    def take() -> None:
        states.append(batch.get_state([4]))
        assert len({len(column) for column in batch.recording().values()}) == 1

    observations: list[NDArray[Any]] = []

    def work() -> int:
        observations.extend(batch.step(np.full(8, 0.3)).observations[4].copy() for _ in range(50))
        between = len(states) + 1  # one that is begun after these steps, and ends before the next
        while len(states) <= between:
            time.sleep(0.001)
        observations.extend(batch.step(np.full(8, 0.3)).observations[4].copy() for _ in range(50))
        return between

    between = hammer([take], work)
    other, compared = _core.Batch(1, CONFIG, "disabled", 1), 0
    for state in [states[between], *states[:: max(1, len(states) // 20)]]:
        other.set_state(state, [0])
        here = other.reset(None, np.zeros(1, dtype=np.bool_))[0]
        if (found := [index for index, seen in enumerate(observations) if (seen == here).all()]) and found[0] < 99:
            np.testing.assert_array_equal(other.step(np.full(1, 0.3)).observations[0], observations[found[0] + 1])
            compared += 1
    assert compared > 0


def test_threads_that_step_together_take_whole_steps() -> None:
    """Every step of either thread is a step of all walkers: together they come as far as one that takes them all."""
    constant = np.full(WALKERS, 0.2)
    alone = _core.Batch(WALKERS, CONFIG, "same_step", 2)
    alone.reset(np.arange(WALKERS, dtype=np.uint64))
    expected = [alone.step(constant).rewards.tobytes() for _ in range(200)]
    batch = _core.Batch(WALKERS, CONFIG, "same_step", 2)
    batch.reset(np.arange(WALKERS, dtype=np.uint64))
    taken: list[list[bytes]] = [[] for _ in range(4)]

    def walk(index: int) -> None:
        taken[index] += [batch.step(constant).rewards.tobytes() for _ in range(50)]

    threads = [threading.Thread(target=walk, args=(index,)) for index in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(reward for thread in taken for reward in thread) == sorted(expected)


def test_difficulty_of_an_environment_can_be_read_while_it_steps() -> None:
    envs = ProsthesisVectorEnv(WALKERS, CONFIG)
    envs.reset(seed=0)
    action = np.zeros((WALKERS, 1), dtype=np.float32)
    hammer([lambda: envs.difficulty, lambda: envs.get_state([3])], lambda: [envs.step(action) for _ in range(200)])
