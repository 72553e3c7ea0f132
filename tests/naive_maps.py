"""The obvious versions of the photon map's kernels, in plain NumPy and float64."""

from __future__ import annotations

import numpy as np

from pmviewer.maps.record import unpack

ALPHA, BETA = 0.918, 1.953

WEIGHTS = {
    "constant": lambda x, k: np.ones_like(x),
    "cone": lambda x, k: 1 - x / k,
    "gaussian": lambda x, k: ALPHA * (1 - (1 - np.exp(-BETA * x**2 / 2)) / (1 - np.exp(-BETA))),
    "simpson": lambda x, k: (1 - x**2) ** 2,
    "epanechnikov": lambda x, k: 1 - x**2,
}


def disc_mean(kind: str, cone_k: float) -> float:
    """∫₀¹ 2x·w(x) dx by the midpoint rule."""
    x = (np.arange(100_000) + 0.5) / 100_000
    return float(np.mean(2 * x * WEIGHTS[kind](x, cone_k)))


def neighbours(positions: np.ndarray, point: np.ndarray, k: int, max_radius: float = np.inf) -> np.ndarray:
    """Indices of the k nearest positions closer than max_radius, nearest first."""
    d = np.linalg.norm(positions.astype(float) - point.astype(float), axis=1)
    order = np.argsort(d, kind="stable")[:k]
    return order[d[order] < max_radius]


def _candidates(photons, power_unit, point, normal, class_mask):
    """Offsets from the point and powers of photons that arrive from the front on a wanted path."""
    p = unpack(photons, power_unit)
    keep = (p["wi"].astype(float) @ normal > 0) & ((class_mask >> p["path_class"]) & 1).astype(bool)
    return p["position"][keep].astype(float) - point, p["Phi"][keep].astype(float)


def irradiance_radius(photons, power_unit, point, normal, radius, flatness, class_mask, kind, cone_k):
    """(E (3,), count)."""
    offset, power = _candidates(photons, power_unit, point, normal, class_mask)
    d = np.linalg.norm(offset, axis=1)
    keep = (d < radius) & (np.abs(offset @ normal) <= flatness * radius)
    w = WEIGHTS[kind](d[keep] / radius, cone_k)
    return w @ power[keep] / (disc_mean(kind, cone_k) * np.pi * radius**2), int(keep.sum())


def irradiance_knn(photons, power_unit, point, normal, k, max_radius, flatness, class_mask, kind, cone_k, rim):
    """(E (3,), count, radius); rim 0, 1, 2: the farthest photon counts nothing, half, whole."""
    offset, power = _candidates(photons, power_unit, point, normal, class_mask)
    d = np.maximum(np.linalg.norm(offset, axis=1), np.abs(offset @ normal) / flatness)
    order = np.argsort(d, kind="stable")[:k]
    order = order[d[order] < max_radius]
    radius, rim_factor = max_radius, 1.0
    if len(order) == k:
        radius, rim_factor = d[order[-1]], rim / 2
    w = WEIGHTS[kind](d[order] / radius, cone_k)
    w[-1:] *= rim_factor
    return w @ power[order] / (disc_mean(kind, cone_k) * np.pi * radius**2), len(order), radius
