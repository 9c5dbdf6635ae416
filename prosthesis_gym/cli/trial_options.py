"""The options that describe one trial, shared by the commands that run one."""

import argparse
import functools
from pathlib import Path
from typing import Any

from prosthesis_gym.bodies import scaled_body
from prosthesis_gym.config import FAST_SOLVER, REFERENCE_SOLVER, Config, apply_settings, load_config, merge, resolve
from prosthesis_gym.controller import CONTROLLERS_OWN
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.layers import Layer, laid_over
from prosthesis_gym.policy import Policy
from prosthesis_gym.scenarios import SCENARIOS, read_scenario

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
_NO_REWARD = {"reward": "a trial has no reward"}
#: Sections of `--set` that do nothing with a policy, and without one, and why.
_BROUGHT_ALONG = dict.fromkeys(CONTROLLERS_OWN, "the policy {controller} brings this section with it") | _NO_REWARD
_UNUSED = {"observation": "without a policy nobody observes"} | _NO_REWARD
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


def configure(arguments: argparse.Namespace) -> tuple[Config, Policy | None]:
    """Return the complete configuration that the options describe, and the policy if the controller is one.

    Raises:
        ValueError: options that contradict each other, an impossible value, or a setting that has no effect.

    """
    _refuse_contradictions(arguments)
    settings = apply_settings({}, arguments.settings)
    layers = [
        Layer(DEFAULTS if arguments.scenario is None else _WITHOUT_SCENARIO, given=False),
        Layer(load_config(arguments.config)),
        Layer({} if arguments.device is None else {"device": {"kind": arguments.device}}),
        Layer(_body(arguments), given=False),
        Layer({} if arguments.scenario is None else read_scenario(arguments.scenario), given=False),
        Layer({"scenario": _scenario(arguments)}),
        Layer({} if arguments.solver is None else SOLVERS[arguments.solver]),
    ]
    unchecked = functools.reduce(merge, [layer.config for layer in (*layers, Layer(settings))], Config())
    device = resolve(unchecked)["device"]["kind"]
    action, policy = _controller(arguments.controller, device)
    useless = _UNUSED if policy is None else _BROUGHT_ALONG
    for setting in arguments.settings:
        if (section := setting.partition(".")[0].strip()) in useless:
            raise ValueError(f"--set {setting}: {useless[section].format(controller=arguments.controller)}")
    layers += [Layer(action, given=False), Layer(settings)]
    if policy is not None:
        return resolve(policy.configure(laid_over(layers, policy.configure, CONTROLLERS_OWN))), policy
    config = resolve(laid_over(layers))
    mode = config["action"]["mode"]
    if mode not in ("state_machine", "constant"):
        raise ValueError(f"action.mode = {mode!r} needs a policy: name its folder as the controller")
    return config, None


def _refuse_contradictions(arguments: argparse.Namespace) -> None:
    if arguments.seed < 0:
        raise ValueError(f"--seed = {arguments.seed} must be 0 or more")
    settings = apply_settings({}, arguments.settings)
    scenario = None if arguments.scenario is None else read_scenario(arguments.scenario)
    if arguments.speed is not None and scenario is not None:
        given = f"--speed {arguments.speed} and --scenario {arguments.scenario}"
        raise ValueError(f"{given}: a scenario has its own speeds")
    if scenario is not None and "variants" in scenario.get("scenario", {}) and _body(arguments):
        raise ValueError(f"--mass and --height with --scenario {arguments.scenario}: the scenario draws a body")
    if arguments.controller is not None and "mode" in settings.get("action", {}):
        raise ValueError(f"--set action.mode=... contradicts the controller {arguments.controller}")


def _body(arguments: argparse.Namespace) -> Config:
    if arguments.mass is None and arguments.height is None:
        return {}
    return scaled_body(arguments.mass, arguments.height)


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
