"""Virtual lights as points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.output.false_look import Look
from pmviewer.viewer.gl.palette import BOUNCES, LIGHT_PALETTE, LIGHTS, POWER, By, Colouring, light_colour
from pmviewer.viewer.gl.program import Shaders
from pmviewer.viewer.gl.records import CloudSummary, with_tags
from pmviewer.viewer.overlays.legend import MOST_SWATCHES, colour_legend, swatches
from pmviewer.viewer.overlays.overlay import Needs, Source, Switch
from pmviewer.viewer.overlays.points import MapPoints

OBJECTS = Colouring(By.LIGHT, text="objects that they lie on")
"""In the light's place of a record stands the object."""


class VirtualLights(MapPoints):
    """Those that light the picture in the latest pass, with the power that each stands for."""

    name = "virtual"
    switch = Switch(imgui.Key.v, "Shift+V", "Virtual lights on or off", shift=True)
    things = "Virtual lights of the latest pass"
    colourings: ClassVar[Mapping[str, Colouring]] = {
        "power": POWER,
        "bounce": BOUNCES,
        "light": LIGHTS,
        "object": OBJECTS,
    }

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._names: tuple[str, ...] = ()

    def needs(self, source: Source) -> Needs | None:
        cloud = source.frame.clouds.get(self.name) if source.frame is not None else None
        if cloud is None:
            return None
        by_object = self.style(source.settings).colour == "object"
        return cloud.photons, cloud.power_unit, cloud.objects if by_object else None, cloud.object_names

    def take(
        self,
        records: NDArray[np.float32],
        power_unit: float = 1.0,
        objects: NDArray[np.int64] | None = None,
        names: tuple[str, ...] = (),
        *_: Any,
    ) -> None:
        super().take(records if objects is None else with_tags(records, objects), power_unit)
        self._names = names

    def colours_legend(self, colouring: Colouring, cloud: CloudSummary, look: Look) -> None:
        if colouring is not OBJECTS:
            colour_legend(colouring, cloud, self.unit, look)
            return
        named = [i for i in cloud.lights if i < len(self._names)]
        swatches("", [(self._names[i], light_colour(i)) for i in named[:MOST_SWATCHES]])
        if len(named) > MOST_SWATCHES:
            more = len(named) - MOST_SWATCHES
            imgui.text_disabled(f"and {more} more; colours repeat after {len(LIGHT_PALETTE)}")
