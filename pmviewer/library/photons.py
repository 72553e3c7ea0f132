"""The photons of a map as arrays, and as a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import PhotonCloud
from pmviewer.errors import SettingError
from pmviewer.maps.record import bands, unpack
from pmviewer.output.ply import write_ply
from pmviewer.scene.spectrum import of_bands
from pmviewer.settings.access import SETTINGS, Settings, flat
from pmviewer.version import __version__

MAPS = ("global", "caustic")
PATH_CLASSES = ("direct LD", "indirect", "caustic LS+D", "indirect caustic")
"""By number: whether there was a diffuse scattering before (1), whether the last one was specular (2)."""
_OF_PICTURE = ("scene", "photons", "maps")
"""Stages whose settings decide what photons there are."""


@dataclass(frozen=True, eq=False, repr=False)
class Photons:
    """Photons of one pass as they are stored in a map, n of them."""

    map: str
    """"global" or "caustic"."""
    positions: NDArray[np.float32]
    """(n, 3), in the scene's units."""
    directions: NDArray[np.float32]
    """(n, 3) unit vectors wi, from the surface to where the photon came from (to half a degree)."""
    powers: NDArray[np.float32]
    """(n, 3), red, green and blue in W (to a part in 2000). They are shares of the whole light: a density estimate adds
    them up and divides by the area alone."""
    bounces: NDArray[np.uint8]
    """(n,) scatterings before this surface; 31 stands for 31 or more."""
    path_classes: NDArray[np.uint8]
    """(n,) numbers of `PATH_CLASSES`."""
    lights: NDArray[np.uint16]
    """(n,) numbers of the lights that they come from, in the order of the scene's light table."""
    wavelengths: NDArray[np.float32] | None
    """(n,) nm, to a sixtieth of the spectrum; NaN for a photon that no glass has split yet. None where photons have
    none: no glass disperses light, or importance chooses what is stored."""
    settings: Settings
    scene_name: str = ""
    pass_number: int = 1
    """The pass that they were traced for, from 1."""
    notes: tuple[str, ...] = ()
    """Sentences about the scene, such as that it was moved."""

    def __len__(self) -> int:
        """How many there are."""
        return len(self.positions)

    def __repr__(self) -> str:
        return f"<{len(self):,} photons of the {self.map} map of {self.scene_name}, pass {self.pass_number}>"

    def save_ply(self, path: str | Path) -> None:
        """Write a PLY file, binary, little endian, with the vertex properties x y z, nx ny nz (`directions`), power_r
        power_g power_b in W, bounces, path_class and light. What they mean and the settings are in its comments. Raises
        OutputError."""
        columns: list[tuple[str, NDArray[Any]]] = []
        parts = (("x", "y", "z"), self.positions), (("nx", "ny", "nz"), self.directions)
        for names, array in (*parts, (("power_r", "power_g", "power_b"), self.powers)):
            columns += [(name, array[:, i]) for i, name in enumerate(names)]
        columns += [("bounces", self.bounces), ("path_class", self.path_classes), ("light", self.lights)]
        if self.wavelengths is not None:
            columns.append(("wavelength", self.wavelengths))
        write_ply(path, columns, self._comments())

    def _comments(self) -> Sequence[str]:
        classes = ", ".join(f"{i} {name}" for i, name in enumerate(PATH_CLASSES))
        values = flat(self.settings)
        told = [
            name
            for name, info in SETTINGS.items()
            if name in ("photons.N", "render.seed") or (info.stage in _OF_PICTURE and values[name] != info.default)
        ]
        return [
            f"pmviewer {__version__}: photons of the {self.map} map, pass {self.pass_number}",
            f"scene {self.scene_name}",
            "x y z: in the scene's units of length",
            "nx ny nz: unit vector wi from the surface to where the photon came from",
            "power_r power_g power_b: W, shares of the whole light: estimates add them up and divide by the area alone",
            "bounces: scatterings before this surface, 31 for 31 or more",
            f"path_class: {classes}",
            "light: number of the light in the scene",
            *(["wavelength: nm, nan for light that no glass has split"] if self.wavelengths is not None else []),
            *(f"note {note}" for note in self.notes),
            *(f"setting {name} = {values[name]}" for name in told),
        ]


def photons_of(
    name: str, cloud: PhotonCloud, settings: Settings, scene_name: str, pass_number: int, notes: tuple[str, ...]
) -> Photons:
    """The photons of a cloud, unpacked."""
    fields = unpack(cloud.photons, cloud.power_unit)
    return Photons(
        map=name,
        positions=np.array(fields["position"]),
        directions=fields["wi"],
        powers=fields["Phi"],
        bounces=fields["bounces"].astype(np.uint8),
        path_classes=fields["path_class"].astype(np.uint8),
        lights=fields["light"].astype(np.uint16),
        wavelengths=of_bands(bands(cloud.photons)).astype(np.float32) if cloud.banded else None,
        settings=settings,
        scene_name=scene_name,
        pass_number=pass_number,
        notes=notes,
    )


def check_map(name: str) -> None:
    """Raises SettingError for what is no photon map."""
    if name not in MAPS:
        raise SettingError(f"There is no photon map '{name}'. There are {' and '.join(MAPS)}.")
