"""Points with properties as PLY files, as most programs that show points read them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.output.files import read_file, write_file

SUFFIX = ".ply"
_TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "u2": "ushort", "i4": "int", "u4": "uint"}


def write_ply(path: str | Path, columns: Sequence[tuple[str, NDArray[Any]]], comments: Iterable[str] = ()) -> None:
    """Write vertices whose properties are `columns`, named arrays (n,) of one length, binary and little endian.

    Comments are written as ASCII, a line each; other characters are escaped. Raises OutputError.
    """
    kinds = [array.dtype.str[1:] for _, array in columns]
    rows = np.empty(len(columns[0][1]), [(name, f"<{kind}") for (name, _), kind in zip(columns, kinds, strict=True)])
    for name, array in columns:
        rows[name] = array
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {' '.join(text.split())}" for text in comments),
        f"element vertex {len(rows)}",
        *(f"property {_TYPES[kind]} {name}" for (name, _), kind in zip(columns, kinds, strict=True)),
        "end_header\n",
    ]
    write_file(path, "\n".join(header).encode("ascii", "backslashreplace") + rows.tobytes(), (SUFFIX,))


def read_ply(path: str | Path) -> dict[str, NDArray[Any]]:
    """The properties of a file's vertices by name, as `write_ply` writes them: one element, binary and little
    endian. Raises SceneError for other files."""
    data = read_file(path)
    end = data.find(b"end_header\n")
    head = data[:end].decode("ascii", "replace").splitlines() if end >= 0 else []
    lines = [line.split() for line in head if not line.startswith(("comment", "obj_info"))]
    if end < 0 or not head or head[0].strip() != "ply":
        raise SceneError("This is not a PLY file.", Path(path))
    elements = [line for line in lines if line[:1] == ["element"]]
    properties = [line for line in lines if line[:1] == ["property"]]
    kinds = {kind: f"<{code}" for code, kind in _TYPES.items()}
    fits = ["format", "binary_little_endian", "1.0"] in lines and len(elements) == 1
    fits = fits and len(elements[0]) == 3 and elements[0][1] == "vertex" and elements[0][2].isdecimal()
    if not fits or not all(len(line) == 3 and line[1] in kinds for line in properties):
        raise SceneError(
            "Only points with numbers can be read here, binary and little endian: what pmviewer photons writes.",
            Path(path),
        )
    try:
        row = np.dtype([(line[2], kinds[line[1]]) for line in properties])
    except ValueError:
        raise SceneError("Two properties of its points have one name.", Path(path)) from None
    count, start = int(elements[0][2]), end + len(b"end_header\n")
    if len(data) - start < count * row.itemsize:
        raise SceneError(f"The file ends before the last of its {count:,} points.", Path(path))
    rows = np.frombuffer(data, row, count, start)
    return {name: np.array(rows[name]) for name in row.names or ()}
