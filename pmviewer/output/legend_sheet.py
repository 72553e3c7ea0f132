"""A picture in false colours with its legend beside it, for files that no window draws."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from pmviewer.output.diagnostic_views import DIAGNOSTICS, view_scale
from pmviewer.output.false_look import Look
from pmviewer.output.side_by_side import DIM, GROUND, INK, drawable

_SMALLEST, _OF_HEIGHT = 12, 40
"""Size of the text in pixels: at least, and as a part of the picture's height."""


def with_legend(
    pixels: NDArray[np.uint8], view: str, plane: NDArray[np.floating], look: Look, note: str = ""
) -> NDArray[np.uint8]:
    """The picture (h, w, 3) of a view with its legend on the right, wider by that: colours from the largest value down
    to the smallest, or one patch for each class; `note` stands below. Views without a legend get the note alone, if
    there is one."""
    info = DIAGNOSTICS.get(view)
    bands: list[tuple[Any, str]] = []
    ticks: list[tuple[float, str]] = []
    colours = np.zeros((0, 3), np.float32)
    if info is not None and info.classes:
        bands = [(look.class_colours[n], name) for n, name in reversed(list(enumerate(info.classes)))]
    elif info is not None and not info.cells:
        scale = view_scale(view, plane, look)
        colours = look.table(info.own)[::-1]
        ticks = [(1.0 - tick.position, drawable(tick.label)) for tick in scale.ticks()]
    title = drawable(f"{view}: {info.text}" if info is not None else "")
    height, width = pixels.shape[:2]
    size = max(_SMALLEST, height // _OF_HEIGHT)
    font = ImageFont.load_default(size)
    if not (bands or ticks or note):
        return pixels
    labels = [text for _, text in ticks] + [text for _, text in bands]
    column = round(max((font.getlength(text) for text in labels), default=0) + 4 * size)
    beside = max(column, 9 * size)
    lines = _lines(title, font, beside - 2 * size) + ([""] if title and note else [])
    lines += _lines(drawable(note), font, beside - 2 * size)
    sheet = Image.new("RGB", (width + beside, height), GROUND)
    sheet.paste(Image.fromarray(np.ascontiguousarray(pixels)), (0, 0))
    draw = ImageDraw.Draw(sheet)
    x, y = width + size, size
    for text in lines:
        draw.text((x, y), text, DIM, font)
        y += round(1.3 * size)
    y += size
    if ticks:
        bottom = min(height - size, y + 12 * size)
        tall = max(bottom - y, 1)
        bar = np.repeat(colours[np.linspace(0, len(colours) - 1, tall).astype(int)][:, None], size, axis=1)
        sheet.paste(Image.fromarray((bar * 255 + 0.5).astype(np.uint8)), (x, y))
        for position, text in ticks:
            draw.text((x + 1.5 * size, y + position * (tall - 1)), text, INK, font, anchor="lm")
    for colour, text in bands:
        draw.rectangle((x, y, x + size, y + size), fill=tuple(round(255 * float(c)) for c in colour))
        draw.text((x + 1.5 * size, y + 0.5 * size), text, INK, font, anchor="lm")
        y += round(1.5 * size)
    return np.asarray(sheet)


def _lines(text: str, font: Any, room: float) -> list[str]:
    """Words in lines that fit."""
    lines: list[str] = []
    for word in text.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= room:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
