"""Photons of the caustic, the global and the volume map as points."""

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


class VolumePhotons(MapPoints):
    """Photons that media scattered in the latest pass, after they were scattered before."""

    name = "volume"
    switch = Switch(imgui.Key.k, "K", "Volume photons on or off")
    things = "Photons in media in the latest pass"
