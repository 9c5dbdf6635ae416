"""No walk that people can walk ends because its integration has diverged."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import SCENARIOS, TerminationReason, _core
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.torture import GROUNDS, ROUND_STEPS, SENSOR_FAULTS, WALKABLE, torture
from prosthesis_gym.walkers import Walkers, environment_config

Ends: TypeAlias = NDArray[np.uint8]
Act: TypeAlias = Callable[[dict[str, NDArray[np.float32]]], Any]


def loaded(channels: dict[str, NDArray[np.float32]]) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = channels["tube_force_bw"] > 0.05
    return found


#: Controllers that somebody might write first.
CONTROLLERS: dict[str, Act] = {
    "stiff in stance, free in swing": lambda channels: np.where(loaded(channels), 1.0, -1.0),
    "always stiff": lambda channels: np.ones(len(channels["tube_force_bw"])),
    "always free": lambda channels: -np.ones(len(channels["tube_force_bw"])),
    "softly damped": lambda channels: np.where(loaded(channels), 0.3, -0.4),
}


def ends(config: dict[str, Any], device: str, act: Act, seeds: NDArray[np.uint64]) -> Ends:
    """Return why the first episode of each seed ends."""
    complete = environment_config(config, device)
    walkers = Walkers(len(seeds), complete)
    names = [name for name, *_ in _core.channels(complete)]
    observations = walkers.reset(seeds)
    reasons: Ends = np.zeros(len(seeds), dtype=np.uint8)
    while not reasons.all():
        actions = np.asarray(act(dict(zip(names, observations.T, strict=True))), dtype=np.float64)
        step = walkers.step(actions)
        reasons = np.where(reasons == 0, step.reasons, reasons)
        observations = step.observations
    return reasons


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("device", DEVICES)
def test_pushed_walkers_of_simple_controllers_fall_or_walk(device: str, name: str) -> None:
    """Seeds 1028, 1163 and 1241 are of walkers who stepped back, whose next cycle then ran backwards."""
    seeds = np.arange(1000, 1256, dtype=np.uint64)
    reasons = ends({"scenario": {"push_n": 300.0}}, device, CONTROLLERS[name], seeds)
    assert not (reasons == TerminationReason.NON_FINITE).any()


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("device", DEVICES)
def test_no_walker_of_a_scenario_diverges(device: str, scenario: str) -> None:
    complete = environment_config({"action": {"mode": "state_machine"}}, device, scenario=scenario)
    walkers = Walkers(64, complete)
    walkers.reset(np.arange(64, dtype=np.uint64))
    actions, reasons = np.zeros(64), np.zeros(64, dtype=np.uint8)
    while not reasons.all():
        reasons = np.where(reasons == 0, walkers.step(actions).reasons, reasons)
    assert not (reasons == TerminationReason.NON_FINITE).any()


def test_no_walker_of_tortures_walkable_part_diverges() -> None:
    rounds = len(SENSOR_FAULTS) * len(GROUNDS) * len(WALKABLE) * 2
    report = torture(rounds * 24 * ROUND_STEPS, walkers=24, scenarios=WALKABLE)
    assert report.rounds == rounds
    assert sum(sum(ended.values()) for ended in report.ends.values()) > 1000
    assert report.violations == {}
