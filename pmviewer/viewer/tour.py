"""The first tour: five steps with the window's own controls highlighted; shown once, and again from the Help menu.

What is highlighted can be used; what is dark takes neither clicks nor the wheel, or the second click of a double click
on "Next", when the card is elsewhere already, would land in the picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import hello_imgui, imgui

from pmviewer.viewer import theme
from pmviewer.viewer.viewport.viewport import VIEWPORT

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom on the screen."""
_PREFERENCE, _SEEN = "tour", "seen"
_WIDTH, _HEIGHT = 23.0, 11.5
"""Of the card, in font sizes; as high as its text needs, about that."""
_DARKER = 0.55


@dataclass(frozen=True)
class Step:
    """`target` names what is highlighted: a panel, or one of the rectangles that the window's parts have told."""

    title: str
    text: str
    target: str
    panel: str = ""
    """That comes to the front."""


STEPS = (
    Step(
        "The picture",
        "It refines pass by pass. Drag to orbit around what is under the mouse, Shift+drag to pan, wheel to zoom, F to "
        "fly. A click pins a pixel: the tab Inspector tells which photons made it.",
        VIEWPORT,
    ),
    Step(
        "Method and view",
        "What is computed, and what of it is shown: the picture, one of its terms, or a view in false colours such as "
        "the density of photons or the noise. Keys 1 to 9 choose views.",
        "toolbar",
    ),
    Step(
        "Photons, split, radius",
        "N photons a pass, the share q of them for both maps, and the radius of look-ups. Double click types a value, "
        "right click resets it. All other settings are below; what has no effect now is grey and says why.",
        "pinned",
        "Settings",
    ),
    Step(
        "What lies in the scene",
        "Stored photons, their paths, gather rays, importance: each drawn over the picture, with colours and size of "
        "its own. C and G show the caustic and the global map.",
        "Overlays",
        "Overlays",
    ),
    Step(
        "What it took, and what is better",
        "Counts and times, the error against a reference, snapshots to compare by S and X, keys of a film. Ctrl+Z "
        "undoes any setting or camera move, Ctrl+P finds any command, H lists all keys.",
        "Statistics",
        "Statistics",
    ),
)


class Tour:
    """`number` is the step that is shown, None for none; `places` gives rectangles by name, where they are known."""

    def __init__(self, places: Callable[[], dict[str, Rectangle]], *, remember: bool) -> None:
        self.number: int | None = None
        self._places = places
        self._remember = remember
        self._fresh = False
        self.shown_at: Rectangle | None = None
        """What is highlighted now."""

    def begin_if_new(self) -> None:
        """Once the window is there: whoever has not seen it sees it."""
        if self._remember and hello_imgui.load_user_pref(_PREFERENCE) != _SEEN:
            self.begin()

    def begin(self) -> None:
        """From the first step on."""
        self._go(0)

    def end(self) -> None:
        """It is not shown by itself again."""
        self.number = None
        if self._remember:
            hello_imgui.save_user_pref(_PREFERENCE, _SEEN)

    def _go(self, number: int) -> None:
        if not 0 <= number < len(STEPS):
            self.end()
            return
        self.number, self._fresh = number, True
        if STEPS[number].panel:
            window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(STEPS[number].panel)
            if window is not None:
                window.is_visible = window.focus_window_at_next_frame = True

    def gui(self) -> None:
        """Draw the step that is shown, over everything. Esc ends it."""
        if self.number is None:
            return
        popup = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        if not popup and imgui.is_key_pressed(imgui.Key.escape, False):
            self.end()
            return
        step, area = STEPS[self.number], imgui.get_main_viewport()
        whole = area.pos.x, area.pos.y, area.pos.x + area.size.x, area.pos.y + area.size.y
        found = self._places().get(step.target) or _of_window(step.target)
        if found is not None:
            found = tuple(min(max(v, whole[i % 2]), whole[i % 2 + 2]) for i, v in enumerate(found))  # type: ignore[assignment]
        self.shown_at = found
        em = imgui.get_font_size()
        wide = min(_WIDTH * em, 0.8 * area.size.x)
        imgui.set_next_window_pos(beside(found, whole, (wide + 1.5 * em, _HEIGHT * em), em))
        flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_move
        flags |= imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_title_bar
        if self._fresh:
            imgui.set_next_window_focus()
            self._fresh = False
        imgui.push_style_color(imgui.Col_.border, imgui.ImVec4(*theme.ACCENT))
        imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
        imgui.push_style_var(imgui.StyleVar_.window_padding, (0.9 * em, 0.7 * em))
        shown, _ = imgui.begin("Tour", None, flags)
        imgui.pop_style_var(2)
        imgui.pop_style_color()
        if shown:
            if found is not None:
                if not popup:  # of what is highlighted: it may reach into the dark
                    _shield(found, whole)
                corner, size = imgui.get_window_pos(), imgui.get_window_size()
                _highlight(found, whole, (corner.x, corner.y, corner.x + size.x, corner.y + size.y))
            self._card(step, wide)
        imgui.end()

    def _card(self, step: Step, wide: float) -> None:
        assert self.number is not None
        number = self.number
        imgui.text_colored(imgui.ImVec4(*theme.ACCENT), step.title)
        imgui.same_line()
        imgui.text_colored(imgui.ImVec4(*theme.DIM), f"{number + 1} of {len(STEPS)}")
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + wide)
        imgui.text_unformatted(step.text)
        imgui.pop_text_wrap_pos()
        imgui.spacing()
        last = number + 1 == len(STEPS)
        if imgui.button("Done##tour" if last else "Next##tour"):
            self._go(number + 1)
        imgui.same_line()
        imgui.begin_disabled(number == 0)
        if imgui.button("Back##tour"):
            self._go(number - 1)
        imgui.end_disabled()
        if not last:
            imgui.same_line()
            if imgui.button("Skip the tour##tour"):
                self.end()


def beside(target: Rectangle | None, whole: Rectangle, size: tuple[float, float], gap: float) -> tuple[float, float]:
    """Where a card of that size is beside its target: right, left, below, above, or inside of it at the top."""
    left, top, right, bottom = whole
    if target is None:
        return (left + right - size[0]) / 2, (top + bottom - size[1]) / 2
    x, y = min(target[0], right - size[0] - gap), min(target[1], bottom - size[1] - gap)
    if target[2] + gap + size[0] + gap < right:
        return target[2] + gap, max(y, top + gap)
    if target[0] - gap - size[0] > left + gap:
        return target[0] - gap - size[0], max(y, top + gap)
    if target[3] + gap + size[1] < bottom:
        return max(x, left + gap), target[3] + gap
    if target[1] - gap - size[1] > top:
        return max(x, left + gap), target[1] - gap - size[1]
    return max((target[0] + target[2] - size[0]) / 2, left), max(target[1] + 2 * gap, top)


def _of_window(name: str) -> Rectangle | None:
    window = imgui.internal.find_window_by_name(name)
    if window is None or not window.was_active:
        return None
    return window.pos.x, window.pos.y, window.pos.x + window.size.x, window.pos.y + window.size.y


def without(rectangle: Rectangle, hole: Rectangle) -> list[Rectangle]:
    """What is left of a rectangle: above, below, left and right of the hole."""
    left, top, right, bottom = rectangle
    x0, x1 = (min(max(x, left), right) for x in (hole[0], hole[2]))
    y0, y1 = (min(max(y, top), bottom) for y in (hole[1], hole[3]))
    parts = [(left, top, right, y0), (left, y1, right, bottom), (left, y0, x0, y1), (x1, y0, right, y1)]
    return [part for part in parts if part[0] < part[2] and part[1] < part[3]]


def _shield(target: Rectangle, whole: Rectangle) -> None:
    """Windows that nobody sees take the mouse where it is dark, below the card, which is the current window."""
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_background | imgui.WindowFlags_.no_nav | imgui.WindowFlags_.no_move
    flags |= imgui.WindowFlags_.no_focus_on_appearing
    card = imgui.internal.get_current_window()
    for number, (left, top, right, bottom) in enumerate(without(whole, target)):
        imgui.set_next_window_pos((left, top))
        imgui.set_next_window_size((right - left, bottom - top))
        imgui.push_style_var(imgui.StyleVar_.window_min_size, (1, 1))
        imgui.begin(f"##dark{number}", None, flags)
        imgui.pop_style_var()
        imgui.internal.bring_window_to_display_front(imgui.internal.get_current_window())
        imgui.end()
    imgui.internal.bring_window_to_display_front(card)


def _highlight(target: Rectangle, whole: Rectangle, card: Rectangle) -> None:
    """All but the target and the card is darker."""
    draw = imgui.get_foreground_draw_list()
    dark = imgui.get_color_u32(imgui.ImVec4(0, 0, 0, _DARKER))
    for part in (rest for around in without(whole, target) for rest in without(around, card)):
        draw.add_rect_filled(part[:2], part[2:], dark)
    x0, y0, x1, y1 = target
    draw.add_rect((x0, y0), (x1, y1), imgui.get_color_u32(imgui.ImVec4(*theme.ACCENT)), 3.0, 2.0)
