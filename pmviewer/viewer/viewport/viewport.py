"""The picture's panel: fits it into the panel, redraws it when something changed, and turns mouse and keys into camera
moves."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import moderngl
import numpy as np
from imgui_bundle import imgui

from pmviewer.engine.frame import Frame
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.output.difference_views import DIFFERENCES
from pmviewer.output.false_look import look_of
from pmviewer.render.camera import CameraPose, resolve_camera, size_only
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Display
from pmviewer.viewer.gl.pair import Keyed
from pmviewer.viewer.gl.textures import Same
from pmviewer.viewer.overlays.overlay import Source
from pmviewer.viewer.pair import BESIDE, FLIP, WIPE, ShownPair
from pmviewer.viewer.panels.widgets import SettingWidgets
from pmviewer.viewer.shortcuts import INSPECT_KEY, is_held
from pmviewer.viewer.sides import Side
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.viewport.gizmo import Gizmo
from pmviewer.viewer.viewport.hud import draw_hud
from pmviewer.viewer.viewport.legend import draw_settings_button
from pmviewer.viewer.viewport.navigation import DRAG_THRESHOLD, Clicks, Navigation
from pmviewer.viewer.viewport.picking import picked
from pmviewer.viewer.viewport.picture import Picture
from pmviewer.viewer.viewport.region import RegionDrag
from pmviewer.viewer.viewport.slice_handle import SliceHandle
from pmviewer.viewer.viewport.surroundings import STOPPED, Surroundings
from pmviewer.viewer.viewport.target import Fit, Target

VIEWPORT = "Viewport"
STOPPED_SECONDS = 1.5
SPLIT_REACH = 8.0
"""Points from the line between compared pictures at which a drag moves it."""


class Viewport:
    """`gui` lays out and handles the mouse; `render` runs before the next frame and draws when something changed."""

    def __init__(self, state: ViewerState) -> None:
        self.state = state
        self.picture: Picture | None = None
        self.fit = Fit()
        self.inspected: tuple[int, int] | None = None
        """The pixel whose gather rays are drawn."""
        self.alone = False
        """Whether the picture fills the window."""
        self.captions = True
        """Whether views are named in the picture."""
        self.redraws = 0
        """How often the picture was drawn: an idle window draws nothing."""
        self.origin = (0.0, 0.0)
        self.size = (0.0, 0.0)
        self.legend_end: float | None = None
        """Where the legend of false colours ends on the screen, None while there is none."""
        self._ratio = 1.0
        self._texture: moderngl.Texture | None = None
        self._drawn_key: Any = None
        self.surroundings = Surroundings()
        self.widgets = SettingWidgets(state.refused_view, state.choices)
        """Of the settings beside the legend."""
        self.gizmo = Gizmo(self)
        self.slice = SliceHandle(self)
        self._navigation = Navigation(self)
        self._clicks = Clicks()
        self._splitting = False
        self.region = RegionDrag(self)
        self._advice: tuple[Any, Scene, str] | None = None
        self.draw_toasts: Callable[[], None] = lambda: None

    # drawing ----------------------------------------------------------------------------------------------------

    def release(self) -> None:
        """Free what lies on the GPU; nothing is drawn any more."""
        if self.picture is not None:
            self.picture.release()
        self.picture = self._texture = None

    def source(self) -> Source:
        """What overlays take their data from."""
        state = self.state
        geometry = state.session.geometry
        radius = float(geometry.radius) if geometry is not None else 1.0
        camera = state.render_camera if geometry is not None else lambda: None
        return Source(
            state.settings, state.frame, radius, camera, self.inspected, state.inspector, state.loaded.photons
        )

    def shown_camera(self) -> CameraPose | None:
        """The frame's camera, so that points lie on the picture; the newest one when only geometry is shown."""
        gain = self.state.gain.frames()
        if gain is not None:
            return gain[0].camera
        frame = self.state.frame
        if frame is None or self.state.shown_display.view == "geometry":
            return self.state.live_camera() if self.state.session.geometry is not None else None
        return frame.camera

    def rectangle(self) -> tuple[float, float, float, float]:
        """The picture's left, top, width and height in the panel, in points; of two pictures the first
        one's."""
        camera = self.shown_camera()
        aspect = camera.width / camera.height if camera else 1.0
        pair = self.state.shown_pair()
        if pair is not None:
            aspect = pair.a.size[0] / pair.a.size[1]
        return self.fit.rectangle((self.size[0] / self.panes, self.size[1]), aspect)

    @property
    def panes(self) -> int:
        """Two while pictures are shown beside each other, else one."""
        pair = self.state.shown_pair()
        return 2 if pair is not None and pair.mode == BESIDE else 1

    def target(self) -> Target:
        """The panel in pixels."""
        left, top, width, height = (round(v * self._ratio) for v in self.rectangle())
        size = round(self.size[0] * self._ratio), round(self.size[1] * self._ratio)
        return Target(size, (left, top, max(width, 1), max(height, 1)), self._ratio)

    def render(self) -> None:
        """Bring the picture's texture up to date, if anything it shows has changed."""
        picture = self.picture
        if picture is None or min(self.size) < 1:
            return
        if self.state.scene_changed():
            picture.forget_frame()
            self.inspected = None
            self.state.inspector.unpin()
            self.fit = Fit()
        settings, frame = self.state.settings, self.state.frame
        changed = picture.surfaces.upload(self.state.session.geometry)
        self.surroundings.take(self.state.session.geometry, self.state.background)
        display, reference = self.state.shown_display, self.state.comparison.reference
        truth = reference.image if reference is not None else None
        same = None if truth is None else Same(truth)
        changed |= picture.planes.reference.take(same, lambda: np.asarray(truth))
        pair = self.state.shown_pair()
        changed |= picture.planes.pair.upload(_keyed(pair))
        difference = self.state.pair.current(pair) if pair is not None else None
        if pair is not None:
            display = pair.display
        if difference is not None:
            info, look = DIFFERENCES[difference.kind], look_of(display)
            changed |= picture.planes.upload_difference(difference.key, difference.values, info, look)
        elif frame is not None:
            changed |= picture.planes.upload(frame, display, truth)
        changed |= picture.layers.upload(self.source())
        camera, target = self.shown_camera(), self.target()
        navigating = self.state.navigating and picture.software
        compared = (pair.mode, pair.split, pair.second, *pair.keys) if pair is not None else None
        key = (camera, target, display, settings.overlays, settings.free_camera, navigating, compared)
        if changed or key != self._drawn_key:
            self._texture = picture.draw("window", target, camera, display, settings, navigating=navigating, pair=pair)
            self._drawn_key = key
            self.redraws += 1
        picture.rest()

    def capture(self, *, overlays: bool) -> np.ndarray | None:
        """(height, width, 3) uint8: the picture at its own resolution, with or without the points; of compared
        pictures what the viewport shows of them."""
        picture, camera = self.picture, self.shown_camera()
        if picture is None or camera is None:
            return None
        settings, pair = self.state.settings, self.state.shown_pair()
        size = (camera.width, camera.height) if pair is None else pair.a.size
        target = Target((size[0] * self.panes, size[1]), (0, 0, *size))
        display = self.state.shown_display if pair is None else pair.display
        picture.draw("capture", target, camera, display, settings if overlays else None, pair=pair)
        return picture.framebuffers.read("capture")

    # interface --------------------------------------------------------------------------------------------------

    def gui(self) -> None:
        """The window with the picture in it."""
        flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
        if self._texture is not None:
            flags |= imgui.WindowFlags_.no_background  # the picture covers it
        if self.alone:
            area = imgui.get_main_viewport()
            imgui.set_next_window_pos(area.pos)
            imgui.set_next_window_size(area.size)
            flags |= imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_saved_settings
        imgui.push_style_var(imgui.StyleVar_.window_padding, (0, 0))
        shown, _ = imgui.begin(VIEWPORT, None, flags | imgui.WindowFlags_.no_collapse)
        imgui.pop_style_var()
        try:
            if shown:
                self._contents()
        finally:  # or imgui ends the program over the open window, and what was wrong stays untold
            imgui.end()

    def _contents(self) -> None:
        available, corner = imgui.get_content_region_avail(), imgui.get_cursor_screen_pos()
        self.size = max(available.x, 1.0), max(available.y, 1.0)
        self.origin = corner.x, corner.y
        self._ratio = imgui.get_io().display_framebuffer_scale.x or 1.0
        if self._texture is not None:
            imgui.image(imgui.ImTextureRef(self._texture.glo), self.size, (0, 1), (1, 0))
        if not self.alone and self._texture is not None:
            imgui.set_cursor_screen_pos(corner)
            self.gizmo.gui(self.shown_camera())
        self.slice.gui(self.shown_camera() if self._texture is not None else None)
        draw_settings_button(self)
        self.legend_end = None
        imgui.set_cursor_screen_pos(corner)
        buttons = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_middle
        if self.gizmo.wants_mouse:
            imgui.dummy(self.size)  # a button would keep the mouse from the handles
            draw_hud(self, not self.alone)
            self.draw_toasts()
            return
        imgui.invisible_button("##picture", self.size, buttons | imgui.ButtonFlags_.mouse_button_right)
        hovered, active = imgui.is_item_hovered(), imgui.is_item_active()
        if hovered:
            imgui.set_item_key_owner(imgui.Key.mouse_wheel_y)
        if hovered and self.state.settings.overlays.gather.show and is_held(INSPECT_KEY):
            self._inspect()
        if hovered and _clicked_with(imgui.get_io().key_ctrl):
            self._focus()
        if hovered and _clicked_with(imgui.get_io().key_shift and not self.state.flying):
            self._choose_object()
        pose = self.state.live_camera() if hovered or active or self.state.flying else None
        drawing = self.region.handle(active)
        if drawing or self._drags_split(hovered, active):
            pose = None
        if pose is not None:
            self._navigation.handle(pose, hovered, active)
        if self._clicks.clicked(active) and not (drawing or self.state.flying or self.state.shown_pair() is not None):
            self._pin()
        draw_hud(self, (hovered or self.slice.holds_mouse) and not self.alone)
        self.draw_toasts()

    def split_x(self) -> float | None:
        """Where the line between the compared pictures is, in points from the panel's left edge; None without."""
        pair = self.state.shown_pair()
        if pair is None or pair.mode != WIPE:
            return None
        left, _, width, _ = self.rectangle()
        return left + pair.split * width

    def _drags_split(self, hovered: bool, active: bool) -> bool:
        """Move the line between the compared pictures with the mouse. True while the mouse does that."""
        x, mouse = self.split_x(), imgui.get_mouse_pos()
        if x is None:
            self._splitting = False
            return False
        near = hovered and abs(mouse.x - self.origin[0] - x) < SPLIT_REACH
        if near and imgui.is_mouse_clicked(imgui.MouseButton_.left):
            self._splitting = True
        self._splitting = self._splitting and active
        if near or self._splitting:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        if self._splitting:
            left, _, width, _ = self.rectangle()
            share = (mouse.x - self.origin[0] - left) / max(width, 1.0)
            self.state.change({"compare.split": min(max(share, 0.0), 1.0)})
        return self._splitting

    def frame_at(self, pixel: tuple[int, int]) -> Frame | None:
        """The frame that is shown at a pixel of the image, None where it is of a snapshot."""
        side = self.side_at(pixel)
        return side.frame if side is not None else self.state.frame

    def side_at(self, pixel: tuple[int, int]) -> Side | None:
        """Which of the compared pictures is shown at a pixel of the image: of a difference the first one. None when
        nothing is compared."""
        pair = self.state.shown_pair()
        if pair is None:
            return None
        if pair.mode == WIPE:
            return pair.sides[pixel[0] + 0.5 >= pair.split * pair.a.size[0]]
        if pair.mode == BESIDE:
            return pair.sides[self.pane_under_mouse()]
        return pair.sides[pair.mode == FLIP and pair.second]

    def pane_under_mouse(self) -> int:
        """0, or 1 where the mouse is over the second of two pictures beside each other."""
        return int(self.panes == 2 and imgui.get_mouse_pos().x - self.origin[0] >= self.size[0] / 2)

    def _inspect(self) -> None:
        """Ask for the gather rays of the pixel under the mouse."""
        pixel = self.pixel_under_mouse()
        if pixel is not None and pixel != self.inspected:
            self.inspected = pixel
            self.state.session.inspect(pixel)

    def _pin(self) -> None:
        """The pixel under the mouse to the inspector; with Alt the photon there."""
        pixel = self.pixel_under_mouse()
        if pixel is None:
            return
        if not imgui.get_io().key_alt:
            self.state.inspector.click(pixel)
            return
        photon = picked(self.source(), self.shown_camera(), self.mouse_in_picture())
        if photon is None:
            self.state.say(
                "warning", "No photon is drawn there: show a photon map (C, G) and Alt+click one of its points."
            )
        else:
            self.state.inspector.pin(pixel, photon)

    def mouse_in_picture(self) -> tuple[float, float]:
        """The mouse's place in the picture, 0 to 1 from its left and top."""
        mouse = imgui.get_mouse_pos()
        left, top, width, height = self.rectangle()
        left += self.pane_under_mouse() * self.size[0] / 2
        return (mouse.x - self.origin[0] - left) / width, (mouse.y - self.origin[1] - top) / height

    def _focus(self) -> None:
        """Focus the lens on what is under the mouse."""
        place, camera = self._place_under_mouse(), self.shown_camera()
        if place is not None and camera is not None:
            self.state.focus_at(camera, place[0] * camera.width, place[1] * camera.height)

    def _choose_object(self) -> None:
        """Take hold of the object under the mouse, or let go what is there."""
        place, camera, editing = self._place_under_mouse(), self.shown_camera(), self.state.editing
        if place is None or camera is None:
            return
        number = self.surroundings.object_under(camera, (place[0] * camera.width, place[1] * camera.height))
        held = editing.chosen is not None and editing.object_number(editing.chosen) == number
        if number < 0 or held:
            editing.choose(None)
        else:
            editing.choose_object(number)

    def advice(self) -> str:
        """One sentence where a surface stops the camera or it shows nothing of use; else an empty one."""
        state, pose = self.state, self.state.live_camera()
        scene = state.session.scene
        if pose is None or scene is None or state.settings.free_camera.on:
            return ""
        if time.monotonic() - self._navigation.stopped_at < STOPPED_SECONDS:
            return STOPPED
        if state.navigating:
            return ""
        key = (pose, state.frame.serial if state.frame is not None else 0)
        known = self._advice
        if known is None or known[0] != key or known[1] is not scene:
            own = resolve_camera(scene, size_only(state.settings.camera.model_copy(update={"name": "auto"})))
            self._advice = known = key, scene, self.surroundings.advice(pose, own, state.frame)
        return known[2]

    def place_under_mouse(self, pose: CameraPose) -> tuple[float, float] | None:
        """Where in the camera's image the mouse is, in pixels; None beside the picture."""
        place = self._place_under_mouse()
        return (place[0] * pose.width, place[1] * pose.height) if place is not None else None

    def pixel_under_mouse(self) -> tuple[int, int] | None:
        """Pixel (x, y) of the image, or None when the mouse is elsewhere."""
        frame, place, pair = self.state.frame, self._place_under_mouse(), self.state.shown_pair()
        if place is None or (frame is None and pair is None):
            return None
        if pair is not None:
            return int(place[0] * pair.a.size[0]), int(place[1] * pair.a.size[1])
        assert frame is not None
        return int(place[0] * frame.camera.width), int(place[1] * frame.camera.height)

    def _place_under_mouse(self) -> tuple[float, float] | None:
        """Place in the picture from (0, 0) top left to (1, 1), or None when the mouse is elsewhere."""
        u, v = self.mouse_in_picture()
        return (u, v) if 0 <= u < 1 and 0 <= v < 1 else None


def _clicked_with(modifier: bool) -> bool:
    """Whether the left button was released where it was pressed, with a key held."""
    io = imgui.get_io()
    still = io.mouse_drag_max_distance_sqr[imgui.MouseButton_.left] < DRAG_THRESHOLD**2
    return modifier and imgui.is_mouse_released(imgui.MouseButton_.left) and still


def _keyed(pair: ShownPair | None) -> tuple[Keyed, Keyed] | None:
    """The pair's layers with what tells them from others."""
    if pair is None:
        return None
    view = pair.display.view
    first, second = ((key, partial(side.image, view)) for side, key in zip(pair.sides, pair.keys, strict=True))
    return first, second


def is_data_view(display: Display) -> bool:
    """True for views that exposure and tone curve leave alone."""
    return display.view in ("albedo", "normal", "depth", "geometry", "error", *DIAGNOSTICS)
