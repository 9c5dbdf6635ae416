"""Bodies of other mass and height than Table 1's, and which of them walk."""

import csv
import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from prosthesis_gym.config import Config, merge, resolve
from prosthesis_gym.files import atomic_write
from prosthesis_gym.gait import stride_table
from prosthesis_gym.trial import run_trial

HEIGHT_M: Final = 1.77
"""Body height that Table 1's lengths belong to: the median adult man of the U.S. population (section 3)."""

MASS_RANGE_KG: Final = (45.0, 120.0)
HEIGHT_RANGE_M: Final = (1.50, 2.00)


def scaled_body(mass_kg: float | None = None, height_m: float | None = None) -> Config:
    """Return the sections of a configuration that make a body of this total mass and height.

    Trunk and thigh are human and keep the proportions of Table 1: lengths in proportion to height, masses so that
    human and prosthesis together weigh `mass_kg`, inertias with mass times height squared. Calf, tube and foot are the
    prosthesis and keep their masses and inertias, calf and foot also their size; the tube is cut so that knee and hip
    are at their share of the height. The ankle has its stiffness per body mass; the first stride that the human
    expects and the hip height that counts as a fall are in proportion to height.

    Args:
        mass_kg: mass of human and prosthesis, kg; None keeps the 75 kg of Table 1.
        height_m: body height, m; None keeps the 1.77 m of Table 1.

    Raises:
        ValueError: a body outside `MASS_RANGE_KG` or `HEIGHT_RANGE_M`.

    """
    table = resolve({})
    body, stiffness = table["body"], table["ankle"]["stiffness_nm_rad"]
    prosthesis_kg = body["calf_mass_kg"] + body["foot_mass_kg"]
    table_kg = body["trunk_mass_kg"] + body["thigh_mass_kg"] + prosthesis_kg
    mass_kg = table_kg if mass_kg is None else mass_kg
    height_m = HEIGHT_M if height_m is None else height_m
    for name, value, (low, high) in (("mass_kg", mass_kg, MASS_RANGE_KG), ("height_m", height_m, HEIGHT_RANGE_M)):
        if not low <= value <= high:
            raise ValueError(f"{name} = {value} is outside its allowed range [{low:g}, {high:g}]")
    heavier = (mass_kg - prosthesis_kg) / (table_kg - prosthesis_kg)
    longer = height_m / HEIGHT_M
    scale = {"mass_kg": heavier, "inertia_kg_m2": heavier * longer**2, "_m": longer}
    scaled = {
        key: value * scale[next(unit for unit in scale if key.endswith(unit))]
        for key, value in body.items()
        if key.startswith(("trunk_", "thigh_"))
    }
    below_knee = body["calf_length_m"] + body["tube_length_m"] + body["foot_height_m"]
    scaled["tube_length_m"] = body["tube_length_m"] + (longer - 1.0) * below_knee
    return {
        "body": scaled,
        "ankle": {"stiffness_nm_rad": stiffness * (mass_kg / table_kg)},
        "human": {"first_stride_m": table["human"]["first_stride_m"] * longer},
        "termination": {"hip_height_m": table["termination"]["hip_height_m"] * longer},
    }


@dataclass(frozen=True)
class BodyResult:
    """How a body of one size walked."""

    mass_kg: float
    height_m: float
    #: "walking", or "fell: <reason>"; see `prosthesis_gym.trial.Trial`.
    outcome: str
    #: Time of the fall, or the trial's length.
    end_s: float
    #: Full strides of cyclic walking.
    strides: int
    #: Speed, stride length and largest knee flexion in swing of the last full stride; None without one.
    speed_m_s: float | None
    stride_length_m: float | None
    peak_swing_knee_deg: float | None

    @property
    def walks(self) -> bool:
        """Whether it was still walking at the end."""
        return self.outcome == "walking"


def walk_bodies(
    masses_kg: Iterable[float], heights_m: Sequence[float], config: Mapping[str, Any]
) -> Iterator[BodyResult]:
    """Walk a body of every mass and height through the trial that `config` describes; sizes replace its body's."""
    for mass_kg in masses_kg:
        for height_m in heights_m:
            trial = run_trial(merge(config, scaled_body(mass_kg, height_m)), progress=False)
            strides = stride_table(trial)
            last = strides[-1] if strides else None
            yield BodyResult(
                mass_kg,
                height_m,
                trial.outcome,
                trial.end_s,
                len(strides),
                last.speed_m_s if last else None,
                last.stride_length_m if last else None,
                last.peak_swing_knee_deg if last else None,
            )


def save_bodies(results: Iterable[BodyResult], path: str | Path) -> None:
    """Write one row per body as .csv, complete or not at all."""
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(field.name for field in dataclasses.fields(BodyResult))
        writer.writerows(dataclasses.astuple(result) for result in results)
