"""Curves as meshes of tubes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.meshes.tubes import carry_frames
from pmviewer.scene.arrays.primitives import unit
from pmviewer.scene.description import Mesh

Float = NDArray[np.float64]
Ints = NDArray[np.int64]
MOST_TRIANGLES = 4_000_000
"""Beyond these, tubes have fewer sides and curves fewer pieces."""
_FINENESS = ((4, 8), (2, 6), (1, 4), (1, 3))
"""Pieces of a cubic segment and sides of a tube, finest first."""
SHARPEST = math.radians(20)
"""Bend of a polygon up to which both pieces share a ring of points. The ring stands between them, and the tube is
narrower by the cosine of half the bend: 1.5 % at most."""
_CAP = (math.radians(45), math.radians(85))
"""Latitudes of the rings that make a tube's end round."""


@dataclass(frozen=True)
class Curves:
    """`points` (n, 4), places and radii; those of curve i are [first[i], first[i + 1])."""

    points: Float
    first: Ints

    def __len__(self) -> int:
        return len(self.first) - 1

    def longer_than(self, least: int) -> Curves:
        """Those of at least so many points."""
        lengths = np.diff(self.first)
        keep = lengths >= least
        first = np.concatenate([[0], np.cumsum(lengths[keep])])
        return Curves(self.points[np.repeat(keep, lengths)], first)


def tubes(curves: Curves, *, cubic: bool) -> Mesh:
    """The surface around the curves with normals, facing outwards: polygons through the points with round ends and
    corners, or uniform cubic B-splines, open at their ends. Polygons need two points each, splines four."""
    if not cubic:
        curves = _cut_at_corners(curves)
    segments = len(curves.points) + (-3 if cubic else 2 * len(_CAP) - 1) * len(curves)
    pieces, sides = _FINENESS[-1]
    for pieces, sides in _FINENESS:
        if 2 * sides * segments * (pieces if cubic else 1) <= MOST_TRIANGLES:
            break
    if cubic:
        curves = _spline(curves, pieces)
    along = _tangents(curves)
    lean = np.zeros(len(along))
    if not cubic:
        curves, along, lean = _rounded(curves, along)
    across = np.empty_like(along)
    carry_frames(along, curves.first, across)
    return _around(curves, along, across, lean, sides)


def _spline(curves: Curves, pieces: int) -> Curves:
    """Points on uniform cubic B-splines, so many a segment and one more at the end."""
    lengths = np.diff(curves.first)
    number = lengths - 3
    last = np.cumsum(number) - 1
    start = np.arange(number.sum()) + np.repeat(3 * np.arange(len(number)), number)
    t = np.arange(pieces + 1)[:, None] / pieces
    weights = np.concatenate([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], 1) / 6
    found = np.einsum("pk,skc->spc", weights, curves.points[start[:, None] + np.arange(4)])
    keep = np.ones(found.shape[:2], bool)
    keep[:, -1] = False
    keep[last, -1] = True
    return Curves(found[keep], np.concatenate([[0], np.cumsum(number * pieces + 1)]))


def _cut_at_corners(curves: Curves) -> Curves:
    """The same with an end on either side of each point where a polygon bends by more than `SHARPEST`."""
    step = np.diff(curves.points[:, :3], axis=0)
    length = np.linalg.norm(step, axis=1)
    cosine = np.einsum("ij,ij->i", step[:-1], step[1:])
    sharp = np.zeros(len(curves.points), bool)
    sharp[1:-1] = cosine < math.cos(SHARPEST) * length[:-1] * length[1:]
    sharp[curves.first[:-1]] = sharp[curves.first[1:] - 1] = False
    number = np.repeat(np.arange(len(sharp)), 1 + sharp)
    second = np.zeros(len(number), bool)
    second[1:] = number[1:] == number[:-1]
    begins = np.isin(number, curves.first[:-1]) | second
    return Curves(curves.points[number], np.append(np.flatnonzero(begins), len(number)))


def _tangents(curves: Curves) -> Float:
    """Unit vectors along the curves: between the directions of the two pieces that meet at a point."""
    ways = unit(np.diff(curves.points[:, :3], axis=0))
    ways[curves.first[1:-1] - 1] = 0.0  # from one curve to the next
    nothing = np.zeros((1, 3))
    before, after = np.concatenate([nothing, ways]), np.concatenate([ways, nothing])
    both = unit(before + after)
    lost = ~both.any(axis=1)  # points that coincide, or a curve that turns back
    both[lost] = np.where(after[lost].any(axis=1, keepdims=True), after[lost], [0.0, 0.0, 1.0])
    return both


def _rounded(curves: Curves, along: Float) -> tuple[Curves, Float, Float]:
    """The same with rings of hemispheres at both ends, and how far the normals of all rings lean along the tangents,
    as the sines of angles."""
    begins, ends = curves.first[:-1], curves.first[1:] - 1
    points, tangents = [curves.points], [along]
    leans: list[Float] = [np.zeros(len(along))]
    order: list[Float] = [np.arange(len(along), dtype=np.float64)]
    for place, sign in ((begins, -1.0), (ends, 1.0)):
        for k, latitude in enumerate(_CAP, 1):
            ring = curves.points[place]
            ring[:, :3] += sign * math.sin(latitude) * ring[:, 3:] * along[place]
            ring[:, 3] *= math.cos(latitude)
            points.append(ring)
            tangents.append(along[place])
            leans.append(np.zeros(len(place)) + sign * math.sin(latitude))
            order.append(np.asarray(place + sign * 0.1 * k, np.float64))
    sort = np.argsort(np.concatenate(order), kind="stable")
    first = curves.first + 2 * len(_CAP) * np.arange(len(curves.first))
    return Curves(np.concatenate(points)[sort], first), np.concatenate(tangents)[sort], np.concatenate(leans)[sort]


def _around(curves: Curves, along: Float, across: Float, lean: Float, sides: int) -> Mesh:
    """Rings of so many vertices around all points, joined along each curve."""
    angles = np.arange(sides) * (2 * math.pi / sides)
    third = np.cross(along, across)
    radial = np.cos(angles)[:, None] * across[:, None] + np.sin(angles)[:, None] * third[:, None]
    # So wide that a polygon's circumference, and with it its width in the mean of all directions, is the circle's.
    wide = math.pi / sides / math.sin(math.pi / sides)
    vertices = curves.points[:, None, :3] + wide * curves.points[:, None, 3:] * radial
    normals = np.sqrt(1 - lean * lean)[:, None, None] * radial + (lean[:, None] * along)[:, None]
    ring = np.ones(len(along), bool)
    ring[curves.first[1:] - 1] = False
    a = (np.flatnonzero(ring)[:, None] * sides + np.arange(sides)).reshape(-1)
    b = (np.flatnonzero(ring)[:, None] * sides + np.roll(np.arange(sides), -1)).reshape(-1)
    faces = np.concatenate([np.stack([a, b, a + sides], 1), np.stack([b, b + sides, a + sides], 1)])
    return Mesh(vertices.reshape(-1, 3), faces.astype(np.int32), normals.reshape(-1, 3))
