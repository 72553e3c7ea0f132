"""What becomes of the finished pictures of a series: files, films and sheets, and what is kept to go on from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pmviewer.commands.job import check_output
from pmviewer.commands.kept_pictures import KeptPictures, Row
from pmviewer.engine.frame import Frame
from pmviewer.engine.series.render import Picture
from pmviewer.errors import OutputError, SettingError
from pmviewer.output.film import FORMATS as FILMS
from pmviewer.output.film import numbered
from pmviewer.output.frame_export import shown_pixels, write_frame_exr, write_frame_png
from pmviewer.output.tone import to_uint8
from pmviewer.settings.access import Settings

MOST_ON_SHEET = 200
MOST_SAID = 3
"""Pictures of which is said why they are rendered again; of the others how many."""
Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class Outputs:
    """`paths` of pictures and films, the `sheet`, a `table` (.csv, .md), pictures a second, and whether to go on from
    what an earlier run has finished. Raises OutputError where nothing is to be written, or not there."""

    paths: Sequence[Path]
    sheet: Path | None
    fps: float = 24.0
    resume: bool = False
    table: Path | None = None

    def __post_init__(self) -> None:
        if not self._all:
            raise OutputError("Nothing would be written: name files with -o, or a sheet with --sheet.")
        for path in self.paths:
            check_output(path, (".png", ".exr", *FILMS))
        if self.sheet is not None:
            check_output(self.sheet, (".png",))
        if self.table is not None:
            check_output(self.table, (".csv", ".md"))

    @property
    def _all(self) -> list[Path]:
        return [path for path in (*self.paths, self.sheet, self.table) if path is not None]

    @property
    def pictures(self) -> list[Path]:
        """Names of numbered pictures."""
        return [path for path in self.paths if path.suffix.lower() not in FILMS]

    @property
    def films(self) -> list[Path]:
        """Names of films."""
        return [path for path in self.paths if path.suffix.lower() in FILMS]

    @property
    def folder(self) -> Path:
        """Where finished pictures are kept, beside the first output."""
        return self._all[0].with_suffix(".pictures")

    @property
    def with_pixels(self) -> bool:
        """Whether pictures are looked at again after they are finished."""
        return bool(self.films) or self.sheet is not None


class PictureFiles:
    """The numbered files of `count` pictures, and what is kept of them."""

    def __init__(self, outputs: Outputs, count: int, measured: Mapping[str, str] = MappingProxyType({})) -> None:
        """measured: what rows depend on besides the picture. Raises OutputError."""
        self.outputs, self.count = outputs, count
        self.kept = KeptPictures(outputs.folder, outputs.with_pixels, measured) if outputs.resume else None
        self.spared = 0
        """Pictures that were there already."""

    def files(self, number: int) -> list[Path]:
        """Of one picture."""
        return [numbered(path, number, self.count) for path in self.outputs.pictures]

    def is_there(self, picture: Picture) -> bool:
        """Whether it needs not be rendered; what `pmviewer.engine.series.render.missing` asks."""
        return self.kept is not None and self.kept.has(picture, self.files(picture.number))

    def take(self, picture: Picture, frame: Frame | None, row_of: Callable[[Frame], Row]) -> tuple[Pixels | None, Row]:
        """Write the files of a picture, None for one that is there; its pixels where they are needed, and its row,
        which `row_of` makes of a frame. Raises OutputError."""
        if frame is None:
            assert self.kept is not None
            self.spared += 1
            pixels = self.kept.pixels(picture.number) if self.outputs.with_pixels else None
            return pixels, self.kept.row(picture.number)
        files = self.files(picture.number)
        for path in files:
            if path.suffix.lower() == ".exr":
                write_frame_exr(path, frame)
            else:
                write_frame_png(path, frame)
        row, pixels = row_of(frame), None
        if self.outputs.with_pixels:
            display = frame.settings.display
            pixels = to_uint8(shown_pixels(frame, display.view, display))
        if self.kept is not None:
            self.kept.keep(picture, files, pixels, row)
        return pixels, row

    def say(self) -> None:
        """Print what was written, and what was there."""
        if self.spared:
            print(f"{self.spared} of {self.count} pictures were there already")
        if self.kept is not None:
            for sentence in self.kept.again[:MOST_SAID]:
                print(sentence)
            if len(self.kept.again) > MOST_SAID:
                print(f"So are {len(self.kept.again) - MOST_SAID} more.")
            print(f"{self.kept.folder} is what --resume goes on from; delete it when you are done.")
        for path in self.outputs.pictures:
            print(f"wrote {numbered(path, 1, self.count)} to {numbered(path, self.count, self.count).name}")


def check_sizes(outputs: Outputs, pictures: Sequence[Settings], most: int = MOST_ON_SHEET) -> None:
    """Raises SettingError where pictures are too many for a sheet, or of several sizes in a film or on a sheet."""
    if outputs.sheet is not None and len(pictures) > most:
        raise SettingError(f"A sheet has room for {most} pictures, not for {len(pictures)}: ask for fewer.")
    sizes = sorted({(one.camera.width, one.camera.height) for one in pictures}, key=str)
    if outputs.with_pixels and len(sizes) > 1:
        (w0, h0), (w1, h1) = sizes[:2]
        raise SettingError(
            f"Films and sheets are of pictures of one size, and these have {w0}x{h0} and {w1}x{h1} pixels."
        )
