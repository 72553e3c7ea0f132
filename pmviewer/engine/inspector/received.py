"""What each object of a scene has received: the photons that lie on its surface, and their power.

A stored photon does not say what it lies on. A short ray along its own way does: from a little before the place where
it arrived, in the direction in which it came, the surface that it met is the first one, at that very distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import PhotonCloud
from pmviewer.engine.opened import OpenScene
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.maps.record import unpack
from pmviewer.progress import check
from pmviewer.scene.describe import area
from pmviewer.scene.description import Mesh, Parallelogram, Scene

STEP = 1e-4
"""Length of the rays, relative to the scene's radius."""
NEAR = 0.5
"""By how much of that length the hit may be elsewhere: directions of grazing photons are not exact enough for less."""
CHUNK = 1 << 17
"""Photons looked at in one go, after which the work may be cancelled."""


@dataclass(frozen=True, eq=False)
class Received:
    """By object, shapes before instances: how many `photons` (m,) lie on it, and their `power` (m, 3) in W, red, green
    and blue. `unknown` photons lie on nothing that could be told."""

    photons: NDArray[np.int64]
    power: NDArray[np.float64]
    unknown: int


def received(opened: OpenScene, cloud: PhotonCloud) -> Received:
    """Of the photons of one map and one pass. Raises Cancelled."""
    scene, objects = opened.scene, len(opened.scene.shapes) + len(opened.scene.instances)
    photons, power, unknown = np.zeros(objects, np.int64), np.zeros((objects, 3)), 0
    for first in range(0, len(cloud.photons), CHUNK):
        check()
        part = np.ascontiguousarray(cloud.photons[first : first + CHUNK])
        fields = unpack(part, cloud.power_unit)
        lies_on = objects_at(opened, fields["position"], fields["wi"])
        known = lies_on >= 0
        unknown += int((~known).sum())
        photons += np.bincount(lies_on[known], minlength=objects)
        for channel in range(3):
            weights = fields["Phi"][known, channel].astype(np.float64)
            power[:, channel] += np.bincount(lies_on[known], weights, minlength=objects)
    assert len(scene.shapes) <= objects
    return Received(photons, power, unknown)


def objects_at(opened: OpenScene, positions: NDArray[np.float32], wi: NDArray[np.float32]) -> NDArray[np.int64]:
    """Numbers (n,) of the objects at places (n, 3) on surfaces, that photons reached from the directions wi (n, 3);
    −1 where none is found."""
    flat, n = opened.flat, len(positions)
    length = np.float32(STEP * flat.radius)
    origins = np.ascontiguousarray(positions + length * wi, np.float32)
    towards = np.ascontiguousarray(-wi, np.float32)
    near, far = np.zeros(n, np.float32), np.full(n, (1 + NEAR) * length, np.float32)
    t, prim, uv = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32)
    cast_closest(flat.record[0], origins, towards, near, far, t, prim, uv)
    met = (prim >= 0) & (np.abs(t - length) <= NEAR * length)
    return np.where(met, _object_of(opened, np.maximum(prim, 0)), -1)


def _object_of(opened: OpenScene, prim: NDArray[np.int32]) -> NDArray[np.int64]:
    """The object of each primitive: those of instances have the numbers behind the stored ones, in their order."""
    flat, shapes = opened.flat, len(opened.scene.shapes)
    stored = len(flat.shape_of_prim)
    own = flat.shape_of_prim[np.minimum(prim, stored - 1)].astype(np.int64)
    if not flat.n_instances:
        return own
    instance = np.searchsorted(flat.arrays["instance_base"], prim, side="right") - 1
    return np.where(prim < stored, own, shapes + instance)


def surface_of(scene: Scene, number: int) -> float | None:
    """Area of an object in squared scene units; None of an instance whose round parts are stretched."""
    if number < len(scene.shapes):
        return area(scene.shapes[number].geometry)
    instance = scene.instances[number - len(scene.shapes)]
    linear = np.asarray(instance.to_world, float)[:3, :3]
    scales = np.linalg.svd(linear, compute_uv=False)
    total = 0.0
    for shape in instance.group.shapes:
        geometry = shape.geometry
        if isinstance(geometry, Mesh):
            total += area(Mesh(geometry.vertices @ linear.T, geometry.faces))
        elif isinstance(geometry, Parallelogram):
            u, v = (linear @ np.asarray(edge) for edge in (geometry.edge_u, geometry.edge_v))
            total += float(np.linalg.norm(np.cross(u, v)))
        elif np.allclose(scales, scales[0], rtol=1e-6):
            total += float(scales[0]) ** 2 * area(geometry)
        else:
            return None
    return total
