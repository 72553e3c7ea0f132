"""What a pass adds to the film, as small as it gets without losing a bit.

Each column goes as float32 where that is exact, which it is for what kernels compute in float32, as float64 otherwise,
and not at all where it is zero; of a region its pixels alone. LZ4 makes a quarter of the rest at a gigabyte a second,
which pays between processes of one machine, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.render.film import Addable, Film, Increment

Span = tuple[int, int]
BLOCK = 128
"""Rows that are turned to columns, or back, at a time: they stay in the processor's cache."""


@dataclass(frozen=True)
class Columns:
    """A (rows, columns) array of float64 sums: `exact` are the numbers of the columns in `narrow` (float32), `others`
    those in `wide` (float64), (columns, rows) each and compressed; all others are zero."""

    columns: int
    exact: tuple[int, ...]
    others: tuple[int, ...]
    narrow: bytes
    wide: bytes

    @property
    def bytes(self) -> int:
        """Of all numbers."""
        return len(self.narrow) + len(self.wide)

    def parts(self) -> Iterator[tuple[tuple[int, ...], NDArray[Any]]]:
        """Columns and their numbers, float32 and float64."""
        from lz4.frame import decompress

        for names, part, dtype in ((self.exact, self.narrow, np.float32), (self.others, self.wide, np.float64)):
            if names:
                yield names, np.frombuffer(decompress(part), dtype).reshape(len(names), -1)


@dataclass(frozen=True)
class PackedIncrement(Addable):
    """An increment on the wire. `spans` are the pixels that the pass renders, first and last + 1."""

    pixels: int
    spans: tuple[Span, ...]
    sums: Columns

    @property
    def bytes(self) -> int:
        """What travels."""
        return self.sums.bytes

    def add_to(self, film: Film) -> None:
        if film.numbered is not None:
            unpack(self, film.blank).add_to(film)
            return
        for names, numbers in self.sums.parts():
            begin = 0
            for first, last in self.spans:
                turned_onto(numbers[:, begin : begin + last - first], np.array(names), film.sums[first:last])
                begin += last - first


def pack(increment: Increment, spans: Sequence[Span]) -> PackedIncrement:
    """Without a loss: every bit comes back. Pixels beyond `spans` are as in an empty film and don't travel."""
    return PackedIncrement(len(increment.sums), tuple(spans), _packed(increment.sums[_rows(spans)]))


def unpack(packed: PackedIncrement, blank: NDArray[np.float64]) -> Increment:
    """The increment again; `blank` (columns,) are the sums of a pixel of an empty film, which those have that nothing
    was rendered of."""
    columns, rows = packed.sums, _rows(packed.spans)
    out = np.empty((packed.pixels, columns.columns))
    if packed.spans != ((0, packed.pixels),):
        out[:] = blank
    inside = out[rows] if isinstance(rows, slice) else np.empty((len(rows), columns.columns))
    inside[:, sorted({*range(columns.columns)}.difference(columns.exact, columns.others))] = 0.0
    for names, numbers in columns.parts():
        turned_back(numbers, np.array(names), inside)
    if not isinstance(rows, slice):
        out[rows] = inside
    return Increment(out)


def _rows(spans: Sequence[Span]) -> slice | NDArray[np.int64]:
    if len(spans) == 1:
        return slice(*spans[0])
    return np.concatenate([np.arange(first, last) for first, last in spans])


def _packed(values: NDArray[np.float64]) -> Columns:
    from lz4.frame import compress

    pixels, columns = values.shape
    narrow, inexact, filled = (
        np.empty((columns, pixels), np.float32),
        np.zeros(columns, np.bool_),
        np.zeros(columns, np.bool_),
    )
    values = np.ascontiguousarray(values)
    narrowed(values, values.view(np.uint64), narrow, inexact, filled)
    exact = np.flatnonzero(filled & ~inexact)
    others = np.flatnonzero(inexact)
    wide = np.empty((len(others), pixels))
    turned(values, others, wide)
    kept = narrow if len(exact) == columns else narrow[exact]
    return Columns(columns, tuple(map(int, exact)), tuple(map(int, others)), compress(kept.data), compress(wide.data))


@kernel
def narrowed(values, bits, out, inexact, filled):
    """Values (n, c) float64, and their bits, turned to out (c, n) float32; which columns are not exact so, and which
    are not all zero."""
    n, columns = values.shape
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        for c in range(columns):
            lossy, some = False, False
            for row in range(first, last):
                value = np.float32(values[row, c])
                out[c, row] = value
                lossy |= np.float64(value) != values[row, c]
                some |= bits[row, c] != 0
            inexact[c] |= lossy
            filled[c] |= some


@kernel
def turned(values, chosen, out):
    """Columns of values (n, c) as rows of out (len(chosen), n)."""
    n = len(values)
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        for k in range(len(chosen)):
            for row in range(first, last):
                out[k, row] = values[row, chosen[k]]


@kernel
def turned_back(numbers, chosen, out):
    """Rows of numbers (len(chosen), n) as columns of out (n, c)."""
    n = len(out)
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        for k in range(len(chosen)):
            for row in range(first, last):
                out[row, chosen[k]] = np.float64(numbers[k, row])


@kernel
def turned_onto(numbers, chosen, sums):
    """Add rows of numbers (len(chosen), n) to columns of sums (n, c)."""
    n = len(sums)
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        for k in range(len(chosen)):
            for row in range(first, last):
                sums[row, chosen[k]] += np.float64(numbers[k, row])
