"""The photons of a look-up as a table, and the life of one of them."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import LookUp, PhotonAt, PhotonLife, PixelReport, luminance
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.gl.records import brightest_channel
from pmviewer.viewer.inspector import Inspector
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.panels.inspector.sorted_table import SortedTable

CLASSES = ("direct", "indirect", "caustic", "indirect caustic")


class PhotonTable(SortedTable[LookUp, tuple[PixelReport, Inspector]]):
    """A click on a heading sorts, one on a row tells that photon's life."""

    names = ("adds", "power", "distance", "weight", "bounces", "light")
    short = ("%", "Φ {}W", "d {}m", "w", "n", "light")
    widths = (1.15, 1.0, 1.05, 0.9, 0.6, 0.8)
    tips = (
        "to the pixel in this pass, luminance, of the sum of them all",
        "luminance of its power",
        "from the point that the pixel sees",
        "of the kernel (estimate.filter), less on the rim of the k nearest (estimate.rim)",
        "scatterings before",
        "the number of the light that it came from",
    )
    most_first = (0, 1, 3)

    def draw(self, report: PixelReport, look_up: LookUp, inspector: Inspector) -> None:
        """In a region of its own that scrolls."""
        if not look_up.found.n:
            wrapped("No photon lies within the radius.")
            return
        self.draw_table(look_up, (report, inspector), look_up.found.n)

    def columns_of(self, of: LookUp) -> tuple[NDArray[np.float64], ...]:
        found = of.found
        adds = luminance(found.adds)
        return (
            adds / max(float(adds.sum()), 1e-30),
            luminance(found.Phi),
            found.distance,
            found.weight,
            found.bounces.astype(np.float64),
            found.light.astype(np.float64),
        )

    def row(self, row: int, of: LookUp, context: tuple[PixelReport, Inspector]) -> None:
        found, (report, inspector) = of.found, context
        share, power, distance, weight, bounces, light = (float(column[row]) for column in self.columns)
        x, y, z = (float(v) for v in found.records[row, :3])
        photon = PhotonAt(report.index, report.N, (x, y, z))
        spans = imgui.SelectableFlags_.span_all_columns
        chosen = inspector.photon is not None and inspector.photon.position == photon.position
        if imgui.selectable(f"{100 * share:.1f}##{row}", chosen, spans)[0]:
            inspector.choose(None if chosen else photon)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            name = report.lights[int(light)] if int(light) < len(report.lights) else ""
            kind = CLASSES[found.path_class[row]] + wavelength_text(float(found.wavelength[row]))
            imgui.set_tooltip(theme.drawable(f"{kind}, from {name}. Click: its path"))
        power, distance = power / self.units[1][0], distance / self.units[2][0]
        for text in (f"{power:.3g}", f"{distance:.2f}", f"{weight:.2f}", f"{bounces:.0f}", f"{light + 1:.0f}"):
            imgui.table_next_column()
            imgui.text_unformatted(text)


def wavelength_text(nm: float) -> str:
    """What is said of a photon's wavelength, nothing where it has none."""
    return f", {nm:.0f} nm" if nm == nm else ""


def life_rows(life: PhotonLife) -> list[tuple[str, str]]:
    """Where the photon was and with which power on the way there, as a share of that with which it left its light."""
    power = brightest_channel(life.vertices)
    start = max(float(power[0]), 1e-30)
    wavelength = life.wavelengths if len(life.wavelengths) else [float("nan")] * len(life.vertices)
    rows = [(f"leaves {life.light}", si(float(power[0]) * life.power_unit, "W"))]
    for number in range(1, len(life.vertices)):
        here = "  ‹ stored here" if number == life.stored_at else ""
        rows.append((f"surface {number}{here}", f"{power[number] / start:.3g} ×{wavelength_text(wavelength[number])}"))
    return rows


def draw_life(life: PhotonLife) -> None:
    """The trajectory in words; the picture shows it."""
    if life.note:
        wrapped(life.note)
        return
    wrapped(f"Trajectory {grouped(life.trajectory + 1)} of pass {life.of.index + 1}; brightest channel of its power:")
    if imgui.begin_table("##life", 2):
        imgui.table_setup_column("where", imgui.TableColumnFlags_.width_stretch)
        imgui.table_setup_column("power", imgui.TableColumnFlags_.width_fixed)
        for number, (where, power) in enumerate(life_rows(life)):
            colour = imgui.ImVec4(*(theme.ACCENT if number == life.stored_at else theme.TEXT))
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_colored(colour, theme.drawable(where))
            imgui.table_next_column()
            imgui.text_colored(colour, power)
        imgui.end_table()
