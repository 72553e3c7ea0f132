"""The tables of false colours on the GPU, a row each."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.output.colour_maps import SEQUENTIAL, SIZE, TWO_SIDED

COLOUR_UNIT = 2
"""Texture unit; the picture's own is 0."""
_TABLES = (*SEQUENTIAL.values(), *TWO_SIDED.values())


def row_of(table: NDArray[np.float32]) -> int:
    """Of a table of `pmviewer.output.colour_maps`."""
    return next(row for row, other in enumerate(_TABLES) if other is table)


class ColourTables:
    """Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._texture = context.texture((SIZE, len(_TABLES)), 3, np.stack(_TABLES).tobytes(), dtype="f4")
        self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def bind(self) -> None:
        """For the next picture in false colours."""
        self._texture.use(COLOUR_UNIT)

    def release(self) -> None:
        """Free what lies on the GPU."""
        self._texture.release()
