"""Reading video files back."""

import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray


def frames_of(path: Path, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return all frames (N, height, width, 3) of a film of the given (width, height)."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path), "-fps_mode", "passthrough"]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    pixels = subprocess.run(command, check=True, capture_output=True, timeout=60).stdout
    return np.frombuffer(pixels, dtype=np.uint8).reshape(-1, size[1], size[0], 3)


def duration_s(path: Path) -> float:
    """Return the length of a film."""
    _, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    return float(seconds)
