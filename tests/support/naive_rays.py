"""Ray casting as it stands in a textbook, in NumPy float64: every ray against every primitive."""

from __future__ import annotations

import numpy as np

SPHERE, CYLINDER, DISK = 0, 1, 2


def triangle_distances(triangles, origins, directions):
    """t, u, v of each ray with each triangle's plane, (rays, n) each; t is NaN outside the triangle."""
    v0, v1, v2 = (triangles[None, :, k].astype(np.float64) for k in range(3))
    o, d = origins[:, None].astype(np.float64), directions[:, None].astype(np.float64)
    e1, e2, s = v1 - v0, v2 - v0, o - v0
    p = np.cross(d, e2)
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (e1 * p).sum(-1)
        u, v, t = (s * p).sum(-1) * inverse, (d * q).sum(-1) * inverse, (e2 * q).sum(-1) * inverse
        inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    return np.where(inside, t, np.nan), u, v


def quadric_distances(row, origins, directions):
    """The two candidate distances of each ray with one quadric, (rays, 2), NaN where there is none."""
    row = row.astype(np.float64)
    kind, center, axis, radius, length = row[0], row[1:4], row[4:7], row[7], row[8]
    s, d = origins.astype(np.float64) - center, directions.astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        if kind == DISK:
            t = (-(s @ axis) / (d @ axis))[:, None]
            inside = np.linalg.norm(s[:, None] + t[..., None] * d[:, None], axis=-1) <= radius
            return np.where(inside, t, np.nan)
        across = np.eye(3) - (np.outer(axis, axis) / (axis @ axis) if kind == CYLINDER else 0.0)
        sp, dp = s @ across, d @ across
        a, b, c = (dp * dp).sum(1), 2 * (sp * dp).sum(1), (sp * sp).sum(1) - radius**2
        root = np.sqrt(b * b - 4 * a * c)
        t = np.stack([(-b - root) / (2 * a), (-b + root) / (2 * a)], 1)
        if kind == CYLINDER:
            along = (s @ axis)[:, None] + t * (d @ axis)[:, None]
            t = np.where((along >= 0) & (along <= length), t, np.nan)
    return t


def all_distances(triangles, quadrics, origins, directions):
    """(rays, columns) distances, NaN for a miss, and the primitive id of each column."""
    columns = [triangle_distances(triangles, origins, directions)[0]]
    ids = [np.arange(len(triangles))]
    for j, row in enumerate(quadrics):
        t = quadric_distances(row, origins, directions)
        columns.append(t)
        ids.append(np.full(t.shape[1], len(triangles) + j))
    return np.concatenate(columns, 1), np.concatenate(ids)


def closest_hit(triangles, quadrics, origins, directions, tmin, tmax):
    """(t, primitive) of the nearest hit in (tmin, tmax), or (tmax, -1)."""
    t, ids = all_distances(triangles, quadrics, origins, directions)
    t = np.where((t > tmin[:, None]) & (t < tmax[:, None]), t, np.inf)
    nearest = t.argmin(1)
    best = t[np.arange(len(t)), nearest]
    return np.where(best < np.inf, best, tmax), np.where(best < np.inf, ids[nearest], -1)


def project(row, points):
    """Normal (n, 3) and signed distance (n,) of points to one quadric's unbounded surface."""
    row = row.astype(np.float64)
    kind, center, axis, radius = row[0], row[1:4], row[4:7], row[7]
    s = points.astype(np.float64) - center
    if kind == DISK:
        return np.broadcast_to(axis, s.shape), s @ axis
    if kind == CYLINDER:
        s = s - np.outer(s @ axis / (axis @ axis), axis)
    distance = np.linalg.norm(s, axis=1)
    return s / distance[:, None], distance - radius
