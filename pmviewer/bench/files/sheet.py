"""The pictures of a run side by side with their names, as one PNG to be looked at."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from pmviewer.bench.files.judge import Row
from pmviewer.output.files import write_file

CELL, CAPTION, GAP = 160, 30, 8
PAPER, INK, FAINT_INK = (24, 24, 26), (235, 235, 235), (160, 160, 165)
CHARACTERS = 24
"""Of a caption line that fit."""


def contact_sheet(rows: Sequence[Row]) -> Image.Image:
    """Pictures in the order of the rows, in a sheet somewhat wider than high. Rows without a picture are left out."""
    shown = [row for row in rows if row.png]
    columns = max(math.ceil(math.sqrt(len(shown) * 1.4)), 1)
    lines = max(math.ceil(len(shown) / columns), 1)
    width, height = columns * (CELL + GAP) + GAP, lines * (CELL + CAPTION + GAP) + GAP
    sheet = Image.new("RGB", (width, height), PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(11)
    for index, row in enumerate(shown):
        x, y = GAP + index % columns * (CELL + GAP), GAP + index // columns * (CELL + CAPTION + GAP)
        picture = Image.open(io.BytesIO(base64.b64decode(row.png))).convert("RGB")
        scale = CELL / max(picture.size)
        picture = picture.resize([max(round(side * scale), 1) for side in picture.size], Image.Resampling.BILINEAR)
        sheet.paste(picture, (x + (CELL - picture.width) // 2, y + (CELL - picture.height) // 2))
        draw.text((x, y + CELL + 2), caption(row.file), INK, font)
        draw.text((x, y + CELL + 15), f"{index + 1}  {row.judgement}, grey {row.grey:.2f}", FAINT_INK, font)
    return sheet


def caption(name: str) -> str:
    """The end of a path, as much as fits."""
    return name if len(name) <= CHARACTERS else "…" + name[-(CHARACTERS - 1) :]


def write_sheet(path: Path, rows: Sequence[Row]) -> None:
    """Write the contact sheet as PNG. Raises OutputError."""
    buffer = io.BytesIO()
    contact_sheet(rows).save(buffer, "PNG")
    write_file(path, buffer.getvalue(), (".png",))
