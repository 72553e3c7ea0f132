"""What overlays of points have in common: a cloud, its style, its count and its legend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.false_look import Look, look_of
from pmviewer.settings.access import PointOverlay, Settings
from pmviewer.viewer.gl.palette import BOUNCES, LIGHTS, POWER, Colouring
from pmviewer.viewer.gl.points import EVERY_TAG, PointCloud
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.gl.records import CloudSummary
from pmviewer.viewer.overlays.legend import colour_legend, drawn_of, nothing_to_draw
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source


class Points(Overlay):
    """Records of photons, or of what is stored as they are."""

    colourings: ClassVar[Mapping[str, Colouring]] = {"power": POWER, "bounce": BOUNCES, "light": LIGHTS}
    """What the choices of its setting `colour` mean."""
    unit: ClassVar[str] = "W"
    """Of the power that it is coloured by."""

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self.cloud = PointCloud(shaders)

    @classmethod
    def tags(cls, style: Any) -> int:
        """Bits of the lights, or of what stands in their place, that are drawn."""
        return EVERY_TAG

    @classmethod
    def only_shadow(cls, style: Any) -> bool:
        """Whether shadow photons that the light reaches are left out."""
        return False

    def colouring(self, style: Any) -> Colouring:
        """How the points become colours."""
        return self.colourings[style.colour]

    def take(self, records: NDArray[np.float32], power_unit: float = 1.0, *_: Any) -> None:
        self.cloud.upload(records, power_unit)

    def release(self) -> None:
        self.cloud.release()

    def draw(self, drawing: Drawing, settings: Settings) -> None:
        style: PointOverlay = self.style(settings)
        limit = style.limit if drawing.limit is None else min(style.limit, drawing.limit)
        self.cloud.draw(
            drawing,
            self.colouring(style),
            size=style.size,
            depth=style.depth,
            limit=limit,
            drawn_tags=self.tags(style),
            only_shadow=self.only_shadow(style),
        )

    def legend(self, source: Source) -> None:
        style: PointOverlay = self.style(source.settings)
        colouring = self.colouring(style)
        cloud = self.cloud.summary(style.limit, colouring)
        if cloud.total:
            self.colours_legend(colouring, cloud, look_of(source.settings.display))
        else:
            nothing_to_draw()
        self.more_legend(source)
        drawn_of(cloud)

    def colours_legend(self, colouring: Colouring, cloud: CloudSummary, look: Look) -> None:
        """What the colours mean."""
        colour_legend(colouring, cloud, self.unit, look)

    def more_legend(self, source: Source) -> None:
        """What else the legend says, under the colours."""


class MapPoints(Points):
    """A cloud that a frame has whether or not it is shown: photons of a map, or what is stored like one."""

    things: ClassVar[str] = "Photons stored in the latest pass"

    def needs(self, source: Source) -> Needs | None:
        cloud = source.frame.clouds.get(self.name) if source.frame is not None else None
        return None if cloud is None else (cloud.photons, cloud.power_unit)

    def count(self, source: Source) -> int | None:
        return None if source.frame is None else source.frame.statistics.stored_in_pass.get(self.name, 0)
