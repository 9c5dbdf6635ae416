"""The options that describe one trial, shared by the commands that run one."""

import argparse
from pathlib import Path
from typing import Any

from prosthesis_gym.bodies import scaled_body
from prosthesis_gym.config import FAST_SOLVER, REFERENCE_SOLVER, apply_settings, load_config, merge, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.policy import Policy
from prosthesis_gym.scenarios import SCENARIOS, load_scenario

#: An undisturbed walk from standing at one speed.
DEFAULTS: dict[str, Any] = {
    "action": {"mode": "state_machine"},
    **REFERENCE_SOLVER,
    "scenario": {
        "start": "standing",
        "duration_s": 10.0,
        "speed_m_s": 1.1,
        "walk_s": 1.0,
        "push_n": 0.0,
    },
}
_WITHOUT_SCENARIO = {section: table for section, table in DEFAULTS.items() if section != "scenario"}
#: Configurations of `--solver`.
SOLVERS = {"fast": FAST_SOLVER, "reference": REFERENCE_SOLVER}
_CONTROLLERS = (
    "state-machine (default), constant:VALUE "
    f"({', '.join(device.command for device in DEVICES.values())}) or a policy's folder"
)


def add_trial_options(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Declare everything but the controller, and return the group of the options."""
    group = parser.add_argument_group("what happens")
    add = group.add_argument
    add("--device", choices=list(DEVICES), help="knee unit (default: damper, or the policy's)")
    add("--speed", type=float, metavar="M/S", help="one intended speed (default: 1.1), instead of a scenario")
    add("--scenario", "--profile", metavar="NAME|FILE", help=f"what happens: {', '.join(SCENARIOS)}, or a file")
    add("--mass", type=float, metavar="KG", help="mass of human and prosthesis (default: 75)")
    add("--height", type=float, metavar="M", help="body height (default: 1.77)")
    add("--start", choices=["standing", "cyclic"], help="default: standing, intent to walk from 1 s")
    add("--duration", type=float, metavar="S", help="length of the trial (default: 10, or the scenario's)")
    add("--solver", choices=sorted(SOLVERS), help="reference: converged (default); fast: as in training")
    add("--seed", type=int, default=0, metavar="N", help="of whatever the configuration leaves to chance (default: 0)")
    add("--config", type=Path, metavar="FILE", help="TOML file with any part of the configuration")
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings", help="any parameter (repeatable)")
    return group


def add_controller_option(group: argparse._ArgumentGroup) -> None:
    """Declare `--controller`."""
    group.add_argument("--controller", metavar="NAME", help=_CONTROLLERS)


def add_controller_argument(parser: argparse.ArgumentParser) -> None:
    """Declare CONTROLLER, a positional argument."""
    parser.add_argument("controller", nargs="?", metavar="CONTROLLER", help=_CONTROLLERS)


def configure(arguments: argparse.Namespace) -> tuple[dict[str, Any], Policy | None]:
    """Return the configuration that the options describe, and the policy if the controller is one."""
    if arguments.seed < 0:
        raise ValueError(f"--seed = {arguments.seed} must be 0 or more")
    if arguments.speed is not None and arguments.scenario is not None:
        given = f"--speed {arguments.speed} and --scenario {arguments.scenario}"
        raise ValueError(f"{given}: a scenario has its own speeds")
    config = DEFAULTS if arguments.scenario is None else _WITHOUT_SCENARIO
    if arguments.config:
        config = merge(config, load_config(arguments.config))
    if arguments.device is not None:
        config = merge(config, {"device": {"kind": arguments.device}})
    if arguments.mass is not None or arguments.height is not None:
        config = merge(config, scaled_body(arguments.mass, arguments.height))
    if arguments.scenario is not None:
        config = merge(config, load_scenario(arguments.scenario))
    config = merge(config, {"scenario": _scenario(arguments)})
    if arguments.solver is not None:
        config = merge(config, SOLVERS[arguments.solver])
    device = resolve(apply_settings(config, arguments.settings))["device"]["kind"]
    action, policy = _controller(arguments.controller, device)
    if policy is not None:
        for setting in arguments.settings:
            if setting.startswith(("action.", "observation.")):
                raise ValueError(f"--set {setting}: the policy {arguments.controller} brings these sections with it")
    return apply_settings(merge(config, action), arguments.settings), policy


def _scenario(arguments: argparse.Namespace) -> dict[str, Any]:
    scenario: dict[str, Any] = {}
    if arguments.speed is not None:
        scenario |= {"speed_m_s": arguments.speed, "profile": []}
    if arguments.start is not None:
        scenario["start"] = arguments.start
    if arguments.duration is not None:
        scenario["duration_s"] = arguments.duration
    return scenario


def _controller(name: str | None, device: str) -> tuple[dict[str, Any], Policy | None]:
    """Return the section `action` that selects a controller of the knee unit, and the policy if it is one."""
    kind, colon, value = (name or "").partition(":")
    if name is None:
        return {}, None
    if name == "state-machine":
        return {"action": {"mode": "state_machine"}}, None
    if kind == "constant" and colon:
        try:
            return {"action": {"mode": "constant", DEVICES[device].constant_key: float(value)}}, None
        except ValueError:
            raise ValueError(f"controller {name}: {value!r} is not a number") from None
    if Path(name).is_dir():
        return {}, Policy.load(name)
    raise ValueError(f"controller {name}: neither state-machine, constant:VALUE nor the folder of a policy")
