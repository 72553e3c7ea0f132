"""The render camera's frustum as lines on the GPU, for the free camera.

Lines have a dark rim, to be read on any ground. What surfaces hide shows through faintly.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import Matrix
from pmviewer.viewer import theme
from pmviewer.viewer.gl.program import load_program, set_uniforms

COLOUR = theme.FREE[:3]
RIM_COLOUR = (0.0, 0.0, 0.0)
WIDTH, RIM = 2.0, 4.5
HIDDEN = 0.28
"""Opacity behind surfaces."""
_DEPTH_CLAMP = 0x864F
"""GL_DEPTH_CLAMP: the frustum may stand before the near plane, where surfaces are cut away, or beyond the scene."""


class FrustumLines:
    """Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = load_program(context, "frustum")
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self._ends: NDArray[np.floating] | None = None

    def upload(self, ends: NDArray[np.floating] | None) -> bool:
        """Take line ends (2n, 3), or none. True when they are others than before."""
        before = self._ends
        if ends is before or (ends is not None and before is not None and np.array_equal(ends, before)):
            return False
        self._ends = ends
        if self._array is not None and self._buffer is not None:
            self._array.release()
            self._buffer.release()
        self._array = self._buffer = None
        if ends is not None:
            self._buffer = self._context.buffer(np.ascontiguousarray(ends, np.float32))
            self._array = self._context.vertex_array(self._program, [(self._buffer, "3f4", "position")])
        return True

    @property
    def shown(self) -> bool:
        return self._array is not None

    def draw(self, view: Matrix, projection: Matrix, viewport: tuple[int, int], pixel_ratio: float) -> None:
        """Draw into the bound framebuffer, whose depth buffer holds the surfaces and is left as it is."""
        if self._array is None:
            return
        context = self._context
        size = float(viewport[0]), float(viewport[1])
        set_uniforms(self._program, view=view, projection=projection, viewport=size)
        for tested in (False, True):
            context.enable_only(moderngl.BLEND | (moderngl.DEPTH_TEST if tested else 0))
            context.enable_direct(_DEPTH_CLAMP)
            context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            opacity = 1.0 if tested else HIDDEN
            for tint, width, share in ((RIM_COLOUR, RIM, 0.6), (COLOUR, WIDTH, 1.0)):
                set_uniforms(self._program, tint=tint, size=width * pixel_ratio, opacity=share * opacity)
                self._array.render(moderngl.LINES)
        context.disable_direct(_DEPTH_CLAMP)
        context.disable(moderngl.BLEND)
