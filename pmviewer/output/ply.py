"""Points with properties as PLY files, as most programs that show points read them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.files import write_file

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
