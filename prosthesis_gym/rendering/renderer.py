"""One walker as a picture: scene, numbers and the last seconds of its gait."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from prosthesis_gym import _core
from prosthesis_gym.arguments import check_whole
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.rendering.camera import Camera
from prosthesis_gym.rendering.canvas import Canvas, Frame
from prosthesis_gym.rendering.figure import IntactLeg, draw_walker
from prosthesis_gym.rendering.readout import History, draw_legend, draw_numbers, draw_strip, panels
from prosthesis_gym.rendering.scenery import GroundHeight, draw_ground
from prosthesis_gym.rendering.style import INK

#: Height of the picture that lines and text are measured in: at 720 pixels a unit is a pixel.
_DESIGN_HEIGHT = 720.0
#: From this height (pixels) on there is room for the strip of plots.
_STRIP_FROM = 480
#: What the scene shows above and below the ground at the walker's feet, m.
_ABOVE_M, _BELOW_M = 2.14, 0.25
#: From this height on the numbers can be read.
_NUMBERS_FROM = 240
#: Lines and text do not shrink below this.
_SMALLEST_UNIT = 0.55
_LARGEST = 1e5
_SIZES = ((160, 90), (3840, 2160))


def check_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return the size (width, height), or raise a ValueError."""
    (least_width, least_height), (most_width, most_height) = _SIZES
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise ValueError(f"size = {size!r} must be width and height in pixels")
    width, height = (check_whole(number, "size") for number in size)
    if not (least_width <= width <= most_width and least_height <= height <= most_height):
        raise ValueError(
            f"size = {width}x{height} must be {least_width}x{least_height} to {most_width}x{most_height} pixels"
        )
    return width, height


class WalkerRenderer:
    """Draws one walker.

    `observe` every state of the walker (a row of a recording, such as `Batch.snapshot` gives), in the order of time;
    `draw` when a picture is wanted. Plots, camera and the swing of the intact leg follow from what has been observed;
    a time that runs backward begins a new episode.

    Args:
        config: complete configuration of the walker.
        ground_height: heights (N,) of the ground at places (N,), m.
        size: width and height in pixels, from 160x90 to 3840x2160; below a height of 480 without plots, below 240
            without numbers.
        caption: text in place of numbers and plots, if given; the walker is then in the middle.

    Raises:
        ValueError: impossible size.
        ModuleNotFoundError: pygame is not installed.

    """

    def __init__(
        self,
        config: Mapping[str, Any],
        ground_height: GroundHeight,
        *,
        size: tuple[int, int] = (1280, 720),
        caption: str | None = None,
    ) -> None:
        width, height = self.size = check_size(size)
        self.device = DEVICES[config["device"]["kind"]]
        _, self._full_command = _core.command_limits(config)
        self._ground_height = ground_height
        self._panels = panels(self.device, self._full_command)
        self._history = History([panel.column for panel in self._panels])
        self._intact_leg = IntactLeg()
        self._caption = caption
        with_strip = height >= _STRIP_FROM and caption is None
        unit = max(height / (_DESIGN_HEIGHT if with_strip else 0.6 * _DESIGN_HEIGHT), _SMALLEST_UNIT)
        self._canvas = Canvas(self.size, unit)
        self._scene_bottom = 0.745 * height if with_strip else float(height)
        pixels_per_m = self._scene_bottom / (_ABOVE_M + _BELOW_M)
        self._camera = Camera((0.42 if caption is None else 0.5) * width, pixels_per_m * _ABOVE_M, pixels_per_m)
        self._row: Mapping[str, float] | None = None

    def observe(self, row: Mapping[str, float]) -> None:
        """Take on a state of the walker: one value per column of a recording."""
        elapsed_s = 0.0 if self._row is None else row["time_s"] - self._row["time_s"]
        if elapsed_s < 0.0 or row["time_s"] == 0.0:
            elapsed_s = 0.0
            self._history.clear()
            self._intact_leg = IntactLeg()
            self._camera.x_m = self._camera.y_m = math.nan
        # What diverges has no place in a picture.
        self._row = row = {column: value if abs(value) < _LARGEST else math.nan for column, value in row.items()}
        self._history.append(row)
        self._intact_leg.observe(row)
        # The walker of a still picture stands in its middle.
        self._camera.follow(row["hip_x_m"], row["ground_height_m"], elapsed_s if self._caption is None else math.inf)

    def project(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the pixel (x right, y down) that shows a point of the world."""
        x, y = self._camera.project(x_m, y_m)
        return float(x), float(y)

    def _command_share(self, row: Mapping[str, float]) -> float:
        share = row["command"] / self._full_command
        return share if math.isfinite(share) else 0.0

    def draw(self) -> Frame:
        """Return the picture of the last state observed, (height, width, 3) uint8.

        Raises:
            ValueError: nothing has been observed.

        """
        if self._row is None:
            raise ValueError("nothing to draw: observe a state of the walker (reset the environment) first")
        row, canvas = self._row, self._canvas
        canvas.clear()
        canvas.clip(self._scene_bottom)
        draw_ground(canvas, self._camera, self._ground_height, self._scene_bottom)
        draw_walker(canvas, self._camera, row, self._intact_leg, self._command_share(row))
        canvas.clip(None)
        if self._caption is not None:
            canvas.text(
                self._caption, (0.5 * self.size[0], 26.0 * canvas.unit), 20.0 * canvas.unit, INK, anchor="centre"
            )
        elif self.size[1] >= _NUMBERS_FROM:
            draw_numbers(canvas, row, self.device)
            draw_legend(canvas)
        if self._scene_bottom < self.size[1]:
            draw_strip(canvas, self._history, self._panels, self._scene_bottom)
        return canvas.frame()
