"""What the viewport shows, drawn into a framebuffer of its own: a plane of the frame or the shaded geometry, and the
photon maps over it, with the same camera to the pixel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame, PhotonCloud
from pmviewer.output.diagnostic_views import CLASS_COLOURS, DIAGNOSTICS, GREY, LUMINANCE, view_scale
from pmviewer.output.falsecolour import ERROR_SCALE, Scale
from pmviewer.output.tone import depth_bounds
from pmviewer.render.camera import CameraPose, Matrix
from pmviewer.settings.access import (
    CacheOverlay,
    Display,
    FateOverlay,
    GatherOverlay,
    LightOverlay,
    Overlays,
    PathOverlay,
    PointOverlay,
    ProjectionOverlay,
)
from pmviewer.viewer.gl.lines import LineCloud, circles, flights, gather_lines, light_points
from pmviewer.viewer.gl.pair import PairPlanes
from pmviewer.viewer.gl.program import load_program, set_uniforms
from pmviewer.viewer.gl.reference_plane import COLOUR_UNIT, REFERENCE_UNIT, ReferencePlane
from pmviewer.viewer.overlays.cells import CellCloud
from pmviewer.viewer.overlays.frustum import FrustumLines
from pmviewer.viewer.overlays.overlays import PointCloud

if TYPE_CHECKING:
    from pmviewer.photons.emission.light_importance import LightImportance
    from pmviewer.photons.light_pass.paths import PhotonPaths
    from pmviewer.photons.projection.projection import ProjectionMap

CLOUDS = ("caustic", "global", "radiance", "cache", "shadow", "importons")
"""Clouds that a frame has whether or not they are shown; 'fates' and 'lights' are made while they are."""
SURROUND = (0.105, 0.105, 0.105)
_CONTENT = {"albedo": 1, "normal": 2, "depth": 3, "error": 4} | {
    view: 7 if how.classes else 6 if how.cells else 5 for view, how in DIAGNOSTICS.items()
}
_CURVE = {"sRGB": 0, "Reinhard": 1, "filmic": 2, "linear": 3}
BEHIND_POINTS = 0.3
"""Surfaces are this bright under points, which would drown on white walls."""
NEAREST_FROM = 3.0
"""Magnification from which pixels are shown as squares."""
GATHER_ENDS = 1 << 16
"""Most ends of gather rays that are drawn: all of them."""
NAVIGATION_LIMIT = 30_000
"""Points drawn while the camera moves, on a driver without a GPU."""


@dataclass(frozen=True)
class Target:
    """Where to draw: framebuffer `size` in pixels and the picture's rectangle in it (left, top, width, height), which
    may reach beyond when the user zooms in. `pixel_ratio` scales point sizes (HiDPI)."""

    size: tuple[int, int]
    picture: tuple[int, int, int, int]
    pixel_ratio: float = 1.0


def clip_planes(camera: CameraPose, center: NDArray[np.floating], radius: float) -> tuple[float, float]:
    """Near and far distance that enclose a bounding sphere as tightly as the depth buffer needs."""
    if camera.orthographic:
        depth = float((center - np.asarray(camera.origin, float)) @ camera.axes()[2])
        far = max(depth + radius, 1e-3 * radius) * 1.01
        return max(depth - radius, 0.0) * 0.99, far
    distance = float(np.linalg.norm(np.asarray(camera.origin, float) - center))
    far = (distance + radius) * 1.01
    return max((distance - radius) * 0.99, far * 1e-3), far


class Picture:
    """Textures and buffers of the viewport. Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        context.gc_mode = "auto"
        self.software = any(name in context.info["GL_RENDERER"].lower() for name in ("llvmpipe", "softpipe", "swrast"))
        self.clouds = {name: PointCloud(context) for name in (*CLOUDS, "fates", "lights")}
        self.paths = LineCloud(context)
        self.gathered = LineCloud(context)
        self.gather_ends = PointCloud(context)
        self.circles = LineCloud(context)
        self.cells = CellCloud(context)
        self.frustum = FrustumLines(context)
        self._drawn_ways: dict[str, Any] = {}
        self.depth_range = (0.0, 1.0)
        self.scale = Scale(0.0, 1.0)
        """Of the diagnostic view that is shown."""
        self.reference = ReferencePlane(context)
        self.pair = PairPlanes(context)
        self._picture_program = load_program(context, "picture")
        self._geometry_program = load_program(context, "geometry")
        self._triangle = context.vertex_array(self._picture_program, [])
        self._plane: moderngl.Texture | None = None
        self._shown: tuple[int, str] | None = None
        self._coarse = False
        self._geometry: Any = None
        self._geometry_array: moderngl.VertexArray | None = None
        self._center, self._radius = np.zeros(3), 1.0
        self._framebuffers: dict[str, moderngl.Framebuffer] = {}

    # data -------------------------------------------------------------------------------------------------------

    def upload_frame(self, frame: Frame, view: str, shown_clouds: Mapping[str, bool]) -> bool:
        """Bring the plane of that view and the clouds that are switched on to the GPU. True when anything changed."""
        changed = False
        if view in ("reference", "error"):
            view = "beauty"  # the error is that of the image; the reference is there already
        if view in DIAGNOSTICS and view not in frame.diagnostics:
            view = "beauty"  # until it is there
        if view != "geometry" and self._shown != (frame.serial, view):
            self._upload_plane(frame.image(view), view)
            self._shown, self._coarse = (frame.serial, view), frame.coarse
            changed = True
        for name in CLOUDS:
            if shown_clouds[name]:
                changed |= self.clouds[name].upload(frame.clouds.get(name))
        return changed

    def _upload_plane(self, image: NDArray[np.float32], view: str) -> None:
        height, width, channels = image.shape
        if view == "depth":
            self.depth_range = depth_bounds(image)
        elif view in DIAGNOSTICS:
            self.scale = view_scale(view, image)
        plane = self._plane
        if plane is None or plane.size != (width, height) or plane.components != channels:
            if plane is not None:
                plane.release()
            plane = self._plane = self.context.texture((width, height), channels, dtype="f4", alignment=4)
            plane.repeat_x = plane.repeat_y = False
        plane.write(np.ascontiguousarray(image, np.float32))

    def upload_geometry(self, geometry: Any) -> bool:
        """Take a `DrawGeometry` (or None). True when it is another one than before."""
        if geometry is self._geometry:
            return False
        self._geometry = geometry
        if self._geometry_array is not None:
            self._geometry_array.release()
        self._geometry_array = None
        if geometry is not None and len(geometry.vertices):
            data = np.hstack([geometry.vertices, geometry.normals, geometry.albedo]).astype(np.float32)
            buffer = self.context.buffer(np.ascontiguousarray(data))
            names = [(n, n in self._geometry_program) for n in ("position", "normal", "albedo")]
            layout = " ".join("3f4" if used else "12x1" for _, used in names)
            attributes = [n for n, used in names if used]
            self._geometry_array = self.context.vertex_array(self._geometry_program, [(buffer, layout, *attributes)])
            self._center, self._radius = np.asarray(geometry.center, float), float(geometry.radius)
        return True

    def upload_paths(self, paths: PhotonPaths | None, style: PathOverlay) -> bool:
        """Take the photon paths as far as they are drawn. True when anything changed."""
        if not self._is_new("paths", (paths, style.first, style.length) if style.show else None):
            return False
        if paths is None or not style.show:
            self.paths.upload(None)
        else:
            self.paths.upload(flights(paths, style.first, style.length), paths.power_unit)
        return True

    def upload_gathered(self, rows: NDArray[np.float32] | None, style: GatherOverlay) -> bool:
        """Take a pixel's gather rays. True when anything changed."""
        if not self._is_new("gathered", (rows,) if style.show else None):
            return False
        if rows is None or not style.show:
            self.gathered.upload(None)
            self.gather_ends.upload(None)
        else:
            ends, unit = gather_lines(rows)
            self.gathered.upload(ends, unit)
            self.gather_ends.upload(PhotonCloud(np.ascontiguousarray(ends[1::2]), unit))
        return True

    def upload_circles(self, cloud: PhotonCloud | None, style: CacheOverlay) -> bool:
        """Take the circles of the cache's records. True when anything changed."""
        shown = style.show and style.circles
        if not self._is_new("circles", (cloud,) if shown else None):
            return False
        if shown and cloud is not None and cloud.reach is not None and len(cloud.photons):
            self.circles.upload(circles(cloud.photons, cloud.reach))
        else:
            self.circles.upload(None)
        return True

    def upload_fates(self, photons: NDArray[np.float32] | None, style: FateOverlay) -> bool:
        """Take photons with their fates. True when anything changed."""
        if not self._is_new("fates", (photons,) if style.show else None):
            return False
        return self.clouds["fates"].upload(PhotonCloud(photons, 1.0) if style.show and photons is not None else None)

    def upload_lights(
        self, lights: LightImportance | None, places: NDArray[np.float64] | None, style: LightOverlay
    ) -> bool:
        """Take the lights' importance. True when anything changed."""
        if not self._is_new("lights", (lights, places) if style.show else None):
            return False
        shown = style.show and lights is not None and places is not None
        return self.clouds["lights"].upload(light_points(lights, places) if shown else None)  # type: ignore[arg-type]

    def upload_cells(self, maps: Mapping[str, Sequence[ProjectionMap]], style: ProjectionOverlay) -> bool:
        """Take the lights' projection maps. True when anything changed."""
        key = (maps.get(style.map), style.size, self._radius) if style.show else None
        if not self._is_new("cells", key):
            return False
        self.cells.upload(maps.get(style.map, ()) if style.show else (), style.size * self._radius)
        return True

    def _is_new(self, what: str, key: tuple[Any, ...] | None) -> bool:
        """Whether that is another one than was uploaded last. Arrays count as themselves, not by their values."""
        before = self._drawn_ways.get(what)
        same = (before is None) == (key is None)
        if same and before is not None and key is not None:
            same = all(a is b or (isinstance(a, int | float) and a == b) for a, b in zip(before, key, strict=True))
        self._drawn_ways[what] = key
        return not same

    def forget_frame(self) -> None:
        """Another scene: what was uploaded of the last one is stale."""
        self._shown = None
        for cloud in self.clouds.values():
            cloud.release()
        for ways in (self.paths, self.gathered, self.gather_ends, self.circles, self.cells):
            ways.release()
        self._drawn_ways.clear()

    @property
    def has_plane(self) -> bool:
        return self._shown is not None

    @property
    def has_geometry(self) -> bool:
        return self._geometry_array is not None

    @property
    def plane_size(self) -> tuple[int, int]:
        """Pixels of the uploaded plane; fewer than the image's when the frame is coarse."""
        return self._plane.size if self._plane is not None else (1, 1)

    # drawing ----------------------------------------------------------------------------------------------------

    def draw(
        self,
        name: str,
        target: Target,
        camera: CameraPose | None,
        display: Display,
        overlays: Overlays | None,
        *,
        navigating: bool = False,
        split: float | None = None,
    ) -> moderngl.Texture:
        """Draw into the framebuffer of that name and return its colour texture (rows bottom to top).

        `camera` is the frame's; None draws the surround alone. `overlays` None leaves the points out. With
        `split` the uploaded pair is drawn instead of the frame: its first picture up to that share of the width.
        """
        framebuffer = self._framebuffer(name, target.size)
        framebuffer.scissor = (0, 0, *framebuffer.size)
        framebuffer.viewport = (0, 0, *framebuffer.size)
        framebuffer.use()
        framebuffer.clear(*SURROUND, 1.0)
        colour = framebuffer.color_attachments[0]
        assert isinstance(colour, moderngl.Texture)
        if camera is None:
            return colour
        left, top, width, height = target.picture
        clip = _clip(target)
        if clip is None:
            return colour
        framebuffer.viewport = (left, target.size[1] - top - height, width, height)
        framebuffer.scissor = clip
        near, far = clip_planes(camera, self._center, self._radius)
        view, projection = camera.view_matrix(), camera.cut_projection(near, far)
        if split is not None and self.pair.planes:
            self._draw_pair(framebuffer, target, clip, display, split)
            return colour
        as_geometry = display.view == "geometry" or not self.has_plane
        if as_geometry:
            points = overlays is not None and overlays.any_shown
            self._draw_geometry(view, projection, BEHIND_POINTS if points else 1.0)
        else:
            self._draw_plane(display, width)
        if overlays is not None:
            self._draw_points(framebuffer, overlays, view, projection, target.pixel_ratio, navigating)
            self._draw_frustum(framebuffer, view, projection, target.pixel_ratio, overlays)
        self.context.disable(moderngl.DEPTH_TEST)
        return colour

    def _draw_pair(
        self,
        framebuffer: moderngl.Framebuffer,
        target: Target,
        clip: tuple[int, int, int, int],
        display: Display,
        split: float,
    ) -> None:
        """The two pictures of the pair on both sides of the split."""
        left, _, width, _ = target.picture
        x, y, w, h = clip
        middle = min(max(round(left + split * width), x), x + w)
        for plane, start, end in zip(self.pair.planes, (x, middle), (middle, x + w), strict=True):
            if end > start:
                framebuffer.scissor = (start, y, end - start, h)
                framebuffer.use()
                self._draw_plane(display, width, plane)

    def _draw_plane(self, display: Display, width: int, other: moderngl.Texture | None = None) -> None:
        """The frame's plane, or another one of the same kind."""
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
        low, high = self.scale.lower, self.scale.upper
        set_uniforms(
            self._picture_program,
            plane=0,
            content=_CONTENT.get(display.view, 0),
            curve=_CURVE[display.tone],
            scale=2.0 ** (0.0 if display.exposure == "auto" else float(display.exposure)),
            depth_range=self.depth_range,
            reference=REFERENCE_UNIT,
            colours=COLOUR_UNIT,
            error_range=(math.log(ERROR_SCALE.lower), math.log(ERROR_SCALE.upper)),
            value_range=(math.log(low), math.log(high)) if self.scale.log else (low, high),
            value_log=int(self.scale.log),
            value_weights=LUMINANCE if plane.components == 3 else (1.0, 0.0, 0.0),
            grey=GREY,
            colour_row=int(diagnostic is not None and diagnostic.diverging),
            class_colours=CLASS_COLOURS,
        )
        self.context.disable(moderngl.DEPTH_TEST)
        self._triangle.render(moderngl.TRIANGLES, vertices=3)

    def _draw_geometry(self, view: Matrix, projection: Matrix, brightness: float = 1.0) -> None:
        """Surfaces, pushed back a little in depth so that they don't fight with the points that lie on them."""
        if self._geometry_array is None:
            return
        self.context.enable_only(moderngl.DEPTH_TEST)
        self.context.polygon_offset = (1.0, 1.0)
        set_uniforms(self._geometry_program, view=view, projection=projection, brightness=brightness)
        self._geometry_array.render(moderngl.TRIANGLES)
        self.context.polygon_offset = (0.0, 0.0)

    def _draw_points(
        self,
        framebuffer: moderngl.Framebuffer,
        overlays: Overlays,
        view: Matrix,
        projection: Matrix,
        pixel_ratio: float,
        navigating: bool,
    ) -> None:
        styles = overlays.by_map()
        if not overlays.any_shown:
            return
        context = self.context
        if overlays.tests_depth:
            self._draw_depth(framebuffer, view, projection)
        for name, style in styles.items():
            if not style.show:
                continue
            context.enable_only(moderngl.PROGRAM_POINT_SIZE | (moderngl.DEPTH_TEST if style.depth else 0))
            limit = min(style.limit, NAVIGATION_LIMIT) if navigating and self.software else style.limit
            self.clouds[name].draw(style, view, projection, limit, pixel_ratio)
        self._draw_ways(framebuffer, overlays, view, projection, pixel_ratio)

    def _draw_ways(
        self,
        framebuffer: moderngl.Framebuffer,
        overlays: Overlays,
        view: Matrix,
        projection: Matrix,
        pixel_ratio: float,
    ) -> None:
        """Cells, circles and lines, which are translucent and leave the depth buffer as it is."""
        framebuffer.depth_mask = False
        framebuffer.use()
        enable, viewport = self.context.enable_only, framebuffer.viewport[2:]
        cells, cache, paths, gather = overlays.projection, overlays.cache, overlays.paths, overlays.gather
        if cells.show:
            enable(moderngl.DEPTH_TEST if cells.depth else 0)
            self.cells.draw(cells, view, projection)
        if cache.show and cache.circles:
            enable(moderngl.DEPTH_TEST if cache.depth else 0)
            self.circles.draw(pixel_ratio, "power", view, projection, viewport, flow=False)
        if paths.show:
            enable(moderngl.DEPTH_TEST if paths.depth else 0)
            self.paths.draw(paths.size * pixel_ratio, paths.colour, view, projection, viewport)
        if gather.show:
            enable(moderngl.DEPTH_TEST if gather.depth else 0)
            self.gathered.draw(gather.size * pixel_ratio, gather.colour, view, projection, viewport, flow=False)
            enable(moderngl.PROGRAM_POINT_SIZE | (moderngl.DEPTH_TEST if gather.depth else 0))
            colour: Literal["light", "power"] = "light" if gather.colour == "source" else "power"
            ends = PointOverlay(size=min(3.0 * gather.size, 12.0), colour=colour)
            self.gather_ends.draw(ends, view, projection, GATHER_ENDS, pixel_ratio)
        framebuffer.depth_mask = True
        framebuffer.use()

    def _draw_frustum(
        self,
        framebuffer: moderngl.Framebuffer,
        view: Matrix,
        projection: Matrix,
        pixel_ratio: float,
        overlays: Overlays,
    ) -> None:
        if not self.frustum.shown:
            return
        if not overlays.tests_depth:  # else surfaces are in the depth buffer already
            self._draw_depth(framebuffer, view, projection)
        framebuffer.depth_mask = False
        framebuffer.use()
        self.frustum.draw(view, projection, framebuffer.viewport[2:], pixel_ratio)
        framebuffer.depth_mask = True
        framebuffer.use()

    def _draw_depth(self, framebuffer: moderngl.Framebuffer, view: Matrix, projection: Matrix) -> None:
        """Surfaces into the depth buffer alone. moderngl hands a framebuffer's mask to OpenGL when it is bound."""
        framebuffer.color_mask = (False, False, False, False)
        framebuffer.use()
        self._draw_geometry(view, projection)
        framebuffer.color_mask = (True, True, True, True)
        framebuffer.use()

    def read(self, name: str) -> NDArray[np.uint8]:
        """(height, width, 3) of what was drawn into that framebuffer, top row first."""
        framebuffer = self._framebuffers[name]
        width, height = framebuffer.size
        pixels = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8).reshape(height, width, 3)
        return np.ascontiguousarray(pixels[::-1])

    def _framebuffer(self, name: str, size: tuple[int, int]) -> moderngl.Framebuffer:
        """A colour and depth buffer of that size; another size replaces it."""
        size = (max(size[0], 1), max(size[1], 1))
        old = self._framebuffers.get(name)
        if old is not None and old.size == size:
            return old
        if old is not None:
            old.color_attachments[0].release()
            old.depth_attachment.release()
            old.release()
        colour = self.context.texture(size, 4)
        colour.filter = (moderngl.NEAREST, moderngl.NEAREST)  # shown pixel for pixel
        new = self.context.framebuffer([colour], self.context.depth_renderbuffer(size))
        self._framebuffers[name] = new
        return new


def _clip(target: Target) -> tuple[int, int, int, int] | None:
    """The part of the picture inside the framebuffer, as OpenGL's scissor wants it; None when nothing is."""
    left, top, width, height = target.picture
    x0, x1 = max(left, 0), min(left + width, target.size[0])
    y0, y1 = max(top, 0), min(top + height, target.size[1])
    if x1 <= x0 or y1 <= y0:
        return None
    return x0, target.size[1] - y1, x1 - x0, y1 - y0
