"""Many pictures on one sheet, each with its caption."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from pmviewer.output.side_by_side import DIM, GAP, GROUND, INK, MARGIN, TEXT, drawable

WIDEST = 2400
"""Pixels of a sheet; pictures are made smaller to fit."""


def contact_sheet(
    pictures: Sequence[NDArray[np.uint8]], captions: Sequence[str], columns: int | None = None
) -> NDArray[np.uint8]:
    """A sheet (h, w, 3) of pictures (h, w, 3) of one size, row by row, with a caption of some lines above each; as many
    columns as make it about square if `columns` is None."""
    height, width = pictures[0].shape[:2]
    if columns is None:
        columns = max(1, min(len(pictures), round(math.sqrt(len(pictures) * height / width * 1.4))))
    rows = -(-len(pictures) // columns)
    scale = min(1.0, (WIDEST - 2 * MARGIN - GAP * (columns - 1)) / (columns * width))
    wide, tall = max(1, round(width * scale)), max(1, round(height * scale))
    lines = max(caption.count("\n") + 1 for caption in captions)
    line = round((1.3 * lines + 0.2) * TEXT)
    size = columns * (wide + GAP) - GAP + 2 * MARGIN, rows * (tall + line + GAP) - GAP + 2 * MARGIN
    sheet, font = Image.new("RGB", size, GROUND), ImageFont.load_default(TEXT)
    draw = ImageDraw.Draw(sheet)
    for number, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
        x = MARGIN + number % columns * (wide + GAP)
        y = MARGIN + number // columns * (tall + line + GAP)
        for number_of_line, text in enumerate(drawable(caption).split("\n")):
            draw.text((x, y + round(1.3 * TEXT) * number_of_line), _fitting(text, font, wide), INK, font)
        image = Image.fromarray(np.ascontiguousarray(picture))
        sheet.paste(image if scale == 1 else image.resize((wide, tall), Image.Resampling.LANCZOS), (x, y + line))
    return np.asarray(sheet)


def grid_sheet(
    pictures: Sequence[NDArray[np.uint8]], rows: Sequence[str], columns: Sequence[str], figures: Sequence[str]
) -> NDArray[np.uint8]:
    """A sheet (h, w, 3) of len(rows)·len(columns) pictures (h, w, 3) of one size, row by row: above each column and to
    the left of each row what it has in common, in some lines each, below each picture its figures."""
    height, width = pictures[0].shape[:2]
    font = ImageFont.load_default(TEXT)
    line = round(1.3 * TEXT)
    left = max((font.getlength(part) for row in rows for part in drawable(row).split("\n")), default=0.0)
    left = min(math.ceil(left), WIDEST // 4) + (GAP if left else 0)
    across = len(columns)
    most = (WIDEST - 2 * MARGIN - left - GAP * (across - 1)) / across
    scale = min(1.0, most / width)
    wide, tall = max(1, round(width * scale)), max(1, round(height * scale))
    told = max((math.ceil(font.getlength(drawable(text))) for text in figures), default=0)
    cell = max(wide, min(told, int(most))) + GAP
    top = line * max(text.count("\n") + 1 for text in columns) + TEXT // 4
    beside = max(tall + line, line * max(text.count("\n") + 1 for text in rows)) + GAP
    sheet = Image.new(
        "RGB", (left + across * cell - GAP + 2 * MARGIN, top + len(rows) * beside - GAP + 2 * MARGIN), GROUND
    )
    draw = ImageDraw.Draw(sheet)

    def lines(text: str, x: int, y: int, room: float, ink: tuple[int, int, int]) -> None:
        for number, part in enumerate(drawable(text).split("\n")):
            draw.text((x, y + line * number), _fitting(part, font, room), ink, font)

    for column, text in enumerate(columns):
        lines(text, MARGIN + left + column * cell, MARGIN, cell - GAP, INK)
    for row, text in enumerate(rows):
        y = MARGIN + top + row * beside
        lines(text, MARGIN, y, left, INK)
        for column in range(across):
            x, number = MARGIN + left + column * cell, row * across + column
            image = Image.fromarray(np.ascontiguousarray(pictures[number]))
            sheet.paste(image if scale == 1 else image.resize((wide, tall), Image.Resampling.LANCZOS), (x, y))
            lines(figures[number], x, y + tall, cell - GAP, DIM)
    return np.asarray(sheet)


def _fitting(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: float) -> str:
    """The text, cut where there is no room for it."""
    while text and font.getlength(text) > width:
        text = text[:-4].rstrip(" .") + "..." if len(text) > 6 else ""
    return text
