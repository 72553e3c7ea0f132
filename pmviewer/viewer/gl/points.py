"""Photon records as points on the GPU.

They are uploaded as they are stored, 24 bytes each, and decoded in the vertex shader; thinning is a stride in the
vertex format, so a map of millions costs no work on the CPU.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.viewer.gl.palette import POWER, By, Colouring, look_uniforms, palettes
from pmviewer.viewer.gl.program import Drawing, Shaders, set_uniforms
from pmviewer.viewer.gl.records import ATTRIBUTES, EMPTY, LAYOUT, RECORD_BYTES, CloudSummary, log_range, summary_of

EVERY_TAG = 0xFFFFFFFF
_SAMPLE = 20_000
"""Records that the scale of colours is taken from."""


def even_thinning(count: int, limit: int) -> int:
    """Stride that leaves at most `limit` of `count` records."""
    return max(1, -(-count // max(limit, 1)))


class PointCloud:
    """Records that are uploaded once and drawn in any style."""

    def __init__(self, shaders: Shaders) -> None:
        self._shaders = shaders
        self._buffer: moderngl.Buffer | None = None
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._count = 0
        self._power_unit = 1.0
        self._sample = np.empty((0, 6), np.float32)
        self._ranges: dict[Colouring, tuple[float, float]] = {}
        self._summaries: dict[Colouring, CloudSummary] = {}

    def upload(self, records: NDArray[np.float32], power_unit: float = 1.0) -> None:
        """Take records (n, 6) in place of those before."""
        self.release()
        self._count, self._power_unit = len(records), power_unit
        if self._count:
            records = np.ascontiguousarray(records, np.float32)
            self._buffer = self._shaders.context.buffer(records)
            self._sample = records[:: even_thinning(self._count, _SAMPLE)]

    def release(self) -> None:
        """Free what lies on the GPU."""
        for array in self._arrays.values():
            self._shaders.drop(array)
        self._arrays.clear()
        if self._buffer is not None:
            self._buffer.release()
        self._buffer, self._count = None, 0
        self._sample = np.empty((0, 6), np.float32)
        self._ranges.clear()
        self._summaries.clear()

    def summary(self, limit: int = 1, colouring: Colouring = POWER) -> CloudSummary:
        """For the legend; `limit` is how many may be drawn."""
        if not self._count:
            return EMPTY
        drawn = -(-self._count // even_thinning(self._count, limit))
        if colouring not in self._summaries:
            self._summaries[colouring] = summary_of(self._sample, self._power_unit, self._count, 0, colouring)
        return replace(self._summaries[colouring], drawn=drawn)

    def draw(
        self,
        drawing: Drawing,
        colouring: Colouring,
        *,
        size: float,
        depth: bool,
        limit: int,
        drawn_tags: int = EVERY_TAG,
        only_shadow: bool = False,
    ) -> None:
        """Draw at most `limit` points `size` wide; `depth`: surfaces hide them. `drawn_tags` has a bit for each of the
        lights, or of what stands in their place, that are drawn (modulo 32)."""
        if self._buffer is None:
            return
        context = self._shaders.context
        context.enable_only(moderngl.PROGRAM_POINT_SIZE | (moderngl.DEPTH_TEST if depth else 0))
        stride = even_thinning(self._count, limit)
        width = size * drawing.pixel_ratio
        if colouring not in self._ranges:
            self._ranges[colouring] = log_range(self._sample, colouring)
        set_uniforms(
            self._program,
            **look_uniforms(drawing.look),
            view=drawing.view,
            projection=drawing.projection,
            size=width,
            colour_by=int(colouring.by),
            channel=colouring.channel if colouring.by == By.QUANTITY else 0,
            colour_row=int(colouring.scale == "around one"),
            light_mask=drawn_tags,
            only_shadow=int(only_shadow),
            power_range=self._ranges[colouring],
            round_points=int(width >= 3),
        )
        self._array(stride).render(moderngl.POINTS, vertices=-(-self._count // stride))

    @property
    def _program(self) -> moderngl.Program:
        return self._shaders.get("points", palettes)

    def _array(self, stride: int) -> moderngl.VertexArray:
        if stride not in self._arrays:
            assert self._buffer is not None
            rest = f" {RECORD_BYTES * (stride - 1)}x1" if stride > 1 else ""
            names = [n for n in ATTRIBUTES if n in self._program]
            content = [(self._buffer, LAYOUT + rest, *names)]
            self._arrays[stride] = self._shaders.array("points", content)
        return self._arrays[stride]
