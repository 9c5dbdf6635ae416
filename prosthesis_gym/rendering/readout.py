"""Numbers above the scene, and below it the last seconds of knee angle, tube force and command."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.devices import Device
from prosthesis_gym.rendering.canvas import Canvas
from prosthesis_gym.rendering.style import COMMAND, FORCE, GRID, INK, INTACT_LEG, KNEE, MUTED, PUSH, STANCE, Colour

#: The strip's window.
WINDOW_S = 3.0
#: Samples of the strip: every so many control periods.
_STRIDE = 2
#: Width of the row of numbers, in units.
_NUMBERS_WIDTH = 850.0
_LEGEND = (
    (FORCE, "ground force"),
    (PUSH, "push"),
    (INTACT_LEG, "intact leg"),
    (COMMAND, "command"),
)
_LEGEND_WIDTH = 276.0
_PHASES = {number: name.replace("_", " ") for number, name in enumerate(_core.PHASES, start=1)}


@dataclass(frozen=True)
class Panel:
    """A small plot: a column of the recording, its heading and colour, and the range that it shows at least."""

    column: str
    heading: str
    colour: Colour
    low: float
    high: float


def panels(device: Device, full_command: float) -> list[Panel]:
    """Return the strip's plots for a knee unit whose command reaches `full_command`."""
    return [
        Panel("knee_angle_deg", "Knee flexion (°)", KNEE, 0.0, 75.0),
        Panel("tube_force_bw", "Tube force (body weights)", FORCE, 0.0, 1.25),
        Panel(
            "command",
            f"{device.command_name.capitalize()} ({device.command_unit})",
            COMMAND,
            -full_command if device.signed else 0.0,
            full_command,
        ),
    ]


class History:
    """The last `WINDOW_S` of the panels' columns."""

    def __init__(self, columns: list[str]) -> None:
        self._columns = ["time_s", *columns]
        self._rows: deque[list[float]] = deque()
        self._extremes: dict[str, tuple[float, float]] = {}

    def append(self, row: Mapping[str, float]) -> None:
        """Add a row of a recording, and forget what is too old."""
        time = row["time_s"]
        rows = self._rows
        # The newest row may lie between the samples that are kept.
        if rows and round(rows[-1][0] / CONTROL_PERIOD_S) % _STRIDE and len(rows) > 1:
            rows.pop()
        stance = row["heel_force_bw"] > 0.0 or row["ball_force_bw"] > 0.0
        rows.append([*(row[column] for column in self._columns), float(stance)])
        for column in self._columns:
            if np.isfinite(row[column]):
                low, high = self._extremes.get(column, (row[column], row[column]))
                self._extremes[column] = (min(low, row[column]), max(high, row[column]))
        while rows[0][0] < time - WINDOW_S - CONTROL_PERIOD_S:
            rows.popleft()

    def clear(self) -> None:
        """Forget everything."""
        self._rows.clear()
        self._extremes.clear()

    def range(self, panel: Panel) -> tuple[float, float]:
        """Return what the panel shows: its own range, and all that was seen, so that the axis never shrinks."""
        low, high = self._extremes.get(panel.column, (panel.low, panel.high))
        return min(panel.low, low), max(panel.high, high)

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Return one array per column, and `stance`: whether the residual foot touches the ground."""
        table = np.array(self._rows).reshape(len(self._rows), len(self._columns) + 1)
        return dict(zip([*self._columns, "stance"], table.T, strict=True))


def draw_strip(canvas: Canvas, history: History, plots: list[Panel], top: float) -> None:
    """Draw the panels side by side from the pixel row `top` to the bottom."""
    (width, height), unit = canvas.size, canvas.unit
    margin, gap = 56.0 * unit, 76.0 * unit
    panel_width = (width - margin - 28.0 * unit - gap * (len(plots) - 1)) / len(plots)
    data = history.arrays()
    for i, panel in enumerate(plots):
        left = margin + i * (panel_width + gap)
        box = (left, top + 36.0 * unit, panel_width, height - top - 36.0 * unit - 24.0 * unit)
        _draw_panel(canvas, panel, data, history.range(panel), box)
    caption = (margin + panel_width, top + 19.0 * unit)
    canvas.text("last 3 s, stance shaded", caption, 15.0 * unit, MUTED, anchor="right")


def _draw_panel(
    canvas: Canvas,
    panel: Panel,
    data: Mapping[str, NDArray[np.float64]],
    limits: tuple[float, float],
    box: tuple[float, float, float, float],
) -> None:
    unit = canvas.unit
    left, top, width, height = box
    time, values = data["time_s"], data[panel.column]
    low, high = limits
    now = time[-1] if time.size else 0.0

    def to_x(at: NDArray[np.float64] | float) -> NDArray[np.float64]:
        return np.asarray(left + width * (1.0 - (now - at) / WINDOW_S))

    def to_y(value: NDArray[np.float64] | float) -> NDArray[np.float64]:
        return np.asarray(top + height * (high - value) / (high - low))

    for begin, end in _stances(time, data["stance"]):
        x = max(float(to_x(begin)), left)
        canvas.rectangle(x, top, float(to_x(end)) - x, height, STANCE)
    for tick in _ticks(low, high):
        y = float(to_y(tick))
        canvas.line([(left, y), (left + width, y)], 1.0 * unit, MUTED if tick == 0.0 else GRID)
        label = f"{tick + 0.0:g}".replace("-", "−")
        canvas.text(label, (left - 8.0 * unit, y), 15.0 * unit, MUTED, anchor="right")
    canvas.text(panel.heading, (left, top - 17.0 * unit), 17.0 * unit, INK)
    shown = np.isfinite(values) & (time >= now - WINDOW_S - 1e-9)
    points = np.stack([to_x(time[shown]), to_y(values[shown])], axis=-1)
    if len(points):
        canvas.curve(points, 2.0 * unit, panel.colour)
        canvas.disc(points[-1], 3.6 * unit, panel.colour)


def _stances(time: NDArray[np.float64], stance: NDArray[np.float64]) -> list[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], stance, [0.0]])))
    return [(float(time[a]), float(time[min(b, time.size - 1)])) for a, b in edges.reshape(-1, 2)]


def _ticks(low: float, high: float) -> NDArray[np.float64]:
    """Three to five round numbers within the range."""
    span = high - low
    power = 10.0 ** np.floor(np.log10(span))
    step = next(step for step in (0.25 * power, 0.5 * power, power, 2.5 * power) if span / step <= 4.5)
    ticks: NDArray[np.float64] = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
    return ticks


def draw_numbers(canvas: Canvas, row: Mapping[str, float], device: Device) -> None:
    """Write time, speed, knee angle, command and phase along the upper edge, all of them in its width."""
    unit = min(canvas.unit, canvas.size[0] / _NUMBERS_WIDTH)
    x, y = 28.0 * unit, 30.0 * unit
    for heading, number, width in _readings(row, device):
        canvas.text(heading, (x, y), 16.0 * unit, MUTED)
        canvas.text(number, (x, y + 24.0 * unit), 26.0 * unit, INK, bold=True)
        x += width * unit


def draw_legend(canvas: Canvas) -> None:
    """Say at the upper right what the colours mean, where there is room beside the numbers."""
    unit = canvas.unit
    if canvas.size[0] < (_NUMBERS_WIDTH + _LEGEND_WIDTH) * unit:
        return
    for i, (colour, meaning) in enumerate(_LEGEND):
        x = canvas.size[0] - (_LEGEND_WIDTH - 150.0 * (i // 2)) * unit
        y = (31.0 + 24.0 * (i % 2)) * unit
        canvas.line([(x, y), (x + 18.0 * unit, y)], 4.0 * unit, colour)
        canvas.text(meaning, (x + 30.0 * unit, y), 16.0 * unit, MUTED)


def _readings(row: Mapping[str, float], device: Device) -> list[tuple[str, str, float]]:
    """(heading, number, width at unit 1) of each reading."""
    return [
        ("time", f"{row['time_s']:.2f} s", 118.0),
        ("speed", f"{_number(row['hip_vx_m_s'], 2)} m/s", 138.0),
        ("knee flexion", f"{_number(row['knee_angle_deg'], 0)}°", 128.0),
        (
            device.command_name,
            f"{_number(row['command'], 1)} {device.command_unit}",
            117.0 + 9.2 * len(device.command_unit),
        ),
        ("phase", phase(row, device), 0.0),
    ]


def _number(value: float, decimals: int) -> str:
    """With a true minus sign, and none before zero."""
    return f"{value:z.{decimals}f}".replace("-", "−")


def phase(row: Mapping[str, float], device: Device) -> str:
    """Phase of the gait as the knee's state machine has it, or stance and swing where the knee has but one state."""
    if device.has_phases:
        return _PHASES[round(row["controller_state"])]
    return "stance" if row["heel_force_bw"] > 0.0 or row["ball_force_bw"] > 0.0 else "swing"
