"""One row of the settings panel: label, the widget that suits the setting, reset. Typing replaces any slider."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.access import SettingInfo
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, short
from pmviewer.viewer.value_text import value_text

_FLAGS = imgui.SliderFlags_.no_input | imgui.SliderFlags_.always_clamp
WIDE_RANGE = 1000
"""A linear range with more steps than this is dragged relatively: a slider would jump over most of its values."""


def how_many(widths: Sequence[float], room: float, more: float) -> int:
    """How many pieces of those widths, the first ones, fit into the room, with a mark at the end (`more` wide) if it
    isn't all."""
    if sum(widths) <= room:
        return len(widths)
    return sum(end <= room - more for end in accumulate(widths))


def range_text(info: SettingInfo) -> str:
    """What the setting accepts, or nothing when any value of its type will do."""
    if info.choices or info.lower is None or info.upper is None:
        return ""
    low, high = (grouped(int(v)) if info.kind is int else short(v) for v in (info.lower, info.upper))
    return f"{low} to {high} {info.unit}".rstrip() + (" or auto" if info.auto else "")


def rounded(value: float, digits: int = 3) -> float:
    """To that many significant digits: a slider's pixel is no more precise."""
    return float(f"{value:.{digits - 1}e}")


@dataclass
class Typing:
    """The text field that has replaced a slider."""

    path: str
    text: str
    fresh: bool = True


@dataclass
class SettingWidgets:
    """Draws setting rows and remembers what is being typed."""

    refused_view: Callable[[str], str | None]
    """Why a choice of `display.view` can't be taken now, or None."""
    choices: Callable[[SettingInfo], tuple[str, ...]] = lambda info: info.choices
    """What can be chosen for a setting now."""
    typing: Typing | None = None
    _before: dict[str, Any] = field(default_factory=dict)
    """Values at the first click, for a double click to restore."""

    def edit(self, info: SettingInfo, value: Any, resolved: Any, width: float = -1) -> Any:
        """Draw the widget for `value` (perhaps "auto", then `resolved` is what that means now), `width` pixels wide or
        as wide as there is room.

        Returns the new value, text to be parsed, or None when nothing changed.
        """
        imgui.set_next_item_width(width)
        if info.scale == "switch":
            changed, new = imgui.checkbox(f"##{info.path}", value)
            return new if changed else None
        if info.scale == "edits":
            imgui.align_text_to_frame_padding()
            imgui.text_disabled(theme.drawable(value_text(info, value)))
            return None
        if info.scale in ("choice", "name"):
            return self._choice(info, value, resolved)
        if info.scale == "vector":
            return self._vector(info, value, resolved)
        if self.typing is not None and self.typing.path == info.path:
            return self._typed(info)
        return self._number(info, value, resolved, width)

    def start_typing(self, info: SettingInfo, value: Any) -> None:
        """Turn this row's slider into a text field that holds the value to six digits."""
        text = f"{value}" if info.kind is int or isinstance(value, str) else f"{value:.6g}"
        self.typing = Typing(info.path, text)

    def _choice(self, info: SettingInfo, value: str, resolved: Any) -> str | None:
        chosen = None
        known = value == "auto" and isinstance(resolved, str) and resolved != "auto"
        if begin_combo(f"##{info.path}", f"auto · {resolved}" if known else value):
            for choice in self.choices(info):
                refusal = self.refused_view(choice) if info.path == "display.view" else None
                flags = imgui.SelectableFlags_.none if refusal is None else imgui.SelectableFlags_.disabled
                if imgui.selectable(choice, choice == value, flags)[0]:
                    chosen = choice
                if refusal is not None and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
                    tooltip_text([(refusal, theme.TEXT)])
                if choice == value:
                    imgui.set_item_default_focus()
            imgui.end_combo()
        return chosen if chosen != value else None

    def _vector(self, info: SettingInfo, value: Any, resolved: Any) -> tuple[float, ...] | None:
        shown = resolved if isinstance(value, str) else value
        if shown is None:
            imgui.text_disabled("auto")
            return None
        speed = 0.005 * max(*(abs(v) for v in shown), 1e-30)
        changed, new = imgui.drag_float3(f"##{info.path}", list(shown), speed, 0, 0, "%.4g")
        return tuple(new) if changed else None

    def _typed(self, info: SettingInfo) -> str | None:
        typing = self.typing
        assert typing is not None
        if typing.fresh:
            imgui.set_keyboard_focus_here()
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        entered, typing.text = imgui.input_text(f"##{info.path}.typed", typing.text, flags)
        if entered:
            self.typing = None
            return typing.text.strip()
        if not typing.fresh and (imgui.is_item_deactivated() or not imgui.is_item_active()):
            self.typing = None
            return typing.text.strip() if imgui.is_item_deactivated_after_edit() else None
        if imgui.is_item_active():
            typing.fresh = False
        return None

    def _number(self, info: SettingInfo, value: Any, resolved: Any, width: float) -> Any:
        automatic = isinstance(value, str)
        current = resolved if automatic else value
        if current is None:
            current = math.sqrt(info.lower * info.upper) if info.scale == "log" else info.lower  # type: ignore[operator]
            text = "auto"
        else:
            number = grouped(int(current)) if info.kind is int else f"{current:.3g}"
            text = f"auto · {number}" if automatic else value_text(info, current)
            room = (imgui.get_content_region_avail().x if width < 0 else width) - imgui.get_font_size() * 0.5
            if imgui.calc_text_size(text).x > room:
                text = number if automatic else text.removesuffix(info.unit).rstrip()
        new = self._slide(info, current, theme.drawable(text).replace("%", "%%"), width)
        if imgui.is_item_activated() and not imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
            self._before[info.path] = value
        clicked = imgui.is_item_hovered() and imgui.is_mouse_clicked(imgui.MouseButton_.left)
        if clicked and (imgui.get_io().key_ctrl or imgui.is_mouse_double_clicked(imgui.MouseButton_.left)):
            before = self._before.get(info.path, value)
            self.start_typing(info, current if isinstance(before, str) else before)
            return before
        return new

    def _slide(self, info: SettingInfo, current: Any, text: str, width: float) -> Any:
        """The slider or drag field; None when it didn't move."""
        name = f"##{info.path}"
        imgui.push_style_color(imgui.Col_.frame_bg, theme.grey(0, 0))
        imgui.push_style_color(imgui.Col_.frame_bg_hovered, theme.grey(theme.look.lighter, 0.06))
        imgui.push_style_color(imgui.Col_.frame_bg_active, theme.grey(theme.look.lighter, 0.10))
        try:
            return self._slide_over_bar(info, name, current, text, width)
        finally:
            imgui.pop_style_color(3)

    def _slide_over_bar(self, info: SettingInfo, name: str, current: Any, text: str, width: float) -> Any:
        low, high = info.lower, info.upper
        assert low is not None
        assert high is not None
        relative = high - low > WIDE_RANGE and info.scale != "log"
        filled_bar(width, 0.0 if relative else slider_share(info, current))
        if info.scale == "log":
            exponent = math.log10(min(max(current, low), high))
            changed, new = imgui.slider_float(name, exponent, math.log10(low), math.log10(high), text, _FLAGS)
            if not changed:
                return None
            number = min(max(rounded(10.0**new), low), high)
        elif info.kind is int and relative:
            changed, number = imgui.drag_int(name, int(current), 1.0, int(low), int(high), text, _FLAGS)
        elif info.kind is int:
            changed, number = imgui.slider_int(name, int(current), int(low), int(high), text, _FLAGS)
        elif relative:
            changed, number = imgui.drag_float(name, current, _speed(info, current), low, high, text, _FLAGS)
        else:
            changed, number = imgui.slider_float(name, current, low, high, text, _FLAGS)
            number = round(number, max(0, 3 - math.floor(math.log10(high - low))))
        if not changed:
            return None
        number = info.kind(round(number)) if info.kind is int else float(number)
        return number if number != current else None


def _speed(info: SettingInfo, value: float) -> float:
    """Change per point of dragging over a range too wide for a slider: of lengths, which scenes have of any size, a
    hundredth."""
    return max(0.01 * abs(value), 1e-3) if info.unit == "units" else 0.1


def begin_combo(label: str, preview: str) -> bool:
    """`imgui.begin_combo` whose value is told by a tooltip where there is no room for it."""
    room = imgui.calc_item_width() - imgui.get_frame_height() - 2 * imgui.get_style().frame_padding.x
    narrow = imgui.calc_text_size(preview).x > room
    is_open = imgui.begin_combo(label, preview, imgui.ComboFlags_.no_arrow_button if narrow else 0)
    if not is_open and imgui.calc_text_size(preview).x > room + imgui.get_frame_height():
        imgui.set_item_tooltip(preview)
    return is_open


def slider_share(info: SettingInfo, value: float) -> float:
    """Where the value lies between the setting's bounds, 0 to 1, on the setting's scale."""
    assert info.lower is not None
    assert info.upper is not None
    low, high = info.lower, info.upper
    if info.scale == "log":
        low, high, value = math.log10(low), math.log10(high), math.log10(max(value, low))
    return min(max((value - low) / (high - low), 0.0), 1.0)


def filled_bar(width: float, share: float) -> None:
    """The ground of the slider that is drawn next, filled from the left up to its value."""
    size = imgui.get_content_region_avail().x if width < 0 else width
    x, y = imgui.get_cursor_screen_pos()
    bottom = y + imgui.get_frame_height()
    rounding = imgui.get_style().frame_rounding
    draw = imgui.get_window_draw_list()
    alpha = imgui.get_style().alpha
    draw.add_rect_filled((x, y), (x + size, bottom), imgui.get_color_u32(theme.ground("frame_bg", alpha)), rounding)
    if share > 0:
        end = x + max(size * share, 2)
        fill = imgui.get_color_u32(theme.with_alpha(theme.ACCENT, 0.30 * alpha))
        edge = imgui.get_color_u32(theme.with_alpha(theme.ACCENT, 0.85 * alpha))
        draw.add_rect_filled((x, y), (end, bottom), fill, rounding)
        draw.add_rect_filled((end - 2, bottom - 4), (end, bottom), edge)  # below the digits


def icon_button(icon: str, name: str, tooltip: str, *, on: bool = False, enabled: bool = True) -> bool:
    """A flat square button with an icon; `on` shows it in the accent colour."""
    imgui.push_style_color(imgui.Col_.button, theme.grey(0, 0))
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*(theme.ACCENT if on else theme.TEXT)))
    imgui.begin_disabled(not enabled)
    size = imgui.get_frame_height()
    pressed = imgui.button(f"{icon}##{name}", (size * 1.15, size))
    imgui.end_disabled()
    imgui.pop_style_color(2)
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled | imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(tooltip)
    return pressed


def reset_button(info: SettingInfo, value: Any) -> bool:
    """Shown only when the value differs from the default."""
    if value == info.default:
        return False
    return icon_button(fa.ICON_FA_ARROW_ROTATE_LEFT, f"reset.{info.path}", f"Reset to {value_text(info, info.default)}")


def tooltip_text(lines: list[tuple[str, theme.Colour]], width_em: float = 26) -> None:
    """A wrapped tooltip of paragraphs, for the item before."""
    imgui.begin_tooltip()
    imgui.push_text_wrap_pos(imgui.get_font_size() * width_em)
    for text, colour in lines:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*colour))
        imgui.text_unformatted(theme.drawable(text))
        imgui.pop_style_color()
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()
