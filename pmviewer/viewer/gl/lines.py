"""Photon records as lines on the GPU.

A line is two records, so that it is coloured as photons are: by the power on the way, by bounces or by light. The
geometry shader makes it as wide as asked for.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.viewer.gl.palette import POWER, Colouring, look_uniforms, palettes
from pmviewer.viewer.gl.program import Drawing, Shaders, set_uniforms
from pmviewer.viewer.gl.records import ATTRIBUTES, EMPTY, LAYOUT, CloudSummary, log_range, summary_of

_DIM_START = 0.55
"""Brightness at the start of lines that brighten towards their ends."""


class LineCloud:
    """Lines that are uploaded once and drawn in any style."""

    def __init__(self, shaders: Shaders) -> None:
        self._shaders = shaders
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self._log_range = (0.0, 1.0)
        self._summary = EMPTY

    def upload(self, ends: NDArray[np.float32], power_unit: float = 1.0, colouring: Colouring = POWER) -> None:
        """Take lines (2n, 6) in place of those before; scales are those of the `colouring`."""
        self.release()
        if not len(ends):
            return
        self._buffer = self._shaders.context.buffer(np.ascontiguousarray(ends, np.float32))
        names = [n for n in ATTRIBUTES if n in self._program]
        self._array = self._shaders.array("lines", [(self._buffer, LAYOUT, *names)])
        self._log_range = log_range(ends[::2], colouring)
        count = len(ends) // 2
        self._summary = summary_of(ends[::2], power_unit, count, count, colouring)

    def release(self) -> None:
        """Free what lies on the GPU."""
        if self._array is not None:
            self._shaders.drop(self._array)
        if self._buffer is not None:
            self._buffer.release()
        self._array = self._buffer = None
        self._summary = EMPTY

    def summary(self) -> CloudSummary:
        """Of the records uploaded last: what scales of colours and legends need."""
        return self._summary

    def draw(self, drawing: Drawing, colouring: Colouring, *, size: float, depth: bool, flow: bool = True) -> None:
        """Draw lines `size` wide, brightening towards their ends if they `flow`; `depth`: surfaces hide them."""
        if self._array is None:
            return
        context = self._shaders.context
        context.enable_only(moderngl.BLEND | (moderngl.DEPTH_TEST if depth else 0))
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        width, height = drawing.viewport
        set_uniforms(
            self._program,
            **look_uniforms(drawing.look),
            view=drawing.view,
            projection=drawing.projection,
            viewport=(float(width), float(height)),
            size=size * drawing.pixel_ratio,
            start_level=_DIM_START if flow else 1.0,
            colour_by=int(colouring.by),
            channel=colouring.channel,
            colour_row=int(colouring.scale == "around one"),
            power_range=self._log_range,
        )
        self._array.render(moderngl.LINES)
        context.disable(moderngl.BLEND)

    @property
    def _program(self) -> moderngl.Program:
        return self._shaders.get("lines", palettes)
