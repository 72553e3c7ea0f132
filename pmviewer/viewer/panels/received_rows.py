"""Under an object in the tab "Scene": its area, and what it has received."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from pmviewer.engine.inspector.report import luminance
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.panels.widgets import tooltip_text
from pmviewer.viewer.state import ViewerState

if TYPE_CHECKING:
    from pmviewer.engine.inspector.received import Received

STACKED = 14.0
"""Room in font sizes below which names have a line of their own, above their figures."""
Row = tuple[str, str, str]
"""Name, figures, and what they are."""


def draw_received(state: ViewerState, number: int) -> None:
    """Rows of the object of that number, shapes before instances; counts come when they are there."""
    em = imgui.get_font_size()
    for name, text, tip in rows_of(state, number):
        imgui.text_colored(theme.grey(theme.look.name), name)
        hovered = imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip)
        if imgui.get_content_region_avail().x > STACKED * em:
            imgui.same_line(imgui.get_cursor_pos_x() + 6.1 * em)
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(theme.drawable(text))
        imgui.pop_text_wrap_pos()
        if hovered or imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            tooltip_text([(tip, theme.TEXT)])


def rows_of(state: ViewerState, number: int) -> list[Row]:
    """What there is to tell of the object."""
    area, counted = state.received.area(number), state.received.counted()
    size = f"{area:.4g} m²" if area is not None else "not known: stretched round parts"
    rows = [("area", size, "Of its surface as it is now, a unit of length being 1 m.")]
    if counted is None:
        return [*rows, ("photons", "being counted" if state.frame is not None else "none yet", "Of the latest pass.")]
    for name, found in counted.maps.items():
        if number < len(found.photons):
            rows.append(_row(name, found, number, area, counted.passes))
    return rows


def _row(name: str, found: Received, number: int, area: float | None, passes: int) -> Row:
    count, total = int(found.photons[number]), int(found.photons.sum()) + found.unknown
    of_pass = f"pass {grouped(passes)}"
    share = f" ({100 * count / total:.3g} %)" if count else ""
    if name == "importons":
        wanted = luminance(found.power)
        part = 100 * wanted[number] / wanted.sum() if wanted.sum() > 0 else 0.0
        text = f"{grouped(count)}{share}, {part:.3g} % of the importance"
        tip = f"Importons of {of_pass} that lie on it: how much of what the picture asks for it has to answer."
        return "importons", text, tip
    power = float(luminance(found.power[number]))
    text = f"{grouped(count)}{share}"
    if count:
        text += f", {si(power, 'W')}"
        text += f", {si(power / area, 'W')}/m²" if area else ""
    tip = (
        f"Photons of the {name} map that lie on it, of all of that map in {of_pass}; their power (luminance), and that "
        "over its area. Mirrors and clear glass store none. "
        f"{grouped(found.unknown)} photons lie too near an edge to tell on what."
    )
    return f"{name}", text, tip
