"""Gymnasium's render modes over a batch of walkers: pictures as arrays, or a window."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np

from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.rendering.canvas import Frame
from prosthesis_gym.rendering.readout import WINDOW_S
from prosthesis_gym.rendering.renderer import WalkerRenderer, check_size
from prosthesis_gym.rendering.style import GRID
from prosthesis_gym.rendering.window import Window
from prosthesis_gym.walkers import Walkers

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


def check_render_mode(mode: str | None, size: tuple[int, int] | None = None) -> RenderMode | None:
    """Return the mode, or raise a ValueError: unknown, or a size of pictures that nobody draws."""
    if mode is None and size is not None:
        raise ValueError(f"render_size = {size!r} has no effect: it needs render_mode = 'rgb_array' or 'human'")
    for known in RENDER_MODES:
        if mode == known:
            return known
    if mode is not None:
        raise ValueError(f"render_mode = {mode!r} must be None or one of {', '.join(map(repr, RENDER_MODES))}")
    return None


class BatchRendering:
    """Draws the first walkers of a batch, at most `MOST_DRAWN` of them, in one of Gymnasium's render modes.

    Nothing is imported, read or made before somebody asks for a picture. From then on the walkers are followed, for
    plots and camera, until nobody has asked for `WINDOW_S` of simulated time: plots fill anew after such a pause.
    Copies and pickles begin with nothing followed, and no window.

    Args:
        walkers: they are read, never changed.
        config: their complete configuration.
        mode: "human" keeps a window up to date, "rgb_array" draws when asked to.
        size: width and height in pixels, of the window or of each walker's picture.

    Raises:
        ValueError: impossible size.

    """

    def __init__(
        self, walkers: Walkers, config: Mapping[str, Any], mode: RenderMode, size: tuple[int, int] | None = None
    ) -> None:
        self.mode = mode
        self._walkers = walkers
        self._config = config
        self._count = min(walkers.num_envs, MOST_DRAWN)
        window_size = _WINDOW_SIZE if self._count == 1 else _TILED_WINDOW_SIZE
        usual = window_size if mode == "human" else _PICTURE_SIZE
        self._size = check_size(usual if size is None else size)
        self._columns = math.ceil(math.sqrt(self._count))
        self._rows = math.ceil(self._count / self._columns)
        self._each = self._size if mode == "rgb_array" else self._tile_size()
        period_s = CONTROL_PERIOD_S * config["action"]["hold"]
        self._steps_per_picture = max(round(WINDOW_PERIOD_S / period_s), 1)
        self._followed_steps = math.ceil(WINDOW_S / period_s)
        self._pictures_per_s = round(1.0 / (self._steps_per_picture * period_s))
        self._steps = 0
        #: Since the last picture that somebody asked for.
        self._unasked_steps = 0
        self._renderers: list[WalkerRenderer] = []
        #: Open from the first picture on in mode "human".
        self.window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and pickles are made of."""
        return vars(self) | {"_renderers": [], "window": None}

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
        self._steps = 0
        self._observe()
        if self.mode == "human":
            self.show()

    def step(self) -> None:
        """Take on the state after a step; a window shows it every `WINDOW_PERIOD_S`."""
        self._steps += 1
        if self.mode == "human":
            self._observe()
            if self._steps % self._steps_per_picture == 0:
                self.show()
        elif self._renderers:
            self._unasked_steps += 1
            if self._unasked_steps > self._followed_steps:
                self._renderers = []
            self._observe()

    def _observe(self) -> None:
        for index, renderer in enumerate(self._renderers):
            renderer.observe(self._walkers.batch.snapshot(index))

    def _follow(self) -> None:
        """Begin to follow the walkers."""
        if not self._walkers.was_reset[: self._count].all():
            raise ValueError("nothing to draw: reset the environment first")
        batch = self._walkers.batch
        self._renderers = [
            WalkerRenderer(self._config, partial(batch.ground_height, index), size=self._each)
            for index in range(self._count)
        ]
        self._observe()

    def frames(self) -> tuple[Frame, ...]:
        """Return one picture (height, width, 3) uint8 per drawn walker.

        Raises:
            ValueError: before the first reset.
            ModuleNotFoundError: pygame is not installed.

        """
        if not self._renderers:
            self._follow()
        self._unasked_steps = 0
        return tuple(renderer.draw() for renderer in self._renderers)

    def tiled(self) -> Frame:
        """Return all drawn walkers in one picture, row by row."""
        return tile(self.frames(), self._columns)

    def show(self) -> None:
        """Draw into the window, which opens at first, no faster than the walkers walk."""
        if self.window is None:
            self.window = Window(self._size, self._pictures_per_s)
        self.window.show(self.tiled())

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.window is not None:
            self.window.close()


def tile(frames: Sequence[Frame], columns: int) -> Frame:
    """Return pictures of one size (height, width, 3) side by side, row by row, with thin lines between them."""
    height, width, _ = frames[0].shape
    rows = math.ceil(len(frames) / columns)
    tiled = np.full((rows * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3), GRID, dtype=np.uint8)
    for i, frame in enumerate(frames):
        top, left = (height + _GAP) * (i // columns), (width + _GAP) * (i % columns)
        tiled[top : top + height, left : left + width] = frame
    return tiled
