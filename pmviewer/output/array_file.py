"""Numbers and arrays in one file: a zip archive, as numpy's .npz files are, with a JSON beside the arrays.

`about.json` comes first; NAME.npy is an array, uncompressed, without pickled objects. Each entry has its checksum: what
is read is what was written. Arrays are written and read piece by piece, so that they take no memory a second time.
"""

from __future__ import annotations

import json
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.output.files import check_readable, replacing
from pmviewer.state import State

ABOUT = "about.json"
CHUNK = 1 << 20
MOST_ABOUT = 1 << 24
"""Bytes of the JSON that are read at most."""
_KINDS = "biuf"
_EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Same content, same file."""
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    ValueError,  # and all of Unicode and JSON
    KeyError,
    TypeError,
    EOFError,
    OverflowError,
    RecursionError,
    NotImplementedError,
    RuntimeError,
)


def write_arrays(path: Path, suffix: str, about: Mapping[str, Any], state: State, *, alone: bool = False) -> int:
    """Write what the file is `about` and a state; returns how many bytes that takes. The file before stays whole on any
    failure. `alone` as for `pmviewer.output.files.replacing`. Raises OutputError."""
    size = sum(array.nbytes for array in state.arrays.values())
    with replacing(path, (suffix,), size, alone=alone) as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            tree = {**about, "numbers": state.numbers}
            archive.writestr(zipfile.ZipInfo(ABOUT, _EARLIEST), json.dumps(tree, default=_plain))
            for name, array in state.arrays.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy", _EARLIEST), "w", force_zip64=True) as entry:
                    _write(entry, np.ascontiguousarray(array))
        return file.tell()


def _plain(value: Any) -> Any:
    """A number of numpy as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {type(value).__name__} can't be kept")


def _write(entry: IO[bytes], array: NDArray[Any]) -> None:
    npy.write_array_header_1_0(entry, npy.header_data_from_array_1_0(array))
    content = _bytes_of(array)
    for start in range(0, len(content), CHUNK):
        entry.write(content[start : start + CHUNK].data)


def _bytes_of(array: NDArray[Any]) -> NDArray[np.uint8]:
    """The memory of a contiguous array."""
    return array.reshape(-1).view(np.uint8)


def read_about(path: str | Path, what: str) -> dict[str, Any]:
    """What the file is about, without its arrays. Raises SceneError, which calls the file `what` ("checkpoint")."""
    with _opened(path, what) as archive:
        return _about(archive)


def read_arrays(path: str | Path, what: str) -> tuple[dict[str, Any], State]:
    """What the file is about, and the state. Raises SceneError for a file that is missing, damaged or none of these."""
    with _opened(path, what) as archive:
        about = _about(archive)
        arrays = {
            info.filename.removesuffix(".npy"): _read(archive, info)
            for info in archive.infolist()
            if info.filename != ABOUT
        }
        return about, State(about.pop("numbers"), arrays)


@contextmanager
def _opened(path: str | Path, what: str) -> Iterator[zipfile.ZipFile]:
    path = check_readable(path)
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except _BROKEN:
        raise SceneError(f"This is no whole {what}: the file is damaged, or something else.", path) from None
    except MemoryError:
        raise SceneError(f"There is not enough memory for this {what}.", path) from None
    except OSError as error:
        raise SceneError(f"The {what} can't be read: {error.strerror or error}.", path) from None


def _about(archive: zipfile.ZipFile) -> dict[str, Any]:
    info = archive.getinfo(ABOUT)
    if info.compress_type != zipfile.ZIP_STORED or info.file_size > MOST_ABOUT:
        raise ValueError(ABOUT)
    about = json.loads(archive.read(info))
    if not isinstance(about, dict) or not isinstance(about.get("numbers"), dict):
        raise ValueError(ABOUT)
    return about


def _read(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    if info.compress_type != zipfile.ZIP_STORED or not info.filename.endswith(".npy"):
        raise ValueError(info.filename)
    with archive.open(info) as entry:
        if npy.read_magic(entry) != (1, 0):
            raise ValueError(info.filename)
        shape, fortran, dtype = npy.read_array_header_1_0(entry)
        bytes_ = math.prod(shape) * dtype.itemsize
        if dtype.kind not in _KINDS or fortran or min(shape, default=0) < 0 or bytes_ > info.file_size:
            raise ValueError(info.filename)
        array = np.empty(shape, dtype)
        content, filled = _bytes_of(array), 0
        while filled < len(content):
            part = entry.read(min(CHUNK, len(content) - filled))
            if not part:
                raise EOFError(info.filename)
            content[filled : filled + len(part)] = np.frombuffer(part, np.uint8)
            filled += len(part)
        if entry.read(1):  # and at its end the checksum is compared
            raise ValueError(info.filename)
    return array
