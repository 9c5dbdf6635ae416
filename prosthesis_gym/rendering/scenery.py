"""The ground: its profile, and marks of the distance walked."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym.rendering.camera import Camera
from prosthesis_gym.rendering.canvas import Canvas
from prosthesis_gym.rendering.style import GROUND, GROUND_EDGE, MUTED

GroundHeight: TypeAlias = Callable[[NDArray[np.float64]], NDArray[np.float64]]

_MARK_M = 0.5
_PIXELS_PER_SAMPLE = 2.0


def draw_ground(canvas: Canvas, camera: Camera, ground_height: GroundHeight, bottom: float) -> None:
    """Draw the ground down to the pixel row `bottom`, with a mark every half metre."""
    width, unit = canvas.size[0], canvas.unit
    left, right = camera.visible_m(width)
    # Sampled on a grid that stands still in the world, so that edges do not flicker as the camera moves.
    spacing = _PIXELS_PER_SAMPLE / camera.pixels_per_m
    x: NDArray[np.float64] = spacing * np.arange(
        math.floor(left / spacing) - 1, math.ceil(right / spacing) + 2, dtype=np.float64
    )
    surface = camera.project(x, ground_height(x))
    surface[:, 1] = np.clip(surface[:, 1], 0.0, bottom)
    canvas.polygon([(surface[0, 0], bottom), *surface, (surface[-1, 0], bottom)], GROUND)
    canvas.curve(surface, 1.5 * unit, GROUND_EDGE)
    marks: NDArray[np.float64] = _MARK_M * np.arange(
        math.ceil(left / _MARK_M), math.floor(right / _MARK_M) + 1, dtype=np.float64
    )
    for mark, (px, py) in zip(marks, camera.project(marks, ground_height(marks)), strict=True):
        whole = mark == round(mark)
        margin = 24.0 * unit
        if py + 14.0 * unit > bottom:
            continue
        canvas.line([(px, py + 6.0 * unit), (px, py + (14.0 if whole else 10.0) * unit)], 1.2 * unit, GROUND_EDGE)
        label_y = py + 26.0 * unit
        if whole and label_y < bottom - 8.0 * unit and margin < px < width - margin:
            canvas.text(f"{mark:.0f} m".replace("-", "−"), (px, label_y), 15.0 * unit, MUTED, anchor="centre")
