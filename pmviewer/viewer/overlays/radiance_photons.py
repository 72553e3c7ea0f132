"""Radiance photons as points, coloured by irradiance."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.points import MapPoints


class RadiancePhotons(MapPoints):
    """Those that gather rays have asked; the others have no irradiance yet."""

    name = "radiance"
    switch = Switch(imgui.Key.g, "Shift+G", "Radiance photons on or off", shift=True)
    things = "Radiance photons that gather rays have used in the latest pass"
    unit = "W/m²"
