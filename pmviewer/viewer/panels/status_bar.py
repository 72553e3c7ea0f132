"""One line at the bottom: what the session does and how far it is."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.engine.frame import Status
from pmviewer.viewer import theme
from pmviewer.viewer.background import Work
from pmviewer.viewer.format import duration, grouped, si
from pmviewer.viewer.panels.statistics_panel import look_up_radius
from pmviewer.viewer.panels.widgets import how_many
from pmviewer.viewer.state import ViewerState

_COLOURS = {"rendering": "accent", "finished": "good", "failed": "error", "paused": "warning"}
"""Of states, as looks name them."""
_MORE, _CANCEL = "…", "Cancel"


def status_parts(state: ViewerState) -> list[str]:
    """The pieces of the line after the state, in order of importance."""
    frame = state.frame
    if frame is None:
        return []
    s = frame.statistics
    parts = [f"pass {grouped(s.passes)}" if not frame.coarse else "coarse"]
    parts.append(f"{si(s.emitted)} emitted")
    parts += [f"{name} {si(count)}" for name, count in s.stored.items()]
    radii = (look_up_radius(frame, name) for name in ("global", *s.radius))
    parts += [f"r {radius}" for radius in radii if radius][:1]
    if s.rays:
        parts.append(f"{si(s.rays_per_second, 'rays/s')}")
    parts.append(duration(s.seconds))
    if s.remaining is not None:
        parts.append(f"relMSE ≈ {s.remaining.relmse:.1e}")
    point = state.comparison.latest(frame)
    if point is not None:
        parts.append(f"relMSE {point.metrics.relmse_all:.2e}")
        parts.append(f"mean ratio {point.metrics.mean_ratio:.3f}")
    dropped = sum(s.dropped.values())
    if dropped:
        parts.append(f"{grouped(dropped)} dropped, not finite")
    return parts


def _within_pass(state: ViewerState, status: Status) -> None:
    """What a long pass is at, and a way out of it."""
    share = "" if status.stage_progress is None else f" {status.stage_progress:.0%}"
    imgui.same_line()
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT), f"pass {grouped(status.passes + 1)}: {status.stage}{share}")
    imgui.same_line()
    if imgui.small_button("Stop##pass"):
        state.session.stop()
    imgui.set_item_tooltip(
        "Pause now: what this pass has done is dropped, and going on begins anew. Pausing (Space) lets it finish."
    )


def draw_status_bar(state: ViewerState) -> None:
    """Draw the session's state with its progress, what is being loaded, figures of the picture, and work beside it."""
    status = state.session.status
    imgui.align_text_to_frame_padding()
    colour = getattr(theme.look, _COLOURS.get(status.state, "text"))
    head: str = status.state
    text = status.text
    if text.startswith(head):
        head, text = text, ""
    imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(head))
    if text:
        imgui.same_line()
        imgui.text_unformatted(theme.drawable(text))
    busy = status.state in ("loading", "preparing")
    em = imgui.get_font_size()
    if busy or (status.state == "rendering" and status.progress is not None):
        imgui.same_line()
        fraction = status.progress if status.progress is not None else -0.4 * imgui.get_time()
        text = f"{status.progress:.0%}" if status.progress is not None else ""
        imgui.push_style_color(imgui.Col_.plot_histogram, theme.with_alpha(theme.ACCENT, 0.55))
        imgui.progress_bar(fraction, (7 * em, imgui.get_frame_height() * 0.9), text)
        imgui.pop_style_color()
        if not busy:
            imgui.set_item_tooltip(f"{grouped(status.passes)} of {grouped(state.settings.render.passes)} passes")
    if status.stage:
        _within_pass(state, status)
    loading = state.session.loading
    if loading:
        if status.state != "loading":
            imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*theme.ACCENT), theme.drawable(f"loading {loading} …"))
        imgui.same_line()
        if imgui.small_button("Cancel##loading"):
            state.session.cancel_loading()
        imgui.set_item_tooltip("Give up loading; the open scene stays")
    ahead = state.session.ahead
    if ahead and not busy:
        imgui.same_line()
        imgui.text_colored(imgui.ImVec4(*theme.ACCENT), theme.drawable(f"preparing {ahead}"))
        imgui.set_item_tooltip("Compiles what the next click may need, behind everything else (display.compile_ahead)")
        imgui.same_line()
        if imgui.small_button("Stop##ahead"):
            state.session.stop_compiling_ahead()
    works = [(work, _work_text(work)) for work in state.background.running() if work.lane.shown]
    _figures(status_parts(state), sum(_width(text) + _button_width(work) for work, text in works))
    for work, text in works:
        _dot()
        imgui.text_colored(imgui.ImVec4(*theme.ACCENT), text)
        if _can_be_cancelled(work):
            imgui.same_line()
            if imgui.small_button(f"{_CANCEL}##{work.title}"):
                work.cancel()


def _figures(parts: list[str], kept: float) -> None:
    """The first of the pieces, as many as fit, so much room being `kept` for what follows; the others under the mouse
    at a mark."""
    right = imgui.get_window_pos().x + imgui.get_window_size().x - imgui.get_style().window_padding.x
    count = how_many([_width(part) for part in parts], right - imgui.get_item_rect_max().x - kept, _width(_MORE))
    for part in parts[:count]:
        _dot()
        imgui.text_unformatted(theme.drawable(part))
    if count < len(parts):
        _dot()
        imgui.text_unformatted(_MORE)
        imgui.set_item_tooltip(theme.drawable(" · ".join(parts[count:])))


def _dot() -> None:
    imgui.same_line()
    imgui.text_disabled("·")
    imgui.same_line()


def _width(text: str) -> float:
    """Of a piece with the dot before it."""
    return float(imgui.calc_text_size(theme.drawable(f"·{text}")).x + 2 * imgui.get_style().item_spacing.x)


def _work_text(work: Work) -> str:
    waited = f" {duration(work.seconds)}" if work.seconds > 0.5 else ""
    far = "" if work.share is None else f" {work.share:.0%}"
    return f"{work.title} …{far}{waited}"


def _can_be_cancelled(work: Work) -> bool:
    return work.stop is not None and work.share is not None


def _button_width(work: Work) -> float:
    style = imgui.get_style()
    wide = imgui.calc_text_size(_CANCEL).x + 2 * style.frame_padding.x + style.item_spacing.x
    return float(wide) if _can_be_cancelled(work) else 0.0
