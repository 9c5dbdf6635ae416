"""What is drawn is checked as what is configured is, when the environment is made: whoever may be drawn is possible."""

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_drawn_parameters import NUMBERS, nested
from test_random_configurations import RANDOMISABLE

from prosthesis_gym import _core
from prosthesis_gym.config import Config, merge, resolve

LENGTHS = {"body.thigh_length_m": 0.42, "body.calf_length_m": 0.28, "body.tube_length_m": 0.14}


def drawn(distributions: dict[str, Any], rest: Config | None = None) -> Config:
    return merge(rest or {}, {"scenario": {"randomise": distributions}})


IMPOSSIBLE: dict[str, tuple[Config, str]] = {
    "an arc between a straight sole and one that is long enough": (
        drawn({"body.sole_radius_m": [0.0, 0.3]}, {"body": {"sole_points": 5}}),
        r"body\.sole_radius_m = 0 to 0\.3",
    ),
    "the same on the way from the configured sole": (
        drawn({"body.sole_radius_m": [0.2, 0.3]}, {"body": {"sole_points": 5}}),
        r"body\.sole_radius_m = 0 to 0\.3",
    ),
    "an arc too tight in the middle of a choice": (
        drawn({"body.sole_radius_m": {"choice": [0.3, 0.05, 0.4]}}, {"body": {"sole_points": 5, "sole_radius_m": 0.3}}),
        r"body\.sole_radius_m = 0\.05 to 0\.4",
    ),
    "an arc for a foot that may be longer": (
        drawn(
            {"body.sole_radius_m": [0.09, 0.3], "body.ball_x_m": [0.15, 0.2]},
            {"body": {"sole_points": 5, "sole_radius_m": 0.2}},
        ),
        r"at least half of heel to ball = 0\.0875 to 0\.1125",
    ),
    "stops that cross in mixed corners": (
        drawn({"end_stop.extension_angle_deg": [-10.0, 58.5], "end_stop.flexion_angle_deg": [60.0, 120.0]}),
        r"end_stop\.flexion_angle_deg = 60 to 120",
    ),
    "a stop that a standing knee may be deep in": (
        drawn({"end_stop.extension_angle_deg": [0.0, 20.0]}),
        r"end_stop\.extension_angle_deg = 0 to 20 must leave room",
    ),
    "the same at a cyclic start": (
        {"scenario": {"start": "cyclic"}, "end_stop": {"extension_angle_deg": 9.0}},
        r"end_stop\.extension_angle_deg = 9 must leave room.*may be 6 deg",
    ),
    "heel and ball that cross in mixed corners": (
        drawn({"body.heel_x_m": [-0.1, 0.1], "body.ball_x_m": [0.05, 0.2]}),
        r"body\.ball_x_m = 0\.05 to 0\.2 must lie ahead of body\.heel_x_m = -0\.1 to 0\.1",
    ),
    "stairs whose edges may be longer than they are": (
        drawn({"ground.stair_rise_m": [0.0, 0.1], "ground.stair_run_m": [0.05, 0.3]}, {"ground": {"edge_m": 0.1}}),
        r"ground\.edge_m = 0\.1",
    ),
    "a heel that reaches farther below the hip than the leg is long": (
        drawn({"body.heel_x_m": [-0.1, 0.0], "human.thigh_flexion_deg": [5.0, 25.0]}),
        r"body\.heel_x_m = -0\.1 to 0",
    ),
    "the same in one walker": ({"body": {"heel_x_m": -0.1}, "human": {"thigh_flexion_deg": 5.0}}, r"heel_x_m = -0\.1"),
    "the same around a variant": (
        {
            "scenario": {
                "variants": [{}, {"body": {"heel_x_m": -0.1}}],
                "randomise": {"human.thigh_flexion_deg": [10.0, 25.0]},
            }
        },
        r"with scenario\.variants\[1\]",
    ),
    "explicit steps too few for the stiffest tube": (
        drawn(
            {"tube.stiffness_n_m": [1e5, 1e8]},
            {"solver": {"stepper": "rk4", "steps": 50}, "tube": {"connection": "compliant"}},
        ),
        r"solver\.steps = 50 must be at least \d+",
    ),
    "more explicit steps than there can be": (
        {"solver": {"stepper": "rk4"}, "socket": {"connection": "compliant", "tilt_rad": 1e-300}},
        r"more than 10000",
    ),
    "thigh and its variation out of range in the highest corner": (
        {
            "scenario": {
                "randomise": {"human.thigh_flexion_deg": [20.0, 50.0]},
                "human": {"thigh_flexion_change_deg": {"choice": [5.0, 20.0, -5.0]}},
            }
        },
        r"human \(varied by scenario\.human\)\.thigh_flexion_deg = 70",
    ),
    "a normal variation of the thigh": (
        {
            "human": {"thigh_flexion_deg": 40.0},
            "scenario": {"human": {"thigh_flexion_change_deg": {"normal": [15.0, 5.0]}}},
        },
        r"human \(varied by scenario\.human\)\.thigh_flexion_deg = 70",
    ),
    "ends of a normal distribution": (drawn({"ground.friction": {"normal": [0.5, 0.2]}}), r"ground\.friction"),
    "a ratio that is no number": (
        drawn({"ankle.damping_nms_rad": {"log_uniform": [1e-320, 1.0]}}),
        r"finite high / low",
    ),
    "a foot without inertia": (
        {"body": {"foot_inertia_kg_m2": 0.0, "foot_com_x_m": 0.0, "foot_com_y_m": 0.0}},
        r"body\.foot_inertia_kg_m2 = 0",
    ),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_impossible_walkers_are_refused_by_key_and_value(case: str) -> None:
    config, named = IMPOSSIBLE[case]
    with pytest.raises(ValueError, match=named):
        _core.Batch(1, config)


@pytest.mark.parametrize(
    "config",
    [
        drawn({"body.sole_radius_m": [0.1, 0.3]}, {"body": {"sole_points": 5, "sole_radius_m": 0.2}}),
        drawn({"end_stop.extension_angle_deg": [-4.0, 4.0], "end_stop.flexion_angle_deg": [70.0, 120.0]}),
        drawn({"human.thigh_flexion_deg": [5.0, 25.0]}),
        drawn(
            {"body.heel_x_m": [-0.04, 0.0], "human.thigh_flexion_deg": [15.0, 30.0], "body.foot_mount_deg": [0.0, 8.0]}
        ),
        drawn({key: [0.95 * value, 1.05 * value] for key, value in LENGTHS.items()}),
    ],
)
def test_possible_walkers_are_not(config: Config) -> None:
    batch = _core.Batch(64, config)
    batch.reset(np.arange(64, dtype=np.uint64))
    for _ in range(200):
        step = batch.step(np.zeros(64))
        assert not (np.array(_core.REASONS)[step.reasons] == "non_finite").any()


def test_explicit_steps_are_as_many_as_the_stiffest_walker_needs() -> None:
    base: Config = {"solver": {"stepper": "rk4"}, "tube": {"connection": "compliant"}}
    stiffest = _core.Batch(1, merge(base, {"tube": {"stiffness_n_m": 1e8}})).solver_steps
    assert stiffest > _core.Batch(1, base).solver_steps
    assert _core.Batch(1, drawn({"tube.stiffness_n_m": [1e5, 1e8]}, base)).solver_steps == stiffest
    variants = {"scenario": {"variants": [{"tube": {"stiffness_n_m": 1e8}}, {}]}}
    batch = _core.Batch(8, merge(base, variants))
    assert batch.solver_steps == stiffest
    batch.reset(np.arange(8, dtype=np.uint64))
    for _ in range(40):
        assert not batch.step(np.zeros(8)).terminated.any()


@pytest.mark.parametrize(
    ("config", "named"),
    [
        (drawn({"motor.gear_ratio": [50, 100]}), r'"motor\.gear_ratio".*device\.kind = .motor.'),
        (drawn({"knee.spring_nm_rad": [1, 2]}, {"device": {"kind": "motor"}}), r"device\.kind = 'damper'"),
        (drawn({"sensors.motor_speed.noise": [0, 1]}), r"device\.kind = 'motor'"),
        (drawn({"tube.stiffness_n_m": [1e5, 1e6]}), r"tube\.connection = 'compliant'"),
        (drawn({"socket.tilt_rad": [0.01, 0.02]}), r"socket\.connection = 'compliant'"),
        (
            drawn({"body.sole_radius_m": [0.2, 0.3]}, {"body": {"sole_radius_m": 0.2}}),
            r"body\.sole_points of more than 2",
        ),
        (drawn({"human.trunk_stiffness_nm_rad": [4e3, 5e3]}), r"mechanism\.trunk = 'forward'"),
        (drawn({"ground.roughness_seed": [0, 9]}), r"ground\.roughness_m other than 0"),
        ({"scenario": {"variants": [{}, {"motor": {"as_published": True}}]}}, r"variants\[1\]\.motor\.as_published"),
        ({"scenario": {"variants": [{"termination": {"ankle_deg": 30.0}}]}}, r"variants\[0\]\.termination\.ankle_deg"),
    ],
)
def test_what_would_change_nothing_is_refused(config: Config, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        resolve(config)


@st.composite
def boxes(draw: st.DrawFn) -> Config:
    """Draw distributions, mostly of numbers that must fit together."""
    coupled = [
        *("body.heel_x_m", "body.ball_x_m", "body.sole_radius_m", "body.foot_mount_deg", "body.foot_height_m"),
        *("human.thigh_flexion_deg", "human.touch_down_knee_deg", "body.thigh_length_m", "body.tube_length_m"),
        *("end_stop.extension_angle_deg", "end_stop.flexion_angle_deg", "end_stop.thickness_deg"),
        *("ground.stair_rise_m", "ground.stair_run_m", "ground.edge_m"),
    ]
    keys = draw(
        st.lists(st.sampled_from(coupled) | st.sampled_from(sorted(RANDOMISABLE)), min_size=1, max_size=4, unique=True)
    )
    return drawn({key: draw(RANDOMISABLE[key]) for key in keys}, {"body": {"sole_points": 4, "sole_radius_m": 0.2}})


@given(boxes(), st.sampled_from([0.0, 0.25, 0.8, 1.0]))
def test_whoever_is_drawn_could_have_been_configured(config: Config, difficulty: float) -> None:
    try:
        batch = _core.Batch(32, config)
    except ValueError:
        return
    batch.difficulty = difficulty
    batch.reset(np.arange(32, dtype=np.uint64))
    episodes = batch.episodes()
    nominal = {key: value for key, value in config.items() if key != "scenario"}
    for walker in range(32):
        for key in config["scenario"]["randomise"]:
            value = episodes[key][walker]
            whole = re.search(r"count|seed|samples", key)
            nominal = merge(nominal, nested(key, int(value) if whole else float(value)))
        resolve(nominal)
    assert np.isfinite(batch.step(np.zeros(32)).observations).all()


def test_every_number_is_drawn_from_the_same_list_as_the_schema() -> None:
    assert {key for key in NUMBERS if not key.startswith(("termination.", "body.sole_points"))} == set(RANDOMISABLE)
