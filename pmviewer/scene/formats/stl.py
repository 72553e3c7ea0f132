"""STL, text and binary: triangles with nothing else, but for colours in some binary files."""

from __future__ import annotations

import io
import re
from functools import partial
from pathlib import Path
from threading import Lock
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.rows import text_facets
from pmviewer.progress import available_threads, parallel, stage
from pmviewer.scene.description import Mesh
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.open_file import open_regular
from pmviewer.scene.formats.stl_colours import coloured, colours_by_attribute
from pmviewer.scene.meshes.welding import FACET, Welder

_HEADER, _RECORD = 84, 50
_AT_ONCE = 20_000
"""Triangles of a binary file that one thread has in memory as they were read."""
_CORNER = re.compile(rb"\s(vertex)\s", re.IGNORECASE)
"""What each line of a text file with a corner begins with, where there are lines."""
_FEWEST = 50_000
"""Triangles from which on a thread of their own pays."""


def read_stl(path: Path, diagnostics: Diagnostics) -> list[tuple[str, Mesh]]:
    """Name and mesh of the file's solids, flat-shaded as the format is; a binary file is one solid.

    Raises SceneError for what is no STL file.
    """
    file, size = open_regular(path)
    with file:
        data = file.read(_HEADER)
        claimed = int.from_bytes(data[80:84], "little") if len(data) == _HEADER else -1
        if claimed >= 0 and size == _HEADER + _RECORD * claimed:
            return _binary(data, file, claimed, path, diagnostics)
        data += file.read()
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16", "replace").encode("utf-8")
    start = data[:1024].removeprefix(b"\xef\xbb\xbf").lstrip()
    if start[:5].lower() == b"solid" and (b"facet" in data[:100_000].lower() or b"endsolid" in data[-1000:].lower()):
        return _text(data, path)
    whole = (len(data) - _HEADER) // _RECORD
    if whole > 0 and start[:5].lower() != b"solid" and _plausible(data, claimed, whole):
        if claimed > whole:
            what = f"The file is cut off: it says it has {claimed:,} triangles and holds {whole:,}, which are shown."
        else:
            what = f"The file says it has {claimed:,} triangles; what follows them is left out."
        if claimed == 0 or claimed == 2**32 - 1:
            what, claimed = f"The file does not say how many triangles it has; {whole:,} are shown.", whole
        diagnostics.warn(what)
        return _binary(data[:_HEADER], io.BytesIO(data[_HEADER:]), min(claimed, whole), path, diagnostics)
    hint = "Is the file complete? Export it again."
    raise SceneError("This is neither a binary nor a text STL file.", path, hint=hint)


def _plausible(data: bytes, claimed: int, whole: int) -> bool:
    """Do the first records look like triangles of a file with a wrong number in its header?"""
    if not (claimed in (0, 2**32 - 1) or 0 < claimed <= 4 * whole + 1000):
        return False
    facets = np.frombuffer(data, FACET, min(whole, 100), _HEADER)
    with np.errstate(invalid="ignore", over="ignore"):
        return bool((np.abs(facets["corners"]) < 1e10).all() and (np.abs(facets["normal"]) < 1.001).all())


def _binary(header: bytes, records: BinaryIO, n: int, path: Path, diagnostics: Diagnostics) -> list[tuple[str, Mesh]]:
    if not n:
        raise SceneError("The STL file has no triangles.", path, hint="Export it again.")
    stage(f"reading {n:,} triangles")
    source, each = _Records(records), max(_FEWEST, -(-n // available_threads()))
    attributes = np.zeros(n, np.uint16)
    parts = parallel([partial(source.part, i, min(i + each, n), attributes) for i in range(0, n, each)])
    if not all(complete for _, complete in parts):
        raise SceneError("The STL file ended while it was read.", path, hint="Open it again.")
    welder = parts[0][0]
    for other, _ in parts[1:]:
        welder.join(other)
    mesh = welder.mesh()
    colours = colours_by_attribute(header[:80], attributes)
    if colours is not None:
        mesh = coloured(mesh, attributes, colours)
    elif attributes.any():
        diagnostics.warn(
            "Numbers behind the STL file's triangles are ignored: they are no colours as programs write them."
        )
    return [(path.stem, mesh)]


def _filled(room: memoryview, file: BinaryIO) -> bool:
    """Read as many bytes as there is room for; False if the file ends before."""
    read = 0
    while read < len(room):
        more = file.readinto(room[read:])  # type: ignore[attr-defined]  # which typeshed's BinaryIO lacks
        if not more:
            return False
        read += more
    return True


class _Records:
    """A file's triangles, from where it stands, for several threads."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._start, self._lock = file, file.tell(), Lock()

    def part(self, first: int, end: int, attributes: NDArray[np.uint16]) -> tuple[Welder, bool]:
        """The triangles [first, end) joined, and whether the file has so many. The first part has room for all of them,
        as many as there are attributes, which become theirs."""
        welder = Welder(end - first if first else len(attributes))
        room = np.empty(min(end - first, _AT_ONCE), FACET)  # one for all: fresh memory costs more than to read into it
        for at in range(first, end, _AT_ONCE):
            facets = room[: end - at]
            count = len(facets)
            with self._lock:
                self._file.seek(self._start + _RECORD * at)
                complete = _filled(facets.view(np.uint8).data, self._file)
            if not complete:
                return welder, False
            welder.add(facets)
            attributes[at : at + count] = facets["attribute"]
        return welder, True


def _text(data: bytes, path: Path) -> list[tuple[str, Mesh]]:
    data = data.replace(b"\r", b"\n")
    if data.count(b"\n") < data.count(b"vertex") + data.count(b"VERTEX"):  # any blanks may stand between words
        data = _CORNER.sub(b"\n\\1 ", data)
    data += b"\n" * 16
    bytes_ = np.frombuffer(data, np.uint8)
    nothing = np.empty((0, 3)), np.empty((0, 2), np.int64)
    n, k = text_facets(bytes_, *nothing)
    if n < 3:
        raise SceneError("The STL file has no triangles.", path, hint="Export it again.")
    corners, solids = np.empty((n, 3)), np.empty((k, 2), np.int64)
    text_facets(bytes_, corners, solids)
    ends = [*solids[1:, 1].tolist(), n]
    found = []
    for (place, first), end in zip(solids.tolist(), ends):
        own = corners[first : first + (end - first) // 3 * 3]
        if len(own):
            name = data[place : data.find(b"\n", place)].decode("utf-8", "replace")[5:].strip()[:80]
            with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is left out later
                rounded = own.astype(np.float32)
            found.append((name or path.stem, _welded(rounded)))
    return found


def _welded(corners: NDArray[np.float32]) -> Mesh:
    """The triangles of corners (3 n, 3) with each vertex once."""
    stage(f"joining the corners of {len(corners) // 3:,} triangles")
    welder = Welder(len(corners) // 3)
    facets = np.empty(len(corners) // 3, FACET)
    facets["corners"] = corners.reshape(-1, 3, 3)
    welder.add(facets)
    return welder.mesh()
