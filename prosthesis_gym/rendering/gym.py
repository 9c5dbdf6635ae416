"""Gymnasium's render modes over a batch of walkers: pictures as arrays, or a window."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.rendering.canvas import Frame, import_pygame
from prosthesis_gym.rendering.renderer import WalkerRenderer, check_size
from prosthesis_gym.rendering.style import GRID

if TYPE_CHECKING:
    import pygame

RenderMode: TypeAlias = Literal["human", "rgb_array"]

RENDER_MODES: list[RenderMode] = ["human", "rgb_array"]
#: Walkers of a batch that are drawn at most, from the first on.
MOST_DRAWN = 16
#: A window shows a new picture after this much simulated time.
WINDOW_PERIOD_S = 0.02
#: Size of a window with one walker, and with several.
_WINDOW_SIZE, _TILED_WINDOW_SIZE = (960, 540), (1280, 720)
#: Size of a picture: small, because `RecordVideo` keeps one per env step in memory.
_PICTURE_SIZE = (640, 360)
_GAP = 2


def check_render_mode(mode: str | None) -> RenderMode | None:
    """Return the mode, or raise a ValueError."""
    for known in RENDER_MODES:
        if mode == known:
            return known
    if mode is not None:
        raise ValueError(f"render_mode = {mode!r} must be None or one of {', '.join(map(repr, RENDER_MODES))}")
    return None


class BatchRendering:
    """Draws the first walkers of a batch, at most `MOST_DRAWN` of them, in one of Gymnasium's render modes.

    Args:
        batch: the walkers; they are read, never changed.
        config: their complete configuration.
        mode: "human" keeps a window up to date, "rgb_array" draws when asked to.
        size: width and height in pixels, of the window or of each walker's picture.

    Raises:
        ValueError: impossible size.
        ModuleNotFoundError: pygame is not installed.

    """

    def __init__(
        self, batch: _core.Batch, config: Mapping[str, Any], mode: RenderMode, size: tuple[int, int] | None = None
    ) -> None:
        self.mode = mode
        self._batch = batch
        count = min(batch.num_envs, MOST_DRAWN)
        window_size = _WINDOW_SIZE if count == 1 else _TILED_WINDOW_SIZE
        self._size = check_size(size or (window_size if mode == "human" else _PICTURE_SIZE))
        self._columns = math.ceil(math.sqrt(count))
        self._rows = math.ceil(count / self._columns)
        each = self._size if mode == "rgb_array" else self._tile_size()
        self._walkers = [
            WalkerRenderer(config, partial(batch.ground_height, index), size=each) for index in range(count)
        ]
        period_s = CONTROL_PERIOD_S * config["action"]["hold"]
        self._steps_per_picture = max(round(WINDOW_PERIOD_S / period_s), 1)
        self._pictures_per_s = round(1.0 / (self._steps_per_picture * period_s))
        self._steps = 0
        self._window: pygame.Surface | None = None
        self._clock: pygame.time.Clock | None = None

    def _tile_size(self) -> tuple[int, int]:
        width, height = self._size
        return check_size(
            (
                (width - _GAP * (self._columns - 1)) // self._columns,
                (height - _GAP * (self._rows - 1)) // self._rows,
            )
        )

    def reset(self) -> None:
        """Take on the state after a reset; a window shows it."""
        self._observe()
        self._steps = 0
        if self.mode == "human":
            self.show()

    def step(self) -> None:
        """Take on the state after a step; a window shows it every `WINDOW_PERIOD_S`."""
        self._observe()
        self._steps += 1
        if self.mode == "human" and self._steps % self._steps_per_picture == 0:
            self.show()

    def _observe(self) -> None:
        for index, walker in enumerate(self._walkers):
            walker.observe(self._batch.snapshot(index))

    def frames(self) -> tuple[Frame, ...]:
        """Return one picture (height, width, 3) uint8 per drawn walker."""
        return tuple(walker.draw() for walker in self._walkers)

    def tiled(self) -> Frame:
        """Return all drawn walkers in one picture, row by row."""
        return tile(self.frames(), self._columns)

    def show(self) -> None:
        """Draw into the window, which opens at first, no faster than the walkers walk."""
        pygame = import_pygame()
        if self._window is None or self._clock is None:
            pygame.display.init()
            pygame.display.set_caption("prosthesis_gym")
            self._window = pygame.display.set_mode(self._size)
            self._clock = pygame.time.Clock()
        picture = self.tiled()
        image = pygame.image.frombuffer(picture.tobytes(), picture.shape[1::-1], "RGB")
        self._window.blit(image, (0, 0))
        pygame.event.pump()
        self._clock.tick(self._pictures_per_s)
        pygame.display.flip()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            import_pygame().display.quit()
            self._window = None


def tile(frames: Sequence[Frame], columns: int) -> Frame:
    """Return pictures of one size (height, width, 3) side by side, row by row, with thin lines between them."""
    height, width, _ = frames[0].shape
    rows = math.ceil(len(frames) / columns)
    tiled = np.full((rows * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3), GRID, dtype=np.uint8)
    for i, frame in enumerate(frames):
        top, left = (height + _GAP) * (i // columns), (width + _GAP) * (i % columns)
        tiled[top : top + height, left : left + width] = frame
    return tiled
