"""Anti-aliased drawing in pixels: pygame primitives on a surface of twice the size, which is then smoothly reduced."""

from __future__ import annotations

import os
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prosthesis_gym.extras import optional
from prosthesis_gym.rendering.style import PAPER, Colour

if TYPE_CHECKING:
    import pygame

Frame: TypeAlias = NDArray[np.uint8]
Point: TypeAlias = ArrayLike
Anchor: TypeAlias = Literal["left", "centre", "right"]

_SUPERSAMPLING = 2


def import_pygame() -> Any:  # noqa: ANN401 - a module has any attributes
    """Import pygame-ce without its greeting, or raise a ModuleNotFoundError that names what to install."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    pygame = optional("pygame", "render")
    if not hasattr(pygame.draw, "aacircle"):  # of pygame-ce 2.5, which has the same name
        raise ModuleNotFoundError(
            f"pygame {pygame.version.ver} is installed in place of pygame-ce, which draws more; exchange them with: "
            "pip uninstall pygame && pip install --force-reinstall pygame-ce"
        )
    return pygame


@lru_cache(maxsize=64)
def _loaded_font(pixels: int, bold: bool) -> pygame.font.Font:
    fonts = optional("font_source_sans_pro", "render").font_files_ttf
    font: pygame.font.Font = import_pygame().font.Font(
        fonts["SourceSansProSemibold" if bold else "SourceSansPro"], pixels
    )
    return font


def _written(content: str, pixels: int, bold: bool, colour: Colour) -> pygame.Surface:
    module = import_pygame()
    module.font.init()
    try:
        return _loaded_font(pixels, bold).render(content, True, colour)
    except module.error:  # somebody else's `pygame.quit` leaves no font usable
        _loaded_font.cache_clear()
        return _loaded_font(pixels, bold).render(content, True, colour)


class Canvas:
    """A surface of `size` (width, height) pixels; all coordinates and widths are in its pixels, x right and y down.

    `unit` is the pixels that lines and text of this surface are measured in.
    """

    def __init__(self, size: tuple[int, int], unit: float = 1.0) -> None:
        self.size = size
        self.unit = unit
        self._pygame = import_pygame()
        self._surface: pygame.Surface = self._pygame.Surface((size[0] * _SUPERSAMPLING, size[1] * _SUPERSAMPLING))
        self.clear()

    def clear(self) -> None:
        """Paint everything in the colour of the paper."""
        self._surface.fill(PAPER)

    def frame(self) -> Frame:
        """Return what has been drawn, (height, width, 3) uint8."""
        reduced = self._pygame.transform.smoothscale(self._surface, self.size)
        pixels = bytearray(self._pygame.image.tobytes(reduced, "RGB"))
        return np.frombuffer(pixels, dtype=np.uint8).reshape(self.size[1], self.size[0], 3)

    def clip(self, bottom: float | None) -> None:
        """Keep what is drawn from now on above the pixel row `bottom`; None ends that."""
        width, height = (_SUPERSAMPLING * extent for extent in self.size)
        rows = height if bottom is None else round(_SUPERSAMPLING * bottom)
        self._surface.set_clip((0, 0, width, rows))

    def rectangle(self, x: float, y: float, width: float, height: float, colour: Colour) -> None:
        """Fill an upright rectangle."""
        left, top, right, bottom = (round(_SUPERSAMPLING * edge) for edge in (x, y, x + width, y + height))
        self._surface.fill(colour, (left, top, right - left, bottom - top))

    def polygon(self, points: ArrayLike, colour: Colour) -> None:
        """Fill a polygon of points (N, 2)."""
        corners = _SUPERSAMPLING * np.asarray(points, dtype=np.float64)
        self._pygame.draw.polygon(self._surface, colour, corners.tolist())
        self._pygame.draw.aalines(self._surface, colour, True, corners.tolist())

    def disc(self, centre: Point, radius: float, colour: Colour) -> None:
        """Fill a circle."""
        x, y = _SUPERSAMPLING * np.asarray(centre, dtype=np.float64)
        self._pygame.draw.aacircle(self._surface, colour, (x, y), _SUPERSAMPLING * radius)

    def capsule(self, start: Point, end: Point, start_radius: float, end_radius: float, colour: Colour) -> None:
        """Fill the hull of two circles: a tapered limb with round ends."""
        a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        length = float(np.hypot(*(b - a)))
        self.disc(a, start_radius, colour)
        self.disc(b, end_radius, colour)
        if length <= abs(start_radius - end_radius):
            return
        along = (b - a) / length
        across = np.array([-along[1], along[0]])
        # The common tangents touch the circles off the perpendicular by the taper.
        sine = (start_radius - end_radius) / length
        cosine = np.sqrt(1.0 - sine * sine)
        left, right = sine * along + cosine * across, sine * along - cosine * across
        corners = [a + start_radius * left, b + end_radius * left, b + end_radius * right, a + start_radius * right]
        self.polygon(corners, colour)

    def line(self, points: ArrayLike, width: float, colour: Colour) -> None:
        """Draw a line through points (N, 2) with round joins and ends."""
        corners = np.asarray(points, dtype=np.float64)
        for start, end in pairwise(corners):
            self.capsule(start, end, 0.5 * width, 0.5 * width, colour)

    def curve(self, points: ArrayLike, width: float, colour: Colour) -> None:
        """Draw a thin line through many points (N, 2): faster than `line`, with plain joins."""
        corners = (_SUPERSAMPLING * np.asarray(points, dtype=np.float64)).tolist()
        for start, end in pairwise(corners):
            self._pygame.draw.aaline(self._surface, colour, start, end, round(_SUPERSAMPLING * width))

    def gauge(
        self, centre: Point, radii: tuple[float, float], share: float, colour: Colour, background: Colour
    ) -> None:
        """Draw a ring of the given inner and outer radius, `share` in [-1, 1] of it filled from the top, clockwise."""
        inner, outer = radii
        self.disc(centre, outer, background)
        if share != 0.0:
            angles = 2.0 * np.pi * np.linspace(0.0, np.clip(share, -1.0, 1.0), 2 + round(48 * min(abs(share), 1.0)))
            rim = np.asarray(centre) + outer * np.stack([np.sin(angles), -np.cos(angles)], axis=-1)
            self.polygon([centre, *rim] if abs(share) < 1.0 else rim, colour)
        self.disc(centre, inner, PAPER)

    def arrow(self, tail: Point, tip: Point, width: float, colour: Colour) -> None:
        """Draw an arrow whose head shrinks with a length too short for it."""
        a, b = np.asarray(tail, dtype=np.float64), np.asarray(tip, dtype=np.float64)
        length = float(np.hypot(*(b - a)))
        if length < width:
            return
        along = (b - a) / length
        across = np.array([-along[1], along[0]])
        head = min(4.2 * width, length)
        neck = b - head * along
        self.line([a, b - 0.8 * head * along], width, colour)
        self.polygon([b, neck + 0.42 * head * across, neck + 0.16 * head * along, neck - 0.42 * head * across], colour)

    def text(
        self,
        content: str,
        position: Point,
        height: float,
        colour: Colour,
        *,
        anchor: Anchor = "left",
        bold: bool = False,
    ) -> None:
        """Write one line with its vertical middle at `position`."""
        image = _written(content, max(round(_SUPERSAMPLING * height), 8), bold, colour)
        x, y = _SUPERSAMPLING * np.asarray(position, dtype=np.float64)
        left = x - {"left": 0.0, "centre": 0.5, "right": 1.0}[anchor] * image.get_width()
        self._surface.blit(image, (round(left), round(y - 0.5 * image.get_height())))
