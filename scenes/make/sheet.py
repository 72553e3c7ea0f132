"""`python scenes/make/sheet.py FILE.png`: the previews of all bundled scenes on one sheet, with their names."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image, ImageDraw

COLUMNS, WIDTH, HEIGHT, TEXT, GAP = 6, 144, 144, 14, 6


def sheet(previews: list[Path]) -> Image.Image:
    """The pictures in rows, each fitted into its cell above its scene's name."""
    rows = -(-len(previews) // COLUMNS)
    page = Image.new("RGB", (COLUMNS * (WIDTH + GAP) - GAP, rows * (HEIGHT + TEXT + GAP) - GAP), "white")
    draw = ImageDraw.Draw(page)
    for i, path in enumerate(previews):
        x, y = i % COLUMNS * (WIDTH + GAP), i // COLUMNS * (HEIGHT + TEXT + GAP)
        with Image.open(path) as image:
            small = image.convert("RGB")
            small.thumbnail((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
            page.paste(small, (x + (WIDTH - small.width) // 2, y + HEIGHT - small.height))
        draw.text((x + WIDTH // 2, y + HEIGHT + 1), path.parent.name, fill="black", anchor="ma")
    return page


def main() -> None:
    """Write the sheet to the file that the command line names."""
    if len(sys.argv) != 2 or not sys.argv[1].endswith(".png"):
        sys.exit("usage: python scenes/make/sheet.py FILE.png")
    previews = sorted(Path(__file__).resolve().parents[1].glob("*/preview.png"))
    sheet(previews).save(sys.argv[1], optimize=True)


if __name__ == "__main__":
    main()
