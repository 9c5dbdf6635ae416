"""How often does a controller let its walker fall? Fixed held-out episodes, with the uncertainty of the answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from prosthesis_gym import _core
from prosthesis_gym.arguments import whole_number
from prosthesis_gym.config import CONTROL_PERIOD_S, resolve
from prosthesis_gym.controller import Controller, actions_of, checked, driven
from prosthesis_gym.reasons import TerminationReason
from prosthesis_gym.reward_terms import RewardTerm
from prosthesis_gym.seeding import check_seed, core_seeds
from prosthesis_gym.walkers import Walkers

#: Seeds from here on are for evaluation: training must stay below.
HELD_OUT_SEED = 1_000_000_000
#: Seeds that a training run picks its best policy by; picking by the held-out ones would flatter the choice.
VALIDATION_SEED = 2_000_000_000

# A walking shank never rotates this slowly for more than a quarter of a second.
_STILL_RAD_S = 0.2
_STILL_S = 1.0
#: A measurement rather than a reward: it has no weight. Its group may be one that the controller does not see.
_STANDS_STILL = RewardTerm(
    "stands_still", 0.0, lambda channels: np.abs(channels["shank_rate_rad_s"]) < _STILL_RAD_S, groups=("shank",)
)
_Z95 = 1.959963984540054
_PUSHES = ("weakest third of pushes", "middle third of pushes", "strongest third of pushes")
#: What ends an episode and is no fall: a diverged integration is a failure of the solver, not of the walker.
_NO_FALLS = (TerminationReason.NONE, TerminationReason.TIME_LIMIT, TerminationReason.NON_FINITE)
_STARTS = ("from standing", "from a cyclic step")


def wilson_interval(count: int, total: int, z: float = _Z95) -> tuple[float, float]:
    """Return Wilson's score interval of the rate `count` in `total`, at 95 % or another normal quantile `z`."""
    if not 0 <= count <= total or total == 0:
        raise ValueError(f"count = {count} is outside its allowed range [0, total = {total}], or total is 0")
    rate, scale = count / total, 1.0 + z * z / total
    centre = (rate + z * z / (2 * total)) / scale
    half = z / scale * math.sqrt(rate * (1 - rate) / total + z * z / (4 * total * total))
    # The bounds at 0 and 1 are exact, but their sums are not.
    return (0.0 if count == 0 else centre - half, 1.0 if count == total else centre + half)


@dataclass(frozen=True)
class EvaluationResult:
    """What came of a batch of episodes, one walker each."""

    #: Falls by reason: a low hip, or a joint beyond its limit.
    reasons: dict[str, int]
    #: Episodes whose integration diverged. Nobody knows how they would have ended: they are in no other count and mean.
    diverged: int
    #: Episodes that ended upright but standing still although the walker meant to walk: neither a fall nor a success.
    stalls: int
    episodes: int
    #: Mean sum of rewards per episode.
    mean_return: float
    #: Mean of each reward term's sum per episode, before its weight.
    mean_terms: dict[str, float]
    #: Mean time until fall or end, s.
    mean_duration_s: float
    #: (falls, episodes) of parts of the episodes: terciles of push size, and start postures.
    parts: dict[str, tuple[int, int]]

    @property
    def judged(self) -> int:
        """Episodes that did not diverge."""
        return self.episodes - self.diverged

    @property
    def falls(self) -> int:
        """Episodes that ended in a fall."""
        return sum(self.reasons.values())

    @property
    def fall_rate(self) -> float:
        """Share of falls in the episodes that did not diverge; NaN if all did."""
        return self.falls / self.judged if self.judged else math.nan

    @property
    def failure_rate(self) -> float:
        """Share of all episodes that ended in a fall, a standstill or a divergence: in anything but success."""
        return (self.falls + self.stalls + self.diverged) / self.episodes

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the fall rate; all of [0, 1] if every episode diverged."""
        return wilson_interval(self.falls, self.judged) if self.judged else (0.0, 1.0)

    @property
    def hip_power_w_kg(self) -> float:
        """Positive power of the residual hip while walking, W/kg: what the leg costs its user."""
        return self.mean_terms["energy"] / self.mean_duration_s


def evaluate(
    controller: Controller | None,
    config: str | Path | Mapping[str, Any] | None,
    *,
    scenario: str | Path | None = None,
    episodes: int = 512,
    seed: int = HELD_OUT_SEED,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> EvaluationResult:
    """Run `episodes` episodes with the seeds `seed`, `seed + 1`, ... in one batch.

    `config` is a mapping, a TOML file, or None for the defaults. A controller (a policy, or one's own) brings its knee
    unit and its sections `action` and `observation`; a `config` that names another knee unit is a ValueError. Without
    one, the state machine drives the knee, or a constant command if `action.mode` is "constant". `scenario` (one of
    `prosthesis_gym.SCENARIOS`, or a file) is what the walkers meet; `config` overrides it. `progress` is called with
    the env steps done and the most there can be.

    Raises:
        ValueError: impossible arguments or actions, or a setting of `config` that has no effect.

    """
    episodes, seed = whole_number("episodes", episodes, 1, 1_000_000), check_seed(seed)
    # "next_step" because the batch goes on when some have ended; of each walker the first episode alone counts.
    resolved = resolve(driven(checked(config, controller, scenario), controller))
    walkers = Walkers(episodes, resolved, [_STANDS_STILL], "next_step", threads)
    observations = walkers.reset(core_seeds(seed, episodes))
    drawn = walkers.batch.episodes()
    step_s = resolved["action"]["hold"] * CONTROL_PERIOD_S
    most = math.ceil(resolved["scenario"]["duration_s"] / step_s)

    running = np.ones(episodes, dtype=bool)
    reasons = np.zeros(episodes, dtype=np.uint8)
    returns, steps = np.zeros(episodes), np.zeros(episodes, dtype=np.int64)
    sums = np.zeros((episodes, len(_core.TERMS)))
    still = np.zeros(episodes, dtype=np.int64)
    actions, done = np.zeros(episodes), 0
    while running.any():
        if controller is not None:
            actions = actions_of(controller, observations)
        step = walkers.step(actions)
        observations = step.observations
        still[running] = np.where(step.terms[:, -1] == 1.0, still + 1, 0)[running]
        ended = running & (step.terminated | step.truncated)
        returns[ended], steps[ended] = step.episode_returns[ended], step.episode_steps[ended]
        sums[ended], reasons[ended] = step.episode_terms[ended, :-1], step.reasons[ended]
        running &= ~ended
        done += 1
        if progress is not None:
            progress(done, most)

    diverged = reasons == TerminationReason.NON_FINITE
    fell = (reasons != TerminationReason.TIME_LIMIT) & ~diverged
    profile = resolved["scenario"]["profile"]
    walks_on = not profile or profile[-1]["walk"]
    return EvaluationResult(
        reasons={one.name.lower(): int((reasons == one).sum()) for one in TerminationReason if one not in _NO_FALLS},
        diverged=int(diverged.sum()),
        stalls=int((~fell & ~diverged & (still * step_s > _STILL_S)).sum()) if walks_on else 0,
        episodes=episodes,
        mean_return=_mean(returns[~diverged]),
        mean_terms={name: _mean(column[~diverged]) for name, column in zip(_core.TERMS, sums.T, strict=True)},
        mean_duration_s=_mean(steps[~diverged]) * step_s,
        parts=_parts(fell[~diverged], np.abs(drawn["push_n"])[~diverged], drawn["start"][~diverged]),
    )


def _mean(values: NDArray[Any]) -> float:
    return float(values.mean()) if values.size else math.nan


def _parts(
    fell: NDArray[np.bool_], push_n: NDArray[np.float64], start: NDArray[np.uint8]
) -> dict[str, tuple[int, int]]:
    """Count (falls, episodes) by tercile of push size, where pushes differ, and by start; no part is empty."""
    if not push_n.size:
        return {}
    thirds = np.digitize(push_n, np.quantile(push_n, [1 / 3, 2 / 3]))
    members = {name: thirds == index for index, name in enumerate(_PUSHES)}
    if not all(member.any() for member in members.values()):
        members = {}  # nobody is pushed, or all are alike
    members |= {name: start == index for index, name in enumerate(_STARTS)}
    return {name: (int(fell[member].sum()), int(member.sum())) for name, member in members.items() if member.any()}


def comparison_table(results: Mapping[str, EvaluationResult]) -> Table:
    """Lay the results out side by side, one column per controller."""
    table = Table(title="Held-out episodes")
    table.add_column("")
    for name in results:
        table.add_column(name, justify="right")

    def row(label: str, cell: Callable[[EvaluationResult], str]) -> None:
        table.add_row(label, *(cell(result) for result in results.values()))

    def rate(part: tuple[int, int] | None) -> str:
        return "-" if part is None else f"{part[0] / part[1]:.1%} of {part[1]}"

    row("episodes", lambda result: str(result.episodes))
    row("falls", lambda result: str(result.falls))
    row("diverged, not counted", lambda result: str(result.diverged))
    row("fall rate", lambda result: f"{result.fall_rate:.1%}")
    row("95 % interval", lambda result: "{:.1%} to {:.1%}".format(*result.interval))
    for name in dict.fromkeys(part for result in results.values() for part in result.parts):
        row(f"  {name}", lambda result, name=name: rate(result.parts.get(name)))  # type: ignore[misc] # mypy loses the default
    row("standstills", lambda result: str(result.stalls))
    for reason in dict.fromkeys(reason for result in results.values() for reason in result.reasons):
        row(f"  by {reason}", lambda result, reason=reason: str(result.reasons.get(reason, 0)))  # type: ignore[misc] # same
    table.add_section()
    row("mean return", lambda result: f"{result.mean_return:.3f}")
    row("mean duration (s)", lambda result: f"{result.mean_duration_s:.2f}")
    row("hip power (W/kg)", lambda result: f"{result.hip_power_w_kg:.3f}")
    for term in dict.fromkeys(term for result in results.values() for term in result.mean_terms):
        row(f"  term {term}", lambda result, term=term: f"{result.mean_terms[term]:.4f}")  # type: ignore[misc] # same
    return table
