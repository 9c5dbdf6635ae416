"""One walker from start to end: run it, keep every signal at 200 Hz, save and load it."""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.arguments import whole_number
from prosthesis_gym.config import CONTROL_PERIOD_S, merge, read_config, resolve
from prosthesis_gym.controller import Controller, actions_of, checked, driven
from prosthesis_gym.extras import optional
from prosthesis_gym.files import atomic_write
from prosthesis_gym.progress import progress_bar
from prosthesis_gym.reasons import TerminationReason

#: Codes of the columns `human_state` and `intact_leg_state` (Figure 3).
STAND, STEP_START, STEP_CYCLE, STEP_STOP = map(
    _core.RESIDUAL_STATES.index, ("stand", "step_start", "step_cycle", "step_stop")
)
INTACT_BOTH, INTACT_SWING, INTACT_STANCE, INTACT_DOUBLE = map(
    _core.INTACT_STATES.index, ("both", "swing", "stance", "double")
)
#: Codes of the event column `leg`.
RESIDUAL, INTACT = range(2)

#: A stopping step that has not come to an end this long after the last foot strike never will.
_STOP_TIMEOUT_S = 5.0
_STEPS_PER_UPDATE = 100
#: Outcome of a trial whose integration diverged: nobody knows how the walk would have gone on.
DIVERGED = "diverged"
_METADATA = b"prosthesis_gym"


@dataclass(frozen=True, eq=False)
class Trial:
    """What happened: `columns` has one row per 5 ms from t = 0, `events` one per foot strike.

    `outcome` is "standing", "walking", "stopped on its toe", "fell: <reason>" or "diverged"; `config` is complete, and
    draws from `seed` what it leaves to chance. `drawn` is what it drew, by the names of `Batch.episodes`.
    """

    columns: dict[str, NDArray[Any]]
    events: dict[str, NDArray[Any]]
    outcome: str
    config: dict[str, Any]
    seed: int = 0
    drawn: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]

    @property
    def end_s(self) -> float:
        """Time of the last row."""
        return float(self["time_s"][-1])

    @property
    def fell(self) -> bool:
        """Whether the trial ended in a fall."""
        return self.outcome.startswith("fell")

    @property
    def ended_early(self) -> bool:
        """Whether the trial ended before its time: in a fall, or because the integration diverged."""
        return self.fell or self.outcome == DIVERGED

    def strikes_s(self, leg: int) -> NDArray[np.float64]:
        """Return the times (s) of the foot strikes of a leg, `RESIDUAL` or `INTACT`."""
        times: NDArray[np.float64] = self.events["time_s"][self.events["leg"] == leg]
        return times


def run_trial(
    config: str | Path | Mapping[str, Any] | None = None,
    *,
    policy: Controller | None = None,
    duration_s: float | None = None,
    seed: int = 0,
    progress: bool = True,
) -> Trial:
    """Walk one walker until it falls or its time is over.

    `config` is a mapping, a TOML file, or None for the defaults. A policy, or another controller, brings its knee unit
    and its sections `action` and `observation`; a `config` that names another knee unit is a ValueError. Without one,
    the state machine drives the knee, or a constant command if `action.mode` is "constant". `duration_s` replaces
    `scenario.duration_s`.

    Raises:
        ValueError: impossible configuration, seed or actions; names key, value and range.

    """
    seed = whole_number("seed", seed, 0, 2**64 - 1, "2^64 - 1")
    config = read_config(config)
    if duration_s is not None:
        config = merge(config, {"scenario": {"duration_s": duration_s}})
    resolved = resolve(driven(checked(config, policy), policy))
    batch = _core.Batch(1, resolved, autoreset="disabled")
    batch.record(0)
    observation = batch.reset(np.array([seed], dtype=np.uint64), None)
    drawn = {name: values[0].item() for name, values in batch.episodes().items()}
    actions = np.zeros(1)
    with progress_bar("simulating", resolved["scenario"]["duration_s"], "s", shown=progress) as show:
        steps, done = 0, False
        while not done:
            if policy is not None:
                actions = actions_of(policy, observation)
            step = batch.step(actions)
            observation, ended_early = step.observations, bool(step.terminated[0])
            done = ended_early or bool(step.truncated[0])
            steps += 1
            if steps % _STEPS_PER_UPDATE == 0:
                show(CONTROL_PERIOD_S * resolved["action"]["hold"] * steps)
    columns, events = batch.recording(), batch.events()
    outcome = _early_outcome(TerminationReason(step.reasons[0])) if ended_early else _upright_outcome(columns, events)
    return Trial(columns, events, outcome, resolved, seed, drawn)


def _early_outcome(reason: TerminationReason) -> str:
    return DIVERGED if reason is TerminationReason.NON_FINITE else f"fell: {reason.name.lower()}"


def _upright_outcome(columns: Mapping[str, NDArray[Any]], events: Mapping[str, NDArray[Any]]) -> str:
    last = {name: columns[name][-1] for name in ("time_s", "intent", "human_state", "intact_leg_state")}
    if last["human_state"] == STAND:
        return "standing"
    # The toe landed first and the heel never loads: the step can neither end nor go on.
    stopping = last["human_state"] == STEP_STOP and last["intact_leg_state"] == INTACT_STANCE and last["intent"] == 0
    waited_s = last["time_s"] - events["time_s"][-1] if len(events["time_s"]) else 0.0
    return "stopped on its toe" if stopping and waited_s > _STOP_TIMEOUT_S else "walking"


def check_trial_path(path: Path) -> None:
    """Raise a ValueError or ModuleNotFoundError unless `save_trial` can write this kind of file here."""
    if path.suffix not in (".parquet", ".csv"):
        raise ValueError(f"{path}: a trial is saved as .parquet or .csv, not {path.suffix or 'without an ending'}")
    if path.suffix == ".parquet":
        optional("pyarrow")


def save_trial(trial: Trial, path: str | Path) -> None:
    """Write .parquet (everything) or .csv (the columns alone), complete or not at all."""
    path = Path(path)
    check_trial_path(path)
    with atomic_write(path) as temporary:
        if path.suffix == ".csv":
            with temporary.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(trial.columns)
                writer.writerows(zip(*(column.tolist() for column in trial.columns.values()), strict=True))
        else:
            pa, parquet = optional("pyarrow"), optional("pyarrow.parquet")
            events = {name: values.tolist() for name, values in trial.events.items()}
            metadata = {
                "outcome": trial.outcome,
                "config": trial.config,
                "seed": trial.seed,
                "drawn": trial.drawn,
                "events": events,
            }
            table = pa.table(trial.columns).replace_schema_metadata({_METADATA: json.dumps(metadata).encode()})
            parquet.write_table(table, temporary)


def load_trial(path: str | Path) -> Trial:
    """Read what `save_trial` wrote as .parquet; a .csv lacks the configuration and the events."""
    path = Path(path)
    if path.suffix != ".parquet":
        raise ValueError(f"{path}: a trial is loaded from .parquet, not {path.suffix or 'without an ending'}")
    pa, parquet = optional("pyarrow"), optional("pyarrow.parquet")
    try:
        table = parquet.read_table(path)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{path}: {error}") from None
    if _METADATA not in (table.schema.metadata or {}):
        raise ValueError(f"{path}: not a trial of prosthesis_gym")
    metadata = json.loads(table.schema.metadata[_METADATA])
    columns = {name: table[name].to_numpy() for name in table.column_names}
    events = {name: np.asarray(values) for name, values in metadata["events"].items()}
    return Trial(columns, events, metadata["outcome"], metadata["config"], metadata["seed"], metadata.get("drawn", {}))
