"""Controllers of one's own: readings in SI units in, commands in the knee's unit out."""

from typing import Any

import numpy as np
import pytest

from prosthesis_gym import _core
from prosthesis_gym.config import merge
from prosthesis_gym.controller import Readings, SensorController
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.evaluation import evaluate
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
