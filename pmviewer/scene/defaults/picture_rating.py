"""How much there is to see in a camera's picture: see `pmviewer.scene.defaults.viewpoint`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.defaults.proxy import Proxy
from pmviewer.scene.description import Camera

Float = NDArray[np.float64]
SIDE = 32
"""A candidate's picture has so many rays either way."""
_BACK = 0.5
"""What the back of a surface counts."""


@dataclass(frozen=True)
class Rated:
    """A camera and what its picture is worth."""

    camera: Camera
    rating: float
    front: float
    """Share of the surfaces in the picture that show their front."""
    cover: float
    """Share of the picture with a surface in it."""


def picture_rays(camera: Camera, side: int = SIDE) -> Float:
    """Unit directions (side², 3) through the middles of a square picture's pixels."""
    return _rays_of([camera], side)[0]


def _rays_of(cameras: list[Camera], side: int) -> Float:
    """The same of several cameras, (n, side², 3)."""
    origin, target, up = (np.array([getattr(c, name) for c in cameras], float) for name in ("origin", "target", "up"))
    forward = target - origin
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    top = np.cross(right, forward)
    reach = np.tan(np.radians([camera.fov for camera in cameras]) / 2)[:, None]
    at = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = (grid.reshape(-1) for grid in np.meshgrid(at, -at))
    rays = np.empty((len(cameras), side * side, 3))
    for k in range(3):
        rays[..., k] = forward[:, k, None] + reach * (x * right[:, k, None] + y * top[:, k, None])
    return rays / np.sqrt(np.einsum("nrk,nrk->nr", rays, rays))[..., None]


def rated_pictures(proxy: Proxy, cameras: list[Camera], close: float, *, inside: bool) -> list[Rated]:
    """How much there is to see in each camera's picture; see the module. What is nearer than `close` is in the way."""
    rays = _rays_of(cameras, SIDE).reshape(-1, 3)
    eyes = np.repeat(np.array([camera.origin for camera in cameras]), SIDE * SIDE, axis=0)
    hits = proxy.closest(eyes, rays)
    n, met = len(cameras), hits.met.reshape(len(cameras), -1)
    triangle, total = hits.triangle.reshape(met.shape), np.maximum(met.sum(axis=1), 1)
    key = (np.arange(n)[:, None] * len(proxy.areas) + triangle)[met]
    key, number = np.unique(key, return_counts=True)
    # −Σ pᵢ log pᵢ with pᵢ = number / total
    sums = np.bincount(key // len(proxy.areas), number * np.log(number), n)
    entropy = np.log(total) - sums / total + 1.0
    front = (hits.front.reshape(met.shape) & met).sum(axis=1) / total
    near = ((hits.distance.reshape(met.shape) < close) & met).sum(axis=1) / total
    cover = met.mean(axis=1)
    filled = np.minimum(1.0, cover / 0.6 if inside else 0.1 + cover / 0.4)
    rating = entropy * (_BACK + (1 - _BACK) * front) * filled * (1 - near) ** 2
    rating[cover == 0] = 0.0
    columns = (rating.tolist(), front.tolist(), cover.tolist())
    return [Rated(camera, *row) for camera, *row in zip(cameras, *columns)]
