"""What happens beside learning: progress on the screen and in TensorBoard, evaluation, checkpoints, a clean stop."""

from __future__ import annotations

import csv
import io
import signal
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

import numpy as np
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from stable_baselines3.common.callbacks import BaseCallback

from prosthesis_gym import TerminationReason
from prosthesis_gym.evaluation import EvaluationResult
from prosthesis_gym.files import atomic_write, read_text
from prosthesis_gym.sb3 import ProsthesisVecEnv

#: Episodes that the fall rate on the screen is taken over.
_RECENT_EPISODES = 1000


class StopSignals:
    """Turns the first Ctrl-C or SIGTERM into a request to stop; a second one acts as usual."""

    def __init__(self) -> None:
        self.received: int | None = None
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> StopSignals:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._previous[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._restore()

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        self.received = number
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)


class StopCallback(BaseCallback):
    """Ends learning on a signal, or when `deadline` (a time of `time.perf_counter`) has passed."""

    def __init__(self, signals: StopSignals, deadline: float) -> None:
        super().__init__()
        self._signals = signals
        self._deadline = deadline

    def _on_step(self) -> bool:
        return self._signals.received is None and time.perf_counter() < self._deadline


class EveryCallback(BaseCallback):
    """Calls `action` between two rollouts whenever another `every_steps` env steps are complete."""

    def __init__(self, every_steps: int, action: Callable[[], None]) -> None:
        super().__init__()
        self._every = every_steps
        self._action = action
        self._passed = 0

    def _on_training_start(self) -> None:
        self._passed = self.num_timesteps // self._every

    def _on_rollout_start(self) -> None:
        passed = self.model.num_timesteps // self._every
        if passed > self._passed:
            self._passed = passed
            self._action()

    def _on_step(self) -> bool:
        return True


class CurriculumCallback(BaseCallback):
    """Raises the environment's difficulty linearly from `start` to 1 over the first `steps` env steps of a run."""

    def __init__(self, steps: int, start: float) -> None:
        super().__init__()
        self._steps = steps
        self._start = start

    def difficulty(self, steps: int) -> float:
        """Return the difficulty after so many env steps."""
        return self._start + (1.0 - self._start) * min(1.0, steps / self._steps)

    def _on_rollout_start(self) -> None:
        difficulty = self.difficulty(self.model.num_timesteps)
        self.training_env.set_attr("difficulty", difficulty)
        self.logger.record("curriculum/difficulty", difficulty)

    def _on_step(self) -> bool:
        return True


def progress_columns() -> tuple[ProgressColumn, ...]:
    """Return the columns of the progress bar; the bar itself takes what the numbers leave of the width."""
    return (
        TextColumn("[bold]{task.description}"),
        BarColumn(bar_width=None),
        TextColumn("{task.completed:,} of {task.total:,}"),
        TextColumn("{task.fields[status]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )


class ProgressCallback(BaseCallback):
    """A progress bar, and scalars for TensorBoard: reward terms with their weights, falls, and where the time goes."""

    def __init__(self, env: ProsthesisVecEnv, weights: Mapping[str, float], total_steps: int, *, shown: bool) -> None:
        super().__init__()
        self._env = env
        self._weights = weights
        self._fell: deque[bool] = deque(maxlen=_RECENT_EPISODES)
        self._terms: deque[dict[str, float]] = deque(maxlen=_RECENT_EPISODES)
        self._began = (0.0, 0.0, 0)
        self._bar = Progress(*progress_columns(), disable=not shown, expand=True)
        self._task = self._bar.add_task("training", total=total_steps, status="first steps")

    def _on_training_start(self) -> None:
        self._began = (time.perf_counter(), self._env.core_seconds, self.num_timesteps)

    def open(self) -> None:
        """Put the bar on the screen, before learning resets the environment, which takes a while by itself."""
        self._bar.start()

    def _on_training_end(self) -> None:
        self._bar.update(self._task, completed=self.num_timesteps)
        self.close()

    def close(self) -> None:
        """Take the bar off the screen; learning that failed does not do it by itself."""
        self._bar.stop()

    def print(self, line: str) -> None:
        """Write a line above the bar."""
        self._bar.console.print(line, highlight=False)

    def _on_step(self) -> bool:
        self._bar.update(self._task, completed=self.num_timesteps)
        infos = self.locals["infos"]
        for index in np.flatnonzero(self.locals["dones"]):
            reason = infos[index]["termination_reason"]
            if reason == TerminationReason.NON_FINITE:
                continue  # a diverged integration is no fall, and what it summed up is worth nothing
            self._fell.append(reason != TerminationReason.TIME_LIMIT)
            self._terms.append(infos[index]["episode_terms"])
        return True

    def _on_rollout_end(self) -> None:
        seconds = time.perf_counter() - self._began[0]
        env_share = (self._env.core_seconds - self._began[1]) / seconds
        speed = (self.num_timesteps - self._began[2]) / seconds
        status = f"{speed:,.0f}/s"
        self.logger.record("time/env_share", env_share)
        if self._fell:
            fall_rate = float(np.mean(self._fell))
            status += f", {fall_rate:.0%} fall"
            self.logger.record("rollout/fall_rate", fall_rate)
            for name, weight in self._weights.items():
                mean = float(np.mean([terms[name] for terms in self._terms]))
                self.logger.record(f"reward/{name}", weight * mean)
        self._bar.update(self._task, completed=self.num_timesteps, status=status)


class EvaluationLog:
    """The evaluations of a run as a CSV file, and which of them was the best."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rows: list[dict[str, str]] = []
        if path.exists():
            self._rows = list(csv.DictReader(io.StringIO(read_text(path), newline="")))

    @property
    def last_steps(self) -> int | None:
        """Env steps of the newest evaluation."""
        return int(self._rows[-1]["steps"]) if self._rows else None

    def is_best(self, result: EvaluationResult) -> bool:
        """Return whether fewer fail (fall, stall or diverge) than ever before, or as few with a higher return."""
        earlier = [(float(row["failure_rate"]), -float(row["mean_return"])) for row in self._rows]
        return (result.failure_rate, -result.mean_return) < min(earlier, default=(np.inf, np.inf))

    def append(self, steps: int, seconds: float, result: EvaluationResult) -> None:
        """Add a row; the file is complete at any time."""
        low, high = result.interval
        row = {
            "steps": steps,
            "seconds": round(seconds, 1),
            "episodes": result.episodes,
            "falls": result.falls,
            "diverged": result.diverged,
            "stalls": result.stalls,
            "failure_rate": result.failure_rate,
            "fall_rate": result.fall_rate,
            "fall_rate_low": low,
            "fall_rate_high": high,
            "mean_return": result.mean_return,
            "mean_duration_s": result.mean_duration_s,
            "hip_power_w_kg": result.hip_power_w_kg,
            **result.mean_terms,
        }
        self._rows.append({key: str(value) for key, value in row.items()})
        with atomic_write(self._path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(row))
            writer.writeheader()
            writer.writerows(self._rows)
