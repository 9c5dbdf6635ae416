"""Trials as video clips and pictures."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.extras import optional
from prosthesis_gym.files import atomic_write
from prosthesis_gym.gait import stride_table
from prosthesis_gym.progress import progress_bar
from prosthesis_gym.rendering.canvas import Frame, import_pygame
from prosthesis_gym.rendering.gym import tile
from prosthesis_gym.rendering.renderer import WalkerRenderer, check_size
from prosthesis_gym.trial import Trial

#: ffmpeg's codec and its options, by the file's ending.
_CODECS: dict[str, tuple[str, list[str]]] = {
    ".mp4": ("libx264", ["-crf", "18", "-preset", "medium", "-movflags", "+faststart"]),
    # A palette of the clip's own colours; those of the few moving limbs count.
    ".gif": ("gif", ["-vf", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=none", "-loop", "0"]),
}
_PICTURE = ".png"
#: Pictures of a strip.
STRIP_PICTURES = 6


def check_clip_path(path: Path) -> None:
    """Raise a ValueError or ModuleNotFoundError unless a clip or picture can be written here."""
    if path.suffix not in (*_CODECS, _PICTURE):
        endings = ", ".join((*_CODECS, _PICTURE))
        raise ValueError(f"{path}: rendered as {endings}, not {path.suffix or 'without an ending'}")
    import_pygame()
    if path.suffix in _CODECS:
        optional("imageio_ffmpeg", "render")


def check_frame_rate(fps: float, slow_motion: float) -> None:
    """Raise a ValueError unless every frame of a clip can have a sample of its own."""
    if not 1.0 <= fps <= 200.0:
        raise ValueError(f"fps = {fps:g} must be in [1, 200]")
    if not 0.1 <= slow_motion <= 200.0:
        raise ValueError(f"slow_motion = {slow_motion:g} must be in [0.1, 200]")
    if fps * slow_motion * CONTROL_PERIOD_S > 1.0 + 1e-9:
        most = 1.0 / CONTROL_PERIOD_S
        raise ValueError(
            f"fps * slow_motion = {fps * slow_motion:g} must be at most {most:g}, the samples in a simulated second"
        )


def save_clip(
    trial: Trial,
    path: str | Path,
    *,
    fps: float = 50.0,
    slow_motion: float = 1.0,
    window: tuple[float, float] | None = None,
    size: tuple[int, int] = (1280, 720),
    progress: bool = True,
) -> int:
    """Write a clip of a trial as .mp4 or .gif, complete or not at all, and return its number of frames.

    Args:
        trial: what to show.
        path: where to write.
        fps: frames per second of the clip.
        slow_motion: how many times slower than life; `fps` times `slow_motion` is at most 200.
        window: begin and end (s) of what is shown; None for all.
        size: width and height in pixels, both even.
        progress: show a bar on stderr if it takes long.

    Raises:
        ValueError: impossible ending, rate, window or size.
        ModuleNotFoundError: the extra `render` is not installed.

    """
    path = Path(path)
    check_clip_path(path)
    if path.suffix == _PICTURE:
        raise ValueError(f"{path}: a clip is saved as {' or '.join(_CODECS)}")
    check_frame_rate(fps, slow_motion)
    width, height = check_size(size)
    if width % 2 or height % 2:
        raise ValueError(f"size = {width}x{height} must be even in both directions for a clip")
    begin, end = check_window(trial, window)
    times = np.arange(begin, end + 1e-9, 1.0 / (fps * slow_motion))
    samples = np.round(times / CONTROL_PERIOD_S).astype(int)
    codec, parameters = _CODECS[path.suffix]
    ffmpeg = optional("imageio_ffmpeg", "render")
    with atomic_write(path) as temporary:
        with (
            progress_bar("rendering", len(samples), "frames", shown=progress) as show,
            closing(
                ffmpeg.write_frames(
                    str(temporary), (width, height), fps=fps, codec=codec, output_params=parameters,
                    pix_fmt_out="yuv420p" if codec == "libx264" else "pal8", quality=None, macro_block_size=2,
                )
            ) as writer,
        ):  # fmt: skip
            writer.send(None)
            for done, frame in enumerate(_frames(trial, samples, (width, height)), start=1):
                writer.send(frame)
                show(done)
        # ffmpeg's last words come after its last frame, and nobody hears them: on a full disk the clip is cut off.
        if (written := _frames_of(temporary)) != len(samples):
            raise OSError(f"ffmpeg wrote {written} of {len(samples)} frames; is the disk full?")
    return len(samples)


def save_picture(
    trial: Trial, path: str | Path, *, at_s: float | None = None, size: tuple[int, int] | None = None
) -> None:
    """Write one picture of a trial as .png, complete or not at all.

    Args:
        trial: what to show.
        path: where to write.
        at_s: time of a single picture with numbers and plots; None for a strip of `STRIP_PICTURES` pictures over the
            last full stride, or over the whole trial if it has none.
        size: width and height in pixels; 1280x720 by default, and of each picture of a strip 360x640.

    Raises:
        ValueError: impossible ending, time or size.
        ModuleNotFoundError: the extra `render` is not installed.

    """
    path = Path(path)
    check_clip_path(path)
    if path.suffix != _PICTURE:
        raise ValueError(f"{path}: a picture is saved as {_PICTURE}")
    if at_s is None:
        picture = _strip(trial, check_size(size or (360, 640)))
    else:
        if not 0.0 <= at_s <= trial.end_s + 1e-9:
            raise ValueError(f"at = {at_s:g} s must lie in the trial's [0, {trial.end_s:g}] s")
        (picture,) = _frames(trial, [round(at_s / CONTROL_PERIOD_S)], check_size(size or (1280, 720)))
    pygame = import_pygame()
    # By way of memory, because pygame tells no disk that is full from other mishaps.
    content = io.BytesIO()
    pygame.image.save(pygame.image.frombuffer(picture.tobytes(), picture.shape[1::-1], "RGB"), content, path.name)
    with atomic_write(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def _frames_of(path: Path) -> int:
    try:
        frames: int = optional("imageio_ffmpeg", "render").count_frames_and_secs(str(path))[0]
    except RuntimeError:
        return 0  # not even a clip
    return frames


def check_window(trial: Trial, window: tuple[float, float] | None) -> tuple[float, float]:
    """Return begin and end (s) of the part of a trial that is shown, or raise a ValueError."""
    if window is None:
        return 0.0, trial.end_s
    begin, end = window
    if not 0.0 <= begin < end <= trial.end_s + 1e-9:
        raise ValueError(f"window = {begin:g} to {end:g} s must lie in the trial's [0, {trial.end_s:g}] s, begin first")
    return begin, end


def _ground(trial: Trial) -> Any:  # noqa: ANN401 - a bound method of the core
    batch = _core.Batch(1, trial.config, threads=1)
    batch.reset(np.array([trial.seed], dtype=np.uint64))  # the episode may have drawn the ground
    return partial(batch.ground_height, 0)


def _rows(trial: Trial) -> Iterator[dict[str, float]]:
    table = np.stack(list(trial.columns.values()), axis=-1)
    for row in table:
        yield dict(zip(trial.columns, row.tolist(), strict=True))


def _frames(trial: Trial, samples: Sequence[int] | np.ndarray, size: tuple[int, int]) -> Iterator[Frame]:
    """Draw the rows with the given numbers, which must not fall."""
    renderer = WalkerRenderer(trial.config, _ground(trial), size=size)
    drawn = 0
    for number, row in enumerate(_rows(trial)):
        renderer.observe(row)
        while drawn < len(samples) and samples[drawn] == number:
            yield renderer.draw()
            drawn += 1


def _strip(trial: Trial, size: tuple[int, int]) -> Frame:
    strides = stride_table(trial)
    if strides:
        begin_s, share = strides[-1].heel_strike_s, strides[-1].stride_time_s / STRIP_PICTURES
    else:
        begin_s, share = 0.0, trial.end_s / (STRIP_PICTURES - 1)
    samples = [round((begin_s + i * share) / CONTROL_PERIOD_S) for i in range(STRIP_PICTURES)]
    captions = [
        f"{100.0 * i / STRIP_PICTURES:.0f} % of the stride" if strides else f"{sample * CONTROL_PERIOD_S:.2f} s"
        for i, sample in enumerate(samples)
    ]
    ground = _ground(trial)
    walkers = [WalkerRenderer(trial.config, ground, size=size, caption=caption) for caption in captions]
    for number, row in enumerate(_rows(trial)):
        for walker, sample in zip(walkers, samples, strict=True):
            if number <= sample:
                walker.observe(row)
    return tile([walker.draw() for walker in walkers], STRIP_PICTURES)
