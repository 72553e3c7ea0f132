"""A series of pictures and its files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pmviewer.commands.job import check_output
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.commands.series_plan import Plan
from pmviewer.engine.frame import Frame
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.series.render import series
from pmviewer.errors import OutputError, SettingError
from pmviewer.output.contact_sheet import contact_sheet
from pmviewer.output.film import FORMATS as FILMS
from pmviewer.output.film import Film, numbered
from pmviewer.output.frame_export import shown_pixels, write_frame_exr, write_frame_png
from pmviewer.output.png import write_png
from pmviewer.output.tone import to_uint8

MOST_ON_SHEET = 200


@dataclass(frozen=True)
class Outputs:
    """`paths` of pictures and films, the `sheet`, and pictures a second. Raises OutputError where nothing is to be
    written, or not there."""

    paths: Sequence[Path]
    sheet: Path | None
    fps: float

    def __post_init__(self) -> None:
        if not self.paths and self.sheet is None:
            raise OutputError("Nothing would be written: name files with -o, or a sheet with --sheet.")
        for path in self.paths:
            check_output(path, (".png", ".exr", *FILMS))
        if self.sheet is not None:
            check_output(self.sheet, (".png",))

    @property
    def pictures(self) -> list[Path]:
        """Names of numbered pictures."""
        return [path for path in self.paths if path.suffix.lower() not in FILMS]

    @property
    def films(self) -> list[Path]:
        """Names of films."""
        return [path for path in self.paths if path.suffix.lower() in FILMS]


def render_series(plan: Plan, outputs: Outputs, threads: int | None) -> None:
    """Render and write everything. Raises PmviewerError."""
    count = len(plan.pictures)
    if outputs.sheet is not None and count > MOST_ON_SHEET:
        raise SettingError(f"A sheet has room for {MOST_ON_SHEET} pictures, not for {count}: lower --pictures.")
    films, seen = [Film(path, outputs.fps) for path in outputs.films], []
    pool = WorkPool(threads)
    try:
        with progress_bar(remaining=True) as bar:
            for number, frame in enumerate(series(plan.opened, plan.pictures, pool, bar.update), 1):
                for path in outputs.pictures:
                    _write(numbered(path, number, count), frame)
                if films or outputs.sheet is not None:
                    seen.append(_pixels(frame))
                    for film in films:
                        film.add(seen[-1])
                    seen = seen if outputs.sheet is not None else []
    finally:
        pool.close()
    for film in films:
        film.close()
        print(f"wrote {film.path}: {count} pictures, {count / outputs.fps:.3g} s")
    if outputs.sheet is not None:
        write_png(outputs.sheet, contact_sheet(seen, plan.captions))
        print(f"wrote {outputs.sheet}: {count} pictures")
    for path in outputs.pictures:
        print(f"wrote {numbered(path, 1, count)} to {numbered(path, count, count).name}")


def _pixels(frame: Frame) -> np.ndarray:
    display = frame.settings.display
    return to_uint8(shown_pixels(frame, display.view, display))


def _write(path: Path, frame: Frame) -> None:
    if path.suffix.lower() == ".exr":
        write_frame_exr(path, frame)
    else:
        write_frame_png(path, frame)
