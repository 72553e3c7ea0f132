"""What the error view needs on the GPU beside the picture: the reference and the colours of its legend."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.output.falsecolour import COLOURS, DIVERGING

REFERENCE_UNIT, COLOUR_UNIT = 1, 2
"""Texture units; the picture's own is 0."""


class ReferencePlane:
    """Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self.texture: moderngl.Texture | None = None
        self._context = context
        self._image: Any = None
        tables = np.stack([COLOURS, DIVERGING])  # rows, as the shader's `colour_row` counts them
        self._colours = context.texture((len(COLOURS), len(tables)), 3, tables.tobytes(), dtype="f4")
        self._colours.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def upload(self, image: NDArray[np.float32] | None) -> bool:
        """Take (h, w, 3), or None. True when it is another one than before."""
        if image is self._image:
            return False
        self._image = image
        self._free()
        if image is not None:
            height, width, channels = image.shape
            pixels = np.ascontiguousarray(image, np.float32)
            self.texture = self._context.texture((width, height), channels, pixels.tobytes(), dtype="f4", alignment=4)
            self.texture.repeat_x = self.texture.repeat_y = False
        return True

    def _free(self) -> None:
        if self.texture is not None:
            self.texture.release()
            self.texture = None

    def release(self) -> None:
        """Free what lies on the GPU."""
        self._free()
        self._image = None
        self._colours.release()

    def bind(self) -> None:
        """For the error view: pixels are compared one by one, so nothing is interpolated. Diagnostic views use the
        colours alone."""
        if self.texture is not None:
            self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self.texture.use(REFERENCE_UNIT)
        self._colours.use(COLOUR_UNIT)
