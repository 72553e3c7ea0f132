"""The strip of snapshots: pictures that were kept with all that made them, taken of the session or read from files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame, Level
from pmviewer.errors import PmviewerError
from pmviewer.viewer.background import READING, Background
from pmviewer.viewer.comparison import Run, run_of

if TYPE_CHECKING:  # brings OpenEXR along, which the window doesn't wait for
    from pmviewer.output.snapshot import CurvePoint, Snapshot

SUFFIXES = (".exr", ".png")
"""Of files that open as snapshots."""
MOST = 24
MOST_BYTES = 1 << 30
"""Of all their layers, which lie on the disk: a further snapshot is refused."""
THUMBNAIL = 160
"""Longest side in pixels."""
Thumbnail = NDArray[np.uint8]


class Snapshots:
    """Lives as long as the window, whose thread calls everything."""

    def __init__(self, background: Background, say: Callable[[Level, str], None]) -> None:
        self.all: list[Snapshot] = []
        """In the order in which they were taken."""
        self.version = 0
        """Grows with each change of the list."""
        self._background = background
        self._say = say
        self._arrived: list[tuple[int, list[Snapshot]]] = []
        self._ticket = 0
        self._taken = 0
        self._thumbnails: dict[int, Thumbnail] = {}

    def get(self, name: str) -> Snapshot | None:
        """By its number as text, or "last"."""
        if name == "last":
            return self.all[-1] if self.all else None
        return next((one for one in self.all if str(one.number) == name), None)

    # taking and dropping ----------------------------------------------------------------------------------------

    def take(self, frame: Frame | None, run: Run | None, truth: str) -> Snapshot | None:
        """Keep the frame, with the curve `run` of its error against the reference `truth`; None, with a sentence in the
        log, where that can't be."""
        if frame is None or frame.coarse:
            self._say("warning", "There is no picture to keep yet: wait for the first pass.")
            return None
        if not self._has_room(frame.planes.nbytes * 25 // 22):
            return None
        from pmviewer.output.snapshot import snapshot_of

        number = self._next()
        taken = snapshot_of(number, f"{number} · {run_of(frame).label}", frame)
        if run is not None and run.version == frame.version:
            taken = replace(taken, curve=curve_of(run), truth=truth)
        self._add([taken])
        return taken

    def open(self, paths: Sequence[Path], numbers: Sequence[int] | None = None) -> None:
        """Read files in the background, each a snapshot of the number given, or a new one; what can't be read is an
        error in the log, and the others come all the same. `numbers` replace the whole strip."""
        self._ticket += numbers is not None
        ticket, whole = self._ticket, numbers is not None
        wanted = list(numbers) if numbers is not None else [self._next() for _ in paths]
        if whole:
            self.clear()
        if not paths:
            return

        def work() -> str:
            from pmviewer.output.snapshot import read_snapshot

            read = []
            for path, number in zip(paths, wanted, strict=True):
                try:
                    read.append(read_snapshot(path, number))
                except (PmviewerError, OSError) as error:
                    self._say("error", str(error))
            self._arrived.append((ticket, read))
            return ""

        self._background.start(READING, "reading snapshots", work)

    def put(self, snapshot: Snapshot) -> Snapshot | None:
        """Take it into the strip, in the place of the one of that name, or as a new one; None, with a sentence in the
        log, where there is no room."""
        same = next((one for one in self.all if one.name == snapshot.name), None)
        if same is not None:
            placed = replace(snapshot, number=same.number)
            self.all = [placed if one is same else one for one in self.all]
            self._thumbnails.pop(same.number, None)
            self.version += 1
            return placed
        if not self._has_room(snapshot.bytes):
            return None
        placed = replace(snapshot, number=self._next())
        self._add([placed])
        return placed

    @property
    def arriving(self) -> bool:
        """Whether files are being read, or will be in the strip with the next window frame."""
        return bool(self._arrived or self._background.running(READING))

    def poll(self) -> None:
        """Once per window frame: take over what was read, unless another session was opened meanwhile."""
        while self._arrived:
            ticket, read = self._arrived.pop(0)
            if ticket == self._ticket:
                self._add([one for one in read if self._has_room(one.bytes)])

    def remove(self, snapshot: Snapshot) -> None:
        """Drop it for good."""
        self.all = [one for one in self.all if one is not snapshot]
        self._thumbnails.pop(snapshot.number, None)
        self.version += 1

    def rename(self, snapshot: Snapshot, name: str) -> None:
        """Give it another name; an empty one changes nothing."""
        name = " ".join(name.split())
        if name and name != snapshot.name:
            self.all = [one.renamed(name) if one is snapshot else one for one in self.all]
            self.version += 1

    def clear(self) -> None:
        """Drop all of them."""
        self.all, self._taken = [], 0
        self._thumbnails.clear()
        self.version += 1

    def _add(self, more: list[Snapshot]) -> None:
        self.all = [*self.all, *more]
        self._taken = max([self._taken, *(one.number for one in more)])
        self.version += bool(more)

    def _next(self) -> int:
        self._taken += 1
        return self._taken

    def _has_room(self, size: int) -> bool:
        held = sum(one.bytes for one in self.all)
        if len(self.all) < MOST and held + size <= MOST_BYTES:
            return True
        most = f"{MOST} snapshots, and {MOST_BYTES >> 20} MiB of them"
        self._say("warning", f"There is no room for another snapshot: {most}, are the most. Remove one first.")
        return False

    # what is drawn ----------------------------------------------------------------------------------------------

    def thumbnail(self, snapshot: Snapshot) -> Thumbnail:
        """(h, w, 3) uint8 of the picture as it was shown, its longest side `THUMBNAIL` pixels or less."""
        known = self._thumbnails.get(snapshot.number)
        if known is None:
            known = self._thumbnails[snapshot.number] = small(snapshot.image("beauty"), exposure_of(snapshot))
        return known


def exposure_of(snapshot: Snapshot) -> float:
    """EV that it was shown with; 0 where nobody says."""
    return snapshot.figure("view.exposure") or 0.0


def small(image: NDArray[np.float32], exposure: float) -> Thumbnail:
    """A picture of that radiance: means of blocks of pixels, by the sRGB curve."""
    from pmviewer.output.tone import to_uint8, tone_map

    step = max(1, -(-max(image.shape[:2]) // THUMBNAIL))
    height, width = image.shape[0] // step * step, image.shape[1] // step * step
    if min(height, width) == 0:
        return to_uint8(tone_map(image, exposure, "sRGB"))
    blocks = image[:height, :width].reshape(height // step, step, width // step, step, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        means = blocks.mean(axis=(1, 3), dtype=np.float32)
    return to_uint8(tone_map(means, exposure, "sRGB"))


def curve_of(run: Run) -> tuple[CurvePoint, ...]:
    """The run's points as a snapshot keeps them."""
    from pmviewer.output.snapshot import CurvePoint

    return tuple(CurvePoint(p.passes, p.seconds, p.cpu_seconds, p.metrics.relmse_all) for p in list(run.points))
