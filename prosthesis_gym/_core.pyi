"""Rust core: batched walkers behind one class. Arrays are C-contiguous; see `Batch` for shapes."""

from collections.abc import Mapping
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

class ParameterDoc(TypedDict):
    key: str
    default: str
    unit: str
    range: str
    doc: str

TERMS: list[str]
REASONS: list[str]

def parameters() -> list[ParameterDoc]: ...
def channels(config: Mapping[str, Any]) -> list[tuple[str, float, float, str]]: ...
def resolve(config: Mapping[str, Any]) -> dict[str, Any]: ...
def walker_joints(config: Mapping[str, Any]) -> list[dict[str, Any]]: ...

class Chain:
    """Rows of states in, rows of results out, C-contiguous; a load is (body, points (rows, 2), forces (rows, 2))."""

    def __init__(self, definition: Mapping[str, Any]) -> None: ...
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

class Batch:
    def __init__(
        self,
        num_envs: int,
        config: Mapping[str, Any],
        autoreset: Literal["next_step", "same_step", "disabled"] = "next_step",
        threads: int | None = None,
    ) -> None: ...
    @property
    def num_envs(self) -> int: ...
    @property
    def bytes_per_walker(self) -> int: ...
    @property
    def observation_size(self) -> int: ...
    def reset(
        self, seeds: NDArray[np.uint64] | None = None, mask: NDArray[np.bool_] | None = None
    ) -> NDArray[np.float32]: ...
    def step(
        self, actions: NDArray[np.float64]
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        NDArray[np.float64],
        NDArray[np.uint8],
        NDArray[np.float32] | None,
        NDArray[np.bool_],
    ]: ...
    def episodes(self) -> dict[str, NDArray[Any]]: ...
    def record(self, index: int) -> None: ...
    def recording(self) -> dict[str, NDArray[np.float64]]: ...
    def events(self) -> dict[str, NDArray[Any]]: ...
