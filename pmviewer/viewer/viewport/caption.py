"""Text over the picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from pmviewer.viewer import theme

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

LEGEND_EMS = 12.0
"""Width that captions leave to legends, in font sizes."""
NARROWEST = 8.0
"""Where less is left beside a legend, in font sizes, captions take the whole width, and the legend begins below."""
_CENTRED_SHARE = 0.8
"""Of the viewport's width, that a centred text fills at most."""


def is_narrow(viewport: Viewport) -> bool:
    """Whether there is no room for a caption beside a legend."""
    return viewport.size[0] < (LEGEND_EMS + NARROWEST) * imgui.get_font_size()


def caption(
    viewport: Viewport,
    text: str,
    position: tuple[float, float],
    *,
    anchor: float = 0.0,
    colour: theme.Colour = theme.DARK.text,
    room: float | None = None,
) -> float:
    """Text on a translucent ground, in lines that leave room for a legend; `anchor` 0.5 centres it on the position, in
    lines that fit into the viewport, `room` is a width that it stays within. Returns how far down the next one begins.
    """
    text = theme.drawable(text)
    if room is None:
        room = viewport.size[0] - position[0] - LEGEND_EMS * imgui.get_font_size()
        if is_narrow(viewport):
            room = viewport.size[0] - 2 * position[0]
        if anchor:
            room = _CENTRED_SHARE * viewport.size[0]
    wrap = room if room > 0 and (anchor == 0.0 or imgui.calc_text_size(text).x > room) else 0.0
    size = imgui.calc_text_size(text, wrap_width=wrap or -1.0)
    x, y = viewport.origin[0] + position[0] - anchor * size.x, viewport.origin[1] + position[1]
    draw = imgui.get_window_draw_list()
    pad = 0.35 * imgui.get_text_line_height()
    ground = imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE))
    draw.add_rect_filled((x - pad, y - 0.5 * pad), (x + size.x + pad, y + size.y + 0.5 * pad), ground, 3)
    code = imgui.get_color_u32(imgui.ImVec4(*colour))
    draw.add_text(imgui.get_font(), imgui.get_font_size(), (x, y), code, text, wrap_width=wrap)
    return position[1] + size.y + 1.15 * pad
