"""Images that are seldom looked at, on disk: in a file without a name, which is gone with the program."""

from __future__ import annotations

import math
import mmap
import os
import tempfile
import weakref
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

Layer = NDArray[np.float32]
_FOLDER = "/var/tmp"
"""For large files by the custom of Unix: /tmp may lie in memory."""


class KeptLayers(Mapping[str, Layer]):
    """Layers (h, w, c) float32 by name. Whoever asks for one gets its place in the file, read only, which takes memory
    for the pixels that are looked at and as long as it is held."""

    def __init__(self, layers: Iterable[tuple[str, Layer]]) -> None:
        """Raises OSError where the disk has no room."""
        self._file = tempfile.TemporaryFile(prefix="pmviewer-", dir=_folder())  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._places: dict[str, tuple[int, tuple[int, ...]]] = {}
        for name, layer in layers:
            start = -(-self._file.tell() // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
            self._file.seek(start)
            self._file.write(np.ascontiguousarray(layer, np.float32).data)
            self._places[name] = start, layer.shape
        self._file.flush()

    def __getitem__(self, name: str) -> Layer:
        start, shape = self._places[name]
        size = 4 * math.prod(shape)
        mapped = mmap.mmap(self._file.fileno(), size, access=mmap.ACCESS_READ, offset=start)
        return np.frombuffer(mapped, np.float32).reshape(shape)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


def kept(layers: Mapping[str, Layer]) -> Mapping[str, Layer]:
    """The layers as they are now, on disk, or copied in memory where the disk refuses."""
    try:
        return KeptLayers(layers.items())
    except OSError:
        return {name: np.array(layer, np.float32) for name, layer in layers.items()}


def _folder() -> str | None:
    """Where temporary files go: what the user has set, else a folder on the disk, else Python's choice."""
    chosen = any(os.environ.get(name) for name in ("TMPDIR", "TEMP", "TMP"))
    return _FOLDER if not chosen and os.access(_FOLDER, os.W_OK) else None
