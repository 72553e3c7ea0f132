"""The tab "Inspector" as a whole: the pixel, and its parts under headings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from imgui_bundle import hello_imgui, imgui

from pmviewer.engine.inspector.report import LookUp, PixelReport, Seen, luminance
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.panels.inspector.fisheye import FisheyeDiscs
from pmviewer.viewer.panels.inspector.light import draw_history, draw_terms
from pmviewer.viewer.panels.inspector.photons import PhotonTable, draw_life
from pmviewer.viewer.panels.inspector.plots import draw_curves, draw_directions
from pmviewer.viewer.panels.inspector.virtual_lights import LightTable, place_name, place_rows
from pmviewer.viewer.panels.statistics_panel import table
from pmviewer.viewer.state import ViewerState

INSPECTOR = "Inspector"
MOST_LIGHTS = 8
OUTSIDE = "This pixel is outside of the picture: pin another one."
RADIANCE = "W/(m² sr)"
_HINT = (
    "Click the picture to pin a pixel: its light by terms, the photons of its look-ups, their paths, and how the "
    "estimate depends on the radius. While nothing is pinned, nothing of it is computed."
)
_MEASURES = ("importance", "required density", "achieved density", "storing probability")


def follow_pin(state: ViewerState) -> None:
    """Once per window frame: bring the tab to the front when a pixel was pinned, let it go when the tab was closed."""
    inspector = state.inspector
    window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(INSPECTOR)
    if window is None or inspector.pinned is None:
        return
    if inspector.raised:
        inspector.raised = False
        if not state.panels_hidden:
            window.is_visible = window.focus_window_at_next_frame = True
    elif not window.is_visible and not state.panels_hidden:
        inspector.unpin()


class InspectorPanel:
    """`gui` draws it; called once a frame while it is in front."""

    def __init__(self, state: ViewerState) -> None:
        self._state = state
        self._photons = PhotonTable()
        self._lights = LightTable()
        self._fisheye = FisheyeDiscs()

    def gui(self) -> None:
        """Draw the tab."""
        inspector = self._state.inspector
        if inspector.pinned is None:
            wrapped(_HINT)
            return
        report = inspector.report
        self._heading(report)
        if inspector.pinned is None:  # by the heading's button
            return
        if report is None:
            wrapped(OUTSIDE if inspector.outside else "Comes with the next pass.")
            return
        for note in report.notes:
            _note(note)
        self._section("Light", lambda: draw_terms(report))
        if report.fisheye is not None:
            seen = report.fisheye
            self._section("Hemisphere of a gather", lambda: self._fisheye.draw(seen))
        if report.lit:
            self._lit(report)
        if report.look_ups:
            self._look_ups(report)
        elif report.way.size and not report.lit:
            wrapped("In the latest pass the path of this pixel looked no photons up.")
        if report.samples is not None and len(report.lights) > 1:
            self._section("Light samples of a pass", lambda: _facts(light_rows(report)))
        self._section("History", lambda: draw_history(report.history))
        if report.measures:
            self._section(f"Importance, {report.measured_map} map", lambda: _facts(measure_rows(report)))

    def _heading(self, report: PixelReport | None) -> None:
        """Which pixel, what is seen there, and the button that lets it go."""
        inspector = self._state.inspector
        assert inspector.pinned is not None
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(f"Pixel {inspector.pinned[0]}, {inspector.pinned[1]}")
        wide = imgui.calc_text_size("Unpin").x + 2 * imgui.get_style().frame_padding.x
        imgui.same_line()
        if imgui.get_content_region_avail().x < wide:
            imgui.new_line()
        if imgui.small_button("Unpin"):
            inspector.unpin()
        imgui.set_item_tooltip("Or Esc, or click the pixel again")
        if report is not None and report.objects:
            wrapped(" → ".join(object_text(seen) for seen in report.objects))
            last = report.objects[-1]
            imgui.set_item_tooltip(f"{last.shape}: material {last.material}, area {last.area:.4g} m²")

    def _lit(self, report: PixelReport) -> None:
        inspector = self._state.inspector
        place = inspector.lit_of(report)
        assert place is not None
        names = [place_name(one) for one in report.lit]
        chosen = one_of("##surface", names, report.lit.index(place), "whose virtual lights are listed and drawn")
        inspector.surface = chosen if chosen is not None else inspector.surface
        _facts(place_rows(place))
        title = f"Virtual lights ({grouped(len(place.number))})###virtual lights"
        self._section(title, lambda: self._lights.draw(report, place, inspector))

    def _look_ups(self, report: PixelReport) -> None:
        inspector = self._state.inspector
        look_up = inspector.look_up_of(report)
        assert look_up is not None
        names = [look_up_name(one) for one in report.look_ups]
        chosen = one_of("##look-up", names, report.look_ups.index(look_up), "whose photons are listed and drawn")
        inspector.number = chosen if chosen is not None else inspector.number
        _facts(look_up_rows(look_up))
        if not look_up.used:
            wrapped("The final gather looks this map up where its rays end. Here is what it holds at the pixel itself.")
        self._section(
            f"Photons ({grouped(look_up.found.n)})###photons", lambda: self._photons.draw(report, look_up, inspector)
        )
        if report.life is not None:
            life = report.life
            self._section("Life of the photon", lambda: draw_life(life))
        elif inspector.photon is not None:
            imgui.text_disabled("Its path is being traced …")
        self._section("Estimate against radius", lambda: draw_curves(look_up))
        self._section("Incident directions", lambda: draw_directions(look_up, report.gathered))

    @staticmethod
    def _section(title: str, draw: Callable[[], None]) -> None:
        if imgui.collapsing_header(title, imgui.TreeNodeFlags_.default_open):
            draw()


def one_of(label: str, names: list[str], current: int, tip: str) -> int | None:
    """A choice among the names, of which one is current, where there is more than one; the number chosen just now."""
    if len(names) < 2:
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(names[current]))
        return None
    chosen = None
    imgui.set_next_item_width(-1)
    if imgui.begin_combo(label, theme.drawable(names[current])):
        for number, name in enumerate(names):
            if imgui.selectable(f"{theme.drawable(name)}##{number}", number == current)[0]:
                chosen = number
        imgui.end_combo()
    imgui.set_item_tooltip(f"The one {tip}")
    return chosen


def object_text(seen: Seen) -> str:
    """A shape and its material, which often gives the shape its name."""
    named = not seen.material or seen.shape.startswith(seen.material)
    return seen.shape if named else f"{seen.shape} ({seen.material})"


def light_rows(report: PixelReport) -> list[tuple[str, str]]:
    """The lights that direct light is most often sampled from, and how often in a pass."""
    assert report.samples is not None
    order = np.argsort(-report.samples, kind="stable")[:MOST_LIGHTS]
    rows = [(f"{i + 1}: {report.lights[i]}", f"{report.samples[i]:.3g}") for i in order if report.samples[i] > 0]
    rest = float(report.samples.sum()) - float(report.samples[order].sum())
    return [*rows, (f"{len(report.lights) - len(order)} others", f"{rest:.3g}")] if rest > 1e-6 else rows


def look_up_name(look_up: LookUp) -> str:
    """Which map, for which term, and where where it is not the first surface."""
    where = "" if look_up.depth == 0 else f", surface {look_up.depth + 1} of the path"
    return f"{look_up.map} map: {look_up.shows}{where}"


def look_up_rows(look_up: LookUp) -> list[tuple[str, str]]:
    """The figures of a look-up."""
    value, total = float(luminance(look_up.value)), float(luminance(look_up.sum))
    asked = f", the {grouped(look_up.k)} nearest" if look_up.k else ""
    rows = [
        ("Radius", si(look_up.radius, "m")),
        *([("Covered", f"{look_up.covered:.0%} of the disc")] if look_up.covered != 1.0 else []),
        ("Photons", f"{grouped(look_up.found.n)}{asked}"),
        ("Kernel", look_up.kernel),
        ("Estimate" if look_up.used else "Estimate here", si(value, RADIANCE)),
    ]
    if look_up.exact:
        rows.append(("Sum of photons", si(total, RADIANCE)))
    return rows


def measure_rows(report: PixelReport) -> list[tuple[str, str]]:
    """What importance says of the pixel."""
    rows = []
    for view in _MEASURES:
        value = report.measures.get(view)
        if value is not None:
            rows.append((view.capitalize(), "none" if value < 0 else f"{value:.4g} {DIAGNOSTICS[view].unit}".rstrip()))
    required, achieved = report.measures.get("required density", -1.0), report.measures.get("achieved density", -1.0)
    if required > 0 and achieved >= 0:
        rows.append(("Achieved / required", f"{achieved / required:.2f}"))
    return rows


def _facts(rows: list[tuple[str, str]]) -> None:
    """Names and values; one below the other where there is no room for both."""
    names, values = (max(imgui.calc_text_size(row[i]).x for row in rows) for i in (0, 1))
    if names + values + imgui.get_font_size() < imgui.get_content_region_avail().x:
        table("", rows)
        return
    imgui.push_text_wrap_pos(0)
    for name, value in rows:
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(name))
        imgui.text_unformatted(theme.drawable(value))
    imgui.pop_text_wrap_pos()


def _note(text: str) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_colored(imgui.ImVec4(*theme.WARNING), theme.drawable(text))
    imgui.pop_text_wrap_pos()
