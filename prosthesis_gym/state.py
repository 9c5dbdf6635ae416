"""Saved walkers as bytes: a header with version and checksum, what the core saves, and sums of terms of one's own."""

import json
import struct
import zlib
from collections.abc import Mapping
from typing import Any

#: A change of what `seal` is given makes a new version. The core's part has a version of its own.
VERSION = 1
_MAGIC = b"PGST"
#: Magic, version, checksum of all that follows.
_HEADER = struct.Struct("<4sHI")
_LENGTH = struct.Struct("<Q")


def seal(core: bytes, extra: Mapping[str, Any]) -> bytes:
    """Return a saved state: what the core saved, and what else belongs to it, as JSON has it."""
    body = _LENGTH.pack(len(core)) + core + json.dumps(extra).encode()
    return _HEADER.pack(_MAGIC, VERSION, zlib.crc32(body)) + body


def unseal(state: bytes) -> tuple[bytes, dict[str, Any]]:
    """Return what `seal` was given.

    Raises:
        ValueError: not a saved state, of another version, or damaged.

    """
    if not isinstance(state, bytes) or len(state) < _HEADER.size or not state.startswith(_MAGIC):
        raise ValueError("state is not one that get_state returned")
    _, version, checksum = _HEADER.unpack_from(state)
    if version != VERSION:
        raise ValueError(f"state has version {version}, must have {VERSION}")
    body = state[_HEADER.size :]
    if zlib.crc32(body) != checksum:
        raise ValueError("state is damaged: its checksum is wrong")
    (length,) = _LENGTH.unpack_from(body)
    core, extra = body[_LENGTH.size : _LENGTH.size + length], body[_LENGTH.size + length :]
    return core, json.loads(extra)
