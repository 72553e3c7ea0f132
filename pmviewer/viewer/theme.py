"""One look: a neutral grey that doesn't tint the picture, one accent colour, one spacing, one font with icons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from imgui_bundle import hello_imgui, imgui

Colour = tuple[float, float, float, float]
LIGHTEST, SPAN = 0.98, 0.75
"""A light ground is as far below white as the dark one is above black, nearly."""

TRANSPARENT: Colour = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Look:
    """Colours of text, and the neutral levels of what it stands on, by imgui's names and some of our own: `background`
    behind the panels, `toolbar`, `plot`, `name` of settings at their default."""

    text: Colour
    dim: Colour
    faint: Colour
    accent: Colour
    good: Colour
    warning: Colour
    error: Colour
    free: Colour
    grounds: Mapping[str, float]
    name: float = 0.76
    lighter: float = 1.0
    """Level towards which what the mouse is over turns."""


DARK = Look(
    text=(0.88, 0.88, 0.88, 1.0),
    dim=(0.70, 0.70, 0.70, 1.0),
    faint=(0.66, 0.66, 0.66, 1.0),
    accent=(0.91, 0.60, 0.20, 1.0),
    good=(0.56, 0.78, 0.48, 1.0),
    warning=(0.95, 0.77, 0.36, 1.0),
    error=(0.98, 0.55, 0.50, 1.0),
    free=(1.0, 0.82, 0.25, 1.0),
    grounds={
        "background": 0.105,
        "toolbar": 0.15,
        "plot": 0.12,
        "window_bg": 0.165,
        "popup_bg": 0.19,
        "menu_bar_bg": 0.135,
        "title_bg": 0.135,
        "title_bg_active": 0.135,
        "title_bg_collapsed": 0.135,
        "border": 0.09,
        "separator": 0.25,
        "frame_bg": 0.235,
        "frame_bg_hovered": 0.28,
        "frame_bg_active": 0.31,
        "button": 0.25,
        "button_hovered": 0.32,
        "button_active": 0.38,
        "header": 0.225,
        "header_hovered": 0.28,
        "header_active": 0.31,
        "scrollbar_bg": 0.15,
        "scrollbar_grab": 0.30,
        "scrollbar_grab_hovered": 0.38,
        "scrollbar_grab_active": 0.45,
        "tab": 0.135,
        "tab_hovered": 0.28,
        "tab_selected": 0.165,
        "tab_dimmed": 0.135,
        "tab_dimmed_selected": 0.165,
        "docking_empty_bg": 0.105,
        "table_header_bg": 0.20,
        "table_border_strong": 0.25,
        "table_border_light": 0.22,
        "table_row_bg_alt": 0.18,
        "checkbox_selected_bg": 0.235,
    },
)
LIGHT = Look(
    text=(0.08, 0.08, 0.08, 1.0),
    dim=(0.20, 0.20, 0.20, 1.0),
    faint=(0.28, 0.28, 0.28, 1.0),
    accent=(0.50, 0.26, 0.0, 1.0),
    good=(0.08, 0.34, 0.08, 1.0),
    warning=(0.44, 0.28, 0.0, 1.0),
    error=(0.60, 0.06, 0.05, 1.0),
    free=(0.44, 0.28, 0.0, 1.0),
    grounds={name: LIGHTEST - SPAN * level for name, level in DARK.grounds.items()},
    name=0.2,
    lighter=0.0,
)
LOOKS: Mapping[str, Look] = {"dark": DARK, "light": LIGHT}
ACCENT = TEXT = DIM = FAINT = GOOD = WARNING = FREE = ERROR = DARK.text
"""Of the look that is used, see `use`."""
LEVELS: dict[str, Colour] = {}
"""Of lines in the log."""
look = DARK
_ON_FRAMES = (
    "hovered",
    "active",
    "scrollbar",
    "border",
    "separator",
    "button",
    "plot",
    "docking",
    "checkbox",
    "toolbar",
)

GREYED = 0.76
"""Opacity of settings that have no effect now: weaker, but to be read."""
OVER_PICTURE = (0.08, 0.85)
"""Level and opacity of the ground of captions and legends, whatever lies under it."""
READABLE = 4.5
"""Contrast that text has at least (WCAG 2.2, 1.4.3)."""

FONT_SIZE = 15.0
_UNDRAWABLE = str.maketrans({"ᵢ": "_i", "₊": "+", "₁": "1", "→": "›", "\u202f": " ", "\u2009": " "})


def drawable(text: str) -> str:
    """The text in characters that the bundled font has; `ᵢ₊₁` becomes `_(i+1)`."""
    return text.replace("ᵢ₊₁", "_(i+1)").translate(_UNDRAWABLE)


def with_alpha(colour: Colour, alpha: float) -> imgui.ImVec4:
    """The colour (r, g, b[, a] in 0 to 1) with another opacity."""
    return imgui.ImVec4(*colour[:3], alpha)


def grey(level: float, alpha: float = 1.0) -> imgui.ImVec4:
    """A neutral of this level, 0 black to 1 white."""
    return imgui.ImVec4(level, level, level, alpha)


def contrast(text: Colour, ground: Colour) -> float:
    """Ratio of luminances, 1 to 21 (WCAG 2.2). Both colours are sRGB-encoded and opaque."""
    light, dark = sorted((_luminance(text), _luminance(ground)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def over(colour: Colour, ground: Colour) -> Colour:
    """What is seen of a translucent colour on an opaque one."""
    red, green, blue = (a * colour[3] + b * (1 - colour[3]) for a, b in zip(colour[:3], ground[:3], strict=True))
    return red, green, blue, 1.0


def _luminance(colour: Colour) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour[:3]]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def text_grounds(of: str) -> dict[str, Colour]:
    """The grounds on which any text of that look stands, by name: resting ones, not what the mouse is over."""
    grounds = LOOKS[of].grounds
    return {
        name: (level, level, level, 1.0)
        for name, level in grounds.items()
        if not any(part in name for part in _ON_FRAMES)
    }


def use(name: str) -> None:
    """Another look for all that is drawn from now on, of LOOKS."""
    global look, TEXT, DIM, FAINT, ACCENT, GOOD, WARNING, ERROR, FREE
    look = LOOKS[name]
    TEXT, DIM, FAINT, ACCENT = look.text, look.dim, look.faint, look.accent
    GOOD, WARNING, ERROR, FREE = look.good, look.warning, look.error, look.free
    LEVELS.update(info=TEXT, warning=WARNING, error=ERROR)


use("dark")


def ground(name: str, alpha: float = 1.0) -> imgui.ImVec4:
    """The look's ground of that name."""
    return grey(look.grounds[name], alpha)


def load_fonts() -> None:
    """Roboto with the Font Awesome icons merged in; hello_imgui scales it with the screen."""
    hello_imgui.get_runner_params().callbacks.default_icon_font = hello_imgui.DefaultIconFont.font_awesome6
    hello_imgui.load_font_ttf_with_font_awesome_icons("fonts/Roboto/Roboto-Regular.ttf", FONT_SIZE)


def apply() -> None:
    """Colours and spacing of the whole window."""
    colours()
    _spacing(imgui.get_style())


def colours() -> None:
    """Those of the look that is used."""
    if look is LIGHT:
        imgui.style_colors_light()
    else:
        imgui.style_colors_dark()
    style = imgui.get_style()
    c, k = imgui.Col_, style.set_color_
    for name in look.grounds:
        if hasattr(c, name):
            k(getattr(c, name), ground(name))
    k(c.text, imgui.ImVec4(*TEXT))
    k(c.text_disabled, imgui.ImVec4(*FAINT))
    k(c.resize_grip, grey(0.3, 0.4))
    k(c.child_bg, grey(0, 0))  # the window's own ground shows: each layer costs time on a software driver
    # Sliders are filled bars (see `widgets.filled_bar`): a grab would cover the number in their middle.
    k(c.slider_grab, grey(0, 0))
    k(c.slider_grab_active, grey(0, 0))
    for item, alpha in {
        c.check_mark: 1.0,
        c.separator_hovered: 0.6,
        c.separator_active: 0.9,
        c.resize_grip_hovered: 0.6,
        c.resize_grip_active: 0.9,
        c.text_selected_bg: 0.35,
        c.drag_drop_target: 0.9,
        c.nav_cursor: 0.9,
        c.plot_histogram: 0.9,
        c.tab_selected_overline: 0.9,
        c.docking_preview: 0.5,
    }.items():
        k(item, with_alpha(ACCENT, alpha))
    k(c.tab_dimmed_selected_overline, grey(0.3))
    k(c.modal_window_dim_bg, imgui.ImVec4(0, 0, 0, 0.5))


def _spacing(style: imgui.Style) -> None:
    style.window_padding = imgui.ImVec2(8, 8)
    style.frame_padding = imgui.ImVec2(7, 4)
    style.cell_padding = imgui.ImVec2(5, 3)
    style.item_spacing = imgui.ImVec2(7, 5)
    style.item_inner_spacing = imgui.ImVec2(6, 4)
    style.scrollbar_size = 12
    style.grab_min_size = 9
    style.window_rounding = 4
    style.child_rounding = 3
    style.frame_rounding = 3
    style.popup_rounding = 4
    style.scrollbar_rounding = 6
    style.grab_rounding = 2
    style.tab_rounding = 3
    style.window_border_size = 1
    style.frame_border_size = 0
    style.popup_border_size = 1
    style.tab_bar_overline_size = 2
    style.window_menu_button_position = imgui.Dir.none
    style.docking_node_has_close_button = False
    style.tab_close_button_min_width_selected = 0
    style.separator_text_padding = imgui.ImVec2(0, 4)
    style.hover_stationary_delay = 0.25
