"""Rust core: batched walkers behind one class. Arrays are C-contiguous; see `Batch` for shapes.

Whatever is given, a call works or raises; it never ends the process.
"""

import builtins
from collections.abc import Mapping
from typing import Any, Literal, Self, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "CONTROL_PERIOD_S",
    "INTACT_STATES",
    "MOST_ENVIRONMENTS",
    "PHASES",
    "REASONS",
    "RESIDUAL_STATES",
    "TERMS",
    "Batch",
    "Chain",
    "InternalError",
    "Step",
    "action_size",
    "channel_groups",
    "channels",
    "command_limits",
    "devices",
    "idle",
    "parameters",
    "resolve",
    "walker_joints",
]

@type_check_only
class ParameterDoc(TypedDict):
    key: str
    default: str
    unit: str
    range: str
    doc: str

class InternalError(RuntimeError):
    """A fault of prosthesis_gym itself, which no input should cause: please report it."""

TERMS: list[str]
MOST_ENVIRONMENTS: int
PHASES: list[str]
REASONS: list[str]
RESIDUAL_STATES: list[str]
INTACT_STATES: list[str]
CONTROL_PERIOD_S: float

def parameters() -> list[ParameterDoc]: ...
def channels(config: Mapping[str, Any]) -> list[tuple[str, float, float, str]]: ...
def channel_groups(config: Mapping[str, Any]) -> list[str]: ...
def action_size(config: Mapping[str, Any]) -> int: ...
def devices() -> dict[str, dict[str, Any]]:
    """Return what the knee units are, by `device.kind`: the fields of `prosthesis_gym.devices.Device`."""

def command_limits(config: Mapping[str, Any]) -> tuple[float, float]:
    """Return the largest command that the configured knee unit carries out, and that of action +1, in its own unit."""

def resolve(config: Mapping[str, Any]) -> dict[str, Any]: ...
def idle(config: Mapping[str, Any]) -> dict[str, tuple[str, str | None]]:
    """Return what changes nothing, by dotted keys: what each needs, and the key that turns it on and off, if any."""

def walker_joints(config: Mapping[str, Any]) -> list[dict[str, Any]]: ...

@final
class Chain:
    """Rows of states in, rows of results out, C-contiguous; a load is (body, points (rows, 2), forces (rows, 2))."""

    def __new__(cls, definition: Mapping[str, Any]) -> Self: ...
    def frames(self, q: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def point_position(self, q: NDArray[np.float64], body: int, point: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def point_velocity(
        self, q: NDArray[np.float64], qd: NDArray[np.float64], body: int, point: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...
    def mass_matrix(self, q: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def bias(self, q: NDArray[np.float64], qd: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def inverse_dynamics(
        self,
        q: NDArray[np.float64],
        qd: NDArray[np.float64],
        qdd: NDArray[np.float64],
        external_forces: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]],
    ) -> NDArray[np.float64]: ...
    def hybrid_dynamics(
        self,
        q: NDArray[np.float64],
        qd: NDArray[np.float64],
        qdd: NDArray[np.float64],
        tau: NDArray[np.float64],
        forward: NDArray[np.bool_],
        external_forces: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]],
    ) -> None: ...
    def kinetic_energy(self, q: NDArray[np.float64], qd: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def potential_energy(self, q: NDArray[np.float64]) -> NDArray[np.float64]: ...

@final
class Step:
    """What a step of N environments gives; D is the observation size, T the number of reward terms.

    The arrays belong to whoever holds them: they are filled again by a later step once nobody does.
    """

    @property
    def observations(self) -> NDArray[np.float32]:
        """(N, D)."""

    @property
    def rewards(self) -> NDArray[np.float64]:
        """(N,)."""

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """(N,): ended early."""

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """(N,): time over."""

    @property
    def terms(self) -> NDArray[np.float64]:
        """(N, T), before their weights."""

    @property
    def reasons(self) -> NDArray[np.uint8]:
        """(N,), index into `REASONS`."""

    @property
    def started(self) -> NDArray[np.bool_]:
        """(N,): reset in this step."""

    @property
    def eventful(self) -> bool:
        """Whether any environment was reset or ended in this step."""

    @property
    def final_observations(self) -> NDArray[np.float32] | None:
        """(N, D) with autoreset "same_step": the rows that count are those of `started`."""

    @property
    def episode_returns(self) -> NDArray[np.float64]:
        """(N,): sum of rewards of the episode that the step belongs to, the step included."""

    @property
    def episode_steps(self) -> NDArray[np.uint32]:
        """(N,): steps of that episode."""

    @property
    def episode_terms(self) -> NDArray[np.float64]:
        """(N, T): sums of its terms; the rows that count are those of episodes that have ended."""

@final
class Batch:
    """N environments. Any thread may call it: threads take turns, and wait without the interpreter.

    In a process that was forked off while a thread had its turn, it is a RuntimeError to use it: that turn never ends.

    Raises:
        ValueError: an impossible argument; more environments than there is memory for.
        InternalError: a fault of the core. The batch may be half changed then, and refuses to go on (RuntimeError).

    """

    def __new__(
        cls,
        num_envs: int,
        config: Mapping[str, Any],
        autoreset: Literal["next_step", "same_step", "disabled"] = "next_step",
        threads: int | None = None,
    ) -> Self: ...
    @property
    def num_envs(self) -> int: ...
    @property
    def solver_steps(self) -> int: ...
    @property
    def repeated_periods(self) -> tuple[int, int, int]:
        """Control periods that were integrated again because the solver had diverged, since the batch was made.

        Settled by the same stepper in finer steps, settled by the reference alone, and diverged by all three: only
        these end an episode as "non_finite".
        """

    @property
    def bytes(self) -> int:
        """Memory of all environments with all that they may come to hold, and of what two steps give."""

    @property
    def bytes_per_walker(self) -> int: ...
    @property
    def observation_size(self) -> int: ...
    def reset(
        self, seeds: NDArray[np.uint64] | None = None, mask: NDArray[np.bool_] | None = None
    ) -> NDArray[np.float32]: ...
    def observations(self, new: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """Return the newest observations (N, D); statistics learn from those in the mask `new`, by default none."""

    def raw_observations(self) -> NDArray[np.float32]:
        """Return the newest observations (N, D) as they are, normalised or not."""

    def step(self, actions: NDArray[np.float64]) -> Step:
        """Take flat actions (N * action size,): those beyond [-1, 1] are limited, infinite ones too.

        Raises:
            ValueError: an action is NaN, or an environment has not been reset.

        """
    def normalise_observations(self, clip: float = 10.0, epsilon: float = 1e-8) -> None:
        """Return observations less their running mean over their running deviation, within +-clip, from now on.

        Resets and steps learn the moments, their own observations included.
        """

    def moments(self) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return count, mean (D,) and variance (D,) of the observations seen."""

    def set_moments(
        self, count: float, mean: NDArray[np.float64], variance: NDArray[np.float64], learns: bool
    ) -> None: ...
    @property
    def learns(self) -> bool:
        """Whether observations change the moments."""

    @learns.setter
    def learns(self, learns: bool) -> None: ...
    def episodes(self) -> dict[str, NDArray[Any]]: ...
    @property
    def difficulty(self) -> float:
        """Share of disturbances and randomisation, in [0, 1], that episodes have from their next start on."""

    @difficulty.setter
    def difficulty(self, difficulty: float) -> None: ...
    @property
    def max_episode_steps(self) -> int | None:
        """Env steps of an episode at most, by default those of `scenario.duration_s`; None without a limit."""

    @max_episode_steps.setter
    def max_episode_steps(self, steps: int | None) -> None: ...
    def get_state(self, indices: list[int]) -> builtins.bytes: ...
    def set_state(self, state: builtins.bytes, indices: list[int]) -> list[bool]:
        """Return which of them had ended and start anew, as with autoreset "same_step" they do."""

    def record(self, index: int) -> None:
        """Record environment `index` at 200 Hz from its next reset on, and no other: the last call counts."""

    def recording(self) -> dict[str, NDArray[np.float64]]:
        """Return what has been recorded since the last reset of the recorded environment: one array per column."""

    def snapshot(self, index: int) -> dict[str, float]: ...
    def ground_height(self, index: int, x: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def events(self) -> dict[str, NDArray[Any]]:
        """Return the foot strikes of the recording."""
