"""User files: read with a byte-order mark or without, written so that neither crash nor full disk loses one."""

import errno
import json
import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_UTF16 = (b"\xff\xfe", b"\xfe\xff")
#: What the names of temporary files and folders begin with, and no user's file does.
_TEMPORARY = ".prosthesis_gym-partial-"


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file, without a byte-order mark.

    Raises:
        ValueError: another encoding; names the file and what to do.
        OSError: no such file, or it cannot be read.

    """
    content = Path(path).read_bytes()
    if content.startswith(_UTF16) or b"\0" in content:
        raise ValueError(f"{path}: looks like UTF-16 or UTF-32, must be UTF-8: save it with the encoding UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise ValueError(
            f"{path}, line {line}: byte 0x{byte:02x} is not UTF-8: save the file with the encoding UTF-8"
        ) from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file; what is no UTF-8 or no TOML is a ValueError with file and line."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: {error}") from None
    except RecursionError:
        raise ValueError(f"{path}: its brackets are nested too deeply to be read") from None


def read_json(path: str | Path) -> dict[str, Any]:
    """Return the object in a JSON file; what is no UTF-8 or no object of JSON is a ValueError with file and line."""
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}: no JSON: {error}") from None
    except RecursionError:
        raise ValueError(f"{path}: its brackets are nested too deeply to be read") from None
    if not isinstance(content, dict):
        raise ValueError(f"{path}, line 1: holds a JSON {type(content).__name__}, must hold an object")  # noqa: TRY004
    return content


def is_temporary(path: str | Path) -> bool:
    """Whether the name is one that `atomic_write` and `atomic_folder` give what is not complete yet."""
    return Path(path).name.startswith(_TEMPORARY)


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` when the block ends without an exception.

    The temporary file keeps the suffix of `path`, because writers choose their format by it. An older file at `path`
    stays as it was until the new one is complete and on the disk.

    Raises:
        OSError: as the block or the disk raises it, with `path` as its file.

    """
    target = Path(path)
    with _named(target):
        _make_folder(target.parent)
        handle, name = tempfile.mkstemp(prefix=_TEMPORARY, suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o666 & ~_umask())
            _sync(temporary)
            temporary.replace(target)
            _sync_folder(target.parent)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; rename it to `path` when the block ends without an exception.

    Raises:
        OSError: as the block or the disk raises it, with `path` as its file; a folder with content stands there.

    """
    target = Path(path)
    with _named(target):
        _make_folder(target.parent)
        temporary = Path(tempfile.mkdtemp(prefix=_TEMPORARY, dir=target.parent))
        try:
            yield temporary
            temporary.chmod(0o777 & ~_umask())
            for entry in temporary.rglob("*"):
                if entry.is_dir():
                    _sync_folder(entry)
                else:
                    _sync(entry)
            _sync_folder(temporary)
            temporary.replace(target)
            _sync_folder(target.parent)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:  # a file, but Python's words for it are about making one
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path)) from None


@contextmanager
def _named(target: Path) -> Iterator[None]:
    """Let an error of the disk name the file that somebody wanted: a full disk names none, others a temporary one."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise OSError(f"{target}: {error}") from error
        named = error.filename
        if named is None or any(map(is_temporary, Path(os.fsdecode(named)).parts)):
            raise OSError(error.errno, error.strerror or os.strerror(error.errno), str(target)) from error
        raise


def _sync(path: Path) -> None:
    """Put what the file holds on the disk: a rename that outlives a crash must not outlive its content."""
    # Windows syncs only what is open for writing.
    handle = os.open(path, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sync_folder(path: Path) -> None:
    """Put the names in the folder on the disk; Windows has no such thing, and does it by itself."""
    if os.name == "nt":
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
