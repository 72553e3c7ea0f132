"""One look: a neutral grey that doesn't tint the picture, one accent colour, one spacing, one font with icons."""

from __future__ import annotations

from imgui_bundle import hello_imgui, imgui

Colour = tuple[float, float, float, float]

ACCENT: Colour = (0.91, 0.60, 0.20, 1.0)
TEXT: Colour = (0.88, 0.88, 0.88, 1.0)
DIM: Colour = (0.60, 0.60, 0.60, 1.0)
FAINT: Colour = (0.42, 0.42, 0.42, 1.0)
GOOD: Colour = (0.56, 0.78, 0.48, 1.0)
WARNING: Colour = (0.95, 0.77, 0.36, 1.0)
FREE: Colour = (1.0, 0.82, 0.25, 1.0)
"""Of the free camera: its label and the frustum that it sees."""
ERROR: Colour = (0.95, 0.45, 0.40, 1.0)
LEVELS: dict[str, Colour] = {"info": TEXT, "warning": WARNING, "error": ERROR}

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


def load_fonts() -> None:
    """Roboto with the Font Awesome icons merged in; hello_imgui scales it with the screen."""
    hello_imgui.get_runner_params().callbacks.default_icon_font = hello_imgui.DefaultIconFont.font_awesome6
    hello_imgui.load_font_ttf_with_font_awesome_icons("fonts/Roboto/Roboto-Regular.ttf", FONT_SIZE)


def apply() -> None:
    """Colours and spacing of the whole window."""
    imgui.style_colors_dark()
    style = imgui.get_style()
    _spacing(style)
    c, k = imgui.Col_, style.set_color_
    for item, level in {
        c.window_bg: 0.165,
        c.popup_bg: 0.19,
        c.menu_bar_bg: 0.135,
        c.title_bg: 0.135,
        c.title_bg_active: 0.135,
        c.title_bg_collapsed: 0.135,
        c.border: 0.09,
        c.separator: 0.25,
        c.frame_bg: 0.235,
        c.frame_bg_hovered: 0.28,
        c.frame_bg_active: 0.31,
        c.button: 0.25,
        c.button_hovered: 0.32,
        c.button_active: 0.38,
        c.header: 0.225,
        c.header_hovered: 0.28,
        c.header_active: 0.31,
        c.scrollbar_bg: 0.15,
        c.scrollbar_grab: 0.30,
        c.scrollbar_grab_hovered: 0.38,
        c.scrollbar_grab_active: 0.45,
        c.tab: 0.135,
        c.tab_hovered: 0.28,
        c.tab_selected: 0.165,
        c.tab_dimmed: 0.135,
        c.tab_dimmed_selected: 0.165,
        c.docking_empty_bg: 0.105,
        c.table_header_bg: 0.20,
        c.table_border_strong: 0.25,
        c.table_border_light: 0.22,
        c.table_row_bg_alt: 0.18,
        c.checkbox_selected_bg: 0.235,
    }.items():
        k(item, grey(level))
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
