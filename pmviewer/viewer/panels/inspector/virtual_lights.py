"""The virtual lights that reach a surface of the pixel, with what each adds."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import LitPlace, PixelReport, luminance
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.inspector import ChosenLight, Inspector
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.panels.inspector.sorted_table import SortedTable

RADIANCE = "W/(m² sr)"


def place_name(place: LitPlace) -> str:
    """Which of the pixel's surfaces it is."""
    at = f"at surface {place.depth + 1}, over mirrors or glass"
    return "indirect light by virtual lights" if place.depth == 0 else f"virtual lights {at}"


def place_rows(place: LitPlace) -> list[tuple[str, str]]:
    """The figures of a surface."""
    rows = [
        ("Reach it", f"{grouped(len(place.number))} of {grouped(place.asked)} asked"),
        ("Hidden", grouped(len(place.blocked))),
        ("Sum of them", si(float(luminance(place.sum)), RADIANCE)),
    ]
    if (place.weight > 0).any():
        rows.append(("ΣA·c / ΣG", f"{place.quotient:.4g}"))
    return rows


class LightTable(SortedTable[LitPlace, tuple[PixelReport, Inspector]]):
    """A click on a heading sorts, one on a row marks that light in the picture."""

    names = ("adds", "power", "distance", "weight", "bounces", "light")
    short = ("%", "Φ {}W", "d {}m", "G %", "n", "light")
    widths = (1.15, 1.0, 1.05, 1.0, 0.6, 0.8)
    tips = (
        "to the pixel in this pass, luminance, of the sum of them all",
        "luminance of the power that it stands for",
        "from the point that the pixel sees",
        "its share of the sum of weights here; 0 of light that is not weighted",
        "scatterings before",
        "the number of the light that its photon came from",
    )
    most_first = (0, 1, 3)

    def draw(self, report: PixelReport, place: LitPlace, inspector: Inspector) -> None:
        """In a region of its own that scrolls."""
        if not len(place.number):
            wrapped("No virtual light of the latest pass reaches this surface.")
            return
        self.draw_table(place, (report, inspector), len(place.number))

    def columns_of(self, of: LitPlace) -> tuple[NDArray[np.float64], ...]:
        adds = luminance(of.adds)
        return (
            adds / max(float(adds.sum()), 1e-30),
            luminance(of.Phi),
            of.distance,
            of.weight / max(float(of.weight.sum()), 1e-30),
            of.bounces.astype(np.float64),
            of.light.astype(np.float64),
        )

    def row(self, row: int, of: LitPlace, context: tuple[PixelReport, Inspector]) -> None:
        report, inspector = context
        share, power, distance, weight, bounces, light = (float(column[row]) for column in self.columns)
        here = ChosenLight(report.index, int(of.number[row]))
        chosen = inspector.light == here
        if imgui.selectable(f"{100 * share:.1f}##{row}", chosen, imgui.SelectableFlags_.span_all_columns)[0]:
            inspector.light = None if chosen else here
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            name = report.lights[int(light)] if int(light) < len(report.lights) else ""
            imgui.set_tooltip(theme.drawable(f"on {of.objects[row]}, from {name}. Click: marks it"))
        power, distance, weight = power / self.units[1][0], distance / self.units[2][0], 100 * weight
        for text in (f"{power:.3g}", f"{distance:.2f}", f"{weight:.1f}", f"{bounces:.0f}", f"{light + 1:.0f}"):
            imgui.table_next_column()
            imgui.text_unformatted(text)
