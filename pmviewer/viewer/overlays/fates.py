"""Photons by fate as points: where they arrived, and what the deposition rule made of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.output.false_look import Look, look_of
from pmviewer.photons.deposition.deposited import FATES
from pmviewer.settings.access import FateOverlay
from pmviewer.viewer.format import grouped
from pmviewer.viewer.gl.palette import BOUNCES, By, Colouring
from pmviewer.viewer.gl.records import CloudSummary, tags
from pmviewer.viewer.overlays.legend import colour_legend, swatches
from pmviewer.viewer.overlays.overlay import Needs, Source, Switch
from pmviewer.viewer.overlays.points import Points

_GLOBAL = 8
"""Of a photon that the global map was asked to store; the fate is in the bits below."""
_OF_CAUSTIC, _OF_GLOBAL = 0xFF, 0xFF00
_SHOWN = {"all": 0x0F0F, "stored": 0x0101, "not stored": 0x0E0E}


def fate_counts(records: NDArray[np.float32], map_: str = "both") -> tuple[int, ...]:
    """How many of the photons (n, 6) of `pmviewer.photons.deposition.fates` met each of FATES, in the maps chosen."""
    ids = tags(records)
    if map_ != "both":
        ids = ids[(ids >= _GLOBAL) == (map_ == "global")]
    return tuple(int(n) for n in np.bincount(ids & (_GLOBAL - 1), minlength=len(FATES)))


class Fates(Points):
    """In the light's place of a record stand map and fate."""

    name = "fates"
    switch = Switch(imgui.Key.f, "Shift+F", "Photons by fate on or off", shift=True)
    things = "Photons of the latest pass that were judged again"
    colourings: ClassVar[Mapping[str, Colouring]] = {"fate": Colouring(By.FATE), "bounce": BOUNCES}

    @classmethod
    def tags(cls, style: FateOverlay) -> int:
        return (
            _SHOWN[style.only]
            & {"both": _OF_CAUSTIC | _OF_GLOBAL, "caustic": _OF_CAUSTIC, "global": _OF_GLOBAL}[style.map]
        )

    def needs(self, source: Source) -> Needs | None:
        photons = source.frame.inspection.fates if source.frame is not None else None
        return None if photons is None else (photons,)

    def count(self, source: Source) -> int | None:
        return self.cloud.summary().total if self.is_shown(source.settings) else None

    def colours_legend(self, colouring: Colouring, cloud: CloudSummary, look: Look) -> None:
        if colouring.by != By.FATE:  # the counts are the legend of fates
            colour_legend(colouring, cloud, self.unit, look)

    def more_legend(self, source: Source) -> None:
        """How many photons met which fate, in the maps that are drawn."""
        photons = source.frame.inspection.fates if source.frame is not None else None
        if photons is None:
            return
        style: FateOverlay = self.style(source.settings)
        counts = fate_counts(photons, style.map)
        total = max(sum(counts), 1)
        palette = look_of(source.settings.display).fate_colours
        for name, count, colour in zip(FATES, counts, palette, strict=True):
            if count:
                swatches("", [(f"{name}: {grouped(count)}, {count / total:.1%}", colour)])
