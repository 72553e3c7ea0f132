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

LINES = 11
NARROW = 11.0
"""In widths of a letter M: below it the table scrolls sideways."""
COLUMNS = ("adds", "power", "distance", "weight", "bounces", "light")
_SHORT = ("%", "Φ {}W", "d {}m", "w", "n", "light")
"""Headings, as there is little room: with the prefix of the unit."""
_WIDTHS = (1.15, 1.0, 1.05, 0.9, 0.6, 0.8)
_TIPS = (
    "to the pixel in this pass, luminance, of the sum of them all",
    "luminance of its power",
    "from the point that the pixel sees",
    "of the kernel (estimate.filter), less on the rim of the k nearest (estimate.rim)",
    "scatterings before",
    "the number of the light that it came from",
)
CLASSES = ("direct", "indirect", "caustic", "indirect caustic")


def columns(look_up: LookUp) -> tuple[NDArray[np.float64], ...]:
    """The table's numbers by column, (m,) each."""
    found = look_up.found
    adds = luminance(found.adds)
    return (
        adds / max(float(adds.sum()), 1e-30),
        luminance(found.Phi),
        found.distance,
        found.weight,
        found.bounces.astype(np.float64),
        found.light.astype(np.float64),
    )


def ordered(values: NDArray[np.float64], descending: bool) -> NDArray[np.int64]:
    """Rows by that column; rows alike stay in the order of their distances."""
    return np.argsort(-values if descending else values, kind="stable").astype(np.int64)


def unit_of(largest: float) -> tuple[float, str]:
    """The factor and the prefix that a column up to this value is written with."""
    for factor, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if largest >= factor:
            return factor, prefix
    return 1e-12, "p"


class PhotonTable:
    """A click on a heading sorts, one on a row tells that photon's life. It remembers how it is sorted."""

    def __init__(self) -> None:
        self._of: LookUp | None = None
        self._columns: tuple[NDArray[np.float64], ...] = ()
        self._order: NDArray[np.int64] = np.zeros(0, np.int64)
        self._sorting = 0, True
        self._narrow = False
        self._units: tuple[tuple[float, str], ...] = ((1.0, ""),) * len(COLUMNS)

    def draw(self, report: PixelReport, look_up: LookUp, inspector: Inspector) -> None:
        """In a region of its own that scrolls."""
        if not look_up.found.n:
            wrapped("No photon lies within the radius.")
            return
        flags = imgui.TableFlags_.sortable | imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg
        narrow = imgui.get_content_region_avail().x < NARROW * imgui.get_font_size()
        flags |= (
            imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.scroll_x
            if narrow
            else imgui.TableFlags_.sizing_stretch_prop
        )
        height = (min(look_up.found.n, LINES) + 1.4) * imgui.get_text_line_height_with_spacing()
        imgui.push_style_var(imgui.StyleVar_.cell_padding, (3, 1))
        if imgui.begin_table("##photons", len(COLUMNS), flags, (0, height)):
            self._take(look_up)
            self._narrow = narrow
            self._headings()
            self._sort()
            clipper = imgui.ListClipper()
            clipper.begin(len(self._order))
            while clipper.step():
                for line in range(clipper.display_start, clipper.display_end):
                    self._row(int(self._order[line]), report, look_up, inspector)
            imgui.end_table()
        imgui.pop_style_var()

    def _headings(self) -> None:
        imgui.table_setup_scroll_freeze(0, 1)
        descending = imgui.TableColumnFlags_.prefer_sort_descending
        for number, name in enumerate(COLUMNS):
            first = imgui.TableColumnFlags_.default_sort if number == 0 else imgui.TableColumnFlags_.none
            flags = first | descending if number in (0, 1, 3) else first
            imgui.table_setup_column(name, flags, 0.0 if self._narrow else _WIDTHS[number])
        imgui.table_next_row(imgui.TableRowFlags_.headers)
        for number, (name, tip) in enumerate(zip(COLUMNS, _TIPS, strict=True)):
            imgui.table_set_column_index(number)
            prefix = self._units[number][1]
            imgui.table_header(f"{_SHORT[number].format(prefix)}###{name}")
            imgui.set_item_tooltip(f"{name}: {tip}")

    def _take(self, look_up: LookUp) -> None:
        if look_up is not self._of:
            self._of, self._columns = look_up, columns(look_up)
            self._units = tuple(unit_of(float(values.max())) for values in self._columns)
            self._order = ordered(self._columns[self._sorting[0]], self._sorting[1])

    def _sort(self) -> None:
        specs, sorting = imgui.table_get_sort_specs(), self._sorting
        if specs is not None and specs.specs_count:
            first = specs.get_specs(0)
            sorting = int(first.column_index), first.get_sort_direction() == imgui.SortDirection.descending
        if sorting != self._sorting:
            self._sorting = sorting
            self._order = ordered(self._columns[sorting[0]], sorting[1])

    def _row(self, row: int, report: PixelReport, look_up: LookUp, inspector: Inspector) -> None:
        found = look_up.found
        share, power, distance, weight, bounces, light = (float(column[row]) for column in self._columns)
        x, y, z = (float(v) for v in found.records[row, :3])
        photon = PhotonAt(report.index, report.N, (x, y, z))
        imgui.table_next_row()
        imgui.table_next_column()
        spans = imgui.SelectableFlags_.span_all_columns
        chosen = inspector.photon is not None and inspector.photon.position == photon.position
        if imgui.selectable(f"{100 * share:.1f}##{row}", chosen, spans)[0]:
            inspector.choose(None if chosen else photon)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            name = report.lights[int(light)] if int(light) < len(report.lights) else ""
            kind = CLASSES[found.path_class[row]] + wavelength_text(float(found.wavelength[row]))
            imgui.set_tooltip(theme.drawable(f"{kind}, from {name}. Click: its path"))
        power, distance = power / self._units[1][0], distance / self._units[2][0]
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
