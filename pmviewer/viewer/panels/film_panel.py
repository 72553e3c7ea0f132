"""The tab "Film": keys on a line of time, playing, export with its progress, and what each key changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.film import difference
from pmviewer.viewer import theme
from pmviewer.viewer.film import FORMATS
from pmviewer.viewer.panels.widgets import begin_combo, icon_button
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.state import ViewerState

FILM = "Film"
_SHORTEST = 4.0
"""Seconds that the line of time has at least."""
_LISTED = 4
"""Settings that are named of what a key changes."""
_EXPLAINED = (
    "A film goes from key to key. Set camera, edits and settings and add a key; change them and add the next: the film "
    "goes through both, numbers evenly and places along a smooth curve."
)


class FilmPanel:
    """Draws `state.film`."""

    def __init__(self, state: ViewerState, actions: Mapping[str, Callable[[], None]]) -> None:
        self._state = state
        self._film = state.film
        self._actions = actions
        self._held: int | None = None
        """Number of the key that the mouse drags."""
        self._scale = _SHORTEST

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        self._buttons()
        self._line()
        if not self._film.keys:
            _wrapped(_EXPLAINED, theme.DIM)
            return
        way = self._film.way()
        if isinstance(way, str):
            _wrapped(way, theme.WARNING)
        self._export()
        self._table()

    def _buttons(self) -> None:
        film, here = self._film, self._film.key_here()
        keyed = here is not None
        if self._button(fa.ICON_FA_PLUS, "add_key", "Add a key of the settings as they are"):
            self._actions["add_key"]()
        if self._button(fa.ICON_FA_ARROWS_ROTATE, "replace", "Replace the key here by the settings as they are", keyed):
            assert here is not None
            film.replace(here)
        if self._button(fa.ICON_FA_TRASH, "remove", "Remove the key here", keyed):
            assert here is not None
            film.remove(here)
        some = bool(film.keys)
        if self._button(fa.ICON_FA_BACKWARD_STEP, "back", "To the key before", some):
            film.go(max((k.at for k in film.keys if k.at < film.at - 1e-3), default=film.keys[0].at))
        icon = fa.ICON_FA_STOP if film.playing else fa.ICON_FA_PLAY
        if self._button(icon, "play_film", "Stop" if film.playing else "Play the film", film.length > 0):
            self._actions["play_film"]()
        if self._button(fa.ICON_FA_FORWARD_STEP, "on", "To the next key", some):
            film.go(min((k.at for k in film.keys if k.at > film.at + 1e-3), default=film.keys[-1].at))
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(f"{film.at:.2f} s")
        if keyed:
            imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*theme.ACCENT), f"key {here + 1}")  # type: ignore[operator]

    @staticmethod
    def _button(icon: str, name: str, text: str, enabled: bool = True) -> bool:
        keys = keys_of(name)
        pressed = icon_button(icon, f"film.{name}", f"{text}  ({keys})" if keys else text, enabled=enabled)
        imgui.same_line(0, 2)
        return pressed

    # the line of time -------------------------------------------------------------------------------------------

    def _line(self) -> None:
        """A click or drag shows the film there; a key is dragged to another time."""
        film, em = self._film, imgui.get_font_size()
        x, y = imgui.get_cursor_screen_pos()
        width, height = imgui.get_content_region_avail().x, 1.9 * em
        imgui.invisible_button("##line", (width, height))
        hovered, active = imgui.is_item_hovered(), imgui.is_item_active()
        if not active:
            self._scale = max(_SHORTEST, 1.15 * max((k.at for k in film.keys), default=0.0), 1.05 * film.at)
        left, across = x + 0.7 * em, width - 1.4 * em

        def place(at: float) -> float:
            return left + across * min(at / self._scale, 1.0)

        mouse = imgui.get_io().mouse_pos.x
        time = min(max((mouse - left) / max(across, 1.0), 0.0), 1.0) * self._scale
        near = min(range(len(film.keys)), key=lambda n: abs(place(film.keys[n].at) - mouse), default=None)
        over = near is not None and hovered and abs(place(film.keys[near].at) - mouse) < 0.55 * em
        if imgui.is_item_activated():
            self._held = near if over else None
            film.go(film.keys[near].at if over and near is not None else round(time, 2))
        elif active and imgui.is_mouse_dragging(imgui.MouseButton_.left, 3.0):
            if self._held is None:
                film.go(round(time, 2))
            else:
                self._held = film.move(self._held, round(time, 2))
        elif not active:
            self._held = None
        if over and near is not None and not active:
            imgui.set_tooltip(f"Key {near + 1} at {film.keys[near].at:g} s: click to go there, drag to move it")
        self._draw(imgui.ImVec2(x, y), (width, height), place)

    def _draw(self, corner: imgui.ImVec2, size: tuple[float, float], place: Callable[[float], float]) -> None:
        film, em, draw = self._film, imgui.get_font_size(), imgui.get_window_draw_list()
        x, y = corner
        bottom, middle = y + size[1], y + 0.55 * size[1]
        ground = imgui.get_color_u32(theme.ground("frame_bg"))
        draw.add_rect_filled((x, y), (x + size[0], bottom), ground, imgui.get_style().frame_rounding)
        step = next(s for s in (0.5, 1, 2, 5, 10, 30, 60, 300, 1000) if self._scale / s <= max(size[0] / (4 * em), 2))
        faint, dim = (
            imgui.get_color_u32(theme.with_alpha(theme.DIM, 0.45)),
            imgui.get_color_u32(imgui.ImVec4(*theme.DIM)),
        )
        for number in range(int(self._scale / step) + 1):
            at = place(number * step)
            draw.add_line((at, bottom - 0.35 * em), (at, bottom), faint)
            draw.add_text((at + 2, y), dim, f"{number * step:g} s" if number else "0")
        if len(film.keys) > 1:
            way = imgui.get_color_u32(theme.with_alpha(theme.ACCENT, 0.5))
            draw.add_line(
                (place(film.keys[0].at), middle + 0.2 * em), (place(film.keys[-1].at), middle + 0.2 * em), way, 2
            )
        here = imgui.get_color_u32(imgui.ImVec4(*theme.TEXT))
        draw.add_line((place(film.at), y), (place(film.at), bottom), here, 1.5)
        key_here = film.key_here()
        for number, key in enumerate(film.keys):
            at, radius = place(key.at), 0.36 * em
            colour = imgui.get_color_u32(imgui.ImVec4(*theme.ACCENT))
            draw.add_ngon_filled((at, middle + 0.2 * em), radius, colour, 4)
            if number == key_here:
                draw.add_ngon((at, middle + 0.2 * em), radius + 2, here, 4, 1.5)

    # export -----------------------------------------------------------------------------------------------------

    def _export(self) -> None:
        film, em = self._film, imgui.get_font_size()
        if film.exporting:
            text, share = film.progress
            if imgui.button(f"{fa.ICON_FA_STOP}  Cancel##film"):
                film.cancel()
            imgui.same_line()
            imgui.push_style_color(imgui.Col_.plot_histogram, theme.with_alpha(theme.ACCENT, 0.55))
            imgui.progress_bar(share, (min(14 * em, imgui.get_content_region_avail().x), imgui.get_frame_height()))
            imgui.pop_style_color()
            _beside(text, theme.DIM)
            return
        how, why = film.export_as, film.refusal()
        imgui.begin_disabled(why is not None)
        if imgui.button(f"{fa.ICON_FA_FILM}  Export …##film"):
            self._actions["export_film"]()
        imgui.end_disabled()
        if why is not None and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
            imgui.set_tooltip(theme.drawable(why))
        imgui.same_line()
        imgui.set_next_item_width(6.2 * em)
        names = {suffix: suffix[1:].upper() for suffix in FORMATS} | {".webp": "WebP", ".png": "PNG files"}
        if begin_combo("##film.format", names[how.format]):
            for suffix, name in names.items():
                if imgui.selectable(name, suffix == how.format)[0]:
                    how.format = suffix
            imgui.end_combo()
        self._number("fps", "pictures a second", 1, 120)
        self._number("passes", "passes each", 1, 10_000)
        _beside(f"{film.length:.2f} s, {film.count()} pictures", theme.DIM)

    def _number(self, name: str, text: str, low: int, high: int) -> None:
        em, how = imgui.get_font_size(), self._film.export_as
        if imgui.get_content_region_avail().x - imgui.get_item_rect_size().x > 0:
            imgui.same_line()
        if imgui.get_content_region_avail().x < 4.5 * em + imgui.calc_text_size(text).x:
            imgui.new_line()
        imgui.set_next_item_width(3.4 * em)
        flags = imgui.SliderFlags_.always_clamp
        changed, value = imgui.drag_int(f"{text}##film.{name}", int(getattr(how, name)), 0.2, low, high, "%d", flags)
        if changed:
            setattr(how, name, type(getattr(how, name))(value))

    def _table(self) -> None:
        """Each key: its time, what it changes, and a way to it."""
        film, em = self._film, imgui.get_font_size()
        here = film.key_here()
        flags = imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.sizing_fixed_fit
        if not imgui.begin_table("##keys", 3, flags):
            return
        imgui.table_setup_column("key")
        imgui.table_setup_column("at", imgui.TableColumnFlags_.width_fixed, 5 * em)
        imgui.table_setup_column("changes", imgui.TableColumnFlags_.width_stretch)
        for number, key in enumerate(film.keys):
            imgui.table_next_row()
            imgui.table_next_column()
            if imgui.selectable(f"key {number + 1}##go{number}", number == here)[0]:
                film.go(key.at)
            imgui.table_next_column()
            imgui.set_next_item_width(-1)
            changed, at = imgui.drag_float(f"##at{number}", key.at, 0.02, 0.0, 3600.0, "%.2f s")
            if changed:
                film.move(number, at)
            imgui.table_next_column()
            text = "the first" if number == 0 else _changes(difference(key, film.keys[number - 1]))
            _cut(text, theme.DIM)
        imgui.end_table()


def _changes(paths: list[str]) -> str:
    """What differs, in a line."""
    camera = [p for p in paths if p.startswith("camera.")]
    others = [p for p in paths if not p.startswith("camera.")]
    names = (["camera"] if camera else []) + ["edits" if p == "edit.changes" else p for p in others]
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more if names else "as the key before"


def _beside(text: str, colour: theme.Colour) -> None:
    """On the same line where there is room."""
    imgui.same_line()
    if imgui.get_content_region_avail().x < imgui.calc_text_size(text).x:
        imgui.new_line()
    _cut(text, colour)


def _cut(text: str, colour: theme.Colour) -> None:
    drawn = theme.drawable(text)
    imgui.text_colored(imgui.ImVec4(*colour), drawn)
    if imgui.is_item_hovered() and imgui.calc_text_size(drawn).x > imgui.get_content_region_avail().x:
        imgui.set_tooltip(drawn)


def _wrapped(text: str, colour: theme.Colour) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(text))
    imgui.pop_text_wrap_pos()
