"""What a pass adds to the film, as small as it gets without losing a bit.

Each column goes as float32 where that is exact, which it is for what kernels compute in float32, as float64 otherwise,
and not at all where it is zero; of a region its pixels alone. LZ4 halves the rest once more at a gigabyte a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.film import Increment

Span = tuple[int, int]


@dataclass(frozen=True)
class Columns:
    """A (rows, columns) array of float64 sums: `exact` are the numbers of the columns in `narrow` (float32), `others`
    those in `wide` (float64), each column after column and compressed; all others are zero."""

    columns: int
    exact: tuple[int, ...]
    others: tuple[int, ...]
    narrow: bytes
    wide: bytes


@dataclass(frozen=True)
class PackedIncrement:
    """An increment on the wire. `spans` are the pixels that the pass renders, first and last + 1."""

    pixels: int
    spans: tuple[Span, ...]
    sums: Columns
    weights: Columns | None

    @property
    def bytes(self) -> int:
        """What travels."""
        parts = [self.sums] if self.weights is None else [self.sums, self.weights]
        return sum(len(part.narrow) + len(part.wide) for part in parts)


def pack(increment: Increment, spans: Sequence[Span]) -> PackedIncrement:
    """Without a loss: every bit comes back. Pixels beyond `spans` are as in an empty film and don't travel."""
    rows = _rows(spans)
    weights = None if increment.weights is None else _packed(increment.weights[rows])
    return PackedIncrement(len(increment.sums), tuple(spans), _packed(increment.sums[rows]), weights)


def unpack(packed: PackedIncrement, blank: NDArray[np.float64]) -> Increment:
    """The increment again; `blank` (columns,) are the sums of a pixel of an empty film, which those have that nothing
    was rendered of."""

    def whole(columns: Columns, empty: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty((packed.pixels, columns.columns))
        out[:] = empty
        _unpack_into(out, _rows(packed.spans), columns)
        return out

    weights = None if packed.weights is None else whole(packed.weights, np.zeros(packed.weights.columns))
    return Increment(whole(packed.sums, blank), weights)


def _rows(spans: Sequence[Span]) -> slice | NDArray[np.int64]:
    if len(spans) == 1:
        return slice(*spans[0])
    return np.concatenate([np.arange(first, last) for first, last in spans])


def _packed(values: NDArray[np.float64]) -> Columns:
    from lz4.frame import compress

    by_column = np.ascontiguousarray(values.T)
    with np.errstate(over="ignore", invalid="ignore"):
        narrow = by_column.astype(np.float32)
        same = [_same_bits(column, wide) for column, wide in zip(narrow, by_column)]
    empty = [not column.view(np.uint64).any() for column in by_column]
    exact = tuple(c for c, is_same in enumerate(same) if is_same and not empty[c])
    others = tuple(c for c, is_same in enumerate(same) if not is_same)
    return Columns(
        values.shape[1],
        exact,
        others,
        compress(narrow[list(exact)].tobytes()),
        compress(by_column[list(others)].tobytes()),
    )


def _same_bits(narrow: NDArray[np.float32], wide: NDArray[np.float64]) -> bool:
    """Whether each comes back from float32 bit for bit; signs of zeros and NaN count."""
    return bool(np.array_equal(narrow.astype(np.float64).view(np.uint64), wide.view(np.uint64)))


def _unpack_into(out: NDArray[np.float64], rows: slice | NDArray[np.int64], columns: Columns) -> None:
    from lz4.frame import decompress

    out[rows] = 0.0
    parts: list[tuple[tuple[int, ...], NDArray[np.floating]]] = [
        (columns.exact, np.frombuffer(decompress(columns.narrow), np.float32)),
        (columns.others, np.frombuffer(decompress(columns.wide), np.float64)),
    ]
    for names, values in parts:
        if names:
            for column, sums in zip(names, values.reshape(len(names), -1)):
                out[rows, column] = sums
