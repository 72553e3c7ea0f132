"""The obvious versions of the photon map's kernels, in plain NumPy and float64."""

from __future__ import annotations

import numpy as np

from pmviewer.bench.measures.lookup import clustered as clustered
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


def encode_power(x: np.ndarray) -> np.ndarray:
    """16-bit codes of non-negative powers: 6 bits of exponent (bias 47), 10 of mantissa, rounded to nearest."""
    x = np.asarray(x, np.float64)
    mantissa, exponent = np.frexp(np.maximum(x, 1e-300))  # x = mantissa · 2^exponent, mantissa in [½, 1)
    codes = np.floor((exponent - 1 + 47) * 1024 + (2 * mantissa - 1) * 1024 + 0.5)
    return np.clip(np.where(codes < 1, 0, codes), 0, 0xFFFF).astype(np.uint32)


def encode_direction(wi: np.ndarray) -> np.ndarray:
    """24-bit octahedral codes, in the high bits of uint32, of unit vectors (n, 3)."""
    wi = np.asarray(wi, np.float64)
    uv = wi[:, :2] / np.abs(wi).sum(axis=1, keepdims=True)
    folded = (1 - np.abs(uv[:, ::-1])) * np.where(uv >= 0, 1, -1)
    uv = np.where(wi[:, 2:] < 0, folded, uv)
    grid = np.clip(np.floor(uv * 2047 + 2047.5), 0, 4094).astype(np.uint32)
    return grid[:, 0] << 20 | grid[:, 1] << 8


def pack(position, wi=(0.0, 0.0, 1.0), power=1.0, flags=0, light=0) -> np.ndarray:
    """Photons (n, 6) float32; what is given once holds for all."""
    n = len(position)
    photons = np.empty((n, 6), np.float32)
    photons[:, :3] = position
    words = photons.view(np.uint32)
    codes = encode_power(np.broadcast_to(power, (n, 3)))
    words[:, 3] = encode_direction(np.broadcast_to(wi, (n, 3))) | np.broadcast_to(np.asarray(flags, np.uint32), n)
    words[:, 4] = codes[:, 0] | codes[:, 1] << 16
    words[:, 5] = codes[:, 2] | np.broadcast_to(np.asarray(light, np.uint32), n) << 16
    return photons
