"""Colours of the renderer: one hue per quantity, the same in the scene and in the plots below it."""

from typing import TypeAlias

Colour: TypeAlias = tuple[int, int, int]

PAPER: Colour = (250, 250, 248)
GROUND: Colour = (233, 230, 224)
GROUND_EDGE: Colour = (120, 114, 104)
INK: Colour = (38, 44, 54)
MUTED: Colour = (128, 134, 143)
GRID: Colour = (224, 225, 226)
STANCE: Colour = (238, 238, 236)

TRUNK: Colour = (176, 183, 193)
THIGH: Colour = (150, 159, 171)
SOCKET: Colour = (74, 83, 97)
TUBE: Colour = (164, 170, 178)
FOOT: Colour = (54, 61, 72)

# Okabe and Ito's hues: told apart with every kind of colour vision.
INTACT_LEG: Colour = (86, 156, 200)
INTACT_LEG_SWINGING: Colour = (205, 222, 234)
KNEE: Colour = (0, 114, 178)
FORCE: Colour = (0, 140, 104)
COMMAND: Colour = (222, 132, 0)
PUSH: Colour = (204, 60, 40)
