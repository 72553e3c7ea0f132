"""A plane of the frame as a texture, and drawing it: tone curves, false colours, errors against the reference."""

from __future__ import annotations

import math

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame
from pmviewer.output.diagnostic_views import (
    CLASS_COLOURS,
    DIAGNOSTICS,
    GREY,
    HELD_WHILE_SHOWN,
    LUMINANCE,
    view_scale,
)
from pmviewer.output.falsecolour import ERROR_SCALE, Scale
from pmviewer.output.shading import shades
from pmviewer.output.tone import depth_bounds
from pmviewer.settings.access import Display
from pmviewer.viewer.gl.pair import PairPlanes
from pmviewer.viewer.gl.program import Shaders, set_uniforms
from pmviewer.viewer.gl.reference_plane import COLOUR_UNIT, REFERENCE_UNIT, ReferencePlane

_CONTENT = {"albedo": 1, "normal": 2, "depth": 3, "error": 4} | {
    view: 7 if info.classes else 6 if info.cells else 5 for view, info in DIAGNOSTICS.items()
}
_CURVE = {"sRGB": 0, "Reinhard": 1, "filmic": 2, "linear": 3}
SHADE_UNIT = 3
NEAREST_FROM = 3.0
"""Magnification from which pixels are shown as squares."""


class Planes:
    """The frame's plane, the reference and a pair to compare. Every method needs the window's OpenGL context."""

    def __init__(self, shaders: Shaders) -> None:
        self._context = shaders.context
        self._program = shaders.get("picture")
        self._triangle = self._context.vertex_array(self._program, [])
        self.reference = ReferencePlane(self._context)
        self.pair = PairPlanes(self._context)
        self.depth_range = (0.0, 1.0)
        self.scale = Scale(0.0, 1.0)
        """Of the diagnostic view that is shown."""
        self._plane: moderngl.Texture | None = None
        self._shade: moderngl.Texture | None = None
        self._shade_of = -1
        self._shown: tuple[int, str] | None = None
        self._coarse = False

    @property
    def any(self) -> bool:
        """Whether a frame's plane is there."""
        return self._shown is not None

    def upload(self, frame: Frame, view: str) -> bool:
        """Take that view of the frame. True when it is another one than before."""
        shaded = (view == "error" or (view in DIAGNOSTICS and view in frame.diagnostics)) and self._upload_shades(frame)
        if view in ("reference", "error"):
            view = "beauty"  # the error is that of the image; the reference is there already
        if view in HELD_WHILE_SHOWN and view not in frame.diagnostics:
            view = "beauty"  # until it is there
        if view == "geometry" or self._shown == (frame.serial, view):
            return shaded
        image = frame.image(view)
        if view == "depth":
            self.depth_range = depth_bounds(image)
        elif view in DIAGNOSTICS:
            self.scale = view_scale(view, image)
        self._plane = self._written(self._plane, image)
        self._shown, self._coarse = (frame.serial, view), frame.coarse
        return True

    def _upload_shades(self, frame: Frame) -> bool:
        """What lies under false colours. True when it is another frame's than before."""
        if self._shade_of == frame.serial:
            return False
        shade = shades(frame.image("normal"), frame.camera)[..., None]
        self._shade, self._shade_of = self._written(self._shade, shade), frame.serial
        return True

    def _written(self, plane: moderngl.Texture | None, image: NDArray[np.float32]) -> moderngl.Texture:
        """The texture with the image (h, w, channels) in it, another one where it has another shape."""
        height, width, channels = image.shape
        if plane is None or plane.size != (width, height) or plane.components != channels:
            if plane is not None:
                plane.release()
            plane = self._context.texture((width, height), channels, dtype="f4", alignment=4)
            plane.repeat_x = plane.repeat_y = False
        plane.write(np.ascontiguousarray(image, np.float32))
        return plane

    def _free(self) -> None:
        for plane in (self._plane, self._shade):
            if plane is not None:
                plane.release()
        self._plane = self._shade = None
        self._shade_of = -1

    def forget(self) -> None:
        """Another scene: free the frame's plane. The reference and the pair are told apart by themselves."""
        self._free()
        self._shown = None

    def release(self) -> None:
        """Free everything that lies on the GPU."""
        self.forget()
        self.reference.release()
        self.pair.upload(None, "")
        self._triangle.release()

    def draw(self, display: Display, width: int, other: moderngl.Texture | None = None) -> None:
        """Draw the frame's plane, or another one of the same kind, into the bound framebuffer's viewport, `width`
        pixels wide."""
        plane = other or (self.reference.texture if display.view == "reference" else self._plane)
        assert plane is not None
        coarse = self._coarse and display.view != "reference" and other is None
        diagnostic = DIAGNOSTICS.get(display.view)
        squares = (width / plane.width >= NEAREST_FROM and not coarse) or display.view == "error" or diagnostic
        sampling = moderngl.NEAREST if squares else moderngl.LINEAR
        plane.filter = (sampling, sampling)
        plane.use(0)
        if display.view == "error" or diagnostic:
            self.reference.bind()
        is_false = bool(display.view == "error" or diagnostic) and self._shade is not None
        if is_false:
            assert self._shade is not None
            self._shade.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._shade.use(SHADE_UNIT)
        low, high = self.scale.lower, self.scale.upper
        set_uniforms(
            self._program,
            plane=0,
            content=_CONTENT.get(display.view, 0),
            curve=_CURVE[display.tone],
            scale=2.0 ** (0.0 if display.exposure == "auto" else float(display.exposure)),
            depth_range=self.depth_range,
            reference=REFERENCE_UNIT,
            colours=COLOUR_UNIT,
            shades=SHADE_UNIT,
            shading=display.shading if is_false else 0.0,
            error_range=(math.log(ERROR_SCALE.lower), math.log(ERROR_SCALE.upper)),
            value_range=(math.log(low), math.log(high)) if self.scale.log else (low, high),
            value_log=int(self.scale.log),
            value_weights=LUMINANCE if plane.components == 3 else (1.0, 0.0, 0.0),
            grey=GREY,
            colour_row=int(diagnostic is not None and diagnostic.diverging),
            class_colours=CLASS_COLOURS,
        )
        self._context.disable(moderngl.DEPTH_TEST)
        self._triangle.render(moderngl.TRIANGLES, vertices=3)
