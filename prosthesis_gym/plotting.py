"""Figures of trials, after Figure 8 of the paper: walking frames, speed, angles, forces and torques; gait cycles."""

from __future__ import annotations

import io
import string
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.extras import optional
from prosthesis_gym.files import atomic_write
from prosthesis_gym.gait import Stride, residual_contact, steady_strides, stride_table
from prosthesis_gym.trial import STAND, Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Array = NDArray[np.float64]

# Okabe and Ito's palette: told apart with every kind of colour vision.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = (
    "#000000", "#e69f00", "#56b4e9", "#009e73", "#0072b2", "#d55e00", "#cc79a7",
)  # fmt: skip
RED, GREY, SHADE = "#d40000", "#8c8c8c", "#eeeeee"

_FRAME_S = 0.1
#: Ground that the frames show at least: at equal scales, less would make their panel narrower than the others.
_SHORTEST_WALK_M = 7.9
_FORMATS = (".png", ".pdf", ".svg")
_STYLE = {
    "font.family": "sans-serif",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.borderaxespad": 0.0,
    "savefig.dpi": 300,
}


def check_plot_path(path: Path) -> None:
    """Raise a ValueError or ModuleNotFoundError unless a figure can be written here."""
    if path.suffix not in _FORMATS:
        raise ValueError(
            f"{path}: a figure is saved as {', '.join(_FORMATS)}, not {path.suffix or 'without an ending'}"
        )
    optional("matplotlib")


def trial_skeleton(trial: Trial) -> dict[str, Array]:
    """Return points (N, 2) in m of trunk top, hip, knee, ankle, heel and ball in every row of a trial."""
    points = ("trunk_top", "hip", "knee", "ankle", "heel", "ball")
    return {point: np.stack([trial[f"{point}_{axis}_m"] for axis in "xy"], axis=-1) for point in points}


def plot_trial(trial: Trial, path: str | Path, window: tuple[float, float] = (0.0, 8.0)) -> None:
    """Frames, speed over the whole trial, and angles, forces and torques in the window (s), as .png, .pdf or .svg."""
    begin, end = window
    if not 0.0 <= begin < end or begin >= trial.end_s:
        raise ValueError(f"window = {window} must lie in the trial's [0, {trial.end_s:g}] s, begin before end")
    end = min(end, trial.end_s)
    half_row = 0.5 * CONTROL_PERIOD_S
    rows = (trial["time_s"] > begin - half_row) & (trial["time_s"] < end + half_row)
    with _new_figure(path, (7.1, 8.6)) as figure:
        grid = figure.add_gridspec(5, 1, height_ratios=[1.75, 1.0, 1.25, 1.25, 1.25])
        _frames(figure.add_subplot(grid[0]), trial, rows)
        _speed(figure.add_subplot(grid[1]), trial)
        panels = [figure.add_subplot(grid[2])]
        panels += [figure.add_subplot(grid[i], sharex=panels[0]) for i in (3, 4)]
        for axes, (label, curves) in zip(panels, _SIGNALS, strict=True):
            _shade_stance(axes, trial, rows)
            for column, name, style in curves:
                axes.plot(trial["time_s"][rows], trial[column][rows], label=name, **style)
            axes.axhline(0.0, color=GREY, linewidth=0.4, zorder=0)
            axes.set_ylabel(label)
        panels[1].fill_between([], [], color=SHADE, linewidth=0.0, label="(c)-(e): residual foot on the ground")
        for axes in panels:
            _legend(axes)
        panels[0].set_xlim(begin, end)
        for axes in panels[:-1]:
            axes.tick_params(labelbottom=False)
        panels[-1].set_xlabel("Time (s)")
        figure.align_ylabels()
        _letter(figure)


#: Panels (c) to (e): axis label, then (column, legend, style) of each curve.
_SIGNALS: list[tuple[str, list[tuple[str, str, dict[str, Any]]]]] = [
    (
        "Angle (deg)",
        [
            (
                "thigh_rough_reference_deg",
                "thigh reference, rough",
                {"color": GREY, "linewidth": 0.7, "linestyle": ":"},
            ),
            ("thigh_reference_deg", "smooth", {"color": BLACK, "linewidth": 0.8, "linestyle": "--"}),
            ("thigh_angle_deg", "thigh (flexion)", {"color": BLUE}),
            ("knee_angle_deg", "knee (flexion)", {"color": VERMILION}),
            ("ankle_angle_deg", "ankle (plantarflexion)", {"color": GREEN}),
        ],
    ),
    (
        "Force (body weights)",
        [
            ("trunk_force_x_bw", "intact leg $F_x$ (forward)", {"color": ORANGE}),
            ("trunk_force_y_bw", "$F_y$ (up)", {"color": BLUE}),
            ("tube_force_bw", "tube $F_u$", {"color": BLACK, "linewidth": 0.8}),
        ],
    ),
    (
        "Torque (N m/kg)",
        [
            ("knee_torque_nm_kg", "knee $T_k$ (extending)", {"color": VERMILION}),
            ("damper_torque_nm_kg", "of which commanded $T_D$", {"color": PURPLE, "linewidth": 0.8, "linestyle": "--"}),
            ("tube_moment_nm_kg", "tube $M_u$", {"color": BLACK, "linewidth": 0.8}),
            ("ankle_torque_nm_kg", "ankle $T_a$ (plantarflexing)", {"color": GREEN}),
        ],
    ),
]


def _frames(axes: Axes, trial: Trial, shown: NDArray[np.bool_]) -> None:
    """Stick figures at 10 Hz, with the paths of hip, heel and ball."""
    paths = trial_skeleton(trial)
    axes.plot(trial["hip_x_m"][shown], trial["ground_height_m"][shown], color=BLACK, linewidth=0.8, zorder=1)
    for name, colour, label in (("hip", BLUE, "hip"), ("ball", ORANGE, "toe"), ("heel", PURPLE, "heel")):
        axes.plot(*paths[name][shown].T, color=colour, linewidth=0.9, label=f"path of the {label}", zorder=4)
    frames = np.flatnonzero(shown)[:: round(_FRAME_S / CONTROL_PERIOD_S)]
    stands = frames[np.isfinite(trial["pendulum_foot_x_m"][frames])]
    pendulum_foot = np.stack([trial[f"pendulum_foot_{axis}_m"][stands] for axis in "xy"], axis=-1)
    pendulums = np.stack([paths["hip"][stands], pendulum_foot], axis=1)
    legs = np.stack([paths[name][frames] for name in ("trunk_top", "hip", "knee", "ankle")], axis=1)
    feet = np.stack([paths[name][frames] for name in ("ankle", "heel", "ball", "ankle")], axis=1)
    lines = optional("matplotlib.collections").LineCollection
    axes.add_collection(lines(pendulums, colors=RED, linewidths=0.6, label="intact leg (pendulum)", zorder=2))
    axes.add_collection(lines(legs, colors=BLACK, linewidths=0.5, label="trunk and residual leg", zorder=3))
    axes.add_collection(lines(feet, colors=GREY, linewidths=0.4, zorder=2))
    axes.set_aspect("equal")
    corners = np.concatenate([points[shown] for points in paths.values()])
    corners = corners[np.isfinite(corners).all(axis=1)]  # a diverged trial ends in NaN
    left, right = corners[:, 0].min() - 0.1, corners[:, 0].max() + 0.1
    axes.set_xlim(left, max(right, left + _SHORTEST_WALK_M))
    highest_ground = np.nanmax(trial["ground_height_m"][shown], initial=0.0)
    axes.set_ylim(min(-0.05, corners[:, 1].min()), highest_ground + 1.6)
    axes.set_xlabel("Distance (m)")
    axes.set_ylabel("Height (m)")
    _legend(axes)


def _speed(axes: Axes, trial: Trial) -> None:
    time = trial["time_s"]
    intended = np.where(trial["intent"] > 0.0, trial["intended_speed_m_s"], np.nan)
    walks = (trial["human_state"] != STAND) & (trial["ambulation_speed_m_s"] > 0.0)  # no speed before the first step
    axes.plot(time, trial["hip_vx_m_s"], color=SKY, linewidth=0.5, alpha=0.8, label="hip velocity")
    axes.plot(time, intended, color=BLACK, linestyle="--", label="intended speed $v_I$")
    measured = np.where(walks, trial["ambulation_speed_m_s"], np.nan)
    axes.plot(time, measured, color=VERMILION, label="ambulation speed, per step")
    axes.set_xlim(0.0, trial.end_s)
    axes.set_xlabel("Time (s)")
    axes.set_ylabel("Speed (m/s)")
    _legend(axes)


def _shade_stance(axes: Axes, trial: Trial, rows: NDArray[np.bool_]) -> None:
    for begin, end in _intervals(trial["time_s"][rows], residual_contact(trial)[rows]):
        axes.axvspan(begin, end, color=SHADE, linewidth=0.0, zorder=-1)


def _intervals(time: Array, on: NDArray[np.bool_]) -> list[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    return [(float(time[a]), float(time[min(b, len(time) - 1)])) for a, b in edges.reshape(-1, 2)]


#: Panels of `plot_gait`: column and axis label.
_CYCLE_PANELS = (
    ("thigh_angle_deg", "Thigh flexion (deg)"),
    ("knee_angle_deg", "Knee flexion (deg)"),
    ("ankle_angle_deg", "Ankle plantarflexion (deg)"),
    ("tube_force_bw", "Tube force (body weights)"),
    ("tube_moment_nm_kg", "Tube moment (N m/kg)"),
    ("knee_torque_nm_kg", "Knee extension torque (N m/kg)"),
)
_CYCLE_PERCENT = np.linspace(0.0, 100.0, 201)
_CYCLE_STYLES = ((BLUE, "-"), (VERMILION, "--"), (GREEN, "-."), (PURPLE, ":"), (ORANGE, (0, (5, 1, 1, 1, 1, 1))))


def plot_gait(trials: Mapping[str, Trial], path: str | Path) -> None:
    """Mean and standard deviation over the steady strides of each trial, by share of the stride; up to five trials."""
    if not 1 <= len(trials) <= len(_CYCLE_STYLES):
        raise ValueError(f"trials: {len(trials)} of them, must be 1 to {len(_CYCLE_STYLES)}")
    steady = {name: steady_strides(trial, stride_table(trial)) for name, trial in trials.items()}
    for name, strides in steady.items():
        if not strides:
            raise ValueError(
                f"trials[{name!r}] has no steady stride (one with three before it at the same intended speed)"
            )
    with _new_figure(path, (7.1, 4.8)) as figure:
        grid = figure.subplots(2, 3, sharex=True)
        for axes, (column, label) in zip(grid.flat, _CYCLE_PANELS, strict=True):
            axes.axhline(0.0, color=GREY, linewidth=0.4, zorder=0)
            for (name, strides), (colour, line) in zip(steady.items(), _CYCLE_STYLES, strict=False):
                cycles = np.stack([_cycle(trials[name], stride, column) for stride in strides])
                mean, deviation = cycles.mean(axis=0), cycles.std(axis=0)
                legend = f"{name} ({len(strides)} strides)"
                axes.plot(_CYCLE_PERCENT, mean, color=colour, linestyle=line, label=legend)
                band = (mean - deviation, mean + deviation)
                axes.fill_between(_CYCLE_PERCENT, *band, color=colour, alpha=0.25, linewidth=0.0)
                toe_off = float(np.mean([stride.residual_stance_percent for stride in strides]))
                axes.axvline(toe_off, color=colour, linestyle=line, linewidth=0.5)
            axes.set_ylabel(label)
            axes.set_xlim(0.0, 100.0)
        for axes in grid[-1]:
            axes.set_xlabel("Share of the stride (%)")
        figure.align_ylabels()
        _letter(figure)
        handles, _ = grid[0, 0].get_legend_handles_labels()
        handles += [
            optional("matplotlib.patches").Patch(color=GREY, alpha=0.4, linewidth=0.0, label="±1 standard deviation"),
            optional("matplotlib.lines").Line2D([], [], color=GREY, linewidth=0.5, label="toe-off"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=4)


def _cycle(trial: Trial, stride: Stride, column: str) -> Array:
    time = stride.heel_strike_s + _CYCLE_PERCENT / 100.0 * stride.stride_time_s
    cycle: Array = np.interp(time, trial["time_s"], trial[column])
    return cycle


def _legend(axes: Axes) -> None:
    """One row above the axes, where there are no data."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=6, columnspacing=1.2)


def _letter(figure: Figure) -> None:
    for letter, axes in zip(string.ascii_lowercase, figure.axes, strict=False):
        axes.set_title(f"({letter})", loc="left", fontweight="bold")


@contextmanager
def _new_figure(path: str | Path, size_inches: tuple[float, float]) -> Iterator[Figure]:
    """Make a figure that is written to `path` when its block ends without an error."""
    path = Path(path)
    check_plot_path(path)
    with optional("matplotlib").rc_context(_STYLE):
        figure: Figure = optional("matplotlib.figure").Figure(figsize=size_inches, layout="constrained")
        yield figure
        # By way of memory: not every format tells a disk that is full from other mishaps.
        content = io.BytesIO()
        figure.savefig(content, format=path.suffix[1:])
        with atomic_write(path) as temporary:
            temporary.write_bytes(content.getbuffer())
