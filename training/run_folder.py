"""The folder of a run: who trains in it, and what is there to go on with.

A lock of the operating system keeps a second process out. It ends with its process, however that ends, so that nothing
stale can stand in the way: neither after a kill, nor where the process's number has been given to another, nor on
another machine. `trainer.json` only tells the second process whom to ask. The lock's file stays, and is what a run is
known by: a folder with anything else in it is somebody else's, and is left alone.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from filelock import FileLock, Timeout

from prosthesis_gym.files import atomic_write, is_temporary, read_json
from training.checkpoint import has_checkpoints, latest_checkpoint

CHECKPOINTS = "checkpoints"
EVALUATIONS_FILE = "evaluation.csv"
POLICY = "policy"
SETTINGS_FILE = "config.toml"
TENSORBOARD = "tensorboard"
#: All that a run leaves, the two files of its report among it.
_LEFT = (SETTINGS_FILE, CHECKPOINTS, EVALUATIONS_FILE, POLICY, TENSORBOARD, "comparison.txt", "gait.png")
_LOCK_FILE = "run.lock"
_OWNER_FILE = "trainer.json"


class RunFolder:
    """A folder that one trainer alone trains in, from now until `release`.

    Raises:
        ValueError: another trainer trains in it, or it is neither empty nor a run's.

    """

    def __init__(self, path: Path) -> None:
        if not _is_free(path) and not holds_a_run(path):
            raise ValueError(f"{path} exists, and is not empty: choose another folder with --out")
        self.path = path
        path.mkdir(parents=True, exist_ok=True)
        # Of no thread: whoever closes a trainer releases it.
        self._lock = FileLock(path / _LOCK_FILE, thread_local=False)
        try:
            self._lock.acquire(timeout=0)
        except Timeout:
            raise ValueError(
                f"{path} is in use: {_owner(path)} trains in it; choose another folder with --out"
            ) from None
        try:
            _remove_unfinished_files(path)
            _write_owner(path)
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Let others train in it; once that is so, do nothing."""
        if not self._lock.is_locked:
            return
        try:
            (self.path / _OWNER_FILE).unlink(missing_ok=True)
        finally:
            self._lock.release()

    def newest_checkpoint(self, tell: Callable[[str], None]) -> Path | None:
        """Return the whole checkpoint of most steps, if there is one; `tell` what is skipped."""
        return latest_checkpoint(self.path / CHECKPOINTS, tell)

    def clear(self, tell: Callable[[str], None]) -> None:
        """Make room for a start: what a run without a whole checkpoint left goes into a folder of its own."""
        left = [path for name in _LEFT if os.path.lexists(path := self.path / name)]
        if not left:
            return
        number = 1
        while (aside := self.path / f"unfinished-{number}").exists():
            number += 1
        aside.mkdir()
        for path in left:
            path.rename(aside / path.name)
        tell(f"no whole checkpoint in {self.path}: starting again; what was there is in {aside}")


def holds_a_run(path: Path) -> bool:
    """Whether the folder is a run's, finished or not."""
    # Older runs, and copies of runs, may lack the file of the lock.
    return (path / _LOCK_FILE).is_file() or has_checkpoints(path / CHECKPOINTS)


def _is_free(path: Path) -> bool:
    return not path.exists() or (path.is_dir() and not any(path.iterdir()))


def _write_owner(path: Path) -> None:
    owner = {"pid": os.getpid(), "host": socket.gethostname(), "since": datetime.now().isoformat(" ", "seconds")}
    with atomic_write(path / _OWNER_FILE) as temporary:
        temporary.write_text(json.dumps(owner), encoding="utf-8")


def _owner(path: Path) -> str:
    try:
        owner = read_json(path / _OWNER_FILE)
        return f"process {owner['pid']} on {owner['host']}, since {owner['since']},"
    except (OSError, ValueError, KeyError):
        return "another process"


def _remove_unfinished_files(path: Path) -> None:
    """Remove what a killed process was writing: nobody else writes here."""
    for folder in (path, path / CHECKPOINTS, path / POLICY):
        for entry in filter(is_temporary, list(folder.glob(".*"))):
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)
