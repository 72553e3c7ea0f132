"""The strip: a thumbnail and a name for each snapshot, and what can be done with it."""

from __future__ import annotations

import moderngl
import numpy as np
from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.panels.widgets import tooltip_text
from pmviewer.viewer.snapshots import Snapshots, Thumbnail
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.viewport.viewport import Viewport

_NAME = 9.0
"""Width that a name has at least, in font sizes."""
EMPTY = "No snapshot yet. S keeps the picture with its settings and figures; EXR and PNG files open as snapshots."


class Strip:
    """Textures of thumbnails are made when they are first seen and freed with their snapshot."""

    def __init__(self, state: ViewerState, viewport: Viewport) -> None:
        self._state = state
        self._viewport = viewport
        self._textures: dict[int, tuple[Thumbnail, moderngl.Texture]] = {}
        self._renaming: tuple[int, str] | None = None

    @property
    def _snapshots(self) -> Snapshots:
        return self._state.snapshots

    def gui(self, height: float) -> None:
        """Draw the strip into what is left of the width."""
        self._free_old()
        if not self._snapshots.all:
            imgui.push_text_wrap_pos(0)
            imgui.text_disabled(EMPTY)
            imgui.pop_text_wrap_pos()
            return
        flags = imgui.WindowFlags_.horizontal_scrollbar
        if imgui.begin_child("##strip", (0, height), imgui.ChildFlags_.none, flags):
            room = imgui.get_content_region_avail().y - 1.25 * imgui.get_frame_height_with_spacing()
            for number in range(len(self._snapshots.all)):
                if number:
                    imgui.same_line()
                self._one(number, max(room, 2 * imgui.get_font_size()))
        imgui.end_child()

    def _one(self, index: int, height: float) -> None:
        snapshot = self._snapshots.all[index]
        width = min(height * snapshot.size[0] / snapshot.size[1], 2.2 * height)
        imgui.begin_group()
        texture = self._texture(index)
        compare, number = self._state.settings.compare, str(snapshot.number)
        is_last = index == len(self._snapshots.all) - 1
        letters = [n for n in ("a", "b") if getattr(compare, n) in ((number, "last") if is_last else (number,))]
        frame = theme.ACCENT if letters and compare.mode != "off" else theme.FAINT
        x, y = imgui.get_cursor_screen_pos()
        if texture is not None:
            imgui.image(imgui.ImTextureRef(texture.glo), (width, height), (0, 0), (1, 1))
        else:
            imgui.dummy((width, height))
        imgui.set_cursor_screen_pos((x, y))
        if imgui.invisible_button(f"##snapshot{number}", (width, height)):
            self._state.change(_compare_with(self._state, number, to_a=imgui.get_io().key_shift))
        draw = imgui.get_window_draw_list()
        draw.add_rect((x, y), (x + width, y + height), imgui.get_color_u32(imgui.ImVec4(*frame)), 2.0, 2, 0)
        if letters and compare.mode != "off":
            text = " ".join(letters).upper()
            size = imgui.calc_text_size(text)
            ground = imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE))
            draw.add_rect_filled((x, y), (x + size.x + 8, y + size.y + 4), ground)
            draw.add_text((x + 4, y + 2), imgui.get_color_u32(imgui.ImVec4(*theme.DARK.accent)), text)
        self._tooltip(index)
        self._menu(index)
        self._name(index, max(width, _NAME * imgui.get_font_size()))
        imgui.end_group()

    def _name(self, index: int, width: float) -> None:
        """The name, or the field that it is typed into."""
        snapshot = self._snapshots.all[index]
        if self._renaming is None or self._renaming[0] != snapshot.number:
            text = theme.drawable(snapshot.name)
            imgui.push_clip_rect(imgui.get_cursor_screen_pos(), (imgui.get_cursor_screen_pos().x + width, 1e6), True)
            imgui.text_unformatted(text)
            imgui.pop_clip_rect()
            if imgui.is_item_hovered() and imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
                self._renaming = snapshot.number, snapshot.name
            return
        imgui.set_next_item_width(max(width, 9 * imgui.get_font_size()))
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        imgui.set_keyboard_focus_here()
        entered, text = imgui.input_text(f"##name{snapshot.number}", self._renaming[1], flags)
        self._renaming = snapshot.number, text
        if entered:
            self._snapshots.rename(snapshot, text)
            self._renaming = None
        elif imgui.is_key_pressed(imgui.Key.escape):
            self._renaming = None

    def _tooltip(self, index: int) -> None:
        if not imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            return
        snapshot = self._snapshots.all[index]
        width, height = snapshot.size
        passes = snapshot.figure("passes")
        about = f"{width}×{height} pixels" + (f", {passes:,.0f} passes" if passes is not None else "")
        scene = str(snapshot.about.get("scene", ""))
        hint = "Click: compare with it as B, Shift+click: as A. Double click the name to change it."
        tooltip_text(
            [(snapshot.name, theme.ACCENT), (", ".join(filter(None, (scene, about))), theme.TEXT), (hint, theme.DIM)]
        )

    def _menu(self, index: int) -> None:
        snapshot = self._snapshots.all[index]
        if not imgui.begin_popup_context_item(f"menu.snapshot{snapshot.number}"):
            return
        state, number = self._state, str(snapshot.number)
        if imgui.menu_item_simple("Compare as A"):
            state.change(_compare_with(state, number, to_a=True))
        if imgui.menu_item_simple("Compare as B"):
            state.change(_compare_with(state, number, to_a=False))
        imgui.separator()
        known = snapshot.settings is not None
        if imgui.menu_item("Take its settings", "", False, known)[0]:
            state.change(settings_of(state, index))
        if imgui.menu_item("Take its camera", "", False, known)[0]:
            state.change(camera_of(state, index))
        imgui.separator()
        if imgui.menu_item_simple("Rename"):
            self._renaming = snapshot.number, snapshot.name
        if imgui.menu_item_simple("Remove"):
            self._snapshots.remove(snapshot)
        imgui.end_popup()

    def _texture(self, index: int) -> moderngl.Texture | None:
        snapshot, picture = self._snapshots.all[index], self._viewport.picture
        if picture is None:
            return None
        pixels = self._snapshots.thumbnail(snapshot)
        held = self._textures.get(snapshot.number)
        if held is None or held[0] is not pixels:
            if held is not None:
                held[1].release()
            height, width = pixels.shape[:2]
            texture = picture.context.texture((width, height), 3, np.ascontiguousarray(pixels).tobytes(), alignment=1)
            self._textures[snapshot.number] = held = pixels, texture
        return held[1]

    def _free_old(self) -> None:
        there = {snapshot.number for snapshot in self._snapshots.all}
        for number in self._textures.keys() - there:
            self._textures.pop(number)[1].release()

    def release(self) -> None:
        """Free what lies on the GPU."""
        for _, texture in self._textures.values():
            texture.release()
        self._textures.clear()


def _compare_with(state: ViewerState, number: str, *, to_a: bool) -> dict[str, object]:
    """Settings that compare with that snapshot, by a wipe where nothing was compared."""
    values: dict[str, object] = {"compare.a" if to_a else "compare.b": number}
    return values | ({"compare.mode": "wipe"} if state.settings.compare.mode == "off" else {})


def settings_of(state: ViewerState, index: int) -> dict[str, object]:
    """What to change for the snapshot's settings to be the session's, but for what is shown and the camera."""
    from pmviewer.viewer.panels.snapshots.table import differing

    wanted = state.snapshots.all[index].settings
    if wanted is None:
        return {}
    rows = differing(wanted, state.settings)
    return {path: values[0] for path, values in rows.items() if not path.startswith(("camera.", "free_camera."))}


def camera_of(state: ViewerState, index: int) -> dict[str, object]:
    """What to change for the snapshot's camera to be the session's: its size stays."""
    from pmviewer.viewer.panels.snapshots.table import differing

    wanted = state.snapshots.all[index].settings
    if wanted is None:
        return {}
    kept = ("camera.width", "camera.height")
    return {
        path: values[0]
        for path, values in differing(wanted, state.settings).items()
        if path.startswith(("camera.", "free_camera.")) and path not in kept
    }
