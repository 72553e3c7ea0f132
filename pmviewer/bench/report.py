"""What a bench returns and how it is shown: a table, then one line for each target it measures."""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import TextIO

Cell = str | float | int


@dataclass(frozen=True)
class Target:
    """A measured value against its bound, both in `unit`. `id` is the target's name in the project's list ("P9")."""

    id: str
    value: float
    bound: float
    unit: str
    larger_is_better: bool
    note: str = ""

    @property
    def ok(self) -> bool:
        """False for NaN too: what could not be measured doesn't hold."""
        return self.value >= self.bound if self.larger_is_better else self.value <= self.bound

    def line(self) -> str:
        """`TARGET P9 87 ms <= 100 ms ok`, or `… short`, and the note in parentheses."""
        unit = f" {self.unit}" if self.unit else ""
        relation = ">=" if self.larger_is_better else "<="
        value, bound = _distinct(float(self.value), float(self.bound))
        verdict = "ok" if self.ok else "short"
        note = f" ({self.note})" if self.note else ""
        return f"TARGET {self.id} {value}{unit} {relation} {bound}{unit} {verdict}{note}"


@dataclass(frozen=True)
class BenchResult:
    """A titled table with the targets that it decides and remarks on how it was measured."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    targets: Sequence[Target]
    notes: Sequence[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"{self.title}: a row has {len(row)} cells for {len(self.columns)} columns: {row}")


def format_number(value: float, digits: int = 3) -> str:
    """`value` with that many significant digits: 0.0123, 1.50, 87.2, 12345; 1.23e-05 and 1.23e+09 where zeros would
    be counted. Digits before the point are never rounded away below 1e7; whole numbers stay whole (2, not 2.00)."""
    if math.isnan(value):
        return "nan"
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    size = abs(value)
    if size >= 1e7 or 0 < size < 1e-3:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{exponent}"
    if value == int(value):
        return str(int(value))
    # The magnitude after rounding: 9.996 has the decimals of 10.0.
    magnitude = math.floor(math.log10(float(f"{size:.{digits - 1}e}")))
    return f"{value:.{max(digits - 1 - magnitude, 0)}f}"


def _distinct(value: float, bound: float) -> tuple[str, str]:
    """The bound in full and the value rounded, with more digits where rounding would show a miss as a hit."""
    text = format_number(value)
    for digits in range(4, 18):
        if float(text) != bound or value == bound:
            break
        text = format_number(value, digits)
    return text, str(int(bound)) if bound.is_integer() and abs(bound) < 1e15 else f"{bound:.15g}"


def format_cell(cell: Cell) -> str:
    """Text of a table cell: whole numbers with thousands apart, others with three significant digits."""
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, Integral):
        return f"{int(cell):,}".replace(",", " ")
    if isinstance(cell, Real):
        return format_number(float(cell))
    return str(cell)


def _numeric(rows: Sequence[Sequence[Cell]], column: int) -> bool:
    return any(isinstance(row[column], Real) for row in rows)


def to_text(result: BenchResult) -> str:
    """The table in aligned columns (numbers to the right), notes, then the TARGET lines."""
    cells = [[format_cell(cell) for cell in row] for row in result.rows]
    lines = [list(result.columns), *cells]
    count = len(result.columns)
    widths = [max(len(line[i]) for line in lines) for i in range(count)]
    right = [_numeric(result.rows, i) for i in range(count)]

    def joined(line: Sequence[str]) -> str:
        padded = (t.rjust(w) if r else t.ljust(w) for t, w, r in zip(line, widths, right, strict=True))
        return "  ".join(padded).rstrip()

    rule = "  ".join("─" * w for w in widths)
    text = [result.title, "", joined(lines[0]), rule, *(joined(line) for line in cells), ""]
    text += [f"note: {note}" for note in result.notes]
    text += [target.line() for target in result.targets]
    return "\n".join(text).rstrip() + "\n"


def print_result(result: BenchResult, file: TextIO | None = None) -> None:
    """Write `to_text` to `file`, standard output if not given; signs its encoding lacks are replaced, not fatal."""
    stream = sys.stdout if file is None else file
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(to_text(result).encode(encoding, "replace").decode(encoding))
    stream.flush()


def to_csv(result: BenchResult) -> str:
    """The table alone, RFC 4180 with a header row, numbers unrounded."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\r\n")
    writer.writerow(result.columns)
    for row in result.rows:
        writer.writerow([_plain(cell) for cell in row])
    return buffer.getvalue()


def _plain(cell: Cell) -> Cell:
    """Python's own number, whose text is the shortest that reads back the same."""
    if isinstance(cell, bool | str):
        return cell
    return int(cell) if isinstance(cell, Integral) else float(cell)


def to_markdown(result: BenchResult) -> str:
    """The table, notes and targets as Markdown."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    rule = [("---:" if _numeric(result.rows, i) else "---") for i in range(len(result.columns))]
    text = [f"## {result.title}", "", line(result.columns), line(rule)]
    text += [line([format_cell(cell) for cell in row]) for row in result.rows]
    if result.notes:
        text += ["", *(f"- {note}" for note in result.notes)]
    if result.targets:
        text += ["", "```", *(target.line() for target in result.targets), "```"]
    return "\n".join(text) + "\n"
