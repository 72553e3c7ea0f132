"""Photons of the caustic and the global map as points."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.points import MapPoints


class CausticPhotons(MapPoints):
    """The caustic map of the latest pass."""

    name = "caustic"
    switch = Switch(imgui.Key.c, "C", "Caustic photons on or off")


class GlobalPhotons(MapPoints):
    """The global map of the latest pass."""

    name = "global"
    switch = Switch(imgui.Key.g, "G", "Global photons on or off")
