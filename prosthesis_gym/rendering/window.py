"""A window on the screen, one of any number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from prosthesis_gym.rendering.canvas import Frame, import_pygame

if TYPE_CHECKING:
    import pygame


class Window:
    """A window that opens with its first picture, and lives and dies alone.

    Args:
        size: width and height in pixels.
        pictures_per_s: no more than so many are shown.

    """

    def __init__(self, size: tuple[int, int], pictures_per_s: int) -> None:
        self._size = size
        self._pictures_per_s = pictures_per_s
        self._window: pygame.Window | None = None
        self._clock: pygame.time.Clock | None = None

    def show(self, picture: Frame) -> None:
        """Show a picture (height, width, 3) uint8 in the upper left corner, and wait until the next may follow."""
        pygame = import_pygame()
        if self._clock is None:
            self._clock = pygame.time.Clock()
        image = pygame.image.frombuffer(picture.tobytes(), picture.shape[1::-1], "RGB")
        window, surface = self._opened()
        surface.blit(image, (0, 0))
        pygame.event.pump()
        self._clock.tick(self._pictures_per_s)
        window.flip()

    def _opened(self) -> tuple[pygame.Window, pygame.Surface]:
        pygame = import_pygame()
        if self._window is not None:
            try:
                # Asked for anew, because writing to the surface of a window that is gone crashes.
                return self._window, self._window.get_surface()
            except pygame.error:  # somebody else has quit pygame, and all windows with it
                pass
        pygame.display.init()
        self._window = window = pygame.Window("prosthesis_gym", self._size)
        return window, window.get_surface()

    def picture(self) -> Frame | None:
        """Return what the window shows, (height, width, 3) uint8; None once it is closed."""
        if self._window is None:
            return None
        pixels = bytearray(import_pygame().image.tobytes(self._window.get_surface(), "RGB"))
        return np.frombuffer(pixels, dtype=np.uint8).reshape(*self._size[::-1], 3)

    def close(self) -> None:
        """Close this window, and no other one."""
        if self._window is not None:
            self._window.destroy()
            self._window = None
