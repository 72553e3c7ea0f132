"""Analytic spheres, open cylinders and disks: bounds, intersection, normal, projection.

Storage: float32 rows [kind, cx, cy, cz, ax, ay, az, radius, length, 0, 0, 0]. A sphere has its centre in c; a cylinder
starts at c and runs `length` along the unit axis a, without caps; a disk has its centre in c and the unit normal a.

All arithmetic is in float64: the roots of a sphere that the ray starts on differ by many orders of magnitude, and the
few quadrics of a scene cost little.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4

_i8 = np.int64

SPHERE, CYLINDER, DISK = 0, 1, 2
QUADRIC_FLOATS = 12


def quadric_bounds(quadrics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners, float32 (m, 3) each, rounded outwards, of quadrics (m, 12)."""
    rows = quadrics.astype(np.float64)
    kind, center, axis, radius, length = rows[:, :1], rows[:, 1:4], rows[:, 4:7], rows[:, 7:8], rows[:, 8:9]
    # A circle of radius r around axis a reaches r sqrt(1 - a_k²) along coordinate k (a is unit up to float32 rounding).
    reach = np.where(kind == SPHERE, radius, radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0) + 1e-6))
    end = center + np.where(kind == CYLINDER, axis * length, 0.0)
    lower, upper = np.minimum(center, end) - reach, np.maximum(center, end) + reach
    infinity = np.float32(np.inf)
    return np.nextafter(lower.astype(np.float32), -infinity), np.nextafter(upper.astype(np.float32), infinity)


@device
def _load_f8(address, i):
    return np.float64(load_f4(address, i))


@device
def intersect_quadric(address, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """Distance of the first hit in (tmin, tmax) with the quadric stored at `address`, or tmax; all float32."""
    kind = np.int32(load_f4(address, 0))
    ax, ay, az = _load_f8(address, _i8(4)), _load_f8(address, _i8(5)), _load_f8(address, _i8(6))
    radius = _load_f8(address, _i8(7))
    sx, sy, sz = ox - _load_f8(address, _i8(1)), oy - _load_f8(address, _i8(2)), oz - _load_f8(address, _i8(3))
    vx, vy, vz = np.float64(dx), np.float64(dy), np.float64(dz)
    if kind == DISK:
        t = -(sx * ax + sy * ay + sz * az) / (vx * ax + vy * ay + vz * az)
        px, py, pz = sx + t * vx, sy + t * vy, sz + t * vz
        near = np.float32(t)
        if near > tmin and near < tmax and px * px + py * py + pz * pz <= radius * radius:
            return near
        return tmax
    length = _load_f8(address, _i8(8))
    start = slope = 0.0
    if kind == CYLINDER:
        # Remove what lies along the axis; a float32 axis is not exactly of unit length.
        scale = 1.0 / (ax * ax + ay * ay + az * az)
        start, slope = (sx * ax + sy * ay + sz * az) * scale, (vx * ax + vy * ay + vz * az) * scale
        sx, sy, sz = sx - start * ax, sy - start * ay, sz - start * az
        vx, vy, vz = vx - slope * ax, vy - slope * ay, vz - slope * az
    inverse = 1.0 / (vx * vx + vy * vy + vz * vz)
    middle = -(sx * vx + sy * vy + sz * vz) * inverse
    # Discriminant from the perpendicular from the centre to the ray: no cancellation for small, distant spheres
    # (Haines et al. 2019).
    px, py, pz = sx + middle * vx, sy + middle * vy, sz + middle * vz
    discriminant = radius * radius - (px * px + py * py + pz * pz)
    if not discriminant >= 0.0:
        return tmax
    half = math.sqrt(discriminant * inverse)
    product = (sx * sx + sy * sy + sz * sz - radius * radius) * inverse
    far = middle + (half if middle >= 0.0 else -half)
    other = product / far if far != 0.0 else 0.0
    t0, t1 = min(far, other), max(far, other)
    near = np.float32(t0)
    if near > tmin and near < tmax and (kind == SPHERE or (start + t0 * slope >= 0.0 and start + t0 * slope <= length)):
        return near
    near = np.float32(t1)
    if near > tmin and near < tmax and (kind == SPHERE or (start + t1 * slope >= 0.0 and start + t1 * slope <= length)):
        return near
    return tmax


@device
def _frame(scene, j, px, py, pz):
    """Unit normal at the point, and its signed distance from the surface, in float64."""
    address = scene.bvh_quadrics + np.int64(j) * (4 * QUADRIC_FLOATS)
    kind = np.int32(load_f4(address, 0))
    ax, ay, az = _load_f8(address, _i8(4)), _load_f8(address, _i8(5)), _load_f8(address, _i8(6))
    sx, sy, sz = px - _load_f8(address, _i8(1)), py - _load_f8(address, _i8(2)), pz - _load_f8(address, _i8(3))
    if kind == DISK:
        return ax, ay, az, sx * ax + sy * ay + sz * az
    if kind == CYLINDER:
        along = (sx * ax + sy * ay + sz * az) / (ax * ax + ay * ay + az * az)
        sx, sy, sz = sx - along * ax, sy - along * ay, sz - along * az
    distance = math.sqrt(sx * sx + sy * sy + sz * sz)
    scale = 1.0 / distance if distance > 0.0 else 0.0
    return sx * scale, sy * scale, sz * scale, distance - _load_f8(address, _i8(7))


@device
def quadric_normal(scene, j, px, py, pz):
    """Geometric unit normal (float32) of quadric j at a point on it: away from centre or axis, a disk's own normal."""
    nx, ny, nz, _ = _frame(scene, j, px, py, pz)
    return np.float32(nx), np.float32(ny), np.float32(nz)


@device
def quadric_project(scene, j, px, py, pz):
    """The point of quadric j's surface (float32, error about one rounding) nearest to a point close to it."""
    nx, ny, nz, distance = _frame(scene, j, px, py, pz)
    return np.float32(px - distance * nx), np.float32(py - distance * ny), np.float32(pz - distance * nz)
