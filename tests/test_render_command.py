"""`prosthesis-gym render` and what it writes."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from films import duration_s, frames_of
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.cli import main, trial_options
from prosthesis_gym.config import merge
from prosthesis_gym.policy import Normalisation, Policy
from prosthesis_gym.rendering import WalkerRenderer, save_clip, save_picture, style
from prosthesis_gym.trial import Trial, run_trial

matplotlib_image = pytest.importorskip("matplotlib.image")

SHORT = ["render", "--duration", "2", "--start", "cyclic", "--solver", "fast"]


@pytest.fixture(scope="module")
def trial() -> Trial:
    fast = {"scenario": {"start": "cyclic"}, **trial_options.SOLVERS["fast"]}
    return run_trial(merge(trial_options.DEFAULTS, fast), duration_s=3.0)


def share_of(frame: NDArray[np.uint8], colour: style.Colour) -> float:
    return float((np.abs(frame.astype(int) - np.array(colour)) <= 8).all(axis=-1).mean())


@pytest.mark.parametrize("name", ["walk.mp4", "walk.gif"])
def test_a_clip_shows_the_walk_at_life_speed(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    path = tmp_path / name
    assert main([*SHORT, "--fps", "25", "--size", "320x240", "--out", str(path)]) == 0
    assert f"wrote {path}: 51 frames" in capsys.readouterr().out
    frames = frames_of(path, (320, 240))
    assert len(frames) == 51
    assert duration_s(path) == pytest.approx(51 / 25, abs=0.05)
    for frame in frames[::10]:
        assert share_of(frame, style.GROUND) > 0.05
        assert share_of(frame, style.PAPER) > 0.3
    changes = (frames[1:].astype(int) - frames[:-1]).any(axis=(1, 2, 3))
    assert changes.mean() > 0.95
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_slow_motion_draws_more_frames_of_the_same_walk(trial: Trial, tmp_path: Path) -> None:
    size, window = (320, 240), (1.0, 1.5)
    assert save_clip(trial, tmp_path / "life.mp4", fps=25, window=window, size=size) == 13
    assert save_clip(trial, tmp_path / "slow.mp4", fps=25, slow_motion=4, window=window, size=size) == 51
    life, slow = (frames_of(tmp_path / name, size) for name in ("life.mp4", "slow.mp4"))
    # Every fourth frame shows the same state; the codec loses a little.
    for i, frame in enumerate(life):
        assert np.abs(frame.astype(int) - slow[4 * i]).mean() < 2.0
    assert np.abs(life[0].astype(int) - life[-1]).mean() > 2.0


@pytest.mark.parametrize(("options", "size"), [([], (6 * 360 + 10, 640)), (["--at", "1.2"], (1280, 720))])
def test_a_picture_is_a_strip_or_a_moment(tmp_path: Path, options: list[str], size: tuple[int, int]) -> None:
    path = tmp_path / "walk.png"
    assert main([*SHORT, *options, "--out", str(path)]) == 0
    picture = (255 * matplotlib_image.imread(path)[..., :3]).round().astype(np.uint8)
    assert picture.shape == (size[1], size[0], 3)
    for column in np.array_split(picture, 6, axis=1):
        assert share_of(column, style.GROUND) > 0.02
    if not options:
        assert all(share_of(column, style.TRUNK) > 0.02 for column in np.array_split(picture, 6, axis=1))


def test_the_pictures_of_a_strip_differ(trial: Trial, tmp_path: Path) -> None:
    save_picture(trial, tmp_path / "strip.png", size=(180, 320))
    picture = matplotlib_image.imread(tmp_path / "strip.png")[60:, :, :3]
    panels = [picture[:, 182 * i : 182 * i + 180] for i in range(6)]
    assert all((one != other).any() for i, one in enumerate(panels) for other in panels[:i])


def test_a_moment_is_what_the_renderer_draws(trial: Trial, tmp_path: Path) -> None:
    save_picture(trial, tmp_path / "moment.png", at_s=1.5, size=(640, 360))
    picture = (255 * matplotlib_image.imread(tmp_path / "moment.png")[..., :3]).round().astype(np.uint8)
    batch = _core.Batch(1, trial.config)
    renderer = WalkerRenderer(trial.config, lambda x: batch.ground_height(0, x), size=(640, 360))
    for i in range(301):
        renderer.observe({name: float(column[i]) for name, column in trial.columns.items()})
    np.testing.assert_array_equal(picture, renderer.draw())


def test_the_ground_of_a_picture_is_the_one_that_the_trial_drew(tmp_path: Path) -> None:
    slope = {"scenario": {"start": "cyclic", "randomise": {"ground.slope_deg": [-3.0, 3.0]}}}
    config = merge(trial_options.DEFAULTS, slope | trial_options.SOLVERS["fast"])
    pictures = []
    for seed in (1, 2):
        trial = run_trial(config, duration_s=0.5, seed=seed)
        steepness = trial["ground_height_m"][-1] / trial["hip_x_m"][-1]
        save_picture(trial, tmp_path / f"{seed}.png", at_s=0.5, size=(640, 360))
        pictures.append((255 * matplotlib_image.imread(tmp_path / f"{seed}.png")[..., :3]).round().astype(np.uint8))
        renderer = WalkerRenderer(trial.config, partial(np.multiply, steepness), size=(640, 360))
        for i in range(101):
            renderer.observe({name: float(column[i]) for name, column in trial.columns.items()})
        assert (pictures[-1] != renderer.draw()).mean() < 1e-3
    assert (pictures[0] != pictures[1]).mean() > 1e-2


@pytest.mark.parametrize(
    ("controller", "settings"),
    [("state-machine", []), ("constant:5", []), ("constant:-1.5", ["--device", "motor"]), ("POLICY", [])],
)
def test_every_controller_can_be_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], controller: str, settings: list[str]
) -> None:
    if controller == "POLICY":
        size = len(_core.channels({}))
        layer = (np.zeros((size, 1), np.float32), np.ones(1, np.float32))
        config = {"action": {"mode": "direct"}, "observation": {"frames": 1}}
        controller = str(tmp_path / "policy")
        Policy([layer], Normalisation(np.zeros(size), np.ones(size)), config).save(controller)
    path = tmp_path / "moment.png"
    arguments = ["render", controller, *settings, "--duration", "0.5", "--at", "0.5", "--out", str(path)]
    assert main(arguments) == 0
    assert path.stat().st_size > 1000
    assert "after 0.50 s" in capsys.readouterr().out


def test_files_are_not_overwritten_unless_forced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "walk.png"
    path.write_bytes(b"old")
    assert main([*SHORT, "--at", "1", "--out", str(path)]) == 2
    assert f"{path} exists; --force overwrites it" in capsys.readouterr().err
    assert path.read_bytes() == b"old"
    assert main([*SHORT, "--at", "1", "--out", str(path), "--force"]) == 0
    assert path.stat().st_size > 1000


def test_an_interrupted_clip_leaves_the_older_file_alone(
    trial: Trial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(b"old")
    draw, drawn = WalkerRenderer.draw, []

    def interrupted(renderer: WalkerRenderer) -> NDArray[np.uint8]:
        drawn.append(1)
        if len(drawn) > 3:
            raise KeyboardInterrupt
        return draw(renderer)

    monkeypatch.setattr(WalkerRenderer, "draw", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_clip(trial, path, size=(320, 240))
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["walk.mp4"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--out", "walk.avi"], "walk.avi: rendered as .mp4, .gif, .png, not .avi"),
        (["--out", "walk"], "not without an ending"),
        (["--out", "walk.mp4", "--size", "100x50"], "size = 100x50 must be 160x90 to 3840x2160 pixels"),
        (["--out", "walk.mp4", "--size", "321x240"], "size = 321x240 must be even"),
        (["--out", "walk.mp4", "--fps", "0"], "fps = 0 must be in [1, 200]"),
        (["--out", "walk.mp4", "--slow-motion", "0"], "slow_motion = 0 must be in [0.1, 200]"),
        (["--out", "walk.mp4", "--slow-motion", "5"], "fps * slow_motion = 250 must be at most 200"),
        (["--out", "walk.mp4", "--window", "1", "9"], "window = 1 to 9 s must lie in the trial's [0, 2] s"),
        (["--out", "walk.mp4", "--at", "1"], "--at 1: walk.mp4 is no .png"),
        (["--out", "walk.png", "--at", "7"], "at = 7 s must lie in the trial's [0, 2] s"),
        (["--out", "walk.png", "--window", "0", "1"], "walk.png is no clip"),
        (["--out", "walk.png", "magic"], "controller magic: neither"),
    ],
)
def test_bad_input_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    complaint: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*SHORT, *arguments]) == 2
    assert complaint in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_size_that_is_none_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([*SHORT, "--out", "walk.mp4", "--size", "wide"])
    assert stopped.value.code == 2
    assert "'wide' is not WIDTHxHEIGHT" in capsys.readouterr().err
