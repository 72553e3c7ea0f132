"""Radiance photons as points, coloured by irradiance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from imgui_bundle import imgui

from pmviewer.viewer.gl.palette import POWER, Colouring
from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.points import MapPoints


class RadiancePhotons(MapPoints):
    """Those that gather rays have asked; the others have no irradiance yet."""

    name = "radiance"
    switch = Switch(imgui.Key.g, "Shift+G", "Radiance photons on or off", shift=True)
    things = "Radiance photons that gather rays have used in the latest pass"
    colourings: ClassVar[Mapping[str, Colouring]] = {"irradiance": POWER}
    unit = "W/m²"
