"""Seeds: any integer that is not negative, which replays what it began, and runs that share nothing."""

from typing import Any

import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv
from prosthesis_gym.evaluation import HELD_OUT_SEED, VALIDATION_SEED
from prosthesis_gym.seeding import core_seed, run_seed

COUNT = 3
#: Every episode differs from its first observation on.
CONFIG: dict[str, Any] = {"scenario": {"start": "cyclic", "randomise": {"ground.slope_deg": [-1.0, 1.0]}}}


def walked(env: ProsthesisEnv | ProsthesisVectorEnv, observations: NDArray[Any]) -> NDArray[Any]:
    rows = [observations]
    rows += [env.step(np.zeros(env.action_space.shape or (), np.float32))[0] for _ in range(40)]
    return np.array(rows)


def episode(env: ProsthesisEnv | ProsthesisVectorEnv, **given: Any) -> NDArray[Any]:  # noqa: ANN401 - seeds of any kind
    return walked(env, env.reset(**given)[0])


@pytest.mark.parametrize("asked_first", [False, True])
def test_an_episode_without_a_seed_replays_from_np_random_seed(asked_first: bool) -> None:
    for env in (ProsthesisEnv(CONFIG), ProsthesisVectorEnv(COUNT, CONFIG)):
        if asked_first:
            assert env.np_random_seed is not None
        first, second = episode(env), episode(env)
        replayed = episode(env, seed=env.np_random_seed), episode(env)
        np.testing.assert_array_equal(first, replayed[0])
        np.testing.assert_array_equal(second, replayed[1])
        assert (first != second).any()


def test_environments_without_seeds_differ() -> None:
    for make in (lambda: ProsthesisEnv(CONFIG), lambda: ProsthesisVectorEnv(COUNT, CONFIG)):
        assert (episode(make()) != episode(make())).any()


def test_a_generator_of_ones_own_draws_the_seed() -> None:
    ours, theirs = ProsthesisEnv(CONFIG), ProsthesisEnv(CONFIG)
    for env in (ours, theirs):
        env.np_random = np.random.default_rng(5)
    np.testing.assert_array_equal(episode(ours), episode(theirs))


@pytest.mark.parametrize("seed", [0, 7, np.int32(7), np.uint64(2**64 - 1), 2**63, 2**64 - 2, 2**64, 2**70, 3**200])
def test_any_integer_is_a_seed_and_environment_i_has_seed_plus_i(seed: Any) -> None:  # noqa: ANN401
    single, envs = ProsthesisEnv(CONFIG), ProsthesisVectorEnv(COUNT, CONFIG)
    rows = episode(envs, seed=seed)
    assert envs.np_random_seed == int(seed)
    for index in range(COUNT):
        np.testing.assert_array_equal(rows[:, index], episode(single, seed=int(seed) + index))
    listed = episode(envs, seed=[int(seed) + index for index in range(COUNT)])
    np.testing.assert_array_equal(rows, listed)
    if int(seed) < 2**60:  # beyond, Gymnasium's own vector environment stops
        theirs = SyncVectorEnv([lambda: ProsthesisEnv(CONFIG)] * COUNT)
        np.testing.assert_array_equal(theirs.reset(seed=int(seed))[0], rows[0])


def test_seeds_below_64_bits_are_the_cores_and_larger_ones_are_told_apart() -> None:
    assert [core_seed(seed) for seed in (0, 5, 2**64 - 1)] == [0, 5, 2**64 - 1]
    large = [2**64 + index for index in range(500)] + [2**width for width in range(64, 500)]
    assert len({core_seed(seed) for seed in large} | {seed % 2**64 for seed in large}) > 2 * len(set(large)) - 450
    assert len({core_seed(seed) for seed in set(large)}) == len(set(large))


@pytest.mark.parametrize(
    ("seed", "complaint"),
    [
        (True, "True"),
        (1.0, "1.0"),
        (0.5, "0.5"),
        (-1, "-1"),
        ("7", "'7'"),
        (np.float64(2.0), "2.0"),
        (np.True_, "True"),
    ],
)
def test_other_seeds_are_refused_and_change_nothing(seed: Any, complaint: str) -> None:  # noqa: ANN401
    single, envs = ProsthesisEnv(CONFIG), ProsthesisVectorEnv(COUNT, CONFIG)
    single.reset(seed=1)
    envs.reset(seed=1)
    before = single.get_state(), envs.get_state()
    for env in (single, envs):
        with pytest.raises(ValueError, match=f"seed = .*{complaint}"):
            env.reset(seed=seed)
    with pytest.raises(ValueError, match=f"seed = .*{complaint}"):
        envs.reset(seed=[0, seed, 2])
    assert (single.get_state(), envs.get_state()) == before


@pytest.mark.parametrize("seed", [[1, 2], [], [1, 2, 3, 4], np.zeros((3, 1), dtype=int)])
def test_lists_of_other_lengths_are_refused(seed: Any) -> None:  # noqa: ANN401
    envs = ProsthesisVectorEnv(COUNT, CONFIG)
    with pytest.raises(ValueError, match="seed"):
        envs.reset(seed=seed)


def test_none_in_a_list_goes_on_as_a_single_environment_does() -> None:
    envs, single = ProsthesisVectorEnv(COUNT, CONFIG), ProsthesisEnv(CONFIG)
    envs.reset(seed=5)
    single.reset(seed=6)
    rows = episode(envs, seed=[9, None, np.int64(11)])
    np.testing.assert_array_equal(rows[:, 1], episode(single))
    np.testing.assert_array_equal(rows[:, 0], episode(single, seed=9))
    np.testing.assert_array_equal(rows[:, 2], episode(single, seed=11))


def test_walkers_that_a_first_reset_left_out_get_seeds_of_their_own() -> None:
    envs, single = ProsthesisVectorEnv(COUNT, CONFIG), ProsthesisEnv(CONFIG)
    mask = np.array([True, False, False])
    envs.reset(seed=40, options={"reset_mask": mask})
    rows = envs.reset(options={"reset_mask": ~mask})[0]
    for index in (1, 2):
        np.testing.assert_array_equal(rows[index], single.reset(seed=40 + index)[0])


def test_runs_share_no_seed_with_each_other_nor_with_evaluations() -> None:
    runs = [run_seed(run, part) for run in range(200) for part in range(5)]
    assert len(set(runs)) == len(runs)
    gaps = np.diff(sorted(runs))
    assert min(int(gap) for gap in gaps) >= 2**24
    assert min(runs) >= 2**63 > max(HELD_OUT_SEED, VALIDATION_SEED)
    assert max(runs) + 2**24 <= 2**64
    assert run_seed(3) == run_seed(3, 0) != run_seed(3, 1)
    assert run_seed(2**100) != run_seed(2**100 + 1)


@pytest.mark.parametrize("run", [-1, 1.0, True])
def test_impossible_runs_are_refused(run: Any) -> None:  # noqa: ANN401
    with pytest.raises(ValueError, match="run = "):
        run_seed(run)
    with pytest.raises(ValueError, match="part = "):
        run_seed(0, run)


def test_neighbouring_runs_share_no_episode() -> None:
    envs = ProsthesisVectorEnv(64, CONFIG)
    runs = [{rows.tobytes() for rows in np.swapaxes(episode(envs, seed=run_seed(run)), 0, 1)} for run in (0, 1)]
    assert [len(run) for run in runs] == [64, 64]
    assert not runs[0] & runs[1]
