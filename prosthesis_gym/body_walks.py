"""Which bodies walk, and which fall and why."""

import csv
import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prosthesis_gym.bodies import scaled_body
from prosthesis_gym.config import merge
from prosthesis_gym.files import atomic_write
from prosthesis_gym.gait import stride_table
from prosthesis_gym.trial import run_trial


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
