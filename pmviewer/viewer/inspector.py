"""What the user has pinned, and what of it is chosen; the session is asked for it and for nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from pmviewer.engine.frame import Frame
from pmviewer.engine.inspector.report import LitPlace, LookUp, PhotonAt, Pinned, PixelReport, luminance
from pmviewer.viewer.session_link import SessionLike


class ChosenLight(NamedTuple):
    """A virtual light: its number in that pass."""

    of_pass: int
    number: int


class Inspector:
    """`pinned` is the pixel (x, y) of the image, `photon` one whose life is told, `number` that of the chosen look-up,
    None until there is one: then the one that adds most, `surface` likewise of the surfaces that virtual lights reach,
    `light` the virtual light that is marked, as long as its pass is the latest one. `raised` is True until the panel
    has come to the front."""

    def __init__(self, session: SessionLike, frame: Callable[[], Frame | None]) -> None:
        self._session = session
        self._frame = frame
        self.pinned: tuple[int, int] | None = None
        self.photon: PhotonAt | None = None
        self.number: int | None = None
        self.surface: int | None = None
        self.light: ChosenLight | None = None
        self.raised = False

    def click(self, pixel: tuple[int, int]) -> None:
        """Pin that pixel, or let it go if it is pinned."""
        if pixel == self.pinned:
            self.unpin()
        else:
            self.pin(pixel)

    def pin(self, pixel: tuple[int, int], photon: PhotonAt | None = None) -> None:
        """From now on the session tells what makes this pixel, and the life of that photon."""
        if self.pinned is None:
            self.raised = True
        if pixel != self.pinned:
            self.number = self.surface = self.light = None
        self.pinned, self.photon = pixel, photon
        self._session.pin(Pinned(*pixel, photon))

    def unpin(self) -> None:
        """Let everything go."""
        if self.pinned is not None:
            self.pinned = self.photon = None
            self.number = self.surface = self.light = None
            self._session.pin(None)

    def choose(self, photon: PhotonAt | None) -> None:
        """Tell the life of that photon, or of none."""
        if self.pinned is not None and photon != self.photon:
            self.pin(self.pinned, photon)

    @property
    def report(self) -> PixelReport | None:
        """On what is pinned, if the newest frame has it."""
        frame = self._frame()
        report = frame.inspection.pixel if frame is not None else None
        if report is None or self.pinned != (report.of.x, report.of.y):
            return None
        return report

    @property
    def outside(self) -> bool:
        """Whether the newest frame was asked and the picture has no such pixel."""
        frame = self._frame()
        if frame is None or frame.inspection.pixel is not None:
            return False
        asked = frame.inspection.wanted.pinned
        return asked is not None and self.pinned == (asked.x, asked.y)

    def look_up_of(self, report: PixelReport) -> LookUp | None:
        """The chosen one of a report, or its last where the path is shorter than it was. Whoever reads more than one
        thing reads them of one report: the next frame comes at any time."""
        if not report.look_ups:
            return None
        if self.number is None:  # what the pixel does not use comes last
            adds = [(float(luminance(one.value)) > 0, one.used, float(luminance(one.value))) for one in report.look_ups]
            self.number = adds.index(max(adds))
        return report.look_ups[min(self.number, len(report.look_ups) - 1)]

    def lit_of(self, report: PixelReport) -> LitPlace | None:
        """The chosen surface of a report that virtual lights reach, or its last where the path is shorter than it
        was."""
        if not report.lit:
            return None
        if self.surface is None:
            adds = [float(luminance(place.sum)) for place in report.lit]
            self.surface = adds.index(max(adds))
        return report.lit[min(self.surface, len(report.lit) - 1)]
