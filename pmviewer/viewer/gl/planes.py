"""A plane of the frame as a texture, and drawing it: tone curves, false colours, differences of two pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame, Preview
from pmviewer.output.diagnostic_views import (
    DIAGNOSTICS,
    ERROR,
    GREY,
    HELD_WHILE_SHOWN,
    LUMINANCE,
    DiagnosticView,
    scalar,
    told,
)
from pmviewer.output.false_look import Histogram, Look, histogram, look_of
from pmviewer.output.falsecolour import Scale
from pmviewer.output.marks import CUT, Marks, radiance_marks
from pmviewer.output.shading import shades
from pmviewer.output.tone import depth_bounds
from pmviewer.settings.access import Display
from pmviewer.viewer.gl.colour_tables import COLOUR_UNIT, ColourTables, row_of
from pmviewer.viewer.gl.pair import PairPlanes
from pmviewer.viewer.gl.program import Shaders, set_uniforms
from pmviewer.viewer.gl.textures import HeldTexture, Same

_CONTENT = {"albedo": 1, "normal": 2, "depth": 3}
_QUANTITY, _CELLS, _CLASSES = 5, 6, 7
_CURVE = {"sRGB": 0, "Reinhard": 1, "filmic": 2, "linear": 3}
SHADE_UNIT = 3
NEAREST_FROM = 3.0
"""Magnification from which pixels are shown as squares."""
RADIANCE = frozenset(("beauty", "emission", "direct", "specular", "caustic", "indirect", "reference", "denoised"))
"""Views that exposure and tone curve apply to."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A view in false colours as it is shown: what it is, its scale, its values' histogram, and the colours' table."""

    info: DiagnosticView
    look: Look
    scale: Scale
    histogram: Histogram

    @property
    def table(self) -> NDArray[np.float32]:
        """(256, 3)."""
        return self.look.table(self.info.own)

    @property
    def marks(self) -> Marks:
        """What lies beyond the colours' ends is clipped."""
        h = self.histogram
        return Marks(h.broken, 0, h.below + h.above, h.total + h.broken)


def false_view(view: str) -> DiagnosticView | None:
    """What a view shows in false colours, None for one that shows none."""
    return ERROR if view == "error" else DIAGNOSTICS.get(view)


class Planes:
    """The frame's plane, the reference, a pair to compare and its difference. Every method needs the window's OpenGL
    context."""

    def __init__(self, shaders: Shaders) -> None:
        self._context = shaders.context
        self._shaders = shaders
        self._triangle = shaders.array("picture", [])
        self._program = self._triangle.program
        self._colours = ColourTables(self._context)
        self.reference = HeldTexture(self._context)
        self.pair = PairPlanes(self._context)
        self.depth_range = (0.0, 1.0)
        self.shown: Shown | None = None
        """Of the view in false colours, or of the difference."""
        self.marks: Marks | None = None
        """Of a view of radiance while marks are drawn."""
        self._plane, self._shade = HeldTexture(self._context), HeldTexture(self._context)
        self._values: tuple[Hashable, NDArray[np.float32]] = None, np.empty((0, 0), np.float32)
        self._key: Hashable = None
        self._coarse = False

    @property
    def any(self) -> bool:
        """Whether a frame's plane is there."""
        return self._plane.texture is not None

    def upload(self, frame: Frame, display: Display, reference: NDArray[np.float32] | None) -> bool:
        """Take that view of the frame. True when it is another one than before."""
        view = display.view
        if view == "geometry":
            return False
        info = false_view(view)
        if info is not None and (view in frame.diagnostics or (view == "error" and reference is not None)):
            changed = self._shade.take(frame.serial, lambda: shades(frame.image("normal"), frame.camera))
            truth = reference if view == "error" else None
            key: Hashable = (frame.serial, view, Same(truth))
            values = _error_of(frame, truth) if truth is not None else lambda: frame.image(view)
            return self._take_false(key, values, info, look_of(display)) or changed
        self.shown = None
        if view == "reference" or info is not None or (view in HELD_WHILE_SHOWN and view not in frame.diagnostics):
            view = "beauty"  # the reference is there already; the others are shown once they are there
        preview = preview_of(frame, display) if view == "beauty" else None
        key, self._coarse = (frame.serial, view, Same(preview)), frame.coarse and preview is None
        changed = self._plane.take(key, lambda: frame.image(view) if preview is None else preview.image)
        if view == "depth" and changed:
            self.depth_range = depth_bounds(frame.image(view))
        image = reference if display.view == "reference" else frame.image(view) if display.marks else None
        return self._count_marks(key, image, display) or changed

    def upload_difference(self, key: Hashable, values: NDArray[np.float32], info: DiagnosticView, look: Look) -> bool:
        """Take what two pictures differ by, (h, w). True when it is another one than before."""
        return self._take_false(key, lambda: values, info, look)

    def _take_false(
        self, key: Hashable, image: Callable[[], NDArray[np.floating]], info: DiagnosticView, look: Look
    ) -> bool:
        """Take a plane in false colours, with its scale and histogram."""
        self.marks, self._coarse = None, False
        changed = self._plane.take(key, lambda: self._kept(key, image()))
        if not changed and self.shown is not None and self.shown.look == look and self.shown.info is info:
            return False
        values = told(info, self._values[1])
        scale = look.scale(info.own, values) if info.in_colours else Scale(0.0, 1.0)
        self.shown = Shown(info, look, scale, histogram(values, scale))
        return True

    def _kept(self, key: Hashable, image: NDArray[np.floating]) -> NDArray[np.floating]:
        """The image as it is; its values stay at hand for other ranges of colours."""
        self._values = key, scalar(image[..., None] if image.ndim == 2 else image)
        return image

    def _count_marks(self, key: Hashable, image: NDArray[np.float32] | None, display: Display) -> bool:
        """Count the pixels that are marked, once for what they depend on."""
        if not display.marks or image is None or display.view not in RADIANCE or display.exposure == "auto":
            changed, self.marks, self._key = self.marks is not None, None, None
            return changed
        wanted = key, display.view, display.exposure, display.tone
        if wanted == self._key:
            return False
        self._key, self.marks = wanted, radiance_marks(image, float(display.exposure), display.tone)
        return True

    def forget(self) -> None:
        """Another scene: free the frame's plane. The reference and the pair are told apart by themselves."""
        self._plane.release()
        self._shade.release()
        self._values = None, np.empty((0, 0), np.float32)
        self.shown = self.marks = self._key = None

    def release(self) -> None:
        """Free everything that lies on the GPU."""
        self.forget()
        self.reference.release()
        self.pair.upload(None)
        self._colours.release()
        self._shaders.drop(self._triangle)

    def draw(self, display: Display, width: int, other: moderngl.Texture | None = None, plain: bool = False) -> None:
        """Draw the frame's plane, or another picture, into the bound framebuffer's viewport, `width` pixels wide.
        `plain`: nothing lies under false colours."""
        plane = other or (self.reference.texture if display.view == "reference" else self._plane.texture)
        assert plane is not None
        coarse = self._coarse and display.view != "reference" and other is None
        shown = self.shown if other is None and display.view != "reference" else None
        squares = (width / plane.width >= NEAREST_FROM and not coarse) or shown is not None
        sampling = moderngl.NEAREST if squares else moderngl.LINEAR
        plane.filter = (sampling, sampling)
        plane.use(0)
        shade = None if shown is None or plain else self._shade.texture
        if shade is not None:
            shade.filter = (moderngl.NEAREST, moderngl.NEAREST)
            shade.use(SHADE_UNIT)
        if shown is not None:
            self._colours.bind()
            self._set_false(shown, plane.components)
        set_uniforms(
            self._program,
            plane=0,
            content=_content(shown.info) if shown is not None else _CONTENT.get(display.view, 0),
            curve=_CURVE[display.tone],
            scale=2.0 ** (0.0 if display.exposure == "auto" else float(display.exposure)),
            depth_range=self.depth_range,
            colours=COLOUR_UNIT,
            shades=SHADE_UNIT,
            shading=display.shading if shade is not None else 0.0,
            grey=GREY,
            marks=int(display.marks),
            cut=min(CUT[display.tone], 1e30),
        )
        self._context.disable(moderngl.DEPTH_TEST)
        self._triangle.render(moderngl.TRIANGLES, vertices=3)

    def _set_false(self, shown: Shown, components: int) -> None:
        scale = shown.scale
        low, high = scale.lower, scale.upper
        set_uniforms(
            self._program,
            value_range=(math.log(low), math.log(high)) if scale.log else (low, high),
            value_log=int(scale.log),
            value_signed=int(shown.info.signed),
            value_weights=LUMINANCE if components == 3 else (1.0, 0.0, 0.0),
            colour_row=row_of(shown.table),
            class_colours=shown.look.class_colours,
        )


def preview_of(frame: Frame, display: Display) -> Preview | None:
    """What is shown in place of the frame's beauty, None for the beauty itself, whose pixels alone are marked."""
    return frame.preview if display.preview != "off" and not display.marks else None


def _content(info: DiagnosticView) -> int:
    return _CLASSES if info.classes else _CELLS if info.cells else _QUANTITY


def _error_of(frame: Frame, truth: NDArray[np.float32]) -> Callable[[], NDArray[np.float32]]:
    """The error of each of the reference's pixels, of a picture that may be coarser."""

    def error() -> NDArray[np.float32]:
        from pmviewer.output.metric import squared_error

        image, (height, width) = frame.image(), truth.shape[:2]
        rows, columns = np.arange(height) * image.shape[0] // height, np.arange(width) * image.shape[1] // width
        with np.errstate(invalid="ignore", over="ignore"):
            return squared_error(image[rows][:, columns], truth).astype(np.float32)

    return error
