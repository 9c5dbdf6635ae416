"""Pictures of walkers: what they show, and that they change nothing."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from films import duration_s, frames_of
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo
from gymnasium.wrappers.vector import RecordVideo as RecordVectorVideo
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, _core
from prosthesis_gym.config import merge, resolve
from prosthesis_gym.rendering import WalkerRenderer, style
from prosthesis_gym.sb3 import ProsthesisVecEnv

Frame = NDArray[np.uint8]

WALK: dict[str, Any] = {
    "action": {"mode": "state_machine"},
    "scenario": {"start": "cyclic", "speed_m_s": 1.1, "push_n": 0.0},
}
SMALL = (640, 360)
#: Rows of a small picture that hold no number.
BELOW_NUMBERS = 64


def walked(seconds: float, config: Mapping[str, Any] | None = None, size: tuple[int, int] = SMALL) -> WalkerRenderer:
    """Walk for some time under the eyes of a renderer."""
    complete = resolve(merge(WALK, config or {}))
    batch = _core.Batch(1, complete)
    batch.reset(np.zeros(1, dtype=np.uint64))
    renderer = WalkerRenderer(complete, lambda x: batch.ground_height(0, x), size=size)
    renderer.observe(batch.snapshot(0))
    for _ in range(round(seconds / 0.005)):
        batch.step(np.zeros(1))
        renderer.observe(batch.snapshot(0))
    return renderer


def pixels_of(frame: Frame, colour: style.Colour, tolerance: int = 12) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = (np.abs(frame.astype(int) - np.array(colour)) <= tolerance).all(axis=-1)
    return near


@pytest.mark.parametrize("size", [(160, 90), SMALL, (641, 359), (1280, 720), (400, 900)])
def test_a_picture_has_the_size_asked_for_and_shows_ground_and_paper(size: tuple[int, int]) -> None:
    frame = walked(0.5, size=size).draw()
    assert frame.shape == (size[1], size[0], 3)
    assert frame.dtype == np.uint8
    assert pixels_of(frame, style.GROUND).mean() > 0.05
    assert pixels_of(frame, style.PAPER).mean() > 0.3
    assert pixels_of(frame, style.TRUNK).sum() > 1e-3 * size[1] ** 2


@pytest.mark.parametrize("size", [(159, 90), (1000, 10), (5000, 720), (1280, 2161), (0, 0)])
def test_impossible_sizes_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=f"size = {size[0]}x{size[1]} must be 160x90 to 3840x2160"):
        WalkerRenderer(resolve({}), np.zeros_like, size=size)


@pytest.mark.parametrize("seconds", [0.0, 0.4, 1.3, 2.2])
def test_hip_and_knee_are_drawn_where_the_projection_says(seconds: float) -> None:
    config = {"ground": {"slope_deg": -1.0}}
    complete = resolve(merge(WALK, config))
    batch = _core.Batch(1, complete)
    batch.reset(np.zeros(1, dtype=np.uint64))
    for _ in range(round(seconds / 0.005)):
        batch.step(np.zeros(1))
    snapshot = batch.snapshot(0)
    ink = pixels_of(walked(seconds, config, (1280, 720)).draw(), style.INK)
    renderer = walked(seconds, config, (1280, 720))
    for joint in ("hip", "knee"):
        x, y = renderer.project(snapshot[f"{joint}_x_m"], snapshot[f"{joint}_y_m"])
        assert ink[round(y), round(x)], joint
        # The mark of a joint is small: its surroundings are limbs.
        assert not ink[round(y) - 12, round(x)]


def test_the_camera_keeps_the_walker_in_the_picture() -> None:
    renderer = walked(6.0)
    complete = resolve(WALK)
    batch = _core.Batch(1, complete)
    batch.reset(np.zeros(1, dtype=np.uint64))
    for _ in range(1200):
        batch.step(np.zeros(1))
    hip = batch.snapshot(0)
    assert hip["hip_x_m"] > 5.0
    x, y = renderer.project(hip["hip_x_m"], hip["hip_y_m"])
    assert 0.35 * SMALL[0] < x < 0.65 * SMALL[0]
    assert 0.2 * SMALL[1] < y < 0.8 * SMALL[1]


def test_a_push_has_an_arrow_while_it_lasts() -> None:
    pushed = {"scenario": {"pushes": [{"time_s": 1.0, "duration_s": 0.1, "force_x_n": 200.0}]}}
    arrows = {seconds: pixels_of(walked(seconds, pushed).draw(), style.PUSH).sum() for seconds in (0.9, 1.05, 1.2)}
    assert arrows[1.05] > 60
    assert arrows[0.9] == arrows[1.2] == 0


def test_a_stronger_push_has_a_longer_arrow_and_a_backward_one_points_backward() -> None:
    def columns(force_n: float) -> NDArray[np.intp]:
        config = {"scenario": {"pushes": [{"time_s": 1.0, "duration_s": 0.1, "force_x_n": force_n}]}}
        renderer = walked(1.02, config)
        arrow = pixels_of(renderer.draw(), style.PUSH)
        # Below its label.
        rows = np.flatnonzero(arrow.any(axis=1))
        widest = rows[np.argmax(arrow[rows].sum(axis=1))]
        return np.flatnonzero(arrow[widest])

    weak, strong, backward = columns(100.0), columns(250.0), columns(-250.0)
    assert np.ptp(strong) > 1.5 * np.ptp(weak)
    assert strong.max() < backward.min()


def test_ground_forces_have_arrows_in_stance_alone() -> None:
    stance, swing = walked(0.3), walked(0.9)
    assert pixels_of(stance.draw(), style.FORCE).sum() > 60
    assert pixels_of(swing.draw(), style.FORCE).sum() == 0


def test_the_gauge_of_the_knee_fills_with_the_command() -> None:
    filled = [
        pixels_of(
            walked(0.3, {"action": {"mode": "constant", "constant_nms2_rad2": command}}).draw(), style.COMMAND
        ).sum()
        for command in (0.0, 5.0, 15.0)
    ]
    assert filled[0] == 0
    assert filled[2] > 2 * filled[1] > 0


def test_stairs_show_in_the_outline_of_the_ground() -> None:
    stairs = {"ground": {"stair_rise_m": 0.1, "stair_run_m": 0.4, "stair_start_x_m": 1.0, "stair_count": 3}}
    ground = [pixels_of(walked(0.0, config).draw(), style.GROUND)[BELOW_NUMBERS:] for config in ({}, stairs)]
    level, stepped = (np.argmax(below, axis=0)[[30, -30]] for below in ground)
    assert abs(int(level[0]) - int(level[1])) <= 1
    metre = walked(0.0).project(0.0, 0.0)[1] - walked(0.0).project(0.0, 1.0)[1]
    assert int(stepped[0]) - int(stepped[1]) == pytest.approx(0.3 * metre, abs=3.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30, -1e12])
def test_a_diverged_walker_leaves_its_surroundings(value: float) -> None:
    renderer = walked(0.5, size=(960, 540))
    before = pixels_of(renderer.draw(), style.TRUNK).sum()
    batch = _core.Batch(1, WALK)
    batch.reset(np.zeros(1, dtype=np.uint64))
    codes = {"time_s": 0.505, "controller_state": 1.0, "intact_leg_state": 1.0}
    renderer.observe(dict.fromkeys(batch.snapshot(0), value) | codes)
    frame = renderer.draw()
    assert pixels_of(frame, style.GROUND).mean() > 0.05
    # Edges of marks, curves and letters have the trunk's colour too.
    assert pixels_of(frame, style.TRUNK).sum() < 0.3 * before


def test_nothing_can_be_drawn_before_anything_is_observed() -> None:
    with pytest.raises(ValueError, match="nothing to draw"):
        WalkerRenderer(resolve({}), np.zeros_like).draw()


# Gymnasium and Stable-Baselines3.


def test_rendered_environments_pass_gymnasiums_checks(env_id: str) -> None:
    env = gymnasium.make(env_id, render_mode="rgb_array")
    check_env(env.unwrapped)
    env.reset(seed=0)
    frame = env.render()
    assert isinstance(frame, np.ndarray)
    assert frame.shape == (360, 640, 3)
    assert frame.dtype == np.uint8
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    assert env.metadata["render_fps"] == 200


@pytest.mark.parametrize("make", [ProsthesisEnv, ProsthesisVectorEnv])
def test_unknown_render_modes_and_pictures_before_the_first_reset_are_refused(make: type[Any]) -> None:
    with pytest.raises(ValueError, match=r"render_mode = 'ansi' must be None or one of 'human', 'rgb_array'"):
        make(render_mode="ansi")
    with pytest.raises(ValueError, match="size = 100x100"):
        make(render_mode="rgb_array", render_size=(100, 100))
    with pytest.raises(ValueError, match="reset the environment"):
        make(render_mode="rgb_array").render()


@pytest.mark.parametrize("make", [ProsthesisEnv, ProsthesisVectorEnv])
def test_render_without_a_mode_warns_and_draws_nothing(make: type[Any]) -> None:
    env = make()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="without a render_mode"):
        assert env.render() is None
    env.close()


@pytest.mark.parametrize("mode", ["human", "rgb_array"])
def test_rendering_never_changes_a_trajectory(mode: str) -> None:
    config = {"scenario": {"duration_s": 0.6}, "sensors": {"knee_encoder": {"noise": 0.01}}}
    rng = np.random.default_rng(0)
    plain = ProsthesisVectorEnv(9, config)
    drawn = ProsthesisVectorEnv(9, config, render_mode=mode, render_size=(640, 360) if mode == "human" else (160, 90))
    np.testing.assert_array_equal(plain.reset(seed=5)[0], drawn.reset(seed=5)[0])
    for _ in range(150):
        actions = rng.uniform(-1.0, 1.0, (9, 1)).astype(np.float32)
        ours, theirs = plain.step(actions), drawn.step(actions)
        drawn.render()
        for one, other in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(one, other)
    drawn.close()


def test_environments_without_render_mode_do_not_import_pygame() -> None:
    code = (
        "import sys, gymnasium, prosthesis_gym\n"
        "env = gymnasium.make('prosthesis_gym/DamperKnee-v0')\n"
        "env.reset(seed=0)\n"
        "env.step(env.action_space.sample())\n"
        "assert 'prosthesis_gym.rendering.renderer' in sys.modules\n"
        "assert not {'pygame', 'imageio_ffmpeg'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.parametrize(("count", "drawn"), [(1, 1), (3, 3), (20, 16)])
def test_vector_environments_return_a_picture_per_walker_up_to_16(count: int, drawn: int) -> None:
    envs = gymnasium.make_vec(
        "prosthesis_gym/DamperKnee-v0", num_envs=count, render_mode="rgb_array", render_size=(160, 90)
    )
    envs.reset(seed=0)
    for _ in range(100):
        envs.step(np.zeros((count, 1), dtype=np.float32))
    frames = envs.render()
    assert frames is not None
    assert len(frames) == drawn
    shapes = {frame.shape for frame in frames if isinstance(frame, np.ndarray)}
    assert shapes == {(90, 160, 3)}
    # Walkers differ: so do their pictures.
    assert len({frame.tobytes() for frame in frames if isinstance(frame, np.ndarray)}) > drawn // 2
    envs.close()


def test_all_walkers_of_a_batch_fit_into_one_picture() -> None:
    envs = ProsthesisVectorEnv(5, render_mode="rgb_array", render_size=(160, 90))
    envs.reset(seed=0)
    assert envs.rendering is not None
    tiled = envs.rendering.tiled()
    assert tiled.shape == (2 * 90 + 2, 3 * 160 + 4, 3)
    for index, frame in enumerate(envs.rendering.frames()):
        top, left = 92 * (index // 3), 162 * (index % 3)
        np.testing.assert_array_equal(tiled[top : top + 90, left : left + 160], frame)


def test_record_video_films_an_episode(tmp_path: Path) -> None:
    env = gymnasium.make("prosthesis_gym/DamperKnee-v0", render_mode="rgb_array", config=WALK, max_episode_steps=40)
    film: gymnasium.Env[Any, Any] = RecordVideo(env, str(tmp_path / "film"), episode_trigger=lambda _: True)
    film.reset(seed=0)
    for _ in range(40):
        film.step(np.zeros(1, dtype=np.float32))
    film.close()
    path = tmp_path / "film" / "rl-video-episode-0.mp4"
    frames = frames_of(path, (640, 360))
    assert len(frames) == 41
    assert duration_s(path) == pytest.approx(41 / 200, abs=0.01)
    assert (frames[0] != frames[-1]).mean() > 0.01


def test_record_video_films_a_batch(tmp_path: Path) -> None:
    envs = gymnasium.make_vec(
        "prosthesis_gym/MotorKnee-v0", num_envs=4, render_mode="rgb_array", render_size=(320, 180), config=WALK
    )
    film = RecordVectorVideo(envs, str(tmp_path / "film"), step_trigger=lambda step: step == 0, video_length=20)
    film.reset(seed=0)
    for _ in range(30):
        film.step(np.zeros((4, 1), dtype=np.float32))
    film.close()
    (path,) = (tmp_path / "film").iterdir()
    frames = frames_of(path, (640, 360))
    assert 19 <= len(frames) <= 21


def test_stable_baselines3_gets_the_pictures() -> None:
    env = ProsthesisVecEnv(4, WALK, render_mode="rgb_array", render_size=(160, 90))
    assert env.render_mode == "rgb_array"
    env.seed(3)
    env.reset()
    before = env.get_images()
    for _ in range(40):
        env.step(np.zeros((4, 1), dtype=np.float32))
    after = env.get_images()
    assert len(before) == len(after) == 4
    for first, last in zip(before, after, strict=True):
        assert first is not None
        assert last is not None
        assert first.shape == (90, 160, 3)
        assert (first != last).any()
    tiled = env.render("rgb_array")
    assert tiled is not None
    assert tiled.shape == (180, 320, 3)
    env.close()


def test_plots_and_camera_begin_anew_with_the_next_episode() -> None:
    env = ProsthesisEnv(WALK, render_mode="rgb_array", render_size=(960, 540))
    env.reset(seed=0)
    fresh = env.render()
    for _ in range(400):
        env.step(np.zeros(1, dtype=np.float32))
    walked_on = env.render()
    env.reset(seed=0)
    again = env.render()
    assert fresh is not None
    assert walked_on is not None
    assert again is not None
    assert (fresh != walked_on).any()
    np.testing.assert_array_equal(fresh, again)
