"""What the viewport shows, drawn into a framebuffer of its own: a plane of the frame or the shaded geometry, and the
overlays over it, with the same camera to the pixel."""

from __future__ import annotations

import moderngl

from pmviewer.output.false_look import look_of
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import Display, Settings
from pmviewer.viewer.gl.framebuffers import Framebuffers
from pmviewer.viewer.gl.planes import Planes
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.gl.surfaces import Surfaces
from pmviewer.viewer.overlays.layers import Layers
from pmviewer.viewer.pair import BESIDE, DIFFERENCE, FLIP, WIPE, ShownPair
from pmviewer.viewer.viewport.target import Target, clip_planes

SURROUND = (0.105, 0.105, 0.105)
BEHIND_POINTS = 0.3
"""Surfaces are this bright under points, which would drown on white walls."""
NAVIGATION_LIMIT = 30_000
"""Points drawn while the camera moves, on a driver without a GPU."""


class Picture:
    """Everything of the viewport that lies on the GPU. Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.software = any(name in context.info["GL_RENDERER"].lower() for name in ("llvmpipe", "softpipe", "swrast"))
        self._shaders = Shaders(context)
        self.planes = Planes(self._shaders)
        self.surfaces = Surfaces(self._shaders)
        self.layers = Layers(self._shaders)
        self.framebuffers = Framebuffers(context)

    def forget_frame(self) -> None:
        """Another scene: what was uploaded of the last one is stale, and freed."""
        self.planes.forget()
        self.layers.forget()
        self.framebuffers.drop("capture")

    def rest(self) -> None:
        """Once per window frame, after drawing: free what only compiling shaders needs."""
        self._shaders.rest()

    def release(self) -> None:
        """Free everything."""
        self.forget_frame()
        self.planes.release()
        self.surfaces.release()
        self.framebuffers.release()
        self._shaders.release()

    def draw(
        self,
        name: str,
        target: Target,
        camera: CameraPose | None,
        display: Display,
        overlays: Settings | None,
        *,
        navigating: bool = False,
        pair: ShownPair | None = None,
    ) -> moderngl.Texture:
        """Draw into the framebuffer of that name and return its colour texture (rows bottom to top).

        `camera` is the frame's; None draws the surround alone. `overlays` are the settings that tell which overlays
        are drawn and how, None leaves them out. With a `pair`, whose pictures are uploaded, it is drawn instead of the
        frame.
        """
        framebuffer = self.framebuffers.get(name, target.size)
        framebuffer.scissor = (0, 0, *framebuffer.size)
        framebuffer.viewport = (0, 0, *framebuffer.size)
        framebuffer.use()
        framebuffer.clear(*SURROUND, 1.0)
        colour = framebuffer.color_attachments[0]
        assert isinstance(colour, moderngl.Texture)
        clip = target.clip
        if clip is None or (camera is None and pair is None):
            return colour
        framebuffer.viewport = target.viewport
        framebuffer.scissor = clip
        if pair is not None and self.planes.pair.planes:
            self._draw_pair(framebuffer, target, display, pair)
            return colour
        if camera is None:
            return colour
        self._draw_one(framebuffer, target, camera, display, overlays, navigating)
        self.context.disable(moderngl.DEPTH_TEST)
        return colour

    def _draw_pair(self, framebuffer: moderngl.Framebuffer, target: Target, display: Display, pair: ShownPair) -> None:
        """The pictures of the pair as their mode says, or their difference once it is there."""
        first, second = self.planes.pair.planes
        width = target.picture[2]
        if pair.mode == BESIDE:
            for number, plane in enumerate((first, second)):
                pane, offset = target.pane(number)
                if pane.clip is not None:
                    framebuffer.viewport = (pane.viewport[0] + offset, *pane.viewport[1:])
                    framebuffer.scissor = (pane.clip[0] + offset, *pane.clip[1:])
                    framebuffer.use()
                    self.planes.draw(display, width, plane)
            return
        framebuffer.use()
        if pair.mode == WIPE:
            self._draw_wipe(framebuffer, target, display, pair.split)
        elif pair.mode == DIFFERENCE and self.planes.shown is not None:
            self.planes.draw(display, width, plain=True)
        else:
            self.planes.draw(display, width, second if pair.mode == FLIP and pair.second else first)

    def _draw_wipe(self, framebuffer: moderngl.Framebuffer, target: Target, display: Display, split: float) -> None:
        """The two pictures of the pair on both sides of the split."""
        assert target.clip is not None
        left, _, width, _ = target.picture
        x, y, w, h = target.clip
        middle = min(max(round(left + split * width), x), x + w)
        for plane, start, end in zip(self.planes.pair.planes, (x, middle), (middle, x + w), strict=True):
            if end > start:
                framebuffer.scissor = (start, y, end - start, h)
                framebuffer.use()
                self.planes.draw(display, width, plane)

    def _draw_one(
        self,
        framebuffer: moderngl.Framebuffer,
        target: Target,
        camera: CameraPose,
        display: Display,
        overlays: Settings | None,
        navigating: bool,
    ) -> None:
        """The frame's plane or the surfaces, and the overlays."""
        near, far = clip_planes(camera, self.surfaces.center, self.surfaces.radius)
        view, projection = camera.view_matrix(), camera.cut_projection(near, far)
        as_geometry = display.view == "geometry" or not self.planes.any
        if as_geometry:
            covered = overlays is not None and self.layers.cover_surfaces(overlays)
            self.surfaces.draw(view, projection, BEHIND_POINTS if covered else 1.0)
        else:
            self.planes.draw(display, target.picture[2])
        if overlays is None or not self.layers.shown(overlays):
            return
        if not as_geometry and self.layers.need_depth(overlays):
            self.surfaces.draw_depth(framebuffer, view, projection)
        limit = NAVIGATION_LIMIT if navigating and self.software else None
        look, size = look_of(display), target.picture[2:]
        self.layers.draw(framebuffer, Drawing(view, projection, size, target.pixel_ratio, limit, look), overlays)
