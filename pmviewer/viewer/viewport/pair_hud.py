"""What lies over compared pictures: their names and figures, the line between them, the difference's mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from pmviewer.output.difference_views import DIFFERENCES
from pmviewer.viewer import theme
from pmviewer.viewer.format import duration, grouped, si
from pmviewer.viewer.pair import BESIDE, FLIP, WIPE, ShownPair
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.sides import Side
from pmviewer.viewer.viewport.caption import caption
from pmviewer.viewer.viewport.legend import draw_false_legend

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport


def draw_pair(viewport: Viewport, pair: ShownPair) -> None:
    """Captions and lines over the pictures that are compared."""
    line = imgui.get_text_line_height()
    margin, (width, height) = 0.6 * line, viewport.size
    if pair.mode == WIPE:
        x = viewport.split_x() or 0.0
        _line(viewport, x, knob=True)
        _side(viewport, pair, 0, x - 0.8 * line, 1.0, x - 1.6 * line)
        _side(viewport, pair, 1, x + 0.8 * line, 0.0, width - x - 1.6 * line)
    elif pair.mode == BESIDE:
        _line(viewport, width / 2, knob=False)
        for number in (0, 1):
            _side(viewport, pair, number, 0.5 * width * number + margin, 0.0, width / 2 - 2 * margin)
    elif pair.mode == FLIP:
        y = _side(viewport, pair, int(pair.second), margin, 0.0, width - 2 * margin)
        caption(viewport, f"{keys_of('flip_pictures')}: {'BA'[pair.second]}", (margin, y), colour=theme.DARK.dim)
    else:
        _difference(viewport, pair)
    notes = [text for text in (pair.refusal, pair.caution) if text]
    for number, text in enumerate(notes):
        place = width / 2, height - (4.0 + 1.6 * number) * line
        caption(viewport, text, place, anchor=0.5, colour=theme.DARK.warning)


def _difference(viewport: Viewport, pair: ShownPair) -> None:
    x = 0.6 * imgui.get_text_line_height()
    found, info = viewport.state.pair.current(pair), DIFFERENCES[pair.kind]
    y = caption(viewport, f"{pair.kind}: {info.text}", (x, x), colour=theme.DARK.accent)
    y = caption(viewport, f"A: {pair.a.name}", (x, y))
    y = caption(viewport, f"B: {pair.b.name}", (x, y))
    if found is not None:
        caption(viewport, f"mean {found.mean:.4g} {info.unit}".rstrip(), (x, y))
        draw_false_legend(viewport)
    elif not pair.refusal:
        caption(viewport, "the difference is being worked out; this is A", (x, y))


def _line(viewport: Viewport, x: float, *, knob: bool) -> None:
    """Between the pictures, with something to take hold of."""
    line = imgui.get_text_line_height()
    draw, (ox, oy), height = imgui.get_window_draw_list(), viewport.origin, viewport.size[1]
    for colour, wide in ((theme.grey(0.0, 0.6), 5.0), (theme.grey(1.0), 2.0)):
        draw.add_line((ox + x, oy), (ox + x, oy + height), imgui.get_color_u32(colour), wide)
    if knob:
        draw.add_circle_filled((ox + x, oy + height / 2), 0.5 * line, imgui.get_color_u32(theme.grey(1.0)))


def _side(viewport: Viewport, pair: ShownPair, number: int, x: float, anchor: float, room: float) -> float:
    """Which picture it is, and what it took, one below the other: narrow windows have no room for a line of them.
    Returns where the next line begins."""
    side, y = pair.sides[number], 0.6 * imgui.get_text_line_height()
    view = "" if pair.display.view == "beauty" else f" · {side.layer(pair.display.view)}"
    gain = viewport.state.gain.gain if viewport.state.gain.shown else None
    letter = "" if gain is not None else f"{'AB'[number]}: "
    name = f"{letter}{side.name}{view}"
    room = max(room, 8 * imgui.get_font_size())
    y = caption(viewport, name, (x, y), anchor=anchor, colour=theme.DARK.accent, room=room)
    if gain is not None:
        of = gain.without if number else gain.with_
        facts = [
            f"{si(of.stored)} photons stored",
            f"relMSE {of.error.relmse_all:.2e}",
            f"{duration(of.cpu_seconds)} CPU",
            *((gain.heading,) if number else ()),
        ]
    else:
        facts = facts_of(side, viewport.state.measured.error(side))
    for fact in facts:
        y = caption(viewport, fact, (x, y), anchor=anchor, room=room)
    return y


def facts_of(side: Side, error: float | None) -> list[str]:
    """What a picture took, as far as it is known: passes, CPU time, error."""
    facts = []
    passes, cpu = side.fact("passes"), side.fact("cpu_seconds")
    if passes is not None:
        facts.append(f"{grouped(int(passes))} {'pass' if passes == 1 else 'passes'}")
    if cpu is not None:
        facts.append(f"{duration(cpu)} CPU")
    if error is not None:
        facts.append(f"relMSE {error:.2e}")
    return facts
