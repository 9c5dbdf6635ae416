"""How far a solver is from the converged reference: steady gait of every knee, and falls in disturbed episodes."""

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S, Config, merge, resolve
from prosthesis_gym.gait import Stride, mean_powers, stride_table
from prosthesis_gym.reasons import TerminationReason
from prosthesis_gym.trial import Trial, run_trial

#: The reference in quarters of its steps, for steady gait: it does not locate impacts on the extension stop, whose
#: damper makes the torque jump, and misses 1 % of its peaks with steps of 0.1 ms.
CONVERGED: Config = {"solver": {"stepper": "rk4", "steps": 200}}
#: The reference at twice its step: what it disagrees with itself about is chaos, not error.
HALF_REFERENCE: Config = {"solver": {"stepper": "rk4", "steps": 25}}
#: Episodes of 10 s that fall or do not: the environments' own, and milder ones of speeds that are walked undisturbed.
EPISODES: Mapping[str, Config] = MappingProxyType(
    {
        "default": {"scenario": {"duration_s": 10.0}},
        "walkable": {
            "scenario": {
                "duration_s": 10.0,
                "speed_m_s": [0.85, 1.35],
                "push_n": [0.0, 200.0],
                "human": {
                    "hip_stiffness_factor": [0.8, 1.2],
                    "pendulum_stiffness_factor": [0.95, 1.1],
                    "hip_lift_m": [0.0, 0.01],
                    "step_delay_s": [0.0, 0.02],
                },
            }
        },
    }
)
#: The motor knee's strides differ by 4 % in their peaks, so many of them make a mean.
_DURATION_S = 120.0
_SETTLED_S = 20.0
_KINEMATICS = (
    "stride_time_s",
    "stride_length_m",
    "peak_swing_knee_deg",
    "peak_stance_knee_deg",
    "hip_peak_residual_stance_m",
    "hip_peak_intact_stance_m",
)


@dataclasses.dataclass(frozen=True)
class GaitError:
    """One measure of steady gait with a solver and with the reference; NaN where one of them fell."""

    device: str
    speed_m_s: float
    measure: str
    reference: float
    found: float

    @property
    def error_percent(self) -> float:
        """Difference in percent of the reference."""
        return 100.0 * (self.found / self.reference - 1.0)


def gait_errors(solver: Config, devices: Iterable[str], speeds_m_s: Iterable[float]) -> Iterator[GaitError]:
    """Compare means over the strides from 20 to 120 s of walks under the state machine with those of `CONVERGED`."""
    speeds = list(speeds_m_s)
    for device in devices:
        for speed in speeds:
            found = _gait(device, speed, solver)
            for measure, value in _converged_gait(device, speed).items():
                yield GaitError(device, speed, measure, value, found.get(measure, float("nan")))


@functools.cache
def _converged_gait(device: str, speed_m_s: float) -> dict[str, float]:
    return _gait(device, speed_m_s, CONVERGED)


def _gait(device: str, speed_m_s: float, solver: Config) -> dict[str, float]:
    config = {
        "device": {"kind": device},
        "action": {"mode": "state_machine"},
        "scenario": {"start": "standing", "speed_m_s": speed_m_s, "walk_s": 1.0, "push_n": 0.0},
    }
    trial = run_trial(merge(config, solver), duration_s=_DURATION_S, progress=False)
    strides = [] if trial.ended_early else [one for one in stride_table(trial) if one.heel_strike_s > _SETTLED_S]
    if not strides:
        return {}
    measures = {name: float(np.mean([getattr(stride, name) for stride in strides])) for name in _KINEMATICS}
    measures["peak_tube_force_bw"] = _mean_peak(trial, strides, "tube_force_bw")
    measures["peak_extension_stop_nm"] = _mean_peak(trial, strides, "extension_stop_peak_nm")
    begin_s, end_s = strides[0].heel_strike_s, strides[-1].heel_strike_s + strides[-1].stride_time_s
    rows = (trial["time_s"] > begin_s) & (trial["time_s"] <= end_s)
    mass_kg = sum(
        trial.config["body"][part] for part in ("trunk_mass_kg", "thigh_mass_kg", "calf_mass_kg", "foot_mass_kg")
    )
    for joint, angle_deg in (
        ("hip", trial["thigh_angle_deg"] - trial["trunk_angle_deg"]),
        ("knee", -trial["knee_angle_deg"]),
    ):
        rate = np.gradient(np.radians(angle_deg), CONTROL_PERIOD_S)
        measures[f"{joint}_power_w"] = float(np.mean((mass_kg * trial[f"{joint}_torque_nm_kg"] * rate)[rows]))
    if trial.config["device"]["kind"] == "motor":
        powers = mean_powers(trial, begin_s, end_s)
        measures |= {name: powers[name] for name in ("rotor_positive_w", "electrical_drawn_w", "joule_w")}
    return measures


def _mean_peak(trial: Trial, strides: list[Stride], column: str) -> float:
    time, values = trial["time_s"], trial[column]
    peaks = [
        values[(time > stride.heel_strike_s) & (time <= stride.heel_strike_s + stride.stride_time_s)].max()
        for stride in strides
    ]
    return float(np.mean(peaks))


def falls(config: Config, episodes: int, seed: int = 0) -> NDArray[np.bool_]:
    """Whether each of so many episodes ends in a fall, the knee's state machine in command; episode i has seed + i."""
    resolved = resolve(merge(config, {"action": {"mode": "state_machine"}}))
    batch = _core.Batch(episodes, resolved, autoreset="same_step")
    batch.reset(np.arange(seed, seed + episodes, dtype=np.uint64), None)
    actions = np.zeros(episodes)
    fell, over = np.zeros(episodes, dtype=np.bool_), np.zeros(episodes, dtype=np.bool_)
    while not over.all():
        step = batch.step(actions)
        fell |= step.terminated & (step.reasons != TerminationReason.NON_FINITE) & ~over
        over |= step.terminated | step.truncated
    return fell
