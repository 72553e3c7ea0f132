"""Shadow photons as points: where direct light arrives and where it does not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from imgui_bundle import imgui

from pmviewer.settings.access import ShadowOverlay
from pmviewer.viewer.gl.palette import LIGHTS, By, Colouring
from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.points import MapPoints


class ShadowPhotons(MapPoints):
    """Photons that flew straight through the scene, lit or in shadow."""

    name = "shadow"
    switch = Switch(imgui.Key.c, "Shift+C", "Shadow photons on or off", shift=True)
    things = "Shadow photons, which serve all passes"
    colourings: ClassVar[Mapping[str, Colouring]] = {"lit or shadow": Colouring(By.LIT), "light": LIGHTS}

    @classmethod
    def only_shadow(cls, style: ShadowOverlay) -> bool:
        return not style.lit
