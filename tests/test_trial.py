"""Trials: running, outcomes, profiles, and files that hold them."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import merge
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.trial import INTACT, RESIDUAL, Trial, _upright_outcome, load_trial, run_trial, save_trial

WALK: Mapping[str, Any] = {
    "action": {"mode": "state_machine"},
    "scenario": {"start": "standing", "speed_m_s": 1.1, "walk_s": 0.5, "push_n": 0.0},
}


class FullBrake:
    """Always commands the largest damping."""

    def __init__(self) -> None:
        self.shapes: set[tuple[int, ...]] = set()

    def configure(self, config: Mapping[str, Any], /) -> dict[str, Any]:
        return merge(config, {"action": {"mode": "direct", "hold": 2}, "observation": {"frames": 3}})

    def act(self, observations: NDArray[np.float32], /) -> NDArray[np.float64]:
        self.shapes.add(observations.shape)
        return np.ones(len(observations))


def assert_equal(one: Trial, two: Trial) -> None:
    assert one.outcome == two.outcome
    assert one.seed == two.seed
    assert _core.resolve(one.config) == _core.resolve(two.config)
    for left, right in ((one.columns, two.columns), (one.events, two.events)):
        assert list(left) == list(right)
        assert all(np.array_equal(left[name], right[name], equal_nan=True) for name in left)


def test_a_row_every_5_ms_from_start_to_end() -> None:
    trial = run_trial(WALK, duration_s=3.0)
    assert {len(column) for column in trial.columns.values()} == {601}
    np.testing.assert_allclose(trial["time_s"], 0.005 * np.arange(601), atol=1e-9)
    assert trial.outcome == "walking"
    assert trial.config["scenario"]["duration_s"] == 3.0
    assert trial.config == _core.resolve(trial.config)


def test_feet_strike_in_turn_between_rows() -> None:
    trial = run_trial(WALK, duration_s=5.0)
    assert trial.strikes_s(INTACT)[0] < trial.strikes_s(RESIDUAL)[0]
    np.testing.assert_array_equal(np.diff(trial.events["leg"]) != 0, True)
    hips = np.interp(trial.events["time_s"], trial["time_s"], trial["hip_x_m"])
    np.testing.assert_allclose(trial.events["hip_x_m"], hips, atol=1e-3)


def test_repeats_bit_for_bit_and_depends_on_the_seed() -> None:
    random = {"action": {"mode": "state_machine"}}
    assert_equal(run_trial(random, seed=3, duration_s=2.0), run_trial(random, seed=3, duration_s=2.0))
    one, two = (run_trial(random, seed=seed, duration_s=2.0) for seed in (3, 4))
    assert not np.array_equal(one["hip_x_m"], two["hip_x_m"])


def test_policy_drives_with_the_configuration_it_was_made_for() -> None:
    policy = FullBrake()
    trial = run_trial(WALK, policy=policy, duration_s=1.0)
    assert policy.shapes == {(1, 3 * len(_core.channels({})))}
    assert trial.config["action"]["hold"] == 2
    assert set(trial["command"][1:]) == {trial.config["action"]["max_command_nms2_rad2"]}
    assert len(trial["time_s"]) == 201


@pytest.mark.parametrize("config", [{}, {"action": {"mode": "direct"}}, {"action": {"mode": "residual"}}])
def test_without_a_policy_the_state_machine_drives_as_in_an_evaluation(config: dict[str, Any]) -> None:
    trial = run_trial(config, duration_s=1.0)
    assert trial.config["action"]["mode"] == "state_machine"
    expected = run_trial({"action": {"mode": "state_machine"}}, duration_s=1.0)
    assert (trial["command"] == expected["command"]).all()
    assert evaluate(None, config, episodes=1, threads=1).episodes == 1


def test_impossible_seeds_and_threads_are_named() -> None:
    for seed in (-1, 2**64):
        with pytest.raises(ValueError, match=f"seed = {seed} is outside"):
            run_trial({}, seed=seed)
    wrong: list[Any] = [1.5, True, "3"]
    for no_seed in wrong:
        with pytest.raises(ValueError, match="must be a whole number"):
            run_trial({}, seed=no_seed)
    for threads in (0, -1, 5000):
        with pytest.raises(ValueError, match=rf"threads = {threads} is outside its allowed range \[1, 1024\]"):
            evaluate(None, {}, episodes=2, threads=threads)


def test_standing_trial_stands() -> None:
    assert run_trial(merge(WALK, {"scenario": {"walk_s": 100.0}}), duration_s=2.0).outcome == "standing"


def test_fall_ends_the_trial_with_its_reason() -> None:
    trial = run_trial(merge(WALK, {"scenario": {"speed_m_s": 0.5}}), duration_s=20.0)
    assert trial.outcome == "fell: hip_height"
    assert trial.fell
    assert trial["hip_y_m"][-1] < trial.config["termination"]["hip_height_m"] <= trial["hip_y_m"][-2]
    assert trial.end_s < 20.0


@pytest.mark.parametrize(
    ("human_state", "intact_leg_state", "intent", "waited_s", "outcome"),
    [
        (0, 0, 0, 1.0, "standing"),
        (2, 1, 1, 0.5, "walking"),
        (3, 2, 0, 4.9, "walking"),
        (3, 2, 0, 5.1, "stopped on its toe"),
        (3, 2, 1, 5.1, "walking"),
        (3, 3, 0, 5.1, "walking"),
    ],
)
def test_outcome_of_a_trial_that_did_not_fall(
    human_state: int, intact_leg_state: int, intent: int, waited_s: float, outcome: str
) -> None:
    last = {
        "time_s": 10.0 + waited_s,
        "intent": intent,
        "human_state": human_state,
        "intact_leg_state": intact_leg_state,
    }
    columns = {name: np.array([np.nan, value]) for name, value in last.items()}
    assert _upright_outcome(columns, {"time_s": np.array([8.0, 10.0])}) == outcome


def test_parquet_round_trip_is_exact(tmp_path: Path) -> None:
    trial = run_trial(WALK, duration_s=2.5)
    assert np.isnan(trial["pendulum_foot_x_m"]).any()
    save_trial(trial, tmp_path / "trial.parquet")
    assert_equal(load_trial(tmp_path / "trial.parquet"), trial)
    assert [path.name for path in tmp_path.iterdir()] == ["trial.parquet"]


def test_csv_holds_every_column_exactly(tmp_path: Path) -> None:
    trial = run_trial(WALK, duration_s=1.0)
    save_trial(trial, tmp_path / "trial.csv")
    with (tmp_path / "trial.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == list(trial.columns)
    values = np.array(rows, dtype=float)
    np.testing.assert_array_equal(values, np.stack(list(trial.columns.values()), axis=1))


@pytest.mark.parametrize("name", ["trial.txt", "trial"])
def test_other_endings_are_refused(tmp_path: Path, name: str) -> None:
    trial = run_trial(WALK, duration_s=0.1)
    with pytest.raises(ValueError, match=r"\.parquet or \.csv"):
        save_trial(trial, tmp_path / name)
    with pytest.raises(ValueError, match=r"from \.parquet"):
        load_trial(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_foreign_parquet_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.parquet").write_bytes(b"no parquet")
    with pytest.raises(ValueError, match=r"broken\.parquet"):
        load_trial(tmp_path / "broken.parquet")
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table({"a": [1]}), tmp_path / "foreign.parquet")
    with pytest.raises(ValueError, match="not a trial"):
        load_trial(tmp_path / "foreign.parquet")
