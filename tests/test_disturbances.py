"""Pushes and gusts (section 4.3 of the paper): what is asked for stands in the columns of the trial."""

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym.config import merge, resolve
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.trial import RESIDUAL, Trial, run_trial

BASE = {
    "action": {"mode": "state_machine"},
    "scenario": {"start": "standing", "speed_m_s": 1.1, "walk_s": 0.5, "push_n": 0.0, "duration_s": 8.0},
}


def disturbed(scenario: dict[str, Any], seed: int = 0) -> Trial:
    return run_trial(merge(BASE, {"scenario": scenario}), seed=seed, progress=False)


def pushed_s(trial: Trial, column: str = "push_force_n") -> NDArray[np.float64]:
    """Return the starts (s) of the control periods with a force; a row stands for the 5 ms before it."""
    times: NDArray[np.float64] = trial["time_s"][trial[column] != 0.0] - 0.005
    return times


def test_listed_pushes_act_at_their_times_with_their_forces() -> None:
    pushes = [
        {"time_s": 1.0, "duration_s": 0.1, "force_x_n": 50.0},
        {"time_s": 3.0, "duration_s": 0.2, "force_y_n": -80.0},
        {"time_s": 3.1, "duration_s": 0.2, "force_x_n": -30.0, "force_y_n": 20.0},
    ]
    trial = disturbed({"pushes": pushes, "push_n": 500.0})
    forward, up = trial["push_force_n"][1:], trial["push_force_up_n"][1:]
    expected = np.zeros((2, 1600))
    for push in pushes:
        begin = round(push["time_s"] / 0.005)
        rows = slice(begin, begin + round(push["duration_s"] / 0.005))
        expected[:, rows] += np.array([[push.get("force_x_n", 0.0)], [push.get("force_y_n", 0.0)]])
    np.testing.assert_array_equal(np.array([forward, up]), expected)


def test_an_upward_push_lifts_the_hip() -> None:
    push = {"time_s": 3.0, "duration_s": 0.2}
    up = disturbed({"pushes": [{**push, "force_y_n": 200.0}]})["hip_y_m"][640]
    down = disturbed({"pushes": [{**push, "force_y_n": -200.0}]})["hip_y_m"][640]
    assert up - 0.003 > disturbed({})["hip_y_m"][640] > down + 0.003


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.8])
def test_a_push_at_a_phase_waits_for_it(phase: float) -> None:
    """The first step that reaches it after the push's time; phases count from heel strike in expected cycles."""
    for drawn in (True, False):
        listed = {"time_s": 4.0, "duration_s": 0.1, "force_x_n": 40.0, "phase": phase}
        trial = disturbed({"push_n": 40.0, "push_s": 4.0, "push_phase": phase} if drawn else {"pushes": [listed]})
        begin_s = pushed_s(trial)[0]
        strikes_s = trial.strikes_s(RESIDUAL)
        hips_m = trial.events["hip_x_m"][trial.events["leg"] == RESIDUAL]
        strike = int(np.searchsorted(strikes_s, begin_s, side="right")) - 1
        cycle_s = (hips_m[strike] - hips_m[strike - 1]) / 1.1
        assert 0.0 <= begin_s + 1e-9 - (strikes_s[strike] + phase * cycle_s) <= 0.005
        assert 4.0 <= begin_s < 4.0 + 1.1 * cycle_s
        assert len(pushed_s(trial)) == round((0.1 if not drawn else 0.15) / 0.005)


def test_nobody_pushes_a_standing_walker_at_a_phase() -> None:
    trial = disturbed({"push_n": 40.0, "push_s": 1.0, "push_phase": 0.3, "walk_s": 100.0})
    assert trial.outcome == "standing"
    assert not pushed_s(trial).size


def test_a_gust_is_one_minus_cosine_of_its_force_and_duration() -> None:
    trial = disturbed({"gust": {"force_n": -24.0, "duration_s": 1.5, "pause_s": 0.5}})
    time_s = trial["time_s"][1:] - 0.005
    into_s = np.maximum(time_s % 2.0 - 0.5, 0.0)
    expected = -12.0 * (1.0 - np.cos(2.0 * np.pi * into_s / 1.5))
    np.testing.assert_allclose(trial["push_force_n"][1:], expected, atol=1e-9)
    assert trial["push_force_n"].min() == pytest.approx(-24.0, abs=1e-9)


def test_gusts_belong_to_the_seed_keep_their_ranges_and_move_the_walker() -> None:
    gust = {"force_n": [10.0, 30.0], "duration_s": [0.5, 1.0], "pause_s": [0.2, 0.4]}
    one, same, other = (disturbed({"gust": gust}, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one["push_force_n"], same["push_force_n"])
    np.testing.assert_array_equal(one["hip_x_m"], same["hip_x_m"])
    assert not np.array_equal(one["push_force_n"], other["push_force_n"])
    assert not np.array_equal(one["hip_x_m"], disturbed({}, seed=1)["hip_x_m"])
    force = one["push_force_n"][1:]
    calm = force == 0.0
    begins = np.flatnonzero(calm[:-1] & ~calm[1:])
    peaks = np.array([part.max() for part in np.split(force, begins)[1:-1]])
    assert len(peaks) >= 4
    assert len(set(peaks)) == len(peaks)
    assert ((peaks > 9.9) & (peaks < 30.1)).all()
    periods_s = np.diff(begins) * 0.005
    assert ((periods_s > 0.69) & (periods_s < 1.41)).all()


def test_gusts_shift_no_other_draw() -> None:
    """The push of an episode is the same with and without gusts."""
    windless, windy = (
        run_trial(merge({"action": {"mode": "state_machine"}}, config), seed=3, duration_s=12.0, progress=False)
        for config in ({}, {"scenario": {"gust": {"force_n": [0.0, 1.0]}}})
    )
    rows = min(len(windless["time_s"]), len(windy["time_s"]))
    np.testing.assert_array_equal(windless["intended_speed_m_s"][:rows], windy["intended_speed_m_s"][:rows])
    assert np.abs(windless["push_force_n"][:rows] - windy["push_force_n"][:rows]).max() <= 1.0


@pytest.mark.parametrize("name", ["pushes", "gusts", "human_variations"])
def test_preset_is_walked_by_most_and_differs_between_seeds(name: str) -> None:
    config = {"action": {"mode": "state_machine"}, **load_scenario(name)}
    trials = [run_trial(config, seed=seed, progress=False) for seed in range(8)]
    assert sum(trial.outcome == "walking" for trial in trials) >= 7
    assert len({float(trial["hip_x_m"][-1]) for trial in trials}) == 8


@pytest.mark.parametrize(
    ("scenario", "complaint"),
    [
        ({"pushes": [{"time_s": 1.0}]}, "scenario.pushes[0]: missing field `duration_s`"),
        (
            {"pushes": [{"time_s": 1.0, "duration_s": 0.1, "phase": 1.5}]},
            "scenario.pushes[0].phase = 1.5 is outside its allowed range [0, 0.9]",
        ),
        (
            {"pushes": [{"time_s": 1.0, "duration_s": 0.1, "force_x_n": 1e6}]},
            "scenario.pushes[0].force_x_n = 1000000 is outside its allowed range [-10000, 10000] N",
        ),
        ({"pushes": [{"time_s": 1.0, "duration_s": 0.1, "force_z_n": 1.0}]}, "scenario.pushes[0].force_z_n: unknown"),
        ({"push_phase": 1.0}, "scenario.push_phase = 1 is outside its allowed range [-1, 0.9]"),
        ({"gust": {"duration_s": 0.0}}, "scenario.gust.duration_s = 0 is outside its allowed range [0.05, 100] s"),
    ],
)
def test_impossible_disturbances_are_named(scenario: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(complaint)):
        resolve({"scenario": scenario})


def test_resolving_keeps_listed_pushes() -> None:
    pushes = [{"time_s": 1.0, "duration_s": 0.1, "force_x_n": 5.0}]
    once = resolve({"scenario": {"pushes": pushes}})
    assert once["scenario"]["pushes"] == [{**pushes[0], "force_y_n": 0.0}]
    assert resolve(once) == once
