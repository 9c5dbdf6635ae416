"""Gait measures of a trial: one row per stride, from one residual heel strike to the next."""

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym.draws import left_to_chance
from prosthesis_gym.trial import INTACT_DOUBLE, INTACT_STANCE, INTACT_SWING, RESIDUAL, STEP_CYCLE, Trial


@dataclass(frozen=True)
class Stride:
    """One full cycle of both legs."""

    #: Residual heel strike that begins the stride.
    heel_strike_s: float
    speed_m_s: float
    #: Hip travel.
    stride_length_m: float
    stride_time_s: float
    #: Share of the stride with any contact of the residual foot.
    residual_stance_percent: float
    #: Share of the stride that the intact leg bears load (its states Stance and Double).
    intact_stance_percent: float
    #: Largest flexion with the residual foot in the air.
    peak_swing_knee_deg: float
    #: Largest flexion in the first half of the residual foot's contact (in the second the knee flexes to push off).
    peak_stance_knee_deg: float
    #: Largest hip height above the ground below while the intact leg swings.
    hip_peak_residual_stance_m: float
    #: Largest hip height while the intact leg stands and the residual foot is in the air.
    hip_peak_intact_stance_m: float
    #: Largest torque of the extension stop, between samples too.
    peak_extension_stop_nm: float
    #: The same with the residual foot in the air: the impact at the end of swing.
    late_swing_extension_stop_nm: float


def residual_contact(trial: Trial) -> NDArray[np.bool_]:
    """Rows in which heel or ball of the residual foot touch the ground."""
    contact: NDArray[np.bool_] = (trial["heel_force_bw"] > 0.0) | (trial["ball_force_bw"] > 0.0)
    return contact


def stride_table(trial: Trial) -> list[Stride]:
    """Every full stride of cyclic walking; first and last steps of a walk are no strides."""
    strikes = trial.events["leg"] == RESIDUAL
    times, hips = trial.events["time_s"][strikes], trial.events["hip_x_m"][strikes]
    strides = []
    for begin, end, length in zip(times[:-1], times[1:], np.diff(hips), strict=True):
        rows = np.flatnonzero((trial["time_s"] > begin) & (trial["time_s"] < end))
        cyclic = trial["human_state"][rows] == STEP_CYCLE
        if cyclic.size and cyclic.all():
            strides.append(
                _stride(trial, rows, begin_s=float(begin), time_s=float(end - begin), length_m=float(length))
            )
    return strides


def _stride(trial: Trial, rows: NDArray[np.intp], *, begin_s: float, time_s: float, length_m: float) -> Stride:
    loaded = residual_contact(trial)[rows]
    intact, knee = (trial[name][rows] for name in ("intact_leg_state", "knee_angle_deg"))
    hip = (trial["hip_y_m"] - trial["ground_height_m"])[rows]
    stop = trial["extension_stop_peak_nm"][rows]
    intact_swings, intact_stands = intact == INTACT_SWING, intact == INTACT_STANCE
    airborne = ~loaded
    early_stance = loaded & (np.cumsum(loaded) <= 0.5 * loaded.sum())
    return Stride(
        heel_strike_s=begin_s,
        speed_m_s=length_m / time_s,
        stride_length_m=length_m,
        stride_time_s=time_s,
        residual_stance_percent=100.0 * float(loaded.mean()),
        intact_stance_percent=100.0 * float((intact_stands | (intact == INTACT_DOUBLE)).mean()),
        peak_swing_knee_deg=_largest(knee, airborne),
        peak_stance_knee_deg=_largest(knee, early_stance),
        hip_peak_residual_stance_m=_largest(hip, intact_swings),
        hip_peak_intact_stance_m=_largest(hip, intact_stands & airborne),
        peak_extension_stop_nm=float(stop.max()),
        late_swing_extension_stop_nm=_largest(stop, airborne),
    )


def _largest(values: NDArray[np.float64], where: NDArray[np.bool_]) -> float:
    """Largest of the chosen values; NaN if there are none, as in a stride without a swing."""
    return float(values[where].max()) if where.any() else float("nan")


def steady_strides(trial: Trial, strides: Sequence[Stride], settling: int = 3) -> list[Stride]:
    """Select the strides that had `settling` strides before them at the same intended speed."""
    time, intended = trial["time_s"], trial["intended_speed_m_s"]
    steady = []
    for first, last in zip(strides, strides[settling:], strict=False):
        rows = (time >= first.heel_strike_s) & (time <= last.heel_strike_s + last.stride_time_s)
        if np.ptp(intended[rows]) == 0.0:
            steady.append(last)
    return steady


def summary(strides: Sequence[Stride]) -> dict[str, dict[str, float]]:
    """Mean, standard deviation and largest value of every measure; empty without strides."""
    measures = [field.name for field in dataclasses.fields(Stride) if field.name != "heel_strike_s"]
    values = {name: np.array([getattr(stride, name) for stride in strides]) for name in measures}
    return {
        name: {"mean": float(column.mean()), "sd": float(column.std()), "max": float(column.max())}
        for name, column in values.items()
        if column.size
    }


def mean_powers(trial: Trial, begin_s: float, end_s: float) -> dict[str, float]:
    """Mean powers (W) of a motor knee from `begin_s` to `end_s` (section 5.3.1 of the paper).

    Knee: of the gear on the knee. Rotor: of the motor's torque on its rotor, its positive and its negative part too.
    Electrical: drawn from the supply and what could be returned to it. Joule: lost in the windings.

    Raises:
        ValueError: a knee without a motor, or a window outside the trial.

    """
    if (kind := trial.config["device"]["kind"]) != "motor":
        raise ValueError(f"mean powers are those of a motor knee, and this one is {kind!r}")
    time = trial["time_s"]
    if not 0.0 <= begin_s < end_s <= time[-1]:
        raise ValueError(
            f"window = [{begin_s:g}, {end_s:g}] s must lie in [0, {time[-1]:g}] s, its start before its end"
        )
    # Each row's powers are means over the 5 ms before it.
    rows = (time > begin_s) & (time <= end_s)
    rotor, electrical = trial["rotor_power_w"][rows], trial["electrical_power_w"][rows]
    return {
        "knee_w": float(trial["gear_power_w"][rows].mean()),
        "rotor_w": float(rotor.mean()),
        "rotor_positive_w": float(np.maximum(rotor, 0.0).mean()),
        "rotor_negative_w": float(np.minimum(rotor, 0.0).mean()),
        "electrical_drawn_w": float(np.maximum(electrical, 0.0).mean()),
        "electrical_returned_w": float(-np.minimum(electrical, 0.0).mean()),
        "joule_w": float(trial["joule_power_w"][rows].mean()),
    }


def stride_json(trial: Trial, powers: dict[str, float] | None = None) -> str:
    """Outcome, seed, draws, strides, their summary and any mean powers as JSON; what does not exist is null."""
    strides = stride_table(trial)
    content: dict[str, object] = {
        "outcome": trial.outcome,
        "end_s": trial.end_s,
        "strides": [dataclasses.asdict(stride) for stride in strides],
        "summary": summary(strides),
    }
    if trial.drawn:
        content |= {"seed": trial.seed, "drawn": left_to_chance(trial)}
    if powers is not None:
        content["mean_powers"] = powers
    return json.dumps(_without_nan(content), indent=2, allow_nan=False)


def _without_nan(value: object) -> object:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
