"""Compressed geometry through its libraries, loaded when a file needs them: Draco and meshoptimizer.

Sizes are checked before a byte is decoded: both formats can claim far more than they hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.gltf.document import Json, is_index

_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")
_GROWTH = {0xA0: 80, 0xA1: 1100}
"""Bytes that one byte of a vertex stream can become at most, by version: 256 rows of a column of equal bytes take 4
bytes in version 0; in version 1 four such columns take one."""


def library(name: str, needed_for: str) -> Any:
    """An optional library. Raises SceneError that says how to install it."""
    try:
        return import_module(name)
    except ImportError:
        what = f"The file's geometry is compressed with {needed_for}, and the Python package '{name}' is not installed."
        hint = 'Install it with pip install "pmviewer[gltf]", or export the file without compression.'
        raise SceneError(what, hint=hint) from None


def decode_meshopt(data: NDArray[np.uint8], packed: Json) -> NDArray[np.uint8]:
    """Bytes of a buffer view packed by EXT_meshopt_compression or KHR_meshopt_compression.

    Raises SceneError for damaged data, and for a missing library (then with a hint).
    """
    count, size, mode = packed.get("count"), packed.get("byteStride"), packed.get("mode")
    method = packed.get("filter", "NONE")
    if not is_index(count) or not is_index(size) or mode not in _MODES or method not in _FILTERS or not len(data):
        raise SceneError("its compression is not described as it should be.")
    if mode == "ATTRIBUTES":
        most = len(data) * _GROWTH.get(int(data[0]), 0)
        usable = 0 < size <= 256 and size % 4 == 0
    else:  # a triangle takes at least a byte, and so does an index of a sequence
        most = len(data) * size * (3 if mode == "TRIANGLES" else 1)
        usable = size in (2, 4)
    if not usable or count * size > most:
        raise SceneError(f"it claims {count} elements of {size} bytes, more than its {len(data)} bytes can hold.")
    meshopt = library("meshopt", "meshoptimizer")
    if not count:
        return np.zeros(0, np.uint8)
    try:
        result = meshopt.decode_gltf_buffer(data.tobytes(), count, size, mode, method)
    except (ValueError, RuntimeError, MemoryError):
        raise SceneError("its compressed data can't be decoded.") from None
    return np.ascontiguousarray(result).view(np.uint8).reshape(-1)


@dataclass(frozen=True)
class DracoMesh:
    """Triangles (n, 3) and attributes (vertices, components) by Draco's own numbers."""

    faces: NDArray[np.int64]
    attributes: dict[int, NDArray]


def decode_draco(data: NDArray[np.uint8]) -> DracoMesh:
    """A mesh of KHR_draco_mesh_compression. Raises SceneError for damaged data, and for a missing library (then with a
    hint)."""
    draco = library("DracoPy", "Draco")
    if bytes(data[:5]) != b"DRACO":
        raise SceneError("its compressed data are not Draco's.")
    try:
        mesh = draco.decode(data.tobytes())
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
        attributes = {int(a["unique_id"]): np.asarray(a["data"]) for a in mesh.attributes}
    except Exception:  # the library raises types of its own, and plain errors for point clouds
        raise SceneError("its compressed data can't be decoded.") from None
    return DracoMesh(faces, {k: a.reshape(len(a), -1) for k, a in attributes.items()})
