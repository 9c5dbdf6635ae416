"""A setting that nothing reads is refused, by whichever door it comes, and what is refused would have done nothing."""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import SCENARIOS, ProsthesisEnv, ProsthesisVectorEnv, RewardTerm, _core
from prosthesis_gym.cli import main
from prosthesis_gym.config import Config, merge, resolve
from prosthesis_gym.controller import SensorController
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.layers import Layer, laid_over
from prosthesis_gym.rewards import REWARDS
from prosthesis_gym.sb3 import ProsthesisVecEnv
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.trial import run_trial
from training.settings import Settings

PROFILE = [{"time_s": 0.0, "speed_m_s": 1.1, "walk": True}]
PUSH = {"time_s": 0.1, "duration_s": 0.1, "force_x_n": 100.0, "force_y_n": 0.0}
CONTEXTS: dict[str, Config] = {
    "default": {},
    "residual": {"action": {"mode": "residual"}},
    "constant": {"action": {"mode": "constant"}},
    "state machine": {"action": {"mode": "state_machine"}},
    "motor": {"device": {"kind": "motor"}},
    "impedance": {"device": {"kind": "motor"}, "action": {"mode": "impedance"}},
    "friction": {"device": {"kind": "friction"}, "action": {"mode": "residual"}},
    "profile": {"scenario": {"profile": PROFILE, "push_n": 0.0}},
    "pushes": {"scenario": {"pushes": [PUSH], "start": "cyclic"}},
    "rough stairs": {"ground": {"stair_rise_m": 0.05, "roughness_m": 0.01}},
    "compliant": {"socket": {"connection": "compliant"}, "tube": {"connection": "compliant"}},
    "upright": {"mechanism": {"trunk": "forward"}},
    "gusts": {"scenario": {"gust": {"force_n": 20.0}}},
    "inverse hip": {"mechanism": {"hip": "inverse"}},
    "one group": {"observation": {"groups": ["knee"]}},
    "one group, friction": {"device": {"kind": "friction"}, "observation": {"groups": ["shank"]}},
    "one group, motor": {"device": {"kind": "motor"}, "observation": {"groups": ["thigh"]}},
}


def nested(key: str, value: object) -> Config:
    config: Config = {}
    for name in reversed(key.split(".")):
        config = {name: config or value}
    return config


def other_value(row: Mapping[str, Any], config: Config) -> object:
    """Return a value beside the present one, if the parameter is a number or a flag."""
    value: Any = resolve(config)
    for name in row["key"].split("."):
        value = value[name]
    if isinstance(value, bool):
        return not value
    if isinstance(value, list) and value and isinstance(value[0], float):
        value = value[0]
    if not isinstance(value, int | float):
        return None
    bounds = re.search(r"[\[(]([^,]+), ([^\])]+)[\])]", row["range"])
    assert bounds is not None, row["range"]
    low, high = float(bounds[1]), float(bounds[2])
    beside = value + 0.3 * (min(high, value + 1.0) - value) if value < high else 0.5 * (low + high)
    return round(beside) + (round(beside) == value) if isinstance(value, int) else beside


def refused(config: Config, key: str) -> bool:
    try:
        laid_over([Layer(config)])
    except ValueError as error:
        return str(error).startswith(f"{key} = ") and "has no effect: it needs" in str(error)
    return False


def walked(config: Config) -> NDArray[np.float64]:
    """Everything that eight walkers hand out in half a second, and what is recorded of one."""
    resolved = resolve(config)
    batch = _core.Batch(8, resolved, "next_step", 1)
    batch.record(1)
    handed: list[NDArray[Any]] = [batch.reset(np.arange(8, dtype=np.uint64), None)]
    rng = np.random.default_rng(0)
    for _ in range(100):
        step = batch.step(rng.uniform(-1.0, 1.0, 8 * _core.action_size(resolved)))
        handed += [step.observations, step.rewards[:, None], step.terms]
    return np.hstack([*(np.ravel(one) for one in handed), *batch.recording().values()])


@pytest.mark.parametrize("context", CONTEXTS)
def test_what_is_refused_would_have_done_nothing(context: str) -> None:
    base = CONTEXTS[context]
    expected, refusals = walked(base), 0
    for row in _core.parameters():
        key, value = row["key"], other_value(row, base)
        if value is None:
            continue
        config = merge(base, nested(key, value))
        try:
            resolve(config)
        except ValueError:
            continue
        if refused(config, key):
            refusals += 1
            np.testing.assert_array_equal(walked(config), expected, err_msg=f"{key} = {value}")
    assert refusals > 20


def test_the_core_knows_what_is_idle_and_what_it_needs() -> None:
    idle = _core.idle({"scenario": {"start": "cyclic", "randomise": {"ground.roughness_m": [0.0, 0.01]}}})
    assert idle["scenario.walk_s"] == ("scenario.start = 'standing' or 'random'", "scenario.start")
    assert idle["motor.gear_ratio"] == ("device.kind = 'motor'", None)
    assert "ground.roughness_length_m" not in idle  # its ground may be drawn rough
    assert "ground.roughness_length_m" in _core.idle({})
    keys = {row["key"] for row in _core.parameters()}
    assert set(idle) < keys
    for needs, switch in idle.values():
        assert needs
        assert switch is None or switch in keys


def test_channels_that_only_a_reward_term_looks_at_are_read() -> None:
    config = {"sensors": {"thigh_rate": {"noise": 0.1}}}
    for make in (ProsthesisEnv, lambda config, **more: ProsthesisVectorEnv(2, config, **more)):
        with pytest.raises(ValueError, match=r"sensors\.thigh_rate\.noise = 0.1 has no effect: .*the group thigh"):
            make(config)
        term = RewardTerm("swing", 1.0, lambda channels: channels["thigh_rate_rad_s"], groups=["thigh"])
        make(config, reward_terms=[term])
        make(merge(config, {"observation": {"groups": ["knee", "thigh"]}}))
    for wrong in (3, [3], "swing"):
        with pytest.raises(ValueError, match="reward"):
            ProsthesisEnv(reward_terms=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("make", [ProsthesisEnv, ProsthesisVectorEnv, lambda **more: ProsthesisVecEnv(2, **more)])
def test_the_size_of_pictures_that_nobody_draws_is_refused(make: Callable[..., object]) -> None:
    with pytest.raises(ValueError, match=r"render_size = \(640, 360\) has no effect: it needs render_mode"):
        make(render_size=(640, 360))
    for wrong in (3, 0, (640,), (640.0, 360), ("a", "b")):
        with pytest.raises(ValueError, match="size = "):
            make(render_size=wrong, render_mode="rgb_array")
    make(render_size=(640, 360), render_mode="rgb_array")


def test_every_setting_of_a_knee_that_the_leg_has_not_is_refused() -> None:
    sections = {
        "damper": ["knee", "state_machine"],
        "motor": ["motor", "motor_state_machine"],
        "friction": ["friction_knee"],
    }
    for kind in DEVICES:
        for other, names in sections.items():
            for row in _core.parameters():
                if row["key"].partition(".")[0] in names:
                    value = other_value(row, {})
                    config = merge({"device": {"kind": kind}}, nested(row["key"], value))
                    assert refused(config, row["key"]) == (kind != other), (kind, row["key"])


def through_settings(config: Config) -> object:
    return Settings.read({"env": merge({"action": {"mode": "direct"}}, config)})


DOORS: dict[str, Callable[[Config], object]] = {
    "single": ProsthesisEnv,
    "vector": lambda config: ProsthesisVectorEnv(2, config),
    "trial": lambda config: run_trial(config, duration_s=0.1),
    "trial of a controller": lambda config: run_trial(config, duration_s=0.1, policy=SensorController(lambda _: 1.0)),
    "evaluation": lambda config: evaluate(None, config, episodes=2),
    "training": through_settings,
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    ("config", "message"),
    [
        (
            {"motor": {"gear_ratio": 100.0}},
            r"motor\.gear_ratio = 100.0 has no effect: .*kind = .motor., .*damper",
        ),
        ({"sensors": {"motor_speed": {"noise": 1.0}}}, r"sensors\.motor_speed\.noise = 1.0 has no effect"),
        ({"scenario": {"gust": {"pause_s": 1.0}}}, r"scenario\.gust\.pause_s = 1.0 .*gust\.force_n other than 0"),
        ({"scenario": {"pushes": [PUSH], "push_s": 5.0}}, r"scenario\.push_s = 5.0 .*empty list scenario\.pushes"),
        (
            {"scenario": {"randomise": {"motor.gear_ratio": [50.0, 60.0]}}},
            r"scenario\.randomise\.\"motor\.gear_ratio\": would change nothing",
        ),
        (
            {"scenario": {"variants": [{"motor": {"gear_ratio": 9.0}}]}},
            r"scenario\.variants\[0\].*motor\.gear_ratio.*would change nothing",
        ),
        ({"ground": {"stair_count": 3}}, r"ground\.stair_count = 3 .*ground\.stair_rise_m other than 0"),
        ({"reward": {"electricity": -1.0}}, r"reward\.electricity = -1.0 has no effect"),
        (
            {"mechanism": {"hip": "inverse"}, "scenario": {"human": {"hip_limit_factor": 0.5}}},
            r"scenario\.human\.hip_limit_factor = 0.5 .*mechanism\.hip = 'forward', which is 'inverse'",
        ),
        ({"tube": {"damping_ratio": 0.3}}, r"tube\.damping_ratio = 0.3 .*tube\.connection = 'compliant'"),
    ],
)
def test_every_door_refuses_the_same(door: str, config: Config, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DOORS[door](config)


@pytest.mark.parametrize(
    "config",
    [
        {"scenario": {"push_n": 0.0, "push_s": 3.0}},  # the baseline of a sweep over forces
        {"scenario": {"profile": PROFILE, "speed_m_s": 1.0, "walk_s": 1.0, "pushes": [PUSH], "push_n": 0.0}},  # merged
        {"scenario": {"gust": {"force_n": 0.0, "duration_s": 1.0}}},
        {"ground": {"roughness_m": 0.0, "roughness_seed": 3}},
        {"scenario": {"randomise": {"ground.roughness_m": [0.0, 0.01]}}, "ground": {"roughness_length_m": 0.5}},
        {"scenario": {"start": "cyclic", "walk_s": 1.0, "speed_m_s": 1.1, "speed_change_s": 100.0}},
        {"sensors": {"motor_speed": {"noise": 1.0}, "knee_encoder": {"noise": 0.01}}},
        {"reward": {"electricity": -1.0, "fall": -20.0}},  # weights for any knee
        {"knee": {"spring_nm_rad": 1.0}, "state_machine": {"recovery": False}},
    ],
)
def test_what_is_sensible_is_not_refused(config: Config) -> None:
    for name, door in DOORS.items():
        if name != "trial of a controller" or "action" not in config:
            door(config)


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("kind", DEVICES)
def test_presets_are_for_every_knee_and_what_came_of_them_is_taken_again(scenario: str, kind: str) -> None:
    for reward in REWARDS:
        envs = ProsthesisVectorEnv(2, {"scenario": {"push_n": 0.0}}, scenario=scenario, reward=reward, device=kind)
        assert ProsthesisVectorEnv(2, envs.config).config == envs.config
    again = merge(envs.config, {"scenario": {"duration_s": 0.2}})
    assert evaluate(None, again, episodes=2).episodes == 2
    assert run_trial(again, progress=False).config["device"]["kind"] == kind
    ProsthesisVectorEnv(1, load_scenario(scenario, kind), device=kind)


def test_a_setting_is_refused_over_a_scenario_in_which_nothing_reads_it() -> None:
    for config, message in (
        ({"scenario": {"speed_m_s": 1.3}}, r"scenario\.speed_m_s = 1.3 has no effect: it needs an empty list"),
        ({"scenario": {"walk_s": 0.3}}, r"scenario\.walk_s = 0.3 has no effect"),
    ):
        with pytest.raises(ValueError, match=message):
            ProsthesisEnv(config, scenario="steady")
        with pytest.raises(ValueError, match=message):
            evaluate(None, config, scenario="steady", episodes=2)
    assert ProsthesisEnv({"scenario": {"push_n": 0.0}}, scenario="pushes").config["scenario"]["push_phase"] == [
        0.0,
        0.9,
    ]


def test_a_later_layer_may_replace_what_a_setting_goes_with(tmp_path: Path) -> None:
    path = tmp_path / "agent.toml"
    path.write_text('[action]\nmode = "residual"\nresidual_nms2_rad2 = 20.0\n[scenario]\npush_s = 3.0\npush_n = 50.0\n')
    walk = ["walk", "--duration", "0.5", "--solver", "fast", "--config", str(path)]
    assert main([*walk, "--controller", "constant:5", "--set", "scenario.push_n=0"]) == 0
    assert main([*walk, "--controller", "state-machine", "--scenario", "steady"]) == 0
    path.write_text("[motor]\ngear_ratio = 50.0\n")
    assert main(walk) == 2
    assert main([*walk, "--device", "motor"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "motor.gear_ratio=100"], "motor.gear_ratio = 100 has no effect"),
        (["--set", "action.constant_a=2"], "action.constant_a = 2 has no effect"),
        (["--controller", "constant:5", "--set", "action.mode=state_machine"], "contradicts the controller constant:5"),
        (["--set", "action.mode=residual"], "action.mode = 'residual' needs a policy"),
        (["--set", "action.residual_nms2_rad2=3"], "action.residual_nms2_rad2 = 3 has no effect"),
        (["--set", "reward.fall=-1"], "--set reward.fall=-1: a trial has no reward"),
        (["--set", "observation.frames=2"], "--set observation.frames=2: without a policy nobody observes"),
        (["--mass", "60", "--scenario", "body_sizes"], "the scenario draws a body"),
        (["--scenario", "steady", "--set", "scenario.speed_m_s=1.3"], "scenario.speed_m_s = 1.3 has no effect"),
        (["--start", "cyclic", "--set", "scenario.walk_s=2"], "scenario.walk_s = 2 has no effect"),
    ],
)
def test_options_of_walk_that_do_nothing_are_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["walk", "--duration", "1", *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["scenarios", "--device", "motor"], "--device motor needs --episodes"),
        (["render", "--out", "x.png", "--fps", "25"], "--fps 25: x.png is no clip"),
        (["render", "--out", "x.png", "--slow-motion", "2"], "--slow-motion 2: x.png is no clip"),
        (["bodies", "--set", "ankle.stiffness_nm_rad=600"], "--set ankle.stiffness_nm_rad=600: each body has its own"),
        (["bodies", "--set", "body.thigh_mass_kg=9"], "--set body.thigh_mass_kg=9: each body has its own"),
        (["bodies", "--set", "friction_knee.set_friction_nm=9"], "friction_knee.set_friction_nm = 9 has no effect"),
    ],
)
def test_options_of_other_commands_that_do_nothing_are_refused(
    command: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    assert message in capsys.readouterr().err


def test_a_difficulty_to_start_with_needs_a_curriculum() -> None:
    with pytest.raises(ValueError, match=r"training\.start_difficulty = 0.5 has no effect"):
        Settings.read({"training": {"start_difficulty": 0.5}})
    assert (
        Settings.read({"training": {"start_difficulty": 0.5, "curriculum_steps": 10}}).training.start_difficulty == 0.5
    )


def test_what_an_episode_drew_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    walk = ["walk", "--scenario", "everything", "--seed", "3", "--solver", "fast", "--duration", "1"]
    assert main(walk) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert main([*walk, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    config = merge(load_scenario("everything"), {"scenario": {"duration_s": 1.0}})
    batch = _core.Batch(1, resolve(config))
    batch.reset(np.array([3], dtype=np.uint64))
    drawn = {name: values[0] for name, values in batch.episodes().items()}
    assert told["seed"] == 3
    for key in ("ground.slope_deg", "push_n", "push_s", "first_speed_m_s", "variant", "hip_lift_m"):
        assert told["drawn"][key] == drawn[key]
    table = [(mass, height) for mass in (55, 65, 75, 85, 95, 105) for height in (1.6, 1.65, 1.7, 1.75, 1.8, 1.85)]
    mass_kg, height_m = table[int(drawn["variant"])]
    assert (told["drawn"]["body_mass_kg"], told["drawn"]["body_height_m"]) == pytest.approx((mass_kg, height_m))
    assert "drawn with seed 3: start = " in printed
    assert f"body_mass_kg = {mass_kg}" in printed
    assert main(["walk", "--duration", "0.5"]) == 0
    assert "drawn" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "config"),
    [
        ("motor", {"knee": {"spring_nm_rad": 1.0}}),
        ("motor", {"state_machine": {"recovery": False}}),
        ("motor", {"action": {"max_command_nms2_rad2": 10.0}}),
        ("friction", {"knee": {"max_damping_nms2_rad2": 1.0}}),
        ("friction", {"action": {"latch": "phase"}}),
        ("motor", {"sensors": {"motor_position": {"noise": 1.0}}}),
        ("damper", {"body": {"trunk_inertia_kg_m2": 3.0}}),
        ("damper", {"body": {"sole_radius_m": 0.3}}),
        ("damper", {"mechanism": {"hip": "inverse"}, "human": {"hip_stiffness_nm_rad": 900.0}}),
    ],
)
def test_settings_of_another_leg_than_the_environments_id_are_refused(kind: str, config: Config) -> None:
    for make in (
        lambda: gymnasium.make(DEVICES[kind].env_id, config=config),
        lambda: gymnasium.make_vec(DEVICES[kind].env_id, num_envs=2, config=config),
        lambda: ProsthesisVectorEnv(2, config, device=kind),
    ):
        with pytest.raises(ValueError, match="has no effect: it needs"):
            make()
