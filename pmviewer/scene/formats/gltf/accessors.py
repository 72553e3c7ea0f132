"""Accessors as arrays: strided, sparse, normalised. Sizes are checked against real bytes before memory is taken."""

from __future__ import annotations

from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.formats.gltf.buffers import Buffers
from pmviewer.scene.formats.gltf.document import Document, Json, is_index

Float = NDArray[np.float64]
_TYPES: dict[int, type[np.generic]] = {
    5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32,
}  # fmt: skip
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_SPARE = 1 << 16
"""Items that an accessor without bytes of its own may have beyond what the file's buffers could hold."""


class Accessors:
    """Decodes the accessors of one file."""

    def __init__(self, document: Document, buffers: Buffers) -> None:
        self._document, self._buffers = document, buffers

    def count(self, index: Any, who: str) -> int:
        """Number of items that the accessor claims."""
        count = self._document.row("accessors", index, who).get("count")
        if not is_index(count):
            raise self._document.error(f"Accessor {index} claims {str(count)[:20]} items.")
        return int(count)

    def has_bytes(self, index: Any, who: str) -> bool:
        """Does the accessor refer to bytes, or is it filled by an extension?"""
        row = self._document.row("accessors", index, who)
        return "bufferView" in row or "sparse" in row

    def floats(self, index: Any, who: str, components: tuple[int, ...]) -> Float:
        """(n, components) numbers; normalised integers become fractions of their range. Raises SceneError."""
        row = self._document.row("accessors", index, who)
        return self.as_floats(self._raw(row, index, who, components), row)

    @staticmethod
    def as_floats(raw: NDArray, accessor: Json) -> Float:
        """Numbers that the accessor describes, from the integers or floats that are stored."""
        if raw.dtype.kind == "f" or not accessor.get("normalized"):
            return raw.astype(np.float64)
        largest = float(np.iinfo(raw.dtype).max)
        return np.maximum(raw / largest, -1.0)

    def integers(self, index: Any, who: str, components: tuple[int, ...] = (1,)) -> NDArray[np.int64]:
        """(n, components) whole numbers. Raises SceneError."""
        row = self._document.row("accessors", index, who)
        raw = self._raw(row, index, who, components)
        if raw.dtype.kind == "f":
            raise self._document.error(f"Accessor {index}, which {who} counts by, has no whole numbers.")
        return raw.astype(np.int64)

    def accessor(self, index: Any, who: str) -> Json:
        """The accessor's object in the file."""
        return self._document.row("accessors", index, who)

    def _raw(self, row: Json, index: int, who: str, components: tuple[int, ...]) -> NDArray:
        kind, width = _TYPES.get(_key(row.get("componentType"))), _COMPONENTS.get(str(row.get("type")), 0)
        if kind is None or width not in components:
            what = f"Accessor {index} has items of type {str(row.get('type'))[:20]} and component type "
            raise self._document.error(f"{what}{str(row.get('componentType'))[:20]}, which {who} can't use.")
        dtype, count = np.dtype(kind).newbyteorder("<"), self.count(index, who)
        if "bufferView" in row:
            values = self._strided(row["bufferView"], row.get("byteOffset", 0), count, dtype, width, index)
        else:
            self._check_spare(index, count)
            values = np.broadcast_to(np.zeros(1, dtype), (count, width))
        sparse = row.get("sparse")
        if isinstance(sparse, dict):
            values = self._with_sparse(values, sparse, index)
        return values

    def _check_spare(self, index: int, count: int) -> None:
        """Items without bytes of their own are zeros: no more than the file could give some."""
        if count > self._sizes() + _SPARE:
            raise self._document.error(f"Accessor {index} claims {count} items and has no data for them.")

    def _sizes(self) -> int:
        """Bytes that the file and those beside it hold."""
        names = {row["uri"] for row in self._document.rows("buffers") if isinstance(row.get("uri"), str)}
        names = {unquote(name) for name in names if not name.startswith("data:")}
        files = (self._document.path.parent / name for name in names if "\0" not in name)
        return self._document.path.stat().st_size + sum(f.stat().st_size for f in files if f.is_file())

    def _strided(self, view: Any, offset: Any, count: int, dtype: np.dtype, width: int, index: int) -> NDArray:
        data, stride = self._buffers.view(view, f"accessor {index}")
        size = dtype.itemsize * width
        step = stride or size
        if not is_index(offset) or step < size or (count and offset + (count - 1) * step + size > len(data)):
            what = (
                f"Accessor {index} claims {count} items of {size} bytes, {step} apart from byte {str(offset)[:20]} on,"
            )
            raise self._document.error(f"{what} but its buffer view has {len(data)} bytes.")
        if not count:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data.data, offset, (step, dtype.itemsize))

    def _with_sparse(self, values: NDArray, sparse: Json, index: int) -> NDArray:
        places, changed, count = sparse.get("indices"), sparse.get("values"), sparse.get("count")
        if not isinstance(places, dict) or not isinstance(changed, dict) or not is_index(count):
            raise self._document.error(f"Accessor {index} is sparse, and its indices or values are not there.")
        kind = _TYPES.get(_key(places.get("componentType")))
        if kind not in (np.uint8, np.uint16, np.uint32):
            raise self._document.error(f"Accessor {index} is sparse, and its indices are no whole numbers.")
        step = np.dtype(kind).newbyteorder("<")
        where = self._strided(places.get("bufferView"), places.get("byteOffset", 0), count or 0, step, 1, index)[:, 0]
        width = values.shape[1]
        what = self._strided(
            changed.get("bufferView"), changed.get("byteOffset", 0), count or 0, values.dtype, width, index
        )
        if len(where) and int(where.max()) >= len(values):
            raise self._document.error(
                f"Accessor {index} is sparse, and changes item {int(where.max())}, which it lacks."
            )
        values = values.copy()
        values[where] = what
        return values


def _key(value: Any) -> int:
    return value if is_index(value) else -1
