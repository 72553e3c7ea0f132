"""The estimate against its radius for each kernel, and the directions that light comes from."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui, implot
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import LookUp, luminance
from pmviewer.viewer import theme
from pmviewer.viewer.format import si
from pmviewer.viewer.gl.palette import LIGHT_PALETTE
from pmviewer.viewer.overlays.legend import swatches, wrapped

KERNEL_COLOURS = dict(zip(("constant", "cone", "gaussian", "simpson", "epanechnikov"), LIGHT_PALETTE[:5], strict=True))
GATHER_COLOUR = (0.45, 0.68, 0.88, 0.9)
GUIDED_COLOUR = (0.42, 0.80, 0.55, 0.9)
MOST_DIRECTIONS = 4000
"""Photons whose directions are drawn: the brightest."""

Axis = tuple[str, float, float]


def begin_plot(name: str, lines: float, x: Axis, y: Axis, *, log_x: bool = False) -> bool:
    """A plain plot so many lines high between the limits of its axes; `end_plot` ends it if it is drawn."""
    implot.push_style_var(implot.StyleVar_.plot_padding, (4, 4))
    implot.push_style_var(implot.StyleVar_.label_padding, (4, 2))
    implot.push_style_color(implot.Col_.frame_bg, theme.grey(0, 0))
    implot.push_style_color(implot.Col_.plot_bg, theme.ground("plot"))
    implot.push_style_color(implot.Col_.axis_grid, theme.grey(theme.look.lighter, 0.12))
    flags = implot.Flags_.no_inputs | implot.Flags_.no_menus | implot.Flags_.no_mouse_text | implot.Flags_.no_legend
    size = imgui.get_content_region_avail().x, lines * imgui.get_text_line_height_with_spacing()
    if not implot.begin_plot(name, size, flags):
        _pop()
        return False
    for axis, (title, low, high) in ((implot.ImAxis_.x1, x), (implot.ImAxis_.y1, y)):
        implot.setup_axis(axis, title, implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight)
        if axis == implot.ImAxis_.x1 and log_x:
            implot.setup_axis_scale(axis, implot.Scale_.log10)
        implot.setup_axis_limits(axis, low, high if high > low else low + 1.0, implot.Cond_.always)
    return True


def end_plot() -> None:
    """After `begin_plot` has returned True."""
    implot.end_plot()
    _pop()


def _pop() -> None:
    implot.pop_style_color(3)
    implot.pop_style_var(2)


def spread(values: NDArray[np.floating]) -> tuple[float, float]:
    """Limits of an axis around values, with some room."""
    low, high = float(values.min()), float(values.max())
    room = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def shown_part(look_up: LookUp) -> slice:
    """Of the curves: from the radius on that holds a photon."""
    first = int(np.searchsorted(look_up.curves.count, 1))
    return slice(first if first < len(look_up.curves.radii) else 0, None)


def draw_curves(look_up: LookUp) -> None:
    """A curve for each kernel; the one in use is wide, the radius of the look-up marked."""
    if not look_up.curves.count[-1]:
        wrapped("No photon lies within twice the radius.")
        return
    part = shown_part(look_up)
    radii = look_up.curves.radii[part]
    settled = look_up.curves.count[part] >= min(8, look_up.curves.count[-1])  # before that the curves shoot up
    tops = [float(L[part][settled].max()) for L in look_up.curves.L.values()]
    high = 1.15 * max(*tops, float(luminance(look_up.value)))
    if begin_plot("##curves", 11, ("radius", radii[0], radii[-1]), ("L", 0.0, high), log_x=True):
        marked = [radius for radius in look_up.radius * 4.0 ** np.arange(-2, 1) if radius >= 0.99 * radii[0]]
        implot.setup_axis_ticks(implot.ImAxis_.x1, marked, [si(radius, "m", 2) for radius in marked])
        for name, L in look_up.curves.L.items():
            used = name == look_up.kernel
            colour = imgui.ImVec4(*KERNEL_COLOURS[name], 1.0 if used else 0.65)
            spec = implot.Spec(line_color=colour, line_weight=2.5 if used else 1.2)
            implot.plot_line(name, radii, np.ascontiguousarray(L[part]), spec)
        mark = imgui.ImVec4(*theme.ACCENT)
        implot.plot_inf_lines("##radius", np.array([look_up.radius]), implot.Spec(line_color=mark, line_weight=1.5))
        dot = implot.Spec(line_color=imgui.ImVec4(0, 0, 0, 0))
        dot.marker, dot.marker_size = implot.Marker_.circle, 4.5
        dot.marker_fill_color = dot.marker_line_color = mark
        here = np.array([float(luminance(look_up.value))])
        implot.plot_scatter("##estimate", np.array([look_up.radius]), here, dot)
        end_plot()
    swatches("", list(KERNEL_COLOURS.items()))
    count = int(look_up.curves.count[np.searchsorted(look_up.curves.radii, look_up.radius)])
    wrapped(
        f"Luminance that this look-up adds to the pixel, W/(m² sr). Line and dot: the radius in use, "
        f"{si(look_up.radius, 'm')} ({count} photons), and the estimate; twice the radius holds "
        f"{int(look_up.curves.count[-1])}."
    )


def on_hemisphere(wi: NDArray[np.floating], n: NDArray[np.floating], wo: NDArray[np.floating]) -> NDArray[np.float64]:
    """Directions (m, 3) in the tangent plane, (m, 2): the unit disc is the hemisphere seen from above (areas are
    projected solid angles), the viewer's side is to the left."""
    across = wo - n * float(wo @ n)
    length = float(np.linalg.norm(across))
    if length < 1e-4:
        across = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        length = float(np.linalg.norm(across))
    t = -across / length
    return np.asarray(wi, np.float64) @ np.column_stack([t, np.cross(n, t)])


def draw_directions(look_up: LookUp, gathered: NDArray[np.float32] | None) -> None:
    """Photons as discs of an area by their power, gather rays as rings."""
    if not look_up.found.n and (gathered is None or not len(gathered)):
        imgui.text_disabled("No light arrives in this pass.")
        return
    side = min(imgui.get_content_region_avail().x, 16 * imgui.get_font_size())
    x, y = imgui.get_cursor_screen_pos()
    radius = 0.46 * side
    cx, cy = x + imgui.get_content_region_avail().x / 2, y + side / 2
    draw = imgui.get_window_draw_list()
    line = imgui.get_color_u32(theme.grey(theme.look.lighter, 0.16))
    draw.add_circle_filled((cx, cy), radius, imgui.get_color_u32(theme.ground("plot")), 64)
    for elevation in (0, 30, 60):
        draw.add_circle((cx, cy), radius * math.cos(math.radians(elevation)), line, 64)
    found = look_up.found
    power = luminance(found.Phi)
    order = np.argsort(-power, kind="stable")[:MOST_DIRECTIONS]
    places = on_hemisphere(found.wi[order], look_up.n, look_up.wo)
    largest = float(power.max(initial=0.0))
    size = np.sqrt(power[order] / max(largest, 1e-30)) * max(2.0, min(5.0, 60 / math.sqrt(max(len(order), 1))))
    colour = imgui.get_color_u32(theme.with_alpha(theme.ACCENT, 0.75))
    for (u, v), r in zip(places.tolist(), size.tolist(), strict=True):
        draw.add_circle_filled((cx + radius * u, cy - radius * v), max(r, 0.8), colour, 8)
    rays = _ray_places(look_up, gathered)
    for u, v, guided in rays:
        tint = imgui.get_color_u32(imgui.ImVec4(*(GUIDED_COLOUR if guided else GATHER_COLOUR)))
        draw.add_circle((cx + radius * u, cy - radius * v), 3.0, tint, 10, 1.2)
    u, v = on_hemisphere(look_up.wo[None], look_up.n, look_up.wo)[0].tolist()
    white = imgui.get_color_u32(theme.grey(theme.look.lighter))
    at = cx + radius * u, cy - radius * v
    draw.add_line((at[0] - 4, at[1]), (at[0] + 4, at[1]), white, 1.5)
    draw.add_line((at[0], at[1] - 4), (at[0], at[1] + 4), white, 1.5)
    imgui.dummy((imgui.get_content_region_avail().x, side))
    text = (
        "Seen along the normal; rings at 30° and 60° above the surface. Orange: photons, area by power. Cross: viewer."
    )
    if rays:
        text += " Blue rings: gather rays by the BSDF; green: guided by photons."
    wrapped(text)


def _ray_places(look_up: LookUp, gathered: NDArray[np.float32] | None) -> list[tuple[float, float, bool]]:
    """Of the gather rays that start at the look-up's place."""
    if gathered is None or not len(gathered):
        return []
    here = np.linalg.norm(gathered[:, :3] - look_up.p, axis=1) < max(0.1 * look_up.radius, 1e-6)
    way = (gathered[here, 3:6] - gathered[here, :3]).astype(np.float64)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-30)
    places = on_hemisphere(way, look_up.n, look_up.wo)
    return [(float(u), float(v), bool(g)) for (u, v), g in zip(places, gathered[here, 9], strict=True)]
