"""Files of curves, as Mitsuba has them: points in lines of text, or 0.6's binary files of hair."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.rows import count_words
from pmviewer.kernels.meshes.text import numbers
from pmviewer.scene.formats.open_file import read_regular
from pmviewer.scene.meshes.tubes import Curves

_BINARY = b"BINARY_HAIR"


def read_curves(path: Path, radius: float | None = None) -> Curves:
    """The file's curves, with this radius, or without one with that which stands behind each point.

    In text each line is a point; blank lines and comments (#) begin a new curve. Binary files say how many points there
    are; an infinite number before a point begins a new curve. Raises SceneError.
    """
    data = read_regular(path, "The file of curves")
    if data.startswith(_BINARY):
        return _binary(data, path, 1.0 if radius is None else radius)
    lines = [line.strip() for line in data.splitlines()]
    given = np.array([bool(line) and not line.startswith(b"#") for line in lines], bool)
    rows = [line for line, is_point in zip(lines, given) if is_point]
    width = len(rows[0].split()) if rows else 0
    if width not in (3, 4) or (width == 3 and radius is None):
        hint = "Each line is to hold x, y, z and the radius."
        raise SceneError("The file has no curves.", path, hint=hint)
    text = np.frombuffer(b"\n".join(rows) + b"\n\n", np.uint8)
    values = np.empty(width * len(rows))
    if count_words(text, 0) != len(values):
        raise SceneError(f"The file of curves has lines of other than {width} numbers.", path, hint="Export it again.")
    numbers(text, 0, values)
    points = np.empty((len(rows), 4))
    points[:, :width] = values.reshape(-1, width)
    if radius is not None:
        points[:, 3] = radius
    begins = given & ~np.concatenate([[False], given[:-1]])
    return Curves(points, np.append(np.flatnonzero(begins[given]), len(rows)))


def _binary(data: bytes, path: Path, radius: float) -> Curves:
    begin = len(_BINARY) + 4
    count = int.from_bytes(data[begin - 4 : begin], "little")
    values = np.frombuffer(data[begin : begin + (len(data) - begin) // 4 * 4], "<f4").astype(np.float64)
    marks = np.flatnonzero(np.isinf(values))
    values = np.delete(values, marks)
    if len(data) < begin or not count or len(values) < 3 * count:
        raise SceneError("The file of hair is cut off.", path, hint="Copy or export it again.")
    first = np.unique(np.concatenate([[0], (marks - np.arange(len(marks))) // 3, [count]]))
    points = np.full((count, 4), radius)
    points[:, :3] = values[: 3 * count].reshape(-1, 3)
    return Curves(points, first[first <= count])
