"""The scene's surfaces as triangles on the GPU: shaded, or in the depth buffer alone."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from pmviewer.render.camera import Matrix
from pmviewer.viewer.gl.program import Shaders, set_uniforms


class Surfaces:
    """Every method needs the window's OpenGL context."""

    def __init__(self, shaders: Shaders) -> None:
        self._shaders = shaders
        self._geometry: Any = None
        self._buffer: moderngl.Buffer | None = None
        self._albedo: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self.center, self.radius = np.zeros(3), 1.0
        """Of the bounding sphere."""

    @property
    def any(self) -> bool:
        """Whether there is something to draw: false before the first scene and for scenes without surfaces."""
        return self._array is not None

    def upload(self, geometry: Any) -> bool:
        """Take a `DrawGeometry` (or None). True when it is another one than before."""
        if geometry is self._geometry:
            return False
        if geometry is not None and self._albedo is not None and geometry.vertices is self._geometry.vertices:
            self._geometry = geometry
            self._albedo.write(np.ascontiguousarray(geometry.albedo, np.float32))
            return True
        self.release()
        self._geometry = geometry
        if geometry is None or not len(geometry.vertices):
            return True
        program, context = self._shaders.get("geometry"), self._shaders.context
        places = np.hstack([geometry.vertices, geometry.normals]).astype(np.float32)
        self._buffer = context.buffer(np.ascontiguousarray(places))
        self._albedo = context.buffer(np.ascontiguousarray(geometry.albedo, np.float32))
        content = []
        for buffer, wanted in ((self._buffer, ("position", "normal")), (self._albedo, ("albedo",))):
            names = [(n, n in program) for n in wanted]
            if any(used for _, used in names):
                layout = " ".join("3f4" if used else "12x1" for _, used in names)
                content.append((buffer, layout, *(n for n, used in names if used)))
        self._array = self._shaders.array("geometry", content)
        self.center, self.radius = np.asarray(geometry.center, float), float(geometry.radius)
        return True

    def release(self) -> None:
        """Free what lies on the GPU."""
        if self._array is not None:
            self._shaders.drop(self._array)
        for buffer in (self._buffer, self._albedo):
            if buffer is not None:
                buffer.release()
        self._geometry = self._array = self._buffer = self._albedo = None

    def draw(self, view: Matrix, projection: Matrix, brightness: float = 1.0) -> None:
        """Draw into the bound framebuffer, pushed back a little in depth so that surfaces don't fight with the points
        that lie on them."""
        if self._array is None:
            return
        context = self._shaders.context
        context.enable_only(moderngl.DEPTH_TEST)
        context.polygon_offset = (1.0, 1.0)
        set_uniforms(self._shaders.get("geometry"), view=view, projection=projection, brightness=brightness)
        self._array.render(moderngl.TRIANGLES)
        context.polygon_offset = (0.0, 0.0)

    def draw_depth(self, framebuffer: moderngl.Framebuffer, view: Matrix, projection: Matrix) -> None:
        """Draw into the depth buffer alone. moderngl hands a framebuffer's mask to OpenGL when it is bound."""
        framebuffer.color_mask = (False, False, False, False)
        framebuffer.use()
        self.draw(view, projection)
        framebuffer.color_mask = (True, True, True, True)
        framebuffer.use()
