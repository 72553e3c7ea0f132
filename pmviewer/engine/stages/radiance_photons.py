"""The radiance photons of a pass: which, how far each reaches, in which unit they are stored."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.stages.light_plan import LightPlan
from pmviewer.engine.stages.pass_maps import LookUpMap
from pmviewer.maps.estimate.estimate import irradiance_at_knn
from pmviewer.maps.estimate.filters import FILTERS, Filter
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.radiance import RadianceMap, build_radiance_map
from pmviewer.maps.record import decode_directions
from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.maps.search.parts import PhotonParts
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.render.record import RIMS
from pmviewer.settings.access import Estimate, Settings

AUTOMATIC_CUTOFF, AUTOMATIC_CUTOFF_NEAREST = 0.5, 1.0
"""In look-up radii. Half a radius keeps the mean exact (see `pmviewer.maps.radiance`). A disc of k photons holds
radiance photons at any density, so that a whole radius costs 0.2 % of bias and saves nearly all look-ups of the rays
themselves."""

PROBES = 256
"""Photons at which the radius of k-nearest look-ups is measured."""


def radiance_photons_of(
    photons: PhotonMaps, global_: LookUpMap, settings: Settings, light: LightPlan
) -> tuple[RadianceMap, float]:
    """Radiance photons of the pass, for look-ups in the map of all its global photons.

    Returns the map, its irradiances not yet computed, and the largest distance at which a radiance photon is used, in
    scene units.
    """
    share, radius = settings.gather.radiance_photons, global_.radius
    assert share != "off"
    cutoff = AUTOMATIC_CUTOFF
    if not isinstance(global_.structure, PhotonGrid):
        radius = median_radius(photons, global_.structure, radius, settings.estimate, light)
        cutoff = AUTOMATIC_CUTOFF_NEAREST
    if settings.gather.cutoff != "auto":
        cutoff = float(settings.gather.cutoff)
    cutoff *= radius
    unit = photons.global_unit / (math.pi * radius * radius)
    return build_radiance_map(photons.global_, photons.normals, share, cutoff, unit), cutoff


def median_radius(
    photons: PhotonMaps,
    trees: PhotonKdTree | PhotonParts,
    max_radius: float,
    estimate: Estimate,
    light: LightPlan,
) -> float:
    """Median radius, in scene units, of the pass's k-nearest look-ups at photons spread evenly over the map. Of a map
    in several parts that of look-ups in the first: their areas are alike."""
    tree = trees.trees[0] if isinstance(trees, PhotonParts) else trees
    n = len(photons.global_)
    if n == 0:
        return max_radius
    picked: NDArray[np.int64] = np.unique(np.linspace(0, n - 1, PROBES).astype(np.int64))
    points = np.ascontiguousarray(photons.global_[picked, :3])
    normals = decode_directions(photons.normals[picked])
    m = len(picked)
    E, counts, radii = np.empty((m, 3), np.float32), np.empty(m, np.int32), np.empty(m, np.float32)
    rim = np.int32(RIMS.index(estimate.rim))
    neighbours = Neighbours(np.int32(light.neighbours), np.float32(max_radius), rim, np.float32(light.share))
    irradiance_at_knn(
        tree.record,
        points,
        normals,
        neighbours,
        np.float32(estimate.flatness),
        np.int32(ALL_CLASSES),
        Filter(np.int32(FILTERS.index(estimate.filter)), np.float32(estimate.cone_k)),
        0,
        m,
        E,
        counts,
        radii,
    )
    return float(np.median(radii))
