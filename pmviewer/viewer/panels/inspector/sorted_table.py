"""A table of numbers that a click on a heading sorts, and that may have very many rows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

LINES = 11
NARROW = 11.0
"""In widths of a letter M: below it the table scrolls sideways."""

Of = TypeVar("Of")
Context = TypeVar("Context")


def ordered(values: NDArray[np.float64], descending: bool) -> NDArray[np.int64]:
    """Rows by that column; rows alike stay in the order that they have."""
    return np.argsort(-values if descending else values, kind="stable").astype(np.int64)


def unit_of(largest: float) -> tuple[float, str]:
    """The factor and the prefix that a column up to this value is written with."""
    for factor, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if largest >= factor:
            return factor, prefix
    return 1e-12, "p"


class SortedTable(ABC, Generic[Of, Context]):
    """It remembers how it is sorted. `names` of the columns; `short`, their headings as there is little room, with a
    place for the prefix of the unit where they have one; `widths`, relative; `tips`; `most_first`: the columns that a
    first click sorts from the largest on."""

    names: ClassVar[tuple[str, ...]]
    short: ClassVar[tuple[str, ...]]
    widths: ClassVar[tuple[float, ...]]
    tips: ClassVar[tuple[str, ...]]
    most_first: ClassVar[tuple[int, ...]]

    def __init__(self) -> None:
        self._of: Of | None = None
        self.columns: tuple[NDArray[np.float64], ...] = ()
        self.units: tuple[tuple[float, str], ...] = ((1.0, ""),) * len(self.names)
        self._order: NDArray[np.int64] = np.zeros(0, np.int64)
        self._sorting = 0, True
        self._narrow = False

    @abstractmethod
    def columns_of(self, of: Of) -> tuple[NDArray[np.float64], ...]:
        """The numbers of each column, (m,) each."""

    @abstractmethod
    def row(self, row: int, of: Of, context: Context) -> None:
        """Draw that row's cells into the table's next row."""

    def draw_table(self, of: Of, context: Context, rows: int) -> None:
        """In a region of its own that scrolls; there are that many rows, at least one."""
        flags = imgui.TableFlags_.sortable | imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg
        narrow = imgui.get_content_region_avail().x < NARROW * imgui.get_font_size()
        flags |= (
            imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.scroll_x
            if narrow
            else imgui.TableFlags_.sizing_stretch_prop
        )
        height = (min(rows, LINES) + 1.4) * imgui.get_text_line_height_with_spacing()
        imgui.push_style_var(imgui.StyleVar_.cell_padding, (3, 1))
        if imgui.begin_table(f"##{type(self).__name__}", len(self.names), flags, (0, height)):
            self._take(of)
            self._narrow = narrow
            self._headings()
            self._sort()
            clipper = imgui.ListClipper()
            clipper.begin(len(self._order))
            while clipper.step():
                for line in range(clipper.display_start, clipper.display_end):
                    imgui.table_next_row()
                    imgui.table_next_column()
                    self.row(int(self._order[line]), of, context)
            imgui.end_table()
        imgui.pop_style_var()

    def _headings(self) -> None:
        imgui.table_setup_scroll_freeze(0, 1)
        descending = imgui.TableColumnFlags_.prefer_sort_descending
        for number, name in enumerate(self.names):
            first = imgui.TableColumnFlags_.default_sort if number == 0 else imgui.TableColumnFlags_.none
            flags = first | descending if number in self.most_first else first
            imgui.table_setup_column(name, flags, 0.0 if self._narrow else self.widths[number])
        imgui.table_next_row(imgui.TableRowFlags_.headers)
        for number, (name, tip) in enumerate(zip(self.names, self.tips, strict=True)):
            imgui.table_set_column_index(number)
            imgui.table_header(f"{self.short[number].format(self.units[number][1])}###{name}")
            imgui.set_item_tooltip(f"{name}: {tip}")

    def _take(self, of: Of) -> None:
        if of is not self._of:
            self._of, self.columns = of, self.columns_of(of)
            self.units = tuple(unit_of(float(values.max())) for values in self.columns)
            self._order = ordered(self.columns[self._sorting[0]], self._sorting[1])

    def _sort(self) -> None:
        specs, sorting = imgui.table_get_sort_specs(), self._sorting
        if specs is not None and specs.specs_count:
            first = specs.get_specs(0)
            sorting = int(first.column_index), first.get_sort_direction() == imgui.SortDirection.descending
        if sorting != self._sorting:
            self._sorting = sorting
            self._order = ordered(self.columns[sorting[0]], sorting[1])
