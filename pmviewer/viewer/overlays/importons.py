"""Importons as points, by the importance of the place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from imgui_bundle import imgui

from pmviewer.output.false_look import Look
from pmviewer.settings.access import ImportonOverlay
from pmviewer.viewer.gl.palette import LIGHT_PALETTE, LIGHTS, MEAN_OF_GREEN_AND_BLUE, By, Colouring
from pmviewer.viewer.gl.points import EVERY_TAG
from pmviewer.viewer.gl.records import CloudSummary
from pmviewer.viewer.overlays.legend import swatches
from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.points import MapPoints


class Importons(MapPoints):
    """Red is the importance as it is used, green the screen's and blue the footprints'. In the light's place stands the
    map: 0 caustic, 1 global."""

    name = "importons"
    switch = Switch(imgui.Key.m, "Shift+M", "Importons on or off", shift=True)
    things = "Importons stored for the importance maps of the latest pass"
    unit = "px/m²"
    colourings: ClassVar[Mapping[str, Colouring]] = {
        "importance": Colouring(By.QUANTITY, 0, text="Importance, as it is used"),
        "screen": Colouring(By.QUANTITY, 1, text="Screen importance"),
        "footprint": Colouring(By.QUANTITY, 2, text="Footprint importance"),
        "average": Colouring(By.QUANTITY, MEAN_OF_GREEN_AND_BLUE, text="Average of screen and footprint importance"),
        "map": LIGHTS,
    }

    @classmethod
    def tags(cls, style: ImportonOverlay) -> int:
        return EVERY_TAG if style.map == "both" else 1 << (style.map == "global")

    def colours_legend(self, colouring: Colouring, cloud: CloudSummary, look: Look) -> None:
        if colouring.by == By.LIGHT:
            maps = [("caustic map", LIGHT_PALETTE[0]), ("global map", LIGHT_PALETTE[1])]
            swatches("Importance for the ", maps)
        else:
            super().colours_legend(colouring, cloud, look)
