"""What drives a knee in a trial or an evaluation, and the shortest way to one's own: a function of the sensors."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prosthesis_gym import _core
from prosthesis_gym.channels import call_with_channels
from prosthesis_gym.config import Config, merge, read_config, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.layers import Layer, laid_over
from prosthesis_gym.scenarios import read_scenario

Readings: TypeAlias = dict[str, NDArray[np.float64]]
"""Name of a sensor -> its readings (N,), one per walker; SI units, as the names say."""


CONTROLLERS_OWN = ("action", "observation")
"""Sections of a configuration that a controller brings."""


class Controller(Protocol):
    """What can drive the knees of N walkers; a trained `prosthesis_gym.policy.Policy` is one."""

    def configure(self, config: Mapping[str, Any], /) -> dict[str, Any]:
        """`config` with the knee unit and the sections `action` and `observation` that the controller is made for."""

    def act(self, observations: NDArray[np.float32], /) -> NDArray[Any]:
        """Actions in [-1, 1], (N,) or (N, 1) of any numbers, for observations (N, D)."""


def require_one_action(config: Mapping[str, Any]) -> None:
    """Raise a ValueError unless an action of the configuration is one number, as that of a controller is."""
    resolved = resolve(config)
    size = _core.action_size(resolved)
    if size != 1:
        mode = resolved["action"]["mode"]
        raise ValueError(f"action.mode = {mode!r} takes {size} numbers per walker, a controller gives 1")


def checked(
    config: str | Path | Mapping[str, Any] | None, controller: Controller | None, scenario: str | Path | None = None
) -> Config:
    """Return `config` over the scenario, if there is one.

    Raises:
        ValueError: impossible configuration, or a setting of `config` that has no effect; what a controller brings
            instead (`action`, `observation`) is no such setting.

    """
    layers = [Layer({} if scenario is None else read_scenario(scenario), given=False), Layer(read_config(config))]
    if controller is not None and not all(callable(getattr(controller, name, None)) for name in ("configure", "act")):
        raise ValueError(f"controller {controller!r} must have the methods configure and act")
    if controller is None:
        return laid_over(layers)
    return laid_over(layers, controller.configure, ignored=CONTROLLERS_OWN)


def driven(config: Mapping[str, Any], controller: Controller | None) -> Config:
    """Return `config` with what drives the knee: the controller, a constant command, or else the state machine.

    Raises:
        ValueError: `config` contradicts the controller, or an action of its mode is not one number.

    """
    if controller is None:
        constant = resolve(config)["action"]["mode"] == "constant"
        return merge(config, {} if constant else {"action": {"mode": "state_machine"}})
    configured = controller.configure(config)
    require_one_action(configured)
    return merge({}, configured)


def actions_of(controller: Controller, observations: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return a controller's actions (N,) for observations (N, D): it may give (N,) or (N, 1), of any numbers.

    Raises:
        ValueError: another shape, no numbers, or one that is not a number.

    """
    number = len(observations)
    given = controller.act(observations)
    if isinstance(given, tuple):
        raise ValueError("the controller's act returned a tuple, must return its actions alone")  # noqa: TRY004
    try:
        actions = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"the controller's act must return an array of shape ({number},): {error}") from None
    if actions.dtype.kind not in "fiu" or actions.shape not in ((number,), (number, 1)):
        raise ValueError(
            f"the controller's act returned shape {actions.shape} and dtype {actions.dtype}, "
            f"must return numbers of shape ({number},) or ({number}, 1)"
        )
    actions = actions.reshape(number).astype(np.float64)
    if np.isnan(actions).any():
        walker = int(np.flatnonzero(np.isnan(actions))[0])
        raise ValueError(f"the controller's act returned nan for walker {walker}, must return numbers in [-1, 1]")
    return actions


class SensorController:
    """A controller made of a function from the leg's own sensors to the knee's command.

    Args:
        command: takes the readings (name -> (N,), such as "knee_angle_rad", "tube_force_bw"; `sensors` lists them) and
            returns the command of each walker, (N,) or a number for all, in the unit of the knee: damping in
            N m s²/rad², current in A or friction in N m. It is limited to what the knee can do. The last command and
            that of the reference state machine are among the readings, in the same unit. Readings are those of the
            configuration's `observation.groups`.
        device: knee unit (a key of `prosthesis_gym.devices.DEVICES`).
        hold: control periods of 5 ms from one call of `command` to the next.

    Raises:
        ValueError: unknown knee unit.

    """

    def __init__(self, command: Callable[[Readings], ArrayLike], device: str = "damper", *, hold: int = 1) -> None:
        if device not in DEVICES:
            raise ValueError(f"device = {device!r} must be one of {', '.join(DEVICES)}")
        if not callable(command):
            raise ValueError(f"command = {command!r} must be a function of the readings")  # noqa: TRY004
        self.device = device
        self.hold = hold
        self._command = command
        self._full, self._names = 1.0, list(self.sensors)

    @property
    def sensors(self) -> dict[str, str]:
        """What each of the readings means."""
        unit = DEVICES[self.device].command
        described = {name: doc for name, _, _, doc in _core.channels({"device": {"kind": self.device}})}
        return described | {
            "last_command": f"Last command: {unit}",
            "state_machine_command": f"What the reference state machine would command now: {unit}",
        }

    def configure(self, config: Mapping[str, Any], /) -> Config:
        """Return `config` with this knee, direct commands over all that the knee can do, and one frame of readings.

        Raises:
            ValueError: `config` names another knee unit.

        """
        configured = merge({"device": {"kind": self.device}}, config)
        resolved = resolve(configured)
        if resolved["device"]["kind"] != self.device:
            raise ValueError(f"device.kind = {resolved['device']['kind']!r}, but the controller is for {self.device!r}")
        self._full, _ = _core.command_limits(resolved)
        action: Config = {"mode": "direct", "hold": self.hold}
        if (full_key := DEVICES[self.device].full_key) is not None:
            action[full_key] = self._full
        configured = merge(configured, {"action": action, "observation": {"frames": 1}})
        self._names = [name for name, *_ in _core.channels(resolve(configured))]
        return configured

    def act(self, observations: NDArray[np.float32], /) -> NDArray[np.float64]:
        """Return actions (N,) for observations (N, D) of the configuration that `configure` returned last.

        Raises:
            ValueError: other observations, or a command that is not finite, or not one number per walker.

        """
        rows = np.asarray(observations, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(self._names):
            raise ValueError(
                f"observations have shape {rows.shape}, must have (N, {len(self._names)}) as configured: "
                f"{', '.join(self._names)}"
            )
        readings = dict(zip(self._names, rows.T, strict=True))
        for name in ("last_command", "state_machine_command"):
            if name in readings:
                readings[name] = readings[name] * self._full
        remedy = "add {group!r} to observation.groups of the configuration"
        returned = np.asarray(call_with_channels(self._command, readings, "the controller's function", remedy))
        number = len(observations)
        if returned.dtype.kind not in "fiu" or returned.shape not in ((), (number,), (number, 1)):
            raise ValueError(
                f"the controller's function returned shape {returned.shape} and dtype {returned.dtype}, "
                f"must return numbers of shape ({number},) or ({number}, 1), or one for all"
            )
        commands = np.broadcast_to(returned.astype(np.float64).reshape(-1), number)
        if not np.isfinite(commands).all():
            raise ValueError(f"command = {commands[~np.isfinite(commands)][0]} must be a finite number")
        if DEVICES[self.device].signed:
            return np.clip(commands / self._full, -1.0, 1.0)
        # Damping and friction grow with the square of the action, from 0 at -1.
        actions: NDArray[np.float64] = 2.0 * np.sqrt(np.clip(commands / self._full, 0.0, 1.0)) - 1.0
        return actions
