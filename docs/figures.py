"""`python docs/figures.py [NAME …]`: make the figures of the documentation by the commands that stand there.

A block of commands below a line <!-- figure NAME, columns N --> gives images/NAME.png: each command writes one panel,
or an EXR file that later ones open, in order, N panels a row; NAME='…' above them stands for words that they share. The
commands open windows: without a display, run all of it under xvfb-run -a.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parent
TEXTS = (
    "compare.md",
    "dispersion.md",
    "editing.md",
    "estimation.md",
    "importance.md",
    "inspector.md",
    "series.md",
    "several-maps.md",
    "thin-glass.md",
    "virtual.md",
    "views.md",
)
_BLOCK = re.compile(r"^<!-- figure (\S+), columns (\d+) -->\n```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
_SHARED = re.compile(r"(\w+)='([^']*)'")
_USE = re.compile(r"\$(\w+)")
GAP = 6


@dataclass(frozen=True)
class Figure:
    """A figure's name, panels a row, and its commands, each a list of words that begins with pmviewer."""

    name: str
    columns: int
    commands: tuple[tuple[str, ...], ...]

    @property
    def panels(self) -> list[str]:
        """The pictures among the files; EXR files are for commands that follow."""
        return [file for file in self.files if file.endswith(".png")]

    @property
    def files(self) -> list[str]:
        """What each command writes."""
        return [words[words.index("--sheet" if "--sheet" in words else "-o") + 1] for words in self.commands]


def figures(text: str) -> Iterator[Figure]:
    """The figures of a Markdown text; a command may go on behind a backslash at a line's end."""
    for name, columns, body in _BLOCK.findall(text):
        yield Figure(name, int(columns), tuple(_commands(body.replace("\\\n", " ").splitlines())))


def _commands(lines: list[str]) -> Iterator[tuple[str, ...]]:
    """The words of each command, shared ones filled in."""
    shared: dict[str, str] = {}
    for line in lines:
        meaning = _SHARED.fullmatch(line)
        if meaning:
            shared[meaning[1]] = meaning[2]
        elif line.strip():
            yield tuple(shlex.split(_USE.sub(lambda use: shared[use[1]], line)))


def make(figure: Figure, folder: Path) -> None:
    """Run the commands in `folder` and write images/NAME.png."""
    from PIL import Image, ImageDraw

    for words in figure.commands:
        subprocess.run([sys.executable, "-m", *words], cwd=folder, check=True)
    panels = [Image.open(folder / name).convert("RGB") for name in figure.panels]
    width, height = (max(side) for side in zip(*(panel.size for panel in panels), strict=True))
    rows = -(-len(panels) // figure.columns)
    page = Image.new("RGB", (figure.columns * (width + GAP) - GAP, rows * (height + GAP) - GAP), "white")
    for i, panel in enumerate(panels):
        x, y = i % figure.columns * (width + GAP), i // figure.columns * (height + GAP)
        page.paste(panel, (x, y))
        if len(panels) > 1:
            draw = ImageDraw.Draw(page)
            draw.rectangle((x, y + height - 20, x + 18, y + height), fill="white")
            draw.text((x + 9, y + height - 10), "abcdefghijklmnopqrstuvwxyz"[i], fill="black", anchor="mm")
    page.quantize(256, dither=Image.Dither.NONE).save(DOCS / "images" / f"{figure.name}.png", optimize=True)


def main() -> None:
    """Make the figures asked for, all by default."""
    known = {figure.name: figure for text in TEXTS for figure in figures((DOCS / text).read_text(encoding="utf-8"))}
    unknown = sorted(set(sys.argv[1:]) - known.keys())
    if unknown:
        sys.exit(f"there is no figure {', '.join(unknown)}; there are {', '.join(known)}")
    for name in sys.argv[1:] or known:
        with tempfile.TemporaryDirectory() as scratch:
            make(known[name], Path(scratch))
        print(f"images/{name}.png: {(DOCS / 'images' / f'{name}.png').stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
