"""Same seed, same trajectories, bit for bit, whatever the batch size, the position in it and the thread count."""

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import REFERENCE_SOLVER, Config, merge, resolve

STEPS = 600


def trajectory(config: Config, count: int, threads: int, seeds: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Observations and rewards of every step, (steps, N, size + 1); environment i acts by its own seed."""
    batch = _core.Batch(count, config, "same_step", threads)
    rngs = [np.random.default_rng(int(seed)) for seed in seeds]
    rows = [np.column_stack([batch.reset(seeds), np.zeros(count)])]
    for _ in range(STEPS):
        actions = np.array([rng.uniform(-1.0, 1.0) for rng in rngs])
        step = batch.step(actions)
        rows.append(np.column_stack([step.observations, step.rewards]))
    return np.array(rows)


UNEVEN: Config = {"ground": {"slope_deg": -1.0, "stair_rise_m": 0.02, "roughness_m": 0.01}}


FRICTION: Config = {"device": {"kind": "friction"}}


@pytest.mark.parametrize(
    "config", [{}, REFERENCE_SOLVER, UNEVEN, FRICTION], ids=["fast", "reference", "uneven ground", "friction knee"]
)
def test_a_batch_equals_its_environments_one_by_one(config: Config) -> None:
    seeds = np.arange(21, dtype=np.uint64)
    together = trajectory(config, 21, 2, seeds)
    for index in (0, 7, 8, 13, 20):
        alone = trajectory(config, 1, 1, seeds[index : index + 1])
        np.testing.assert_array_equal(together[:, index], alone[:, 0])


def test_the_number_of_threads_changes_nothing() -> None:
    seeds = np.arange(200, dtype=np.uint64)
    one, two, five = (trajectory({}, 200, threads, seeds) for threads in (1, 2, 5))
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(one, five)


def test_threads_fill_every_array_of_a_step_alike_to_the_last_walker() -> None:
    """The last block is not full, actions are three numbers, and episodes end."""
    config = resolve({"device": {"kind": "motor"}, "action": {"mode": "impedance"}, "scenario": {"duration_s": 0.2}})
    walkers = 203
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (90, walkers * 3))
    fields = [name for name, kind in vars(_core.Step).items() if not name.startswith("_") and name != "eventful"]

    def steps(threads: int) -> list[dict[str, object]]:
        batch = _core.Batch(walkers, config, autoreset="same_step", threads=threads)
        batch.reset(np.arange(walkers, dtype=np.uint64), None)
        return [{name: np.array(getattr(step, name)) for name in fields} for step in map(batch.step, actions)]

    one = steps(1)
    assert "episode_terms" in fields
    assert sum(int(np.asarray(step["started"]).sum()) for step in one) >= 2 * walkers
    for threads in (2, 5):
        for mine, theirs in zip(one, steps(threads), strict=True):
            for name in fields:
                np.testing.assert_array_equal(mine[name], theirs[name], err_msg=name)


def test_position_in_the_batch_changes_nothing() -> None:
    seeds = np.arange(40, dtype=np.uint64)
    order = np.random.default_rng(0).permutation(40)
    straight = trajectory({}, 40, 1, seeds)
    shuffled = trajectory({}, 40, 1, seeds[order])
    np.testing.assert_array_equal(straight[:, order], shuffled)


IMPERFECT: Config = {
    "sensors": {
        "knee_encoder": {"noise": 0.002, "bias": 0.01, "delay_samples": 1},
        "tube_force": {"noise": 0.02, "bias": 0.01, "drop_out": 0.1, "saturation": 1.5},
        "tube_moment": {"noise": 0.02, "resolution": 0.01, "delay_samples": 3},
        "shank_rate": {"noise": 0.05, "bias": 0.1, "drop_out": 0.05},
    }
}


def test_sensor_noise_belongs_to_the_seed_and_not_to_the_batch() -> None:
    seeds = np.arange(21, dtype=np.uint64)
    together = trajectory(IMPERFECT, 21, 2, seeds)
    np.testing.assert_array_equal(together, trajectory(IMPERFECT, 21, 1, seeds))
    for index in (0, 7, 13, 20):
        alone = trajectory(IMPERFECT, 1, 1, seeds[index : index + 1])
        np.testing.assert_array_equal(together[:, index], alone[:, 0])
    assert (together[1:] != trajectory({}, 21, 2, seeds)[1:]).any(axis=(0, 2)).all()


def test_every_episode_and_seed_has_noise_of_its_own() -> None:
    """First observation of a standing walker, which differs between episodes in its bias and noise alone."""
    config = merge(IMPERFECT, {"scenario": {"start": "standing"}})
    batch = _core.Batch(2, config, "same_step", 1)
    first, second = batch.reset(np.array([3, 4], dtype=np.uint64)), batch.reset()
    again = batch.reset(np.array([3, 4], dtype=np.uint64))
    np.testing.assert_array_equal(first, again)
    shank_rates = [*first[:, 5], *second[:, 5]]
    assert len(set(shank_rates)) == 4


def test_sensors_with_zero_options_are_the_default_ones() -> None:
    options = ("noise", "bias", "delay_samples", "drop_out", "saturation")
    sensors = {
        name: dict.fromkeys(options, 0) for name, value in resolve({})["sensors"].items() if isinstance(value, dict)
    }
    assert len(sensors) == 12
    seeds = np.arange(9, dtype=np.uint64)
    np.testing.assert_array_equal(trajectory({"sensors": sensors}, 9, 1, seeds), trajectory({}, 9, 1, seeds))


def test_diverging_walkers_end_with_a_reason_and_leave_their_neighbours_alone() -> None:
    """Explicit steps diverge on this ground, those of the reference too, at another time for every walker."""
    config = {"solver": {"stepper": "rk4", "steps": 20}, "ground": {"stiffness_n_m15": 1e6, "damping_ns_m15": 1e7}}
    seeds = np.arange(16, dtype=np.uint64)
    batch = _core.Batch(16, config, "same_step", 1)
    batch.reset(seeds)
    diverged = 0
    for _ in range(1000):
        step = batch.step(np.full(16, -1.0))
        for outputs in (step.observations, step.rewards, step.terms, step.episode_returns):
            assert np.isfinite(outputs).all()
        non_finite = step.reasons == _core.REASONS.index("non_finite")
        assert step.terminated[non_finite].all()
        diverged += int(non_finite.sum())
    assert diverged > 5
    assert batch.repeated_periods[2] == diverged

    together = trajectory(config, 16, 1, seeds)
    for index in (0, 5, 15):
        alone = trajectory(config, 1, 1, seeds[index : index + 1])
        np.testing.assert_array_equal(together[:, index], alone[:, 0])
