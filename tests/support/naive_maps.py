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


def arriving(photons, point, normal, flat=0.0):
    """Which photons (n,) come from the front to the same surface: the cells of their normals have middles that are less
    than 60° away, and those below the plane don't have the place before them by more than 30°. Up to
    `flat` off the plane all may."""
    words = photons.view(np.uint32)[:, 3]
    u, v = (((words >> shift) & 7).astype(float) / 4 - 0.875 for shift in (20, 8))
    middles = np.stack([u, v, 1 - np.abs(u) - np.abs(v)], axis=1)
    below = middles[:, 2] < 0
    folded = (1 - np.abs(middles[:, 1::-1])) * np.where(middles[:, :2] >= 0, 1, -1)
    middles[below, :2] = folded[below]
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    normal = np.asarray(normal, float)
    d = photons[:, :3].astype(float) - point
    sine = np.einsum("ij,ij->i", middles, d) / np.maximum(np.linalg.norm(d, axis=1), 1e-300)
    apart = (d @ normal < 0) & (sine < -0.5)
    front, off = unpack(photons, 1.0)["wi"].astype(float) @ normal > 0, np.abs(d @ normal) > flat
    return front & ~(off & ((middles @ normal < 0.5) | apart))


def _candidates(photons, power_unit, point, normal, class_mask, flat=0.0):
    """Offsets from the point and powers of photons that arrive from the front on a wanted path."""
    p = unpack(photons, power_unit)
    keep = arriving(photons, point, normal, flat) & ((class_mask >> p["path_class"]) & 1).astype(bool)
    return p["position"][keep].astype(float) - point, p["Phi"][keep].astype(float)


def irradiance_radius(photons, power_unit, point, normal, radius, flatness, class_mask, kind, cone_k):
    """(E (3,), count)."""
    offset, power = _candidates(photons, power_unit, point, normal, class_mask, flatness * radius / 2048)
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


def _octahedral(w: np.ndarray) -> np.ndarray:
    w = np.asarray(w, np.float64)
    uv = w[:, :2] / np.abs(w).sum(axis=1, keepdims=True)
    folded = (1 - np.abs(uv[:, ::-1])) * np.where(uv >= 0, 1, -1)
    return np.where(w[:, 2:] < 0, folded, uv)


def encode_arrival(wi: np.ndarray, n: np.ndarray) -> np.ndarray:
    """24-bit codes of unit vectors (n, 3) with the cells of unit normals (n, 3) in the lowest bits: of all codes with
    these bits the nearest."""
    coordinates = []
    for place, cell in zip(_octahedral(wi).T, _octahedral(n).T, strict=True):
        low = np.minimum(np.floor((cell + 1) * 4), 7)
        most = np.where(low < 7, 511, 510)  # 4094 is the last code
        step = np.clip(np.floor((place * 2047 + 2047 - low) / 8 + 0.5), 0, most)
        coordinates.append((8 * step + low).astype(np.uint32))
    return coordinates[0] << 20 | coordinates[1] << 8


def encode_direction(wi: np.ndarray) -> np.ndarray:
    """24-bit octahedral codes, in the high bits of uint32, of unit vectors (n, 3)."""
    uv = _octahedral(wi)
    grid = np.clip(np.floor(uv * 2047 + 2047.5), 0, 4094).astype(np.uint32)
    return grid[:, 0] << 20 | grid[:, 1] << 8


def pack(position, wi=(0.0, 0.0, 1.0), power=1.0, flags=0, light=0, normal=None) -> np.ndarray:
    """Photons (n, 6) float32; what is given once holds for all. Without normals wi are theirs."""
    n = len(position)
    photons = np.empty((n, 6), np.float32)
    photons[:, :3] = position
    words = photons.view(np.uint32)
    codes = encode_power(np.broadcast_to(power, (n, 3)))
    arrivals = (np.broadcast_to(w, (n, 3)) for w in (wi, wi if normal is None else normal))
    words[:, 3] = encode_arrival(*arrivals) | np.broadcast_to(np.asarray(flags, np.uint32), n)
    words[:, 4] = codes[:, 0] | codes[:, 1] << 16
    words[:, 5] = codes[:, 2] | np.broadcast_to(np.asarray(light, np.uint32), n) << 16
    return photons


def combined_knn(parts, power_unit, point, normal, k, max_radius, flatness, kind, rim, share, combine):
    """Irradiance (3,) from the k nearest photons of each of the `parts`, lists of photons, by the course guide's two
    ways; of M photons that end a disc M − 1 count, and one as `rim` (0, 1, 2) says."""
    powers, rims, areas, inside = [], [], [], 0
    for photons in parts:
        offset, power = _candidates(photons, power_unit, point, normal, 0b1111)
        d = np.maximum(np.linalg.norm(offset, axis=1), np.abs(offset @ normal) / flatness)
        order = np.argsort(d, kind="stable")[:k]
        order = order[d[order] < max_radius]
        radius, ends = max_radius, len(order) == k
        if ends:
            radius = d[order[-1]]
            rims.append(power[order[-1]])
            order = order[:-1]
        else:
            rims.append(None)
        inside += len(order)
        used = order[d[order] < np.sqrt(share) * radius] if share < 1 else order
        powers.append(WEIGHTS[kind](d[used] / (np.sqrt(share) * radius), 1.1) @ power[used])
        areas.append(np.pi * share * radius**2 * disc_mean(kind, 1.1))
    of_rim = float(WEIGHTS[kind](np.ones(1), 1.1)[0]) * rim / 2 if share == 1 else 0.0
    if combine == "irradiances":
        on_rims = [np.zeros(3) if power is None else of_rim * power for power in rims]
        return sum((P + R) / a for P, R, a in zip(powers, on_rims, areas, strict=True))
    ended = [power for power in rims if power is not None]
    M, total, at_rims = len(parts), sum(powers), sum(ended, np.zeros(3))
    if kind == "constant" and share == 1:
        total = total + (M - 1 + of_rim) / M * at_rims
    else:
        total = total * (1 + len(ended) * (M - 1) / M / max(inside, 1)) + of_rim / M * at_rims
    return total / np.mean(areas)
