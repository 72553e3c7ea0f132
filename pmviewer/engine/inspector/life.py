"""The life of a stored photon: its trajectory, traced again from the light on."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.engine.inspector.report import PhotonAt, PhotonLife
from pmviewer.engine.stages.pass_maps import PassMaps
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.maps.record import bands
from pmviewer.photons.light_pass.search import path_of, trajectory_at
from pmviewer.scene.spectrum import of_bands

GONE = "The pass that stored this photon is over, and with guided emission it can't be traced again: choose one anew."
NOT_TRACED = "This photon is one of the test photons of guided emission, whose paths aren't traced again."

OF_A_PIECE = (
    "Guided emission split this photon off another one where it came to an important place; the ways of such pieces "
    "aren't traced again."
)


def life_of(tracer: Tracer, maps: PassMaps, photon: PhotonAt) -> PhotonLife:
    """Traced by one light pass more, less what comes after the photon. Passes that are over are traced as well, but
    where what was known then decided about the emission."""
    guided = maps.photons.guided if maps.photons is not None else None
    if guided is not None and (photon.index, photon.N) != (maps.index, maps.N):
        return PhotonLife(photon, note=GONE)
    plan = tracer.planned(photon.index, photon.N, guided)
    place = np.array(photon.position, np.float32)
    trajectory = trajectory_at(tracer.flat, plan, place, tracer.run)
    if trajectory is None:
        return PhotonLife(photon, note=NOT_TRACED)
    paths = path_of(tracer.flat, plan, trajectory, tracer.run)
    vertices = paths.vertices[0, : paths.counts[0]].copy()
    at = np.flatnonzero((vertices[:, :3] == place).all(axis=1))
    if not len(at) and guided is not None:
        return PhotonLife(photon, note=OF_A_PIECE)
    light = int(vertices[:1].view(np.uint32)[0, 5] >> 16) if len(vertices) else 0
    names = tracer.flat.light_names
    name = names[light] if light < len(names) else str(light + 1)
    stored_at = int(at[0]) if len(at) else -1
    waves = (math.nan, *of_bands(bands(vertices[1:])).tolist()) if tracer.flat.disperses else ()
    return PhotonLife(photon, vertices, paths.power_unit, trajectory, stored_at, name, wavelengths=waves)
