"""From metres to pixels, following the hip smoothly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Time constants of the camera, s: along the walk, and over the height of the ground.
_FOLLOW_S = (0.35, 0.5)


@dataclass
class Camera:
    """Shows the world point (`x_m`, `y_m`) at the pixel (`pixel_x`, `pixel_y`)."""

    pixel_x: float
    pixel_y: float
    pixels_per_m: float
    x_m: float = math.nan
    y_m: float = math.nan

    def follow(self, x_m: float, y_m: float, elapsed_s: float) -> None:
        """Move towards a point as `elapsed_s` passes; jump there at first."""
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return
        if not math.isfinite(self.x_m):
            self.x_m, self.y_m = x_m, y_m
        along, up = (-math.expm1(-elapsed_s / constant_s) for constant_s in _FOLLOW_S)
        self.x_m += along * (x_m - self.x_m)
        self.y_m += up * (y_m - self.y_m)

    def project(self, x_m: ArrayLike, y_m: ArrayLike) -> NDArray[np.float64]:
        """Return pixels (..., 2) of world points."""
        x = self.pixel_x + self.pixels_per_m * (np.asarray(x_m, dtype=np.float64) - self.x_m)
        y = self.pixel_y - self.pixels_per_m * (np.asarray(y_m, dtype=np.float64) - self.y_m)
        return np.stack(np.broadcast_arrays(x, y), axis=-1)

    def visible_m(self, width: float) -> tuple[float, float]:
        """Return the world's x at the left and right edge of a view of this many pixels."""
        left = self.x_m - self.pixel_x / self.pixels_per_m
        return left, left + width / self.pixels_per_m
