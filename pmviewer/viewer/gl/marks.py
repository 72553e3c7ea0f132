"""Points with a dark rim and lines with one, over everything else: what is pinned is to be seen on any ground."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.viewer.gl.program import Drawing, Shaders, set_uniforms

RGB = tuple[float, float, float]
RIM_COLOUR: RGB = (0.0, 0.0, 0.0)
RIM = 2.5
"""How much wider a line's rim is than the line."""


class Marks:
    """Points (n, 3) with levels (n,) in 0 … 1, which are drawn between two colours."""

    def __init__(self, shaders: Shaders) -> None:
        self._shaders = shaders
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None

    def upload(self, points: NDArray[np.floating], levels: NDArray[np.floating]) -> None:
        """Take these in place of those before."""
        self.release()
        if not len(points):
            return
        content = np.column_stack([points, levels]).astype(np.float32)
        self._buffer = self._shaders.context.buffer(content)
        layout = [(self._buffer, "3f4 1f4", "position", "level")]
        self._array = self._shaders.array("marks", layout)

    def release(self) -> None:
        """Free what lies on the GPU."""
        if self._array is not None and self._buffer is not None:
            self._shaders.drop(self._array)
            self._buffer.release()
        self._array = self._buffer = None

    def draw(self, drawing: Drawing, low: RGB, high: RGB, size: float) -> None:
        """All of them, so wide in points; the rims lie below, that no point covers another with its rim."""
        if self._array is None:
            return
        self._shaders.context.enable_only(moderngl.PROGRAM_POINT_SIZE)
        program = self._shaders.get("marks")
        set_uniforms(program, view=drawing.view, projection=drawing.projection)
        for dark, bright, wide in ((RIM_COLOUR, RIM_COLOUR, size + RIM), (low, high, size)):
            set_uniforms(program, low=dark, high=bright, size=wide * drawing.pixel_ratio)
            self._array.render(moderngl.POINTS)


class Strokes:
    """Lines (2n, 3) of one colour."""

    def __init__(self, shaders: Shaders) -> None:
        self._shaders = shaders
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None

    def upload(self, ends: NDArray[np.floating]) -> None:
        """Take these in place of those before."""
        self.release()
        if len(ends):
            self._buffer = self._shaders.context.buffer(np.ascontiguousarray(ends, np.float32))
            layout = [(self._buffer, "3f4", "position")]
            self._array = self._shaders.array("frustum", layout)

    def release(self) -> None:
        """Free what lies on the GPU."""
        if self._array is not None and self._buffer is not None:
            self._shaders.drop(self._array)
            self._buffer.release()
        self._array = self._buffer = None

    def draw(self, drawing: Drawing, colour: RGB, width: float) -> None:
        """All of them, so wide in points."""
        if self._array is None:
            return
        context, program = self._shaders.context, self._shaders.get("frustum")
        across, down = drawing.viewport
        context.enable_only(moderngl.BLEND)
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        size = float(across), float(down)
        set_uniforms(program, view=drawing.view, projection=drawing.projection, viewport=size)
        for tint, wide, opacity in ((RIM_COLOUR, width + RIM, 0.6), (colour, width, 1.0)):
            set_uniforms(program, tint=tint, size=wide * drawing.pixel_ratio, opacity=opacity)
            self._array.render(moderngl.LINES)
        context.disable(moderngl.BLEND)
