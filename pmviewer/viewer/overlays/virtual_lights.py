"""Virtual lights as points."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.points import MapPoints


class VirtualLights(MapPoints):
    """Those that light the picture in the latest pass, with the power that each stands for."""

    name = "virtual"
    switch = Switch(imgui.Key.v, "Shift+V", "Virtual lights on or off", shift=True)
    things = "Virtual lights of the latest pass"
