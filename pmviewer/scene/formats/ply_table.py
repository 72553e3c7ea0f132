"""The elements of a PLY file as columns: its header, and its rows in text or bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.rows import count_words, gather, walk_bytes, walk_numbers
from pmviewer.kernels.meshes.text import numbers

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_HEADER_LIMIT = 1 << 20
_LONGEST_ROW = 1 << 12
"""Items of a list up to which all rows may be of one length, as almost all are."""


@dataclass(frozen=True)
class Property:
    """A column; `type` is NumPy's, `count_type` that of a list's length."""

    name: str
    type: str
    count_type: str | None = None


@dataclass
class Element:
    """What the header says of one kind of rows: `count` of them, each with these properties in this order."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    def least_bytes(self, text: bool) -> int:
        """A row takes at least so many."""
        if text:
            return 2 * len(self.properties)
        return sum(np.dtype(p.count_type or p.type).itemsize for p in self.properties)


@dataclass(frozen=True)
class ListColumn:
    """items[starts[i] : starts[i + 1]] are those of row i."""

    items: NDArray[np.number]
    starts: NDArray[np.int64]


Column = NDArray[np.number] | ListColumn
Columns = dict[str, Column]


@dataclass(frozen=True)
class Header:
    """`order` is the byte order, "" for text; `body` where the rows begin; `comments` without the word itself."""

    order: str
    elements: list[Element]
    body: int
    comments: list[str]


def read_header(data: bytes, path: Path) -> Header:
    """Raises SceneError for what is no header, or one that promises more than the file can hold."""
    begin = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    if data[begin : begin + 3].lower() != b"ply":
        hint = "The large file itself is missing: fetch it (git lfs pull)."
        hint = hint if data.startswith(b"version https://git-lfs") else "Check the file's ending."
        raise SceneError("This is not a PLY file (it has no PLY header).", path, hint=hint)
    order: str | None = None
    elements: list[Element] = []
    comments: list[str] = []
    for number, (line, end) in enumerate(_lines(data, begin), 1):
        words = line.split()
        try:
            match words:
                case ["end_header", *_]:
                    if order is None:
                        raise SceneError("The PLY header names no format.", path)
                    header = Header(order, elements, end, comments)
                    _check_size(header, len(data) - end, path)
                    return header
                case ["format", name, *_]:
                    order = _FORMATS[name.lower()]
                case ["element", name, count, *_]:
                    elements.append(Element(name, int(count)))
                    if elements[-1].count < 0:
                        raise ValueError(count)
                case ["property", "list", count_type, item, name, *_]:
                    elements[-1].properties.append(Property(name, _TYPES[item.lower()], _TYPES[count_type.lower()]))
                case ["property", item, name, *_]:
                    elements[-1].properties.append(Property(name, _TYPES[item.lower()]))
                case ["comment" | "obj_info", *_]:
                    comments.append(line.strip().split(None, 1)[-1])
                case ["element" | "property" | "format", *_]:
                    raise ValueError(line)
                case _:
                    pass  # words of other programs
        except (KeyError, ValueError, IndexError):
            raise SceneError(f"The PLY header's line {line[:60]!r} is not understood.", path, number) from None
    raise SceneError("The PLY header has no end (end_header).", path, hint="Is the file complete?")


def _lines(data: bytes, begin: int) -> Iterator[tuple[str, int]]:
    """The lines of the header and the places behind them, whatever ends them; a comment may hold any byte."""
    at, limit = begin, min(len(data), _HEADER_LIMIT)
    while at < limit:
        ends = [end for end in (data.find(b"\n", at, limit), data.find(b"\r", at, limit)) if end >= 0]
        end = min(ends, default=limit)
        line = data[at:end].decode("latin-1")
        at = end + 1
        if data[end : end + 2] == b"\r\n":
            at = end + 2
        yield line, at


def _check_size(header: Header, size: int, path: Path) -> None:
    least = sum(e.count * e.least_bytes(header.order == "") for e in header.elements)
    # The last number of a text needs no blank behind it.
    if least > size + 1:
        counts = ", ".join(f"{e.count:,} × {e.name}" for e in header.elements)
        what = f"The PLY file is cut off: its header promises {counts}, {least:,} bytes at least, and {size:,} follow."
        raise SceneError(what, path, hint="Copy or export it again.")


def read_columns(data: bytes, header: Header, path: Path) -> dict[str, Columns]:
    """All elements' columns by name. Raises SceneError for data that do not fit the header."""
    result: dict[str, Columns] = {}
    at = header.body
    if header.order == "":
        bytes_ = np.frombuffer(data + b"\n\n\n", np.uint8)
        source = np.empty(count_words(bytes_, at))
        numbers(bytes_, at, source)
        at = 0
    else:
        source = np.frombuffer(data, np.uint8)
    for element in header.elements:
        if element.count and element.properties:
            result[element.name], at = _read_element(source, at, header.order, element, path)
    return result


def _read_element(source: NDArray, at: int, order: str, element: Element, path: Path) -> tuple[Columns, int]:
    """The columns of an element that begins at a place (byte, or number of a text), and the place behind it."""
    row = _uniform_row(source, at, order, element)
    if row is not None:
        end = at + element.count * (row.itemsize if order else row.itemsize // 8)
        return _columns_of(source[at:end].view(row), element), end
    n, p = element.count, len(element.properties)
    places, lengths = np.empty((n, p), np.int64), np.empty((n, p), np.int64)
    counted = [np.dtype(x.count_type) if x.count_type else None for x in element.properties]
    if order:
        sizes = np.array([np.dtype(x.type).itemsize for x in element.properties])
        count_sizes = np.array([0 if c is None else c.itemsize for c in counted])
        signed = np.array([c is not None and c.kind == "i" for c in counted])
        end = walk_bytes(source, at, sizes, count_sizes, signed, order == ">", places, lengths)
    else:
        end = walk_numbers(source, at, np.array([c is not None for c in counted]), places, lengths)
    if end < 0:
        reason = f"there are fewer than {n:,} rows" if end == -1 else "the length of a list is negative or absurd"
        what = f"The PLY file's data do not fit its header: {reason} (element '{element.name}')."
        raise SceneError(what, path, hint="Is it complete? Export it again.")
    columns: Columns = {}
    for k, x in enumerate(element.properties):
        size = np.dtype(x.type).itemsize if order else 1
        items = np.empty(int(lengths[:, k].sum()) * size, source.dtype)
        gather(source, np.ascontiguousarray(places[:, k]), np.ascontiguousarray(lengths[:, k]), size, items)
        values = items.view(order + x.type) if order else items
        if x.count_type is None:
            columns[x.name] = _typed(values, x)
        else:
            columns[x.name] = ListColumn(values, np.concatenate([[0], np.cumsum(lengths[:, k])]))
    return columns, end


def _uniform_row(source: NDArray, at: int, order: str, element: Element) -> np.dtype | None:
    """Row type if all lists are as long as the first row's, else None."""
    fields: list[tuple] = []
    for i, p in enumerate(element.properties):
        item = order + p.type if order else "f8"
        if p.count_type is None:
            fields.append((f"p{i}", item))
            continue
        count = np.dtype(order + p.count_type if order else "f8")
        before = np.dtype(fields).itemsize if fields else 0
        place = at + (before if order else before // 8)
        one = source[place : place + (count.itemsize if order else 1)]
        if one.nbytes < count.itemsize:
            return None
        length = one.view(count)[0]
        if not 0 <= length <= _LONGEST_ROW:
            return None
        fields += [(f"c{i}", count), (f"p{i}", item, (int(length),))]
    row = np.dtype(fields)
    end = at + element.count * (row.itemsize if order else row.itemsize // 8)
    if row.itemsize == 0 or end > len(source):
        return None
    rows = source[at:end].view(row)
    if any((rows[name] != rows[name][0]).any() for name in row.names or () if name.startswith("c")):
        return None
    return row


def _typed(values: NDArray, p: Property) -> NDArray:
    """Whole numbers of a text in their own type, which tells bytes of colours from shares."""
    if values.dtype.kind != "f" or np.dtype(p.type).kind == "f":
        return values
    with np.errstate(invalid="ignore"):
        return values.astype(p.type)


def _columns_of(rows: NDArray, element: Element) -> Columns:
    columns: Columns = {}
    for i, p in enumerate(element.properties):
        values = rows[f"p{i}"]
        if p.count_type is None:
            columns[p.name] = _typed(values, p)
        else:
            n, length = values.shape
            columns[p.name] = ListColumn(values.reshape(-1), np.arange(n + 1, dtype=np.int64) * length)
    return columns
