"""Controllers of one's own: readings in SI units in, commands in the knee's unit out."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisEnv, _core
from prosthesis_gym.config import merge
from prosthesis_gym.controller import Readings, SensorController
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.evaluation import EvaluationResult, evaluate
from prosthesis_gym.trial import run_trial

WALK: dict[str, Any] = {"scenario": {"start": "standing", "speed_m_s": 1.1, "push_n": 0.0, "duration_s": 4.0}}
COMMANDS = {"damper": 7.5, "motor": -1.25, "friction": 6.0}


@pytest.mark.parametrize("device", DEVICES)
def test_a_constant_function_is_the_constant_command(device: str) -> None:
    command = COMMANDS[device]
    ours = run_trial(WALK, policy=SensorController(lambda _: command, device))
    fixed = {"device": {"kind": device}, "action": {"mode": "constant", DEVICES[device].constant_key: command}}
    theirs = run_trial(merge(WALK, fixed))
    # The command comes back from its square root: the walks agree but for rounding.
    rows = slice(0, 200)
    np.testing.assert_allclose(ours["knee_angle_deg"][rows], theirs["knee_angle_deg"][rows], atol=1e-6)


@pytest.mark.parametrize("device", DEVICES)
def test_the_reference_command_among_the_readings_is_in_the_knees_unit(device: str) -> None:
    ours = run_trial(WALK, policy=SensorController(lambda readings: readings["state_machine_command"], device))
    theirs = run_trial(merge(WALK, {"device": {"kind": device}, "action": {"mode": "state_machine"}}))
    rows = slice(0, 200)
    np.testing.assert_allclose(ours["knee_angle_deg"][rows], theirs["knee_angle_deg"][rows], atol=1e-3)


@pytest.mark.parametrize("device", DEVICES)
def test_readings_are_the_channels_of_the_knee_for_every_walker(device: str) -> None:
    seen: list[Readings] = []

    def command(readings: Readings) -> float:
        seen.append(readings)
        return 0.0

    controller = SensorController(command, device, hold=4)
    evaluate(controller, merge(WALK, {"scenario": {"duration_s": 0.1}}), episodes=5)
    assert len(seen) == 5
    channels = [channel[0] for channel in _core.channels({"device": {"kind": device}})]
    assert list(seen[0]) == channels == list(controller.sensors)
    assert {values.shape for values in seen[0].values()} == {(5,)}


def test_commands_beyond_the_knee_count_as_its_limit() -> None:
    config = {"knee": {"max_damping_nms2_rad2": 30.0}}
    controller = SensorController(lambda readings: np.where(np.arange(len(readings["last_command"])) % 2, 1e6, -1.0))
    controller.configure(config)
    np.testing.assert_array_equal(controller.act(np.zeros((4, 8), dtype=np.float32)), [-1.0, 1.0, -1.0, 1.0])


class Given:
    """A controller that returns what it was given, as the actions of any walkers."""

    def __init__(self, actions: Callable[[int], Any]) -> None:
        self._actions = actions

    def configure(self, config: Mapping[str, Any], /) -> dict[str, Any]:
        return merge(config, {"action": {"mode": "direct"}})

    def act(self, observations: NDArray[np.float32], /) -> Any:  # noqa: ANN401 - that is the test
        return self._actions(len(observations))


@pytest.mark.parametrize(
    "actions",
    [
        lambda number: np.full(number, 0.25, dtype=np.float32),
        lambda number: np.full((number, 1), 0.25, dtype=np.float32),
        lambda number: np.full((number, 1), 0.25),
        lambda number: [0.25] * number,
        lambda number: np.full(number, 0.25, dtype=">f8"),
        lambda number: np.full((2 * number, 1), 0.25)[::2],
    ],
)
def test_actions_of_any_floats_in_a_row_or_a_column_are_the_same(actions: Callable[[int], Any]) -> None:
    plain = Given(lambda number: np.full(number, 0.25))
    short = merge(WALK, {"scenario": {"duration_s": 0.5}})
    assert evaluate(Given(actions), short, episodes=5) == evaluate(plain, short, episodes=5)
    ours, theirs = (run_trial(short, policy=controller) for controller in (Given(actions), plain))
    np.testing.assert_array_equal(ours["knee_angle_deg"], theirs["knee_angle_deg"])


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (
            lambda number: np.zeros((number, 2)),
            r"shape \({n}, 2\) and dtype float64, must return numbers of shape \({n},\)",
        ),
        (lambda number: np.zeros(number + 1), r"returned shape \({m},\)"),
        (lambda _: 0.5, r"returned shape \(\)"),
        (lambda _: None, "dtype object"),
        (lambda number: ["left"] * number, "dtype <U4"),
        (lambda number: np.zeros(number, dtype=bool), "dtype bool"),
        (lambda number: (np.zeros(number), None), "returned a tuple, must return its actions alone"),
        (lambda number: np.where(np.arange(number) == number - 1, np.nan, 0.0), "returned nan for walker {last}"),
    ],
)
def test_actions_that_are_none_are_explained(actions: Callable[[int], Any], message: str) -> None:
    for number, walk in ((1, run_trial), (5, evaluated)):
        expected = message
        for name, value in (("{n}", number), ("{m}", number + 1), ("{last}", number - 1)):
            expected = expected.replace(name, str(value))
        with pytest.raises(ValueError, match=expected):
            walk(WALK, policy=Given(actions))


def evaluated(config: dict[str, Any], policy: Given) -> EvaluationResult:
    return evaluate(policy, config, episodes=5)


def test_what_sb3_predicts_drives_a_knee() -> None:
    sb3 = pytest.importorskip("stable_baselines3")
    env = ProsthesisEnv({"action": {"mode": "direct"}})
    model = sb3.PPO("MlpPolicy", env, n_steps=8, batch_size=8, device="cpu", seed=0)

    class Predicting(Given):
        def act(self, observations: NDArray[np.float32], /) -> Any:  # noqa: ANN401 - what SB3 says
            return model.predict(observations, deterministic=True)[0]

    assert (
        evaluate(Predicting(lambda _: None), merge(WALK, {"scenario": {"duration_s": 0.2}}), episodes=3).episodes == 3
    )


@pytest.mark.parametrize(
    "groups", [["knee"], ["shank", "knee", "load", "command"], ["privileged", "phase"], ["command"]]
)
def test_readings_are_those_of_the_configured_groups(groups: list[str]) -> None:
    seen: list[Readings] = []

    def command(readings: Readings) -> float:
        seen.append(readings)
        return 7.5

    config = merge(WALK, {"observation": {"groups": groups, "frames": 3}, "scenario": {"duration_s": 0.2}})
    ours = run_trial(config, policy=SensorController(command))
    assert list(seen[0]) == [channel[0] for channel in _core.channels({"observation": {"groups": groups}})]
    theirs = run_trial(merge(WALK, {"scenario": {"duration_s": 0.2}}), policy=SensorController(lambda _: 7.5))
    np.testing.assert_array_equal(ours["knee_angle_deg"], theirs["knee_angle_deg"])


def test_a_reading_that_is_not_there_is_explained() -> None:
    with pytest.raises(ValueError, match=r"reads 'true_hip_height_m'.*add 'privileged' to observation.groups"):
        run_trial(WALK, policy=SensorController(lambda readings: readings["true_hip_height_m"]))
    with pytest.raises(ValueError, match=r"reads 'motor_speed_.*only a motor knee has it"):
        run_trial(WALK, policy=SensorController(lambda readings: readings["motor_speed_100_rad_s"]))
    with pytest.raises(ValueError, match=r"reads 'knee_angle'.*no such channel; here are knee_angle_rad"):
        run_trial(WALK, policy=SensorController(lambda readings: readings["knee_angle"]))
    own = {"a": 1.0}
    with pytest.raises(KeyError, match="knee_angle_rad"):
        run_trial(WALK, policy=SensorController(lambda _: own["knee_angle_rad"]))
    with pytest.raises(ValueError, match=r"observations have shape \(4, 3\), must have \(N, 8\) as configured"):
        SensorController(lambda _: 0.0).act(np.zeros((4, 3), dtype=np.float32))


def test_impossible_controllers_are_explained() -> None:
    with pytest.raises(ValueError, match="device = 'spring' must be one of damper, motor, friction"):
        SensorController(lambda _: 0.0, "spring")
    with pytest.raises(ValueError, match="the controller is for 'motor'"):
        run_trial({"device": {"kind": "damper"}}, policy=SensorController(lambda _: 0.0, "motor"))
    with pytest.raises(ValueError, match="command = nan must be a finite number"):
        run_trial(WALK, policy=SensorController(lambda _: float("nan")))
    with pytest.raises(
        ValueError, match=r"returned shape \(3,\) and dtype float64, must return numbers of shape \(1,\)"
    ):
        run_trial(WALK, policy=SensorController(lambda _: np.zeros(3)))
    with pytest.raises(ValueError, match=r"returned shape \(\) and dtype object"):
        run_trial(WALK, policy=SensorController(lambda _: None))  # type: ignore[arg-type, return-value]
