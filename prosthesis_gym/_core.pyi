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
