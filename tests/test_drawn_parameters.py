"""A walker with a drawn parameter is the one that is configured with it, bit for bit, whatever parameter is drawn.

What would change nothing for a leg cannot be drawn for it, so what is drawn also differs from the nominal walker.
"""

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import Config, merge, resolve

DEVICES = ("damper", "motor", "friction")
SECTIONS = {
    *("body", "ground", "human", "knee", "motor", "friction_knee", "end_stop", "ankle", "socket", "tube", "sensors"),
    "termination",
}
GROUPS = ["knee", "load", "shank", "shank_force", "thigh", "ankle", "command", "motor", "phase", "privileged"]
#: Everything that happens to a walker, so that nothing of it stays idle: starts, stops, pushes and falls.
LIFE: Config = {
    "ground": {"step_x_m": 0.3, "stair_start_x_m": 0.6, "stair_run_m": 0.2, "edge_m": 0.03},
    "observation": {"groups": GROUPS},
    "scenario": {
        "duration_s": 4.0,
        "push_n": [0.0, 200.0],
        "push_s": [0.5, 3.5],
        "profile": [
            {"time_s": 0.0, "speed_m_s": 1.0, "walk": False},
            {"time_s": 0.1, "speed_m_s": 1.0, "walk": True},
            {"time_s": 1.6, "speed_m_s": 0.9, "walk": False},
        ],
    },
}
WORLDS: dict[str, Config] = {
    "usual": {},
    "terrain": {
        "ground": {
            **{"step_height_m": 0.02, "stair_rise_m": 0.01, "stair_count": 3, "roughness_m": 0.005},
        },
        "sensors": {"thigh_imu_m": 0.1, "shank_imu_m": 0.2},
    },
    "general": {
        "mechanism": {"trunk": "forward"},
        "body": {"sole_points": 5, "sole_radius_m": 0.3},
        "socket": {"connection": "compliant"},
        "tube": {"connection": "compliant", "stiffness_n_m": 1e5},
    },
    "inverse hip": {"mechanism": {"hip": "inverse"}},
}
MODES: dict[str, Config] = {
    "direct": {"action": {"mode": "direct"}},
    "late": {"action": {"mode": "direct", "rate_limit_per_s": 4.0, "filter_s": 0.02, "delay_samples": 2, "hold": 2}},
    "residual": {"action": {"mode": "residual"}},
    "state_machine": {"action": {"mode": "state_machine"}},
    "constant": {"action": {"mode": "constant", "constant_nms2_rad2": 30.0, "constant_a": 5.0, "constant_nm": 15.0}},
    "impedance": {"action": {"mode": "impedance"}},
}
#: Values where a quarter more of the default, or a little where that is 0, would be impossible or never be met.
VALUES: dict[str, float] = {
    "knee.max_damping_nms2_rad2": 8.0,
    "friction_knee.max_friction_nm": 8.0,
    "friction_knee.set_friction_nm": 2.0,
    "motor.current_limit_a": 3.2,
    "motor.voltage_limit_v": 3.0,
    "ground.roughness_seed": 7,
    "ground.stair_count": 2,
    "ground.slope_deg": 2.0,
    "body.heel_x_m": -0.04,
    "end_stop.flexion_angle_deg": 62.0,
    "human.shortest_state_s": 0.6,
    "human.shortest_stride_m": 1.9,
    "human.lift_speed_m_s": 1.4,
    "human.stop_distance_m": -0.05,
    "human.heel_strike_force_n": 300.0,
    "human.standing_hip_limit_nm_kg": 0.05,
    "human.trunk_limit_nm_kg": 0.3,
    "human.standing_trunk_limit_nm_kg": 0.02,
    "termination.hip_height_m": 0.85,
}
IMPERFECTIONS = {
    "resolution": 0.05,
    "noise": 0.05,
    "bias": 0.05,
    "delay_samples": 3,
    "drop_out": 0.3,
    "saturation": 0.1,
}
SAME_FOR_ALL = {
    *(
        "body.sole_points",
        "termination.knee_hyperextension_deg",
        "termination.knee_flexion_deg",
        "termination.ankle_deg",
    ),
}
#: What acts on walkers that stop, stand, stumble or sit down, which takes long walks.
LATE = {
    *("human.standing_filter_delay_s", "human.standing_hip_limit_nm_kg", "human.stop_distance_m", "human.stop_lift_m"),
    *("human.hip_limit_nm_kg", "human.shortest_state_s", "end_stop.flexion_angle_deg"),
}
#: Where the parameters of worlds other than the usual one begin.
HOMES: dict[str, tuple[str, ...]] = {
    "terrain": ("ground.", "sensors.thigh_imu_m", "sensors.shank_imu_m"),
    "general": ("socket.", "tube.", "body.", "human.trunk", "human.standing_trunk"),
    "inverse hip": ("human.trunk_lean", "human.filter", "body.thigh"),
}
WALKERS = 6


def nested(key: str, value: object) -> Config:
    """Return the partial configuration that sets `key`."""
    config: Any = value
    for part in reversed(key.split(".")):
        config = {part: config}
    return dict(config)


def value_at(config: Config, key: str) -> Any:  # noqa: ANN401 - a parameter is of any type
    value: Any = config
    for part in key.split("."):
        value = value[part]
    return value


def numbers() -> dict[str, str]:
    """Return every number of the sections that may be drawn, with its range."""
    defaults = resolve({})
    rows = {row["key"]: row["range"] for row in _core.parameters() if row["key"].split(".")[0] in SECTIONS}
    return {key: limits for key, limits in rows.items() if type(value_at(defaults, key)) in (int, float)}


NUMBERS = numbers()


def other(key: str, now: float) -> float:
    """Return a value of the parameter other than `now`."""
    if key in VALUES:
        return type(now)(VALUES[key])
    if (name := key.rpartition(".")[2]) in IMPERFECTIONS and key.startswith("sensors."):
        return IMPERFECTIONS[name] if now == 0 else 2.0 * now
    found = re.search(r"[\[(](\S+), (\S+)\]", NUMBERS[key])
    assert found
    moved = now + 0.25 * abs(now) if now else 0.02
    return moved if moved <= float(found[2]) else 0.75 * now


def actions_of(config: Config, steps: int) -> NDArray[np.float64]:
    size = WALKERS * _core.action_size(config)
    slow = np.random.default_rng(3).uniform(-1.3, 1.3, (steps // 25 + 1, size))
    slow[:, : size // 2] = 0.0  # these walk as their state machine has it, and come to a stop
    return np.repeat(slow, 25, axis=0)[:steps]


def walk(config: Config, steps: int = 300) -> list[NDArray[Any]]:
    """Return what an agent is told in every step, and what is recorded of the last episode."""
    batch = _core.Batch(WALKERS, config, "same_step", 1)
    batch.record(0)
    told: list[NDArray[Any]] = [batch.reset(np.arange(WALKERS, dtype=np.uint64))]
    for action in actions_of(config, steps):
        step = batch.step(action)
        told += [step.observations, step.rewards, step.terms, step.reasons, step.started]
        assert step.final_observations is not None
        told.append(np.where(step.started[:, None], step.final_observations, 0.0))
    return [*told, *batch.recording().values()]


def equal(ours: list[NDArray[Any]], theirs: list[NDArray[Any]]) -> bool:
    return all(np.array_equal(mine, other, equal_nan=True) for mine, other in zip(ours, theirs, strict=True))


def draw(key: str, value: float) -> Config:
    return {"scenario": {"randomise": {key: value}}}


def modes_for(device: str, key: str) -> list[str]:
    """Return the modes in which a parameter could act: a knee unit's own, in all."""
    if key.partition(".")[0] not in ("knee", "motor", "friction_knee"):
        return ["residual"]
    return [mode for mode in MODES if mode != "impedance" or device == "motor"]


def refused(config: Config, key: str, value: float) -> bool:
    """Whether a parameter that would change nothing is refused, by name."""
    try:
        resolve(merge(config, draw(key, value)))
    except ValueError as error:
        if f'"{key}": would change nothing' not in str(error):
            raise
        return True
    return False


def keys_of(world: str) -> list[str]:
    """Return the parameters to draw in a world: in others than the usual one, those that are at home there."""
    numbers = [key for key in NUMBERS if key not in SAME_FOR_ALL]
    return [key for key in numbers if key.startswith(HOMES.get(world, ""))]


@pytest.mark.parametrize(
    ("world", "device"),
    [
        *(("usual", device) for device in DEVICES),
        ("terrain", "damper"),
        ("general", "damper"),
        ("inverse hip", "motor"),
    ],
)
def test_what_is_drawn_is_what_is_configured(world: str, device: str) -> None:
    nominal: dict[str, list[NDArray[Any]]] = {}
    base = merge(merge(LIFE, WORLDS[world]), {"device": {"kind": device}})
    complete = resolve(base)
    # The damper knee alone brings its walkers to a stop and lets them stand.
    steps = 800 if (world, device) == ("usual", "damper") else 300
    idle: list[str] = []
    for key in keys_of(world):
        value = other(key, value_at(complete, key))
        if refused(base, key, value):
            continue
        acts = False
        for mode in modes_for(device, key):
            config = merge(base, MODES[mode])
            told = walk(merge(config, draw(key, value)), steps)
            assert equal(told, walk(merge(config, nested(key, value)), steps)), f"{key} = {value} in mode {mode}"
            if mode not in nominal:
                nominal[mode] = walk(config, steps)
            acts |= not equal(told, nominal[mode])
        if not acts and not (steps == 300 and key in LATE):
            idle.append(key)
    assert not idle


def test_what_no_leg_could_tell_is_refused_for_all() -> None:
    """Every parameter can be drawn for some leg in some world, or is known to act on nothing."""
    accepted = set()
    for world, changes in WORLDS.items():
        for device in DEVICES:
            base = merge(merge(LIFE, changes), {"device": {"kind": device}})
            complete = resolve(base)
            keys = [key for key in keys_of(world) if not refused(base, key, other(key, value_at(complete, key)))]
            accepted.update(keys)
    never = {key for key in NUMBERS if key not in SAME_FOR_ALL} - accepted
    assert never == {key for key in NUMBERS if key.startswith("sensors.motor_position.")}


@pytest.mark.parametrize("device", DEVICES)
def test_a_variant_is_what_is_configured(device: str) -> None:
    """Sets of parameters, not all of them numbers, alone and beside drawn numbers."""
    base = merge(LIFE, {"device": {"kind": device}})
    unit = {
        "damper": {"knee": {"max_damping_nms2_rad2": 8.0, "spring_nm_rad": 3.0}},
        "motor": {"motor": {"current_limit_a": 3.2, "gear_ratio": 80.0, "as_published": True}},
        "friction": {"friction_knee": {"set_friction_nm": 2.0, "max_friction_nm": 8.0}},
    }[device]
    variant = merge(unit, {"body": {"trunk_mass_kg": 50.0}, "ground": {"slope_deg": 1.0, "roughness_m": 0.002}})
    variant = merge(variant, {"termination": {"hip_height_m": 0.7}, "sensors": {"tube_force": {"delay_samples": 3}}})
    for mode in modes_for(device, f"{next(iter(unit))}."):
        config = merge(base, MODES[mode])
        configured = merge(config, variant)
        assert equal(walk(merge(config, {"scenario": {"variants": [variant]}})), walk(configured))
        both = {"scenario": {"variants": [variant], "randomise": {"ankle.damping_nms_rad": 3.0}}}
        assert equal(walk(merge(config, both)), walk(merge(configured, {"ankle": {"damping_nms_rad": 3.0}})))


def test_neighbours_with_other_units_keep_their_own() -> None:
    """Walkers of one block that have drawn different limits command by their own."""
    config = merge(LIFE, {"scenario": {"randomise": {"knee.max_damping_nms2_rad2": [2.0, 20.0]}}})
    batch = _core.Batch(8, config, "same_step", 1)
    batch.reset(np.arange(8, dtype=np.uint64))
    index = [name for name, *_ in _core.channels(config)].index("last_command")
    drawn = batch.episodes()["knee.max_damping_nms2_rad2"]
    commands = batch.step(np.ones(8)).observations[:, index]
    np.testing.assert_allclose(commands, np.minimum(drawn, 20.0) / 20.0, rtol=1e-6)
