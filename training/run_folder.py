"""The folder of a run: who trains in it, and what is there to go on with.

A lock of the operating system keeps a second process out. It ends with its process, however that ends, so that nothing
stale can stand in the way: neither after a kill, nor where the process's number has been given to another, nor on
another machine. `trainer.json` only tells the second process whom to ask.
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

from prosthesis_gym.files import atomic_write, read_json
from training.checkpoint import whole_checkpoints

CHECKPOINTS = "checkpoints"
SETTINGS_FILE = "config.toml"
_LOCK_FILE = "run.lock"
_OWNER_FILE = "trainer.json"


class RunFolder:
    """A folder that this process alone trains in, from now until `release`.

    Raises:
        ValueError: another process trains in it.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.mkdir(parents=True, exist_ok=True)
        # This process may hold the lock more than once.
        self._lock = FileLock(path / _LOCK_FILE, is_singleton=True)
        try:
            self._lock.acquire(timeout=0)
        except Timeout:
            raise ValueError(
                f"{path} is in use: {_owner(path)} trains in it; choose another folder with --out"
            ) from None
        owner = {"pid": os.getpid(), "host": socket.gethostname(), "since": datetime.now().isoformat(" ", "seconds")}
        with atomic_write(path / _OWNER_FILE) as temporary:
            temporary.write_text(json.dumps(owner), encoding="utf-8")
        _remove_unfinished_files(path)

    def release(self) -> None:
        """Let others train in it."""
        (self.path / _OWNER_FILE).unlink(missing_ok=True)
        self._lock.release()

    def newest_checkpoint(self, tell: Callable[[str], None]) -> Path | None:
        """Return the whole checkpoint of most steps, if there is one; `tell` what is skipped."""
        whole, damaged = whole_checkpoints(self.path / CHECKPOINTS)
        for path, reason in damaged:
            if not whole or path.name > whole[-1].name:
                tell(f"skipping the damaged checkpoint {path}: {reason}")
        return whole[-1] if whole else None

    def clear(self, tell: Callable[[str], None]) -> None:
        """Make room for a start: what a run without a whole checkpoint left goes into a folder of its own."""
        left = [path for path in self.path.iterdir() if not _is_bookkeeping(path)]
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
    """Whether the folder has anything of a run, finished or not."""
    return (path / SETTINGS_FILE).is_file()


def is_free(path: Path) -> bool:
    """Whether a run may make itself at home in the folder: it is not there, or empty."""
    return not path.exists() or (path.is_dir() and all(_is_bookkeeping(entry) for entry in path.iterdir()))


def _is_bookkeeping(path: Path) -> bool:
    return path.name in (_LOCK_FILE, _OWNER_FILE) or path.name.startswith("unfinished-")


def _owner(path: Path) -> str:
    try:
        owner = read_json(path / _OWNER_FILE)
        return f"process {owner['pid']} on {owner['host']}, since {owner['since']},"
    except (OSError, ValueError, KeyError):
        return "another process"


def _remove_unfinished_files(path: Path) -> None:
    """Remove what a killed process was writing: nobody else writes here."""
    for folder in (path, path / CHECKPOINTS, path / "policy"):
        for entry in folder.glob(".*"):
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)
