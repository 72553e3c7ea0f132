"""How a program and a window in another process talk: requests and answers as JSON, arrays as bytes behind them.

The window listens at a socket of this machine (a named pipe on Windows). Where, and the key that a program must know,
stand in a file that its user alone can read. Nothing that comes over the wire is run or unpickled.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from pmviewer.errors import PmviewerError

MOST_TEXT = 1 << 22
"""Bytes of a request or answer without its array."""
MOST_BYTES = 1 << 31
Message = dict[str, Any]


@dataclass(frozen=True)
class Place:
    """A window that listens: its process, where it listens, the key (hex) and the time since when (s since 1970)."""

    pid: int
    address: str
    key: str
    since: float


def folder() -> Path:
    """Where listening windows of this user are written down."""
    return Path(platformdirs.user_state_dir("pmviewer")) / "windows"


def write_place(place: Place) -> Path:
    """For programs to find. Raises OSError."""
    folder().mkdir(parents=True, exist_ok=True, mode=0o700)
    path = folder() / f"{place.pid}.json"
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        json.dump(asdict(place), file)
    return path


def places() -> Iterator[tuple[Path, Place]]:
    """The windows that are written down, the latest first; files that can't be read are passed over."""
    found = []
    for path in sorted(folder().glob("*.json")):
        with contextlib.suppress(OSError, ValueError, TypeError):
            found.append((path, Place(**json.loads(path.read_text(encoding="utf-8")))))
    yield from sorted(found, key=lambda one: one[1].since, reverse=True)


def send(connection: Connection, message: Message, array: NDArray[np.float32] | None = None) -> None:
    """One message, with an array behind it if one is given. Raises OSError."""
    if array is not None:
        message = {**message, "shape": list(array.shape)}
    connection.send_bytes(json.dumps(message, default=_plain).encode())
    if array is not None:
        connection.send_bytes(np.ascontiguousarray(array, "<f4").tobytes())


def receive(connection: Connection) -> tuple[Message, NDArray[np.float32] | None]:
    """The next message and its array. Raises EOFError when the other side is gone, OSError, and PmviewerError for what
    is no message."""
    try:
        message = json.loads(connection.recv_bytes(MOST_TEXT))
        shape = message.get("shape")
        if shape is None:
            return message, None
        values = np.frombuffer(connection.recv_bytes(MOST_BYTES), "<f4").reshape(shape)
        return message, values.astype(np.float32)
    except (ValueError, AttributeError) as error:
        raise PmviewerError(f"The other side said what is no message: {error}") from error


def _plain(value: Any) -> Any:
    """Of what JSON doesn't know: arrays and numbers of NumPy, mappings."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if hasattr(value, "items"):
        return dict(value.items())
    raise TypeError(f"a {type(value).__name__} can't be sent to a window")
