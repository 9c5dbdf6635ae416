"""Walkers in other processes, however those are started, and forks of a process whose thread pool has worked already.

A fork copies no threads: a pool that a child inherits never answers. Time limits turn a hang into a failure.
"""

import multiprocessing
import os
import threading
import time
from multiprocessing.connection import Connection
from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import assert_same_steps, play, random_actions
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from prosthesis_gym import ProsthesisVectorEnv, _core

# A fork of a process with threads (rayon's, torch's) warns from Python 3.12 on; that it works is what is tested.
pytestmark = [pytest.mark.timeout(120), pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")]

START_METHODS = multiprocessing.get_all_start_methods()
CONFIG: dict[str, Any] = {"action": {"hold": 4}, "scenario": {"duration_s": 3.0, "push_n": 400.0, "push_s": [0.5, 2.0]}}
ENV_ID = "prosthesis_gym/DamperKnee-v0"
WALKERS, STEPS = 2, 200
#: Enough for rayon's pool to take part.
MANY = 256


def wake_pool() -> ProsthesisVectorEnv:
    """Return walkers whose thread pool has run."""
    envs = ProsthesisVectorEnv(MANY, CONFIG, threads=2)
    envs.reset(seed=0)
    for _ in range(5):
        envs.step(np.zeros((MANY, 1), dtype=np.float32))
    return envs


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("context", START_METHODS)
def test_async_vector_env_walks_as_the_native_one(context: str, mode: AutoresetMode) -> None:
    wake_pool()
    options = {"context": context, "autoreset_mode": mode}
    others = gymnasium.make_vec(ENV_ID, WALKERS, config=CONFIG, vectorization_mode="async", vector_kwargs=options)
    played = []
    for envs in (gymnasium.make_vec(ENV_ID, WALKERS, config=CONFIG, autoreset_mode=mode), others):
        rng = np.random.default_rng(0)
        played.append(play(envs, STEPS, seed=1, act=lambda rng=rng: random_actions(rng, WALKERS)))  # type: ignore[misc] # mypy loses the default
        envs.close()
    assert_same_steps(*played)


@pytest.mark.parametrize("start_method", [method for method in START_METHODS if method != "forkserver"])
def test_subproc_vec_env_walks_as_dummy_vec_env(start_method: str) -> None:
    wake_pool()
    # A process that was not forked knows the environment only if its id names the package too.
    makers = [lambda: gymnasium.make(f"prosthesis_gym:{ENV_ID}", config=CONFIG)] * WALKERS
    played = []
    for env in (SubprocVecEnv(makers, start_method=start_method), DummyVecEnv(makers)):
        env.seed(3)
        rng = np.random.default_rng(0)
        rows: list[Any] = [env.reset()]
        for _ in range(STEPS):
            observations, rewards, dones, _ = env.step(random_actions(rng, WALKERS))
            # SB3's two vector environments differ in the dtype of rewards.
            rows.append((observations, rewards.astype(np.float32), dones))
        env.close()
        played.append(rows)
    np.testing.assert_array_equal(played[0][0], played[1][0])
    for ours, theirs in zip(played[0][1:], played[1][1:], strict=True):
        for mine, expected in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(mine, expected)


def go_on(envs: ProsthesisVectorEnv, pipe: Connection) -> None:
    """In a child: step the parent's walkers, and fresh ones."""
    actions = np.full((MANY, 1), 0.5, dtype=np.float32)
    inherited = [envs.step(actions)[0] for _ in range(5)]
    fresh = wake_pool().step(actions)[0]
    pipe.send((os.getpid(), inherited, fresh))


@pytest.mark.skipif("fork" not in START_METHODS, reason="Windows has no fork: nothing to test")
def test_a_fork_goes_on_with_walkers_whose_pool_has_run() -> None:
    envs = wake_pool()
    ours, theirs = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=go_on, args=(envs, theirs))
    child.start()
    assert ours.poll(60), "the forked child hangs"
    process, inherited, fresh = ours.recv()
    child.join(60)
    assert (child.exitcode, process) == (0, child.pid)
    actions = np.full((MANY, 1), 0.5, dtype=np.float32)
    for observations in inherited:
        np.testing.assert_array_equal(observations, envs.step(actions)[0])
    np.testing.assert_array_equal(fresh, wake_pool().step(actions)[0])


@pytest.mark.skipif("fork" not in START_METHODS, reason="Windows has no fork: nothing to test")
def test_a_fork_in_the_middle_of_a_step_is_an_error_in_the_child_and_no_hang() -> None:
    """The turn of a thread that is not in the child would never end there; new environments work."""
    slow = {"solver": {"stepper": "rk4", "steps": 10_000}, "action": {"hold": 200}}
    batch = _core.Batch(8, slow, threads=1)
    batch.reset(np.arange(8, dtype=np.uint64))
    begins = threading.Event()

    def step() -> None:
        begins.set()
        batch.step(np.zeros(8))

    thread = threading.Thread(target=step, daemon=True)
    thread.start()
    begins.wait()
    time.sleep(0.1)
    assert thread.is_alive()
    receiver, sender = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_use_in_child, args=(batch, sender))
    child.start()
    assert thread.is_alive(), "the step ended before the fork"
    refused, answer = receiver.recv()
    child.join()
    assert refused.count("make a new one") == 3
    assert answer == (64, 8)


def _use_in_child(batch: _core.Batch, sender: Connection) -> None:
    refused = []
    for call in (lambda: batch.difficulty, lambda: batch.get_state([0]), lambda: batch.step(np.zeros(8))):
        try:
            call()
        except RuntimeError as error:
            refused.append(str(error))
    fresh = _core.Batch(64, {}, threads=2)
    fresh.reset(np.arange(64, dtype=np.uint64))
    sender.send((" ".join(refused), fresh.step(np.zeros(64)).observations.shape))
