"""Windows, and pictures that nobody asks for: nothing is done for them."""

import os
import subprocess
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv
from prosthesis_gym.rendering import style

Frame = NDArray[np.uint8]

WALK: dict[str, Any] = {
    "action": {"mode": "state_machine"},
    "scenario": {"start": "cyclic", "speed_m_s": 1.1, "push_n": 0.0},
}


def pixels_of(frame: Frame, colour: style.Colour) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = (np.abs(frame.astype(int) - np.array(colour)) <= 12).all(axis=-1)
    return near


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_a_missing_renderer_is_named_when_a_picture_is_wanted(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    for env in (ProsthesisEnv(WALK, render_mode=mode), ProsthesisVectorEnv(2, WALK, render_mode=mode)):
        if mode == "rgb_array":
            env.reset(seed=0)
            env.step(np.zeros(env.action_space.shape or (), np.float32))
        with pytest.raises(ModuleNotFoundError, match=r"pip install 'prosthesis-gym\[render\]'"):
            env.render() if mode == "rgb_array" else env.reset(seed=0)  # which opens the window


def shown(env: ProsthesisVectorEnv) -> Any:  # noqa: ANN401 - an array, or None
    """Return what the window of an environment shows."""
    assert env.rendering is not None
    return None if env.rendering.window is None else env.rendering.window.picture()


def windowed(count: int = 1) -> ProsthesisVectorEnv:
    return ProsthesisVectorEnv(count, WALK, render_mode="human")


def test_a_window_follows_every_step_and_closes() -> None:
    env = windowed()
    assert shown(env) is None
    env.reset(seed=0)
    first = shown(env)
    assert first is not None
    assert first.shape == (540, 960, 3)
    assert pixels_of(first, style.TRUNK).sum() > 100
    for _ in range(20):
        env.step(np.zeros((1, 1), dtype=np.float32))
    later = shown(env)
    assert (later != first).any()
    assert env.render() is None
    env.close()
    assert shown(env) is None
    env.close()


def test_windows_live_and_die_alone() -> None:
    import pygame  # noqa: PLC0415 - rendering is optional

    action = np.zeros((2, 1), dtype=np.float32)
    first, second = windowed(2), windowed(2)
    others = pygame.display.set_mode((80, 60))  # somebody else's
    for seed, env in enumerate((first, second)):
        env.reset(seed=seed)
    pictures = shown(first), shown(second)
    for _ in range(12):
        first.step(action)
    assert (shown(first) != pictures[0]).any()
    np.testing.assert_array_equal(shown(second), pictures[1])
    first.close()
    assert shown(first) is None
    np.testing.assert_array_equal(shown(second), pictures[1])
    for _ in range(12):
        second.step(action)
    assert (shown(second) != pictures[1]).any()
    assert pygame.display.get_surface() is others
    second.close()
    assert pygame.display.get_surface() is others
    pygame.display.quit()


@pytest.mark.parametrize("begun_anew", [False, True])
def test_a_window_opens_anew_after_somebody_has_quit_pygame(begun_anew: bool) -> None:
    import pygame  # noqa: PLC0415 - rendering is optional

    env = windowed()
    env.reset(seed=0)
    pygame.quit()
    if begun_anew:
        pygame.init()
    for _ in range(12):
        env.step(np.zeros((1, 1), dtype=np.float32))
    picture = shown(env)
    assert picture is not None
    assert pixels_of(picture, style.TRUNK).sum() > 100
    pygame.quit()
    env.close()


def test_nothing_is_imported_or_read_before_the_first_picture() -> None:
    code = """
import sys
import numpy as np
from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, _core
from prosthesis_gym.sb3 import ProsthesisVecEnv
for env in (ProsthesisEnv(render_mode="rgb_array"), ProsthesisVectorEnv(20, render_mode="rgb_array")):
    env.reset(seed=0)
    for _ in range(30):
        env.step(np.zeros(env.action_space.shape, np.float32))
    env.close()
env = ProsthesisVecEnv(3, render_mode="rgb_array")
env.reset()
env.step(np.zeros((3, 1), np.float32))
assert not any(name.split(".")[0] in ("pygame", "font_source_sans_pro") for name in sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def allocated(env: ProsthesisEnv, steps: int) -> int:
    """Return the peak of memory, bytes, that Python has allocated for steps, beyond what it had before."""
    action = np.zeros(1, dtype=np.float32)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(steps):
        env.step(action)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak - before


def test_steps_that_nobody_wants_pictures_of_read_no_state() -> None:
    """Neither before the first picture, nor when nobody has asked for one in 3 s."""
    plain, env = ProsthesisEnv(WALK), ProsthesisEnv(WALK, render_mode="rgb_array", render_size=(160, 90))
    for each in (plain, env):
        each.reset(seed=0)
        allocated(each, 50)  # caches
    quiet = allocated(plain, 50)
    assert allocated(env, 50) <= quiet + 2000
    env.render()
    assert allocated(env, 50) > quiet + 4000
    for _ in range(600):
        env.step(np.zeros(1, dtype=np.float32))
    assert allocated(env, 50) <= quiet + 2000
    assert env.render() is not None


def test_late_pictures_show_the_present_and_plots_fill_from_then_on() -> None:
    early, late = (ProsthesisEnv(WALK, render_mode="rgb_array", render_size=(960, 540)) for _ in range(2))
    for env in (early, late):
        env.reset(seed=0)
    early.render()

    def walked_on(steps: int) -> tuple[Frame, Frame]:
        for _ in range(steps):
            for env in (early, late):
                env.step(np.zeros(1, dtype=np.float32))
        pictures = early.render(), late.render()
        assert pictures[0] is not None
        assert pictures[1] is not None
        return pictures[0], pictures[1]

    def curve(frame: Frame) -> int:
        return int(pixels_of(frame[round(0.745 * 540) :, :], style.KNEE).sum())

    ours, theirs = walked_on(500)
    # The same walker, but for the plots.
    assert pixels_of(theirs[:400], style.TRUNK).sum() == pytest.approx(
        pixels_of(ours[:400], style.TRUNK).sum(), rel=0.05
    )
    assert curve(theirs) < 0.3 * curve(ours)
    for _ in range(8):  # asked for in time, they go on being filled
        ours, theirs = walked_on(100)
    assert curve(theirs) == pytest.approx(curve(ours), rel=0.1)


def test_a_picture_before_the_first_reset_is_refused() -> None:
    for env in (ProsthesisEnv(render_mode="rgb_array"), ProsthesisVectorEnv(2, render_mode="rgb_array")):
        with pytest.raises(ValueError, match="reset the environment first"):
            env.render()


def test_pygame_in_the_place_of_pygame_ce_is_named() -> None:
    other = Path(sys.prefix) / "pygame"
    if not (other / "pygame").exists():
        pytest.skip("pygame and pygame-ce cannot share an environment; .ci/contracts puts pygame aside and runs this")
    code = "import prosthesis_gym as p; env = p.ProsthesisEnv(render_mode='rgb_array'); env.reset(); env.render()"
    environment = os.environ | {"PYTHONPATH": str(other)}
    failed = subprocess.run(
        [sys.executable, "-c", code], check=False, env=environment, capture_output=True, text=True, timeout=120
    )
    assert "ModuleNotFoundError: pygame 2" in failed.stderr
    assert "pip install --force-reinstall pygame-ce" in failed.stderr
