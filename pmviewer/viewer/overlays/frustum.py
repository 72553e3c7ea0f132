"""The render camera's frustum as lines, for the free camera.

Lines have a dark rim, to be read on any ground. What surfaces hide shows through faintly.
"""

from __future__ import annotations

import moderngl
import numpy as np

from pmviewer.render.camera import CameraPose
from pmviewer.render.free_camera import frustum_lines
from pmviewer.settings.access import FreeCamera, Settings
from pmviewer.viewer import theme
from pmviewer.viewer.gl.program import Drawing, Shaders, set_uniforms
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source

COLOUR = theme.DARK.free[:3]
RIM_COLOUR = (0.0, 0.0, 0.0)
WIDTH, RIM = 2.0, 4.5
HIDDEN = 0.28
"""Opacity behind surfaces."""
_DEPTH_CLAMP = 0x864F
"""GL_DEPTH_CLAMP: the frustum may stand before the near plane, where surfaces are cut away, or beyond the scene."""


class Frustum(Overlay):
    """Its settings are those of the free camera, and so is its switch."""

    name = "frustum"
    rank = 1

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None

    @classmethod
    def style(cls, settings: Settings) -> FreeCamera:
        return settings.free_camera

    @classmethod
    def is_shown(cls, settings: Settings) -> bool:
        return settings.free_camera.on and settings.free_camera.frustum

    @classmethod
    def tests_depth(cls, settings: Settings) -> bool:
        return True

    def needs(self, source: Source) -> Needs | None:
        camera = source.render_camera()
        return None if camera is None else (camera, source.settings.free_camera.length * source.scene_radius)

    def take(self, camera: CameraPose, length: float) -> None:
        """The frustum of that camera, so long in scene units."""
        self.release()
        ends = np.ascontiguousarray(frustum_lines(camera, length), np.float32)
        self._buffer = self.shaders.context.buffer(ends)
        content = [(self._buffer, "3f4", "position")]
        self._array = self.shaders.array("frustum", content)

    def release(self) -> None:
        if self._array is not None and self._buffer is not None:
            self.shaders.drop(self._array)
            self._buffer.release()
        self._array = self._buffer = None

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        if self._array is None:
            return
        context, program = self.shaders.context, self.shaders.get("frustum")
        width, height = drawing.viewport
        size = float(width), float(height)
        set_uniforms(program, view=drawing.view, projection=drawing.projection, viewport=size)
        for tested in (False, True):
            context.enable_only(moderngl.BLEND | (moderngl.DEPTH_TEST if tested else 0))
            context.enable_direct(_DEPTH_CLAMP)
            context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            opacity = 1.0 if tested else HIDDEN
            for tint, wide, share in ((RIM_COLOUR, RIM, 0.6), (COLOUR, WIDTH, 1.0)):
                set_uniforms(program, tint=tint, size=wide * drawing.pixel_ratio, opacity=share * opacity)
                self._array.render(moderngl.LINES)
        context.disable_direct(_DEPTH_CLAMP)
        context.disable(moderngl.BLEND)
