"""The walker as drawn: trunk, residual leg with the prosthesis, intact leg, and the forces on them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym.rendering import style
from prosthesis_gym.rendering.camera import Camera
from prosthesis_gym.rendering.canvas import Canvas
from prosthesis_gym.trial import INTACT_BOTH, INTACT_SWING

Vector = NDArray[np.float64]

# What the model does not have, in m: radii of what is drawn around its lines.
_PELVIS, _SHOULDER, _HEAD, _NECK_TO_HEAD = 0.08, 0.098, 0.09, 0.115
_HIP, _KNEE, _TUBE, _ANKLE, _SOLE, _TOE = 0.07, 0.046, 0.017, 0.026, 0.016, 0.008
_SOCKET_FROM, _SOCKET_TO = 0.42, 0.96
_TOE_BEYOND_BALL, _TOE_RISE = 0.055, 0.024
_GAUGE = (0.034, 0.056)
#: What sets limbs off from those behind them.
_SEAM = 0.008
_SPRING_WIDTH, _SPRING_COILS, _SPRING_ENDS = 0.032, 7, 0.22
#: Arrows: a ground force of one body weight, and a push of 100 N, in m.
_BODY_WEIGHT_M, _PUSH_100_N_M = 0.42, 0.16
_PUSH_GAP_M = 0.1
_LEAST_FORCE_BW, _LEAST_PUSH_N = 0.02, 1.0
_LARGEST_FORCE_BW = 10.0
#: The swinging intact leg is at its touch-down angle, as far as the model goes; drawn, it takes this long to get there.
_SWING_THROUGH_S, _SWING_SHORTENING = 0.34, 0.12


@dataclass
class IntactLeg:
    """Where the intact leg is drawn: on the model's pendulum, below the hip while standing, or swinging through."""

    foot: Vector | None = None
    carries: bool = False
    _left_ground_s: float = math.nan
    _last_reach: Vector | None = None

    def observe(self, row: Mapping[str, float]) -> None:
        """Take on the state of a new row of a recording."""
        hip = np.array([row["hip_x_m"], row["hip_y_m"]])
        if row["intact_leg_state"] == INTACT_SWING:
            if self.carries or self._last_reach is None:
                self._left_ground_s = row["time_s"]
            self.carries = False
            self.foot = hip + self._swing(row, hip)
            return
        standing = row["intact_leg_state"] == INTACT_BOTH
        places = ("hip_x_m", "ground_height_m") if standing else ("pendulum_foot_x_m", "pendulum_foot_y_m")
        self.foot = np.array([row[place] for place in places])
        self.carries = True
        if np.isfinite(self.foot).all():
            self._last_reach = self.foot - hip

    def _swing(self, row: Mapping[str, float], hip: Vector) -> Vector:
        goal = np.array([row["touch_down_foot_x_m"], row["touch_down_foot_y_m"]]) - hip
        if self._last_reach is None:
            return goal
        share = min((row["time_s"] - self._left_ground_s) / _SWING_THROUGH_S, 1.0)
        eased = share * share * (3.0 - 2.0 * share)
        (start_angle, start_length), (end_angle, end_length) = (
            (math.atan2(reach[0], -reach[1]), math.hypot(*reach)) for reach in (self._last_reach, goal)
        )
        angle = start_angle + eased * (end_angle - start_angle)
        length = start_length + eased * (end_length - start_length)
        length *= 1.0 - _SWING_SHORTENING * math.sin(math.pi * share)
        return np.array([length * math.sin(angle), -length * math.cos(angle)])


def draw_walker(
    canvas: Canvas, camera: Camera, row: Mapping[str, float], intact_leg: IntactLeg, command_share: float
) -> None:
    """Draw the walker of a row of a recording; `command_share` in [-1, 1] is the knee's command over its largest."""
    places = {
        name: camera.project(row[f"{name}_x_m"], row[f"{name}_y_m"])
        for name in ("hip", "trunk_top", "knee", "ankle", "heel", "ball")
    }
    if not all(np.isfinite(place).all() for place in places.values()):
        return  # a diverged walker is nowhere
    if intact_leg.foot is not None:
        _draw_intact_leg(canvas, camera, places["hip"], camera.project(*intact_leg.foot), intact_leg.carries)
    _draw_trunk(canvas, camera, places["hip"], places["trunk_top"])
    _draw_residual_leg(canvas, camera, places, command_share)
    _draw_forces(canvas, camera, places, row)


def _draw_intact_leg(canvas: Canvas, camera: Camera, hip: Vector, foot: Vector, carries: bool) -> None:
    scale = camera.pixels_per_m
    length = float(np.hypot(*(foot - hip)))
    if length == 0.0:
        return
    colour = style.INTACT_LEG if carries else style.INTACT_LEG_SWINGING
    along = (foot - hip) / length
    across = np.array([-along[1], along[0]])
    width = 0.016 * scale
    if carries:
        shares = np.linspace(_SPRING_ENDS, 1.0 - _SPRING_ENDS, 2 * _SPRING_COILS + 1)
        sides = np.resize([0.0, 1.0, 0.0, -1.0], shares.size) * _SPRING_WIDTH * scale
        coils = hip + length * shares[:, None] * along + sides[:, None] * across
        canvas.line([hip, *coils, foot], width, colour)
    else:
        canvas.line([hip, foot], width, colour)
    # On the ground the tip is at the point that the pendulum turns about.
    radius = 0.02 * scale
    canvas.disc(foot - radius * along, radius, colour)


def _draw_trunk(canvas: Canvas, camera: Camera, hip: Vector, top: Vector) -> None:
    scale = camera.pixels_per_m
    up = (top - hip) / np.hypot(*(top - hip))
    shoulder = top - _SHOULDER * scale * up
    canvas.capsule(hip, shoulder, _PELVIS * scale, _SHOULDER * scale, style.TRUNK)
    canvas.disc(top + _NECK_TO_HEAD * scale * up, _HEAD * scale, style.TRUNK)


def _draw_residual_leg(canvas: Canvas, camera: Camera, places: Mapping[str, Vector], command_share: float) -> None:
    scale = camera.pixels_per_m
    hip, knee, ankle, heel, ball = (places[name] for name in ("hip", "knee", "ankle", "heel", "ball"))
    _draw_foot(canvas, ankle, heel, ball, scale)
    canvas.capsule(knee, ankle, 1.6 * _TUBE * scale + _SEAM * scale, (_TUBE + _SEAM) * scale, style.PAPER)
    canvas.capsule(knee, ankle, 1.6 * _TUBE * scale, _TUBE * scale, style.TUBE)

    seam = _SEAM * scale
    canvas.capsule(hip, knee, _HIP * scale + seam, _KNEE * scale + seam, style.PAPER)
    canvas.capsule(hip, knee, _HIP * scale, _KNEE * scale, style.THIGH)
    begin, end = hip + _SOCKET_FROM * (knee - hip), hip + _SOCKET_TO * (knee - hip)
    above, below = ((_HIP + share * (_KNEE - _HIP) + 0.004) * scale for share in (_SOCKET_FROM, _SOCKET_TO))
    canvas.capsule(begin, end, above, below, style.SOCKET)

    canvas.disc(knee, (_GAUGE[1] + 0.008) * scale, style.SOCKET)
    canvas.gauge(knee, (_GAUGE[0] * scale, _GAUGE[1] * scale), command_share, style.COMMAND, style.GRID)
    for joint, radius in ((hip, 0.02), (knee, 0.012), (ankle, 0.011)):
        canvas.disc(joint, max(radius * scale, 1.5 * canvas.unit), style.INK)


def _draw_foot(canvas: Canvas, ankle: Vector, heel: Vector, ball: Vector, scale: float) -> None:
    """Draw a keel from heel over ball to toe whose lower edge is the model's sole."""
    forward = (ball - heel) / np.hypot(*(ball - heel))
    up = np.array([forward[1], -forward[0]])
    rear, front = heel + _SOLE * scale * up, ball + _SOLE * scale * up
    toe = ball + _TOE_BEYOND_BALL * scale * forward + _TOE_RISE * scale * up
    instep = rear + 0.62 * (front - rear)
    canvas.capsule(front, toe, _SOLE * scale, _TOE * scale, style.FOOT)
    canvas.polygon([rear, ankle, instep], style.FOOT)
    canvas.capsule(ankle, instep, _ANKLE * scale, _SOLE * scale, style.FOOT)
    canvas.capsule(ankle, rear, _ANKLE * scale, _SOLE * scale, style.FOOT)
    canvas.capsule(rear, front, _SOLE * scale, _SOLE * scale, style.FOOT)


def _draw_forces(canvas: Canvas, camera: Camera, places: Mapping[str, Vector], row: Mapping[str, float]) -> None:
    scale, unit = camera.pixels_per_m, canvas.unit
    width = 4.0 * unit
    for point in ("heel", "ball"):
        force = np.array([row[f"{point}_force_forward_bw"], -row[f"{point}_force_up_bw"]])
        size_bw = float(np.hypot(*force))
        if size_bw > _LEAST_FORCE_BW:
            shown = force * min(1.0, _LARGEST_FORCE_BW / size_bw)
            _outlined_arrow(canvas, places[point], places[point] + _BODY_WEIGHT_M * scale * shown, width, style.FORCE)
    push = np.array([row["push_force_n"], -row["push_force_up_n"]])
    size_n = float(np.hypot(*push))
    if size_n > _LEAST_PUSH_N:
        direction = push / size_n
        tip = places["hip"] - _PUSH_GAP_M * scale * direction
        tail = tip - _PUSH_100_N_M * scale * push / 100.0
        _outlined_arrow(canvas, tail, tip, 1.4 * width, style.PUSH)
        label = tail - np.array([0.0, 18.0 * unit])
        canvas.text(f"{size_n:.0f} N", label, 20.0 * unit, style.PUSH, anchor="centre", bold=True)


def _outlined_arrow(canvas: Canvas, tail: Vector, tip: Vector, width: float, colour: style.Colour) -> None:
    """Draw an arrow with a seam of paper around its shaft, which sets it off from the limbs behind it."""
    if np.hypot(*(tip - tail)) < width:
        return
    canvas.line([tail, tip - 0.1 * (tip - tail)], 1.6 * width, style.PAPER)
    canvas.arrow(tail, tip, width, colour)
