"""Photons of the caustic, the global and the volume map as points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.viewer.gl.palette import BOUNCES, DIRECTIONS, LIGHTS, POWER, WAVELENGTHS, Colouring
from pmviewer.viewer.gl.program import Shaders
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.overlays.overlay import Needs, Source, Switch
from pmviewer.viewer.overlays.points import MapPoints


class MapPhotons(MapPoints):
    """Photons of a map, which tell their wavelengths where glass splits light into colours."""

    colourings: ClassVar[Mapping[str, Colouring]] = {
        "power": POWER,
        "bounce": BOUNCES,
        "light": LIGHTS,
        "wavelength": WAVELENGTHS,
        "direction": DIRECTIONS,
    }

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._banded = False

    def needs(self, source: Source) -> Needs | None:
        cloud = source.frame.clouds.get(self.name) if source.frame is not None else None
        return None if cloud is None else (cloud.photons, cloud.power_unit, cloud.banded)

    def take(self, records: NDArray[np.float32], power_unit: float = 1.0, banded: bool = False, *_: Any) -> None:
        super().take(records, power_unit)
        self._banded = banded

    def colouring(self, style: Any) -> Colouring:
        wanted = super().colouring(style)
        return POWER if wanted is WAVELENGTHS and not self._banded else wanted

    def more_legend(self, source: Source) -> None:
        if self.style(source.settings).colour == "wavelength" and not self._banded:
            wrapped("Photons have no wavelengths here: no glass splits light, or importance chooses what is stored.")


class CausticPhotons(MapPhotons):
    """The caustic map of the latest pass."""

    name = "caustic"
    switch = Switch(imgui.Key.c, "C", "Caustic photons on or off")


class GlobalPhotons(MapPhotons):
    """The global map of the latest pass."""

    name = "global"
    switch = Switch(imgui.Key.g, "G", "Global photons on or off")


class VolumePhotons(MapPhotons):
    """Photons that media scattered in the latest pass, after they were scattered before."""

    name = "volume"
    switch = Switch(imgui.Key.k, "K", "Volume photons on or off")
    things = "Photons in media in the latest pass"
