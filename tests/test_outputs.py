"""Arrays that a step hands out: whoever holds one keeps it, and those that nobody holds are filled again."""

import weakref
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import TerminationReason, _core
from prosthesis_gym.config import resolve
from prosthesis_gym.vector_env import ProsthesisVectorEnv

WALKERS = 24


def batch(config: dict[str, object] | None = None) -> _core.Batch:
    made = _core.Batch(WALKERS, resolve(config or {}), autoreset="same_step")
    made.reset(np.arange(WALKERS, dtype=np.uint64), None)
    return made


def address(array: NDArray[np.float32]) -> int:
    return int(array.__array_interface__["data"][0])


@pytest.mark.parametrize("part", [lambda array: array, lambda array: array[3:7], lambda array: array.T, memoryview])
def test_what_is_held_of_a_step_never_changes(part: Callable[[NDArray[np.float32]], object]) -> None:
    walkers, held = batch(), []
    for _ in range(30):
        observations = walkers.step(np.zeros(WALKERS)).observations
        held.append((part(observations), np.array(part(observations))))
        del observations
    for array, copy in held:
        np.testing.assert_array_equal(np.asarray(array), copy)
    assert len({copy.tobytes() for _, copy in held}) == 30


def test_infos_of_a_step_never_change() -> None:
    envs = ProsthesisVectorEnv(WALKERS)
    envs.reset(seed=0)
    actions = np.zeros((WALKERS, 1), dtype=np.float32)
    held = [envs.step(actions)[4]["reward_energy"] for _ in range(20)]
    copies = [terms.copy() for terms in held]
    for _ in range(20):
        envs.step(actions)
    np.testing.assert_array_equal(held, copies)


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
@pytest.mark.parametrize("kept", [True, False], ids=["all kept", "all scribbled over and let go"])
def test_reasons_of_a_step_are_those_of_its_ends_whatever_became_of_earlier_ones(autoreset: str, kept: bool) -> None:
    envs = ProsthesisVectorEnv(WALKERS, max_episode_steps=20, autoreset_mode=autoreset)
    envs.reset(seed=0)
    actions = np.full((WALKERS, 1), 0.5, dtype=np.float32)
    held, seen = [], []
    for step in range(200):
        if step == 7:  # a third of the walkers ends at other times than the rest
            envs.reset(options={"reset_mask": np.arange(WALKERS) % 3 == 0})
        infos = envs.step(actions)[4]
        final = infos.get("final_info", infos)
        reasons, ended = final["termination_reason"], final["termination_reason"] != TerminationReason.NONE
        if not ended.any():
            continue
        seen.append(int(ended.sum()))
        assert set(reasons[ended].tolist()) == {TerminationReason.TIME_LIMIT}
        if kept:
            held.append((reasons, reasons.copy()))
        else:
            reasons[:] = 77
        del infos, final, reasons
    assert {WALKERS // 3, WALKERS - WALKERS // 3} == set(seen)
    for array, copy in held:
        np.testing.assert_array_equal(array, copy)


def test_what_a_weak_reference_may_bring_back_is_not_filled_again() -> None:
    walkers = batch()
    observations = walkers.step(np.zeros(WALKERS)).observations
    weak, before = weakref.ref(observations), observations.copy()
    del observations
    for _ in range(10):
        walkers.step(np.zeros(WALKERS))
        again = weak()
        if again is not None:
            np.testing.assert_array_equal(again, before)
        del again


def test_arrays_that_nobody_holds_are_filled_again() -> None:
    walkers = batch()
    seen = {address(walkers.step(np.zeros(WALKERS)).observations) for _ in range(50)}
    assert len(seen) <= 3


def test_arrays_that_somebody_changed_are_not_handed_out_again() -> None:
    """Shape, type and flags of an array can be changed in place before it is let go."""
    walkers, untouched = batch(), batch()
    for change in ("shape", "dtype", "flags"):
        observations = walkers.step(np.zeros(WALKERS)).observations
        untouched.step(np.zeros(WALKERS))
        if change == "shape":
            observations.shape = (observations.size,)
        elif change == "dtype":
            observations.dtype = np.dtype(np.int32)  # type: ignore[assignment, misc]
        else:
            observations.flags.writeable = False
        del observations
        for _ in range(4):
            mine, theirs = (one.step(np.zeros(WALKERS)).observations for one in (walkers, untouched))
            assert mine.dtype == np.float32
            np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize(("device", "steps"), [("damper", 5), ("motor", 9), ("friction", 5)])
def test_solver_takes_the_steps_that_the_knee_needs_unless_told_otherwise(device: str, steps: int) -> None:
    """The same bits with `solver.steps` left out and given."""
    by_default = batch({"device": {"kind": device}})
    given = batch({"device": {"kind": device}, "solver": {"steps": steps}})
    assert by_default.solver_steps == given.solver_steps == steps
    for _ in range(40):
        mine, theirs = (one.step(np.zeros(WALKERS)) for one in (by_default, given))
        assert mine.observations.tobytes() == theirs.observations.tobytes()
    coarse = batch({"device": {"kind": device}, "solver": {"steps": 3}})
    assert (
        coarse.step(np.zeros(WALKERS)).observations.tobytes()
        != by_default.step(np.zeros(WALKERS)).observations.tobytes()
    )
