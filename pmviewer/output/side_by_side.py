"""Two pictures beside each other with a caption above each and a table below: what a comparison leaves behind."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

GAP, MARGIN = 8, 10
TEXT = 14
_PLAIN = str.maketrans({"×": "x", "–": "-", "≤": "<=", "→": "->", "…": "..."})
"""What the built-in font lacks."""
GROUND, INK, DIM = (24, 24, 24), (235, 235, 235), (160, 160, 160)


def drawable(text: str) -> str:
    """The text in letters that the built-in font has."""
    return text.translate(_PLAIN)


def side_by_side(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    captions: tuple[str, str],
    rows: Sequence[tuple[str, ...]] = (),
    notes: Sequence[str] = (),
) -> NDArray[np.uint8]:
    """A sheet (h, w, 3) with both pictures (h, w, 3), `captions` above them, a table of `rows` and sentences below."""
    font = ImageFont.load_default(TEXT)
    rows = [tuple(drawable(text) for text in row) for row in rows]
    notes = [drawable(note) for note in notes]
    line = round(TEXT * 1.4)
    height, width = left.shape[:2]
    columns = [max(font.getlength(row[i]) for row in rows) for i in range(len(rows[0]))] if rows else []
    table = sum(columns) + 2 * TEXT * max(len(columns) - 1, 0)
    wide = max(2 * width + GAP, table, *(2 * font.getlength(c) + GAP for c in captions))
    notes = [part for note in notes for part in _wrapped(note, font, wide)]
    tall = line + height + (line * (len(rows) + len(notes)) + MARGIN if rows or notes else 0)
    page = Image.new("RGB", (round(wide) + 2 * MARGIN, tall + 2 * MARGIN), GROUND)
    draw = ImageDraw.Draw(page)
    for x, picture, caption in ((0, left, captions[0]), (round(wide) - width, right, captions[1])):
        draw.text((MARGIN + x, MARGIN), caption, INK, font)
        page.paste(Image.fromarray(np.ascontiguousarray(picture)), (MARGIN + x, MARGIN + line))
    y = 2 * MARGIN + line + height
    for number, row in enumerate(rows):
        x = float(MARGIN)
        for i, (text, column) in enumerate(zip(row, columns, strict=True)):
            ends = x + (column - font.getlength(text) if i else 0)  # numbers end below each other
            draw.text((ends, y), text, DIM if number == 0 or i == 0 else INK, font)
            x += column + 2 * TEXT
        y += line
    for note in notes:
        draw.text((MARGIN, y), note, DIM, font)
        y += line
    return np.asarray(page)


def _wrapped(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: float) -> list[str]:
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
