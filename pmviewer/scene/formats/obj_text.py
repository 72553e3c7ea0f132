"""The statements of an OBJ file as arrays: compiled passes over pieces of the file, on several threads."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.meshes.text import HASH, ends_line, next_line, number, skip_blanks, skip_word
from pmviewer.progress import parallel

_PIECE = 1 << 22
"""Bytes that one thread reads at a time."""
_V, _VT, _VN, _FACE, _EVENT, _IGNORED, _NOTHING = range(7)
_V_LETTER, _T, _N, _F, _O, _L, _P = (ord(c) for c in "vtnfolp")
_COLOUR_WORDS = 6
"""Numbers after `v` from which three of them are a colour; a fourth or seventh is a weight."""
N_COUNTS = 8
_CORNERS, _COLOURED = 6, 7
MISSING, BAD = -1, -(2**31) + 1

_PAINT = re.compile(rb"^#MRGB[ \t]+((?:[0-9a-fA-F]{8})+)", re.MULTILINE)
"""What ZBrush writes of the colours of vertices."""

Counts = NDArray[np.int64]


@dataclass
class ObjText:
    """`v` (n, 3), `vt` (n, 2), `vn` (n, 3) float64; `colours` (n, 3) or None, NaN where a vertex has none.

    `corners` (m,) int32 are vertices from 0 on, `corner_vt` and `corner_vn` likewise, MISSING where a corner has none,
    or None where no corner in the file has one; indices that can't be are outside of the arrays. Faces are
    corners[starts[i] : starts[i + 1]]. `events` (k, 3) int64: the place of each other statement in `data`, its line,
    and the number of faces before it. `ignored` lines and points were passed over.
    """

    data: bytes
    v: NDArray[np.float64]
    vt: NDArray[np.float64]
    vn: NDArray[np.float64]
    colours: NDArray[np.float64] | None
    corners: NDArray[np.int32]
    corner_vt: NDArray[np.int32] | None
    corner_vn: NDArray[np.int32] | None
    starts: NDArray[np.int64]
    events: NDArray[np.int64]
    ignored: int

    def statements(self) -> Iterator[tuple[str, str, int, int]]:
        """Keyword, argument, line and number of faces before it of the events."""
        for place, line, face in self.events.tolist():
            end = self.data.find(b"\n", place)
            words = decoded(self.data[place:end]).split(None, 1)
            if words:
                yield words[0].lower(), words[1].strip() if len(words) > 1 else "", line, face


def decoded(data: bytes) -> str:
    """UTF-8, or Latin-1 where it isn't."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_text(data: bytes) -> ObjText:
    """All statements of a file. What is no number becomes NaN, what is no index BAD."""
    data = _normalised(data)
    bytes_ = np.frombuffer(data, np.uint8)
    pieces = _pieces(data)
    counts = np.zeros((len(pieces), N_COUNTS), np.int64)
    lines = parallel([partial(count_statements, bytes_, i, j, row) for (i, j), row in zip(pieces, counts)])
    before = np.cumsum(counts, axis=0) - counts
    total = counts.sum(axis=0)
    first_lines = np.cumsum([1, *lines[:-1]])
    arrays = _room_for(total)
    parallel(
        [
            partial(read_statements, bytes_, i, j, row, line, arrays)
            for (i, j), row, line in zip(pieces, before, first_lines.tolist())
        ]
    )
    return ObjText(
        data=data,
        v=arrays.v,
        vt=arrays.vt,
        vn=arrays.vn,
        colours=arrays.colours if total[_COLOURED] else _painted(data, len(arrays.v)),
        corners=arrays.corners,
        corner_vt=arrays.corner_vt if len(arrays.corner_vt) else None,
        corner_vn=arrays.corner_vn if len(arrays.corner_vn) else None,
        starts=arrays.starts,
        events=arrays.events,
        ignored=int(total[_IGNORED]),
    )


def _painted(data: bytes, count: int) -> NDArray[np.float64] | None:
    """(count, 3) colours from 0 to 1 of ZBrush's comments, "#MRGB" and then eight hexadecimal digits a vertex: a mask,
    red, green and blue. None if there are none, or not as many as vertices."""
    digits = b"".join(_PAINT.findall(data)) if b"#MRGB" in data else b""
    if not count or len(digits) != 8 * count:
        return None
    return np.frombuffer(bytes.fromhex(digits.decode("ascii")), np.uint8).reshape(-1, 4)[:, 1:] / 255.0


def _normalised(data: bytes) -> bytes:
    """The file as UTF-8 or Latin-1 with one line a statement, ended by line feeds, and two at the end."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16", "replace").encode("utf-8")
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\\" in data:  # a line that goes on in the next one
        data = re.sub(rb"\\[ \t]*\r?\n", lambda match: b" " * len(match[0]), data)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data.replace(b"\0", b" ") + b"\n\n" if b"\0" in data else data + b"\n\n"


def _pieces(data: bytes) -> list[tuple[int, int]]:
    """Begin and end of pieces of whole lines, of about _PIECE bytes."""
    ends = [0]
    while ends[-1] < len(data):
        cut = data.find(b"\n", min(ends[-1] + _PIECE, len(data) - 1)) + 1
        ends.append(cut or len(data))
    return list(pairwise(ends))


def _room_for(total: Counts) -> _Arrays:
    """Arrays for so many statements (N_COUNTS,)."""
    v, vt, vn = (np.empty((total[kind], width)) for kind, width in ((_V, 3), (_VT, 2), (_VN, 3)))
    corners = np.empty(total[_CORNERS], np.int32)
    starts = np.empty(total[_FACE] + 1, np.int64)
    starts[-1] = len(corners)
    return _Arrays(
        v=v,
        vt=vt,
        vn=vn,
        colours=np.full((len(v), 3), np.nan) if total[_COLOURED] else np.empty((0, 3)),
        corners=corners,
        corner_vt=np.empty(len(corners) if len(vt) else 0, np.int32),
        corner_vn=np.empty(len(corners) if len(vn) else 0, np.int32),
        starts=starts,
        events=np.empty((total[_EVENT], 3), np.int64),
    )


@device
def _lower(sign):
    """Of a capital its small letter."""
    return sign + 32 if 65 <= sign <= 90 else sign + 0


@device
def _kind(data, i):
    """Of the statement at i, whose keyword may be in capitals. The old `fo` is `f`."""
    a, b = _lower(data[i]), _lower(data[i + 1])
    if ends_line(a) or a == HASH:
        return _NOTHING
    if a == _V_LETTER:
        if b <= 32:
            return _V
        if data[i + 2] <= 32:
            if b == _T:
                return _VT
            if b == _N:
                return _VN
    elif a == _F and (b <= 32 or (b == _O and data[i + 2] <= 32)):
        return _FACE
    elif b <= 32 and (a == _L or a == _P):  # noqa: SIM109
        return _IGNORED
    return _EVENT


@device
def _words(data, i):
    """How many words there are from i to the end of the line."""
    count = 0
    i = skip_blanks(data, i)
    while not ends_line(data[i]) and data[i] != HASH:
        count += 1
        i = skip_blanks(data, _past(data, i))
    return count


@device
def _past(data, i):
    """Behind the word at i; other signs below the blank count as blanks."""
    j = skip_word(data, i)
    return j if j > i or ends_line(data[i]) else i + 1


@kernel
def count_statements(data, begin, end, counts):
    """Count what the lines of data[begin:end] hold; returns the number of lines."""
    i, lines = begin, 0
    while i < end:
        i = skip_blanks(data, i)
        kind = _kind(data, i)
        if kind != _NOTHING:
            counts[kind] += 1
        if kind == _V:
            if _words(data, i + 1) >= _COLOUR_WORDS:
                counts[_COLOURED] += 1
        elif kind == _FACE:
            counts[_CORNERS] += _words(data, skip_word(data, i))
        i = next_line(data, i)
        lines += 1
    return lines


@device
def _index(data, i, known):
    """The index at i, counted from 0 (`known` elements precede a negative one), and the place behind its digits."""
    negative = data[i] == 45
    if negative or data[i] == 43:
        i += 1
    value, digits = np.int64(0), 0
    while 48 <= data[i] <= 57:
        if value < 2**40:
            value = value * 10 + np.int64(data[i]) - 48
        digits += 1
        i += 1
    if digits == 0:
        return np.int64(MISSING), i
    value = known - value if negative else value - 1
    # An index of 0 and those beyond 32 bits must not become valid ones.
    if value < 0 or value >= 2**31 - 1:
        return np.int64(BAD), i
    return value, i


@device
def _row(data, i, out, row, width):
    """Up to `width` numbers into a row; what is missing becomes 0 in vt, else NaN."""
    for k in range(width):
        i = skip_blanks(data, i)
        if ends_line(data[i]) or data[i] == HASH:
            out[row, k] = np.nan if width == 3 else 0.0
        else:
            out[row, k], i = number(data, i)


class _Arrays(NamedTuple):
    """What statements are read into, as in `ObjText`; an array that the file has nothing for has the length 0."""

    v: Any
    vt: Any
    vn: Any
    colours: Any
    corners: Any
    corner_vt: Any
    corner_vn: Any
    starts: Any
    events: Any


@kernel
def read_statements(data, begin, end, counts, line, arrays):
    """Fill the arrays from the lines of data[begin:end]; `counts` tells what precedes them."""
    # Taken apart here: counting references to all of them would cost every statement.
    v, vt, vn, colours, corners, corner_vt, corner_vn, starts, events = arrays
    n_v, n_vt, n_vn, n_face = counts[_V], counts[_VT], counts[_VN], counts[_FACE]
    n_event, n_corner = counts[_EVENT], counts[_CORNERS]
    i = begin
    while i < end:
        i = skip_blanks(data, i)
        kind = _kind(data, i)
        if kind == _V:
            words = _words(data, i + 1) if len(colours) > 0 else 0
            _row(data, i + 1, v, n_v, 3)
            if words >= _COLOUR_WORDS:
                j = skip_blanks(data, i + 1)
                for _ in range(words - 3 if words == _COLOUR_WORDS else 4):
                    j = skip_blanks(data, _past(data, j))
                _row(data, j, colours, n_v, 3)
            n_v += 1
        elif kind == _VT:
            _row(data, i + 2, vt, n_vt, 2)
            n_vt += 1
        elif kind == _VN:
            _row(data, i + 2, vn, n_vn, 3)
            n_vn += 1
        elif kind == _FACE:
            starts[n_face] = n_corner
            n_face += 1
            j = skip_blanks(data, skip_word(data, i))
            while not ends_line(data[j]) and data[j] != HASH:
                corners[n_corner], k = _index(data, j, n_v)
                t = n = np.int64(MISSING)
                if data[k] == 47:
                    t, k = _index(data, k + 1, n_vt)
                    if data[k] == 47:
                        n, k = _index(data, k + 1, n_vn)
                if len(corner_vt) > 0:
                    corner_vt[n_corner] = t
                if len(corner_vn) > 0:
                    corner_vn[n_corner] = n
                n_corner += 1
                j = skip_blanks(data, _past(data, j))
        elif kind == _EVENT:
            events[n_event, 0], events[n_event, 1], events[n_event, 2] = i, line, n_face
            n_event += 1
        i = next_line(data, i)
        line += 1
