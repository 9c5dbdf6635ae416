"""Adversarial stepping: walkers with the worst of actions, sensors, grounds and pushes, and a check of every step."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import psutil
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import Config, merge, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.reasons import TerminationReason
from prosthesis_gym.seeding import check_seed, run_seed
from prosthesis_gym.vector_env import ProsthesisVectorEnv
from prosthesis_gym.walkers import Observations, spaces

Step: TypeAlias = tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]
"""What `step` of the vector environment returns."""

#: Env steps (5 ms) of a round: a batch of walkers with one configuration.
ROUND_STEPS = 300
#: Growth of resident memory from the first half of the rounds to the second that is no leak.
MEMORY_NOISE_MIB = 16.0
_LOADED_BW = 0.05
#: Scenarios in which people walk: no integration may diverge in them, whatever actions, sensors and ground are.
WALKABLE = ("undisturbed", "gusts")
_MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)

#: Standard deviations and limits that no sensor on the market would be sold with, in each sensor's unit.
_SENSOR_SCALES = {
    "knee_encoder": 0.2,
    "tube_force": 0.5,
    "tube_moment": 0.5,
    "ankle_moment": 0.5,
    "shank_inclination": 0.2,
    "shank_rate": 2.0,
    "shank_specific_force": 10.0,
    "thigh_rate": 2.0,
    "thigh_specific_force": 10.0,
    "motor_position": 10.0,
    "motor_speed": 100.0,
    "motor_current": 2.0,
}


def _all_sensors(**options: float) -> Config:
    return {"sensors": {name: dict(options) for name in _SENSOR_SCALES}}


def _scaled_sensors(*options: str) -> Config:
    return {"sensors": {name: dict.fromkeys(options, scale) for name, scale in _SENSOR_SCALES.items()}}


SENSOR_FAULTS: dict[str, Config] = {
    "sound": {},
    "late by 250 ms": _all_sensors(delay_samples=50),
    "half lost": _all_sensors(drop_out=0.5),
    "dead": _all_sensors(drop_out=1.0),
    "saturated": _scaled_sensors("saturation"),
    "noisy": _scaled_sensors("noise", "bias"),
}
GROUNDS: dict[str, Config] = {
    "level": {},
    "uphill": {"ground": {"slope_deg": 8.0}},
    "downhill": {"ground": {"slope_deg": -8.0}},
    "step": {"ground": {"step_height_m": 0.15, "step_x_m": 0.3, "edge_m": 0.005}},
    "stairs": {"ground": {"stair_rise_m": 0.15, "stair_start_x_m": 0.3}},
    "rough": {"ground": {"roughness_m": 0.05, "roughness_length_m": 0.2}},
    "slippery": {"ground": {"friction": 0.05}},
}
SCENARIOS: dict[str, Config] = {
    "undisturbed": {"scenario": {"push_n": 0.0}},
    "pushes": {"scenario": {"push_n": [0.0, 2000.0], "push_s": [0.0, 1.0]}},
    "gusts": {"scenario": {"gust": {"force_n": [-300.0, 300.0]}}},
    "strange gait": {
        "scenario": {
            "speed_m_s": [0.3, 2.5],
            "human": {"hip_lift_m": [0.0, 0.1], "swing_flexion_deg": [0.0, 60.0], "hip_stiffness_factor": [0.1, 3.0]},
        }
    },
}


@dataclass(frozen=True)
class Round:
    """What one batch has to endure."""

    device: str
    sensors: str
    ground: str
    scenario: str
    mode: AutoresetMode
    seed: int

    @property
    def config(self) -> Config:
        """Its configuration: episodes of 1.2 s, so that many end."""
        config: Config = {"device": {"kind": self.device}, "scenario": {"duration_s": 1.2}}
        for part in (SENSOR_FAULTS[self.sensors], GROUNDS[self.ground], SCENARIOS[self.scenario]):
            config = merge(config, part)
        return config


@dataclass
class Report:
    """What came of it."""

    env_steps: int = 0
    rounds: int = 0
    #: Episodes by knee and by how they ended.
    ends: dict[str, Counter[str]] = field(default_factory=lambda: {device: Counter() for device in DEVICES})
    #: Control periods that had to be integrated again: settled in finer steps, by the reference alone, by none.
    repeated_periods: NDArray[np.int64] = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    #: What went wrong: how, and where first.
    violations: dict[str, str] = field(default_factory=dict)
    #: Resident memory after each round.
    memory_mib: list[float] = field(default_factory=list)

    @property
    def memory_growth_mib(self) -> float:
        """Highest memory of the second half of the rounds over that of the first."""
        half = len(self.memory_mib) // 2
        return max(self.memory_mib[half:]) - max(self.memory_mib[:half]) if half else 0.0


def adversaries(
    observations: Observations, step: int, channels: list[str], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the worst actions (N, 1): walker i has the i-th adversary, in turn.

    Constant extremes, far beyond them too; bang-bang at 100, 25, 5 and 1 Hz; white noise; and those that watch the leg:
    stiff in stance and free in swing, the reverse, and with or against the motion of the knee.
    """
    loaded = np.where(observations[:, channels.index("tube_force_bw")] > _LOADED_BW, 1.0, -1.0)
    flexing = np.where(observations[:, channels.index("knee_speed_rad_s")] > 0.0, 1.0, -1.0)
    size = len(observations)
    bang_bang = [np.full(size, 1.0 if step // half % 2 else -1.0) for half in (1, 4, 20, 100)]
    extremes = [np.full(size, value) for value in (-1.0, 1.0, -1e6, 1e6)]
    kinds = np.stack([*extremes, *bang_bang, rng.uniform(-1.0, 1.0, size), loaded, -loaded, flexing, -flexing])
    walkers = np.arange(size)
    actions: NDArray[np.float64] = kinds[walkers % len(kinds), walkers][:, None]
    return actions


def torture(
    steps: int,
    *,
    walkers: int = 1024,
    seed: int = 0,
    threads: int | None = None,
    scenarios: Sequence[str] = tuple(SCENARIOS),
    progress: Callable[[int], None] | None = None,
) -> Report:
    """Make at least `steps` env steps in rounds of `walkers`, over all knees and in turn all conditions.

    `scenarios` are some of `SCENARIOS`. `progress` is called after each round with the env steps done.

    Raises:
        ValueError: impossible arguments; names the value and its range.

    """
    if steps < 1:
        raise ValueError(f"steps = {steps} must be at least 1")
    if walkers < 1:
        raise ValueError(f"walkers = {walkers} must be at least 1")
    if unknown := [name for name in scenarios if name not in SCENARIOS]:
        raise ValueError(f"scenarios: {unknown[0]!r} must be one of {', '.join(SCENARIOS)}")
    check_seed(seed)
    conditions = list(itertools.product(SENSOR_FAULTS, GROUNDS, scenarios, _MODES))
    np.random.default_rng(seed).shuffle(conditions)
    knees = itertools.cycle(DEVICES)
    report, process = Report(), psutil.Process()
    for index, (sensors, ground, scenario, mode) in enumerate(itertools.cycle(conditions)):
        _endure(Round(next(knees), sensors, ground, scenario, mode, run_seed(seed, index)), walkers, threads, report)
        report.memory_mib.append(process.memory_info().rss / 2**20)
        if progress is not None:
            progress(report.env_steps)
        if report.env_steps >= steps:
            break
    if report.memory_growth_mib > MEMORY_NOISE_MIB:
        report.violations["resident memory grows"] = f"by {report.memory_growth_mib:.1f} MiB"
    return report


def _endure(ordeal: Round, walkers: int, threads: int | None, report: Report) -> None:
    """Run one round and add what happened to the report."""
    envs = ProsthesisVectorEnv(walkers, ordeal.config, autoreset_mode=ordeal.mode, threads=threads)
    channels = [channel[0] for channel in _core.channels(resolve(ordeal.config))]
    rng = np.random.default_rng(ordeal.seed)
    observations, _ = envs.reset(seed=ordeal.seed)
    for step in range(ROUND_STEPS):
        outcome = envs.step(adversaries(observations, step, channels, rng))
        for violation in find_violations(envs, outcome):
            report.violations.setdefault(violation, f"first in step {step} of {ordeal}")
        observations, *_, infos = outcome
        reasons = infos.get("final_info", infos)["termination_reason"]
        report.ends[ordeal.device].update(_core.REASONS[reason] for reason in reasons[reasons != 0])
        if ordeal.scenario in WALKABLE and (reasons == TerminationReason.NON_FINITE).any():
            report.violations.setdefault("a walk that people can walk diverged", f"first in step {step} of {ordeal}")
    report.repeated_periods += envs.batch.repeated_periods
    report.rounds += 1
    report.env_steps += ROUND_STEPS * walkers
    envs.close()


def find_violations(envs: ProsthesisVectorEnv, outcome: Step) -> list[str]:
    """Return what is wrong with the outcome of a step of `envs`: nothing, one hopes."""
    observations, rewards, terminated, truncated, infos = outcome
    final = infos.get("final_info", infos)
    ended = terminated | truncated
    reasons = final["termination_reason"]
    space, _ = spaces(envs.config)
    seen = [observations, *infos["final_obs"][ended]] if "final_obs" in infos else [observations]
    terms = [info[key] for info in (infos, final) for key in envs.walkers.terms.keys]
    checks = {
        "observations are not finite": all(np.isfinite(rows).all() for rows in seen),
        "observations leave their space": all(((rows >= space.low) & (rows <= space.high)).all() for rows in seen),
        "rewards are not finite": bool(np.isfinite(rewards).all()),
        "reward terms are not finite": all(np.isfinite(values).all() for values in terms),
        "terminated and truncated at once": not (terminated & truncated).any(),
        "an end without a reason, or the reverse": bool(((reasons != TerminationReason.NONE) == ended).all()),
        "a time limit that does not truncate, or the reverse": bool(
            ((reasons == TerminationReason.TIME_LIMIT) == truncated).all()
        ),
    }
    return [name for name, holds in checks.items() if not holds]
