"""Photons of lamps that start the more densely, the nearer they aim at what is small (T7).

Of a dome over a scene, or a lamp high above, hardly any light meets what is small on a floor or before a backdrop
(`pmviewer.photons.projection.small`). Around the middle of that lie balls of the radii r, 2r, 4r …; a point of the
light sees n of them from outside, under cones with cosines c_k. A share EVERYWHERE of its photons starts in any of the
light's directions, the others within one of the cones, all of which have as many. The density, over that of photons
that start anywhere, is m = EVERYWHERE + (1 − EVERYWHERE)/n · Σ 1/(2 (1 − c_k) cos θ) over the cones that a direction
at the angle θ to the surface lies in, and with 2/(1 − c_k) for points, which emit in all directions alike; a photon has
1/m of the usual power. As with discs (`pmviewer.photons.projection.scales`) nothing is biased whatever is taken for
small, and no photon has more than 1/EVERYWHERE times that.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.light import light_start
from pmviewer.kernels.scene import L_KIND, POINT, light_number
from pmviewer.kernels.surface import leave
from pmviewer.kernels.vector import dot, from_basis, scale, sub
from pmviewer.kernels.warp import square_to_cone, square_to_cosine_hemisphere, square_to_sphere
from pmviewer.photons.projection.scales import EVERYWHERE
from pmviewer.photons.projection.small import Small
from pmviewer.scene.description import Cylinder, Disk, Geometry, Mesh, Sphere

Float = NDArray[np.float64]

PLACES = 32
"""Squared: places of a light by which its gain is estimated."""

_f4 = np.float32
_i8 = np.int64
_EVERYWHERE = _f4(EVERYWHERE)
_NEAR = _f4(1.0 - EVERYWHERE)


def gain_of(geometry: Geometry | None, position: Float | None, small: Small) -> float:
    """By how much more of the photons of a lamp aim at what is small, about; 1 where it doesn't shine there.

    The lamp is a surface that emits alike everywhere, or a point.
    """
    if geometry is None:
        assert position is not None
        points, normals, weights = position[None], None, np.ones(1)
    else:
        points, normals, weights = _places(geometry)
    away = small.center - points
    distance = np.linalg.norm(away, axis=1)
    outside = distance > small.radius
    ratio = np.minimum(small.radius / np.maximum(distance, 1e-300), 1.0)
    cones = np.maximum(np.ceil(-np.log2(ratio)), 1.0)
    if normals is None:
        share = (1 - np.sqrt(1 - ratio**2)) / 2
    else:
        cos = np.einsum("ij,ij->i", away, normals) / np.maximum(distance, 1e-300)
        share = np.where(outside, ratio**2 * np.maximum(cos, 0.0), 1.0)
    aimed = np.where(outside, EVERYWHERE * share + (1 - EVERYWHERE) / cones * (share > 0), share)
    usual = float(share @ weights)
    return float(aimed @ weights) / usual if usual > 0 else 1.0


def _places(geometry: Geometry) -> tuple[Float, Float, Float]:
    """Points (n, 3) all over a surface, the unit normals on the side that it faces, and the area of each, of any
    unit."""
    if isinstance(geometry, Mesh):
        corners = geometry.vertices[geometry.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=1)
        return corners.mean(axis=1), cross / np.maximum(area, 1e-300)[:, None], area
    u, v = (axis.ravel() for axis in np.meshgrid(*[(np.arange(PLACES) + 0.5) / PLACES] * 2))
    phi, ones = 2 * math.pi * v, np.ones(len(u))
    if isinstance(geometry, Sphere):
        z = 2 * u - 1
        normals = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], axis=1)
        side = -1.0 if geometry.flip_normals else 1.0
        return geometry.center + geometry.radius * normals, side * normals, ones
    if isinstance(geometry, Disk):
        s, t = _across(np.array(geometry.normal, float))
        r = geometry.radius * np.sqrt(u)
        points = geometry.center + (r * np.cos(phi))[:, None] * s + (r * np.sin(phi))[:, None] * t
        return points, np.broadcast_to(geometry.normal, points.shape), ones
    if isinstance(geometry, Cylinder):
        axis = np.subtract(geometry.p1, geometry.p0)
        s, t = _across(axis / np.linalg.norm(axis))
        normals = np.cos(phi)[:, None] * s + np.sin(phi)[:, None] * t
        side = -1.0 if geometry.flip_normals else 1.0
        return geometry.p0 + u[:, None] * axis + geometry.radius * normals, side * normals, ones
    normal = np.cross(geometry.edge_u, geometry.edge_v)
    points = np.array(geometry.corner) + u[:, None] * geometry.edge_u + v[:, None] * geometry.edge_v
    return points, np.broadcast_to(normal / np.linalg.norm(normal), points.shape), ones


def _across(axis: Float) -> tuple[Float, Float]:
    """Two unit vectors perpendicular to a unit one and to each other."""
    s = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    s /= np.linalg.norm(s)
    return s, np.cross(axis, s)


@device
def start_in_cones(scene, projection, light, position, direction):
    """Origin, unit direction and power of a photon of an area light or a point, and the factor for its power: 0 where
    the light does not shine."""
    point = np.int32(light_number(scene, light, L_KIND)) == POINT
    p, n, front, gap, beta = light_start(scene, light, position)
    away = sub((projection.small_x, projection.small_y, projection.small_z), p)
    distance2, r = dot(away, away), projection.small_radius
    cones = _i8(0)
    reach = r
    while reach * reach < distance2:
        reach *= _f4(2.0)
        cones += _i8(1)
    u, v = direction
    axis = n
    if cones > 0:
        axis = scale(away, _f4(1.0) / _f4(math.sqrt(distance2)))
    if cones == 0 or u < _EVERYWHERE:
        if cones > 0:
            u /= _EVERYWHERE
        if point:
            d = square_to_sphere(u, v)
        else:
            local = square_to_cosine_hemisphere(u, v)
            d = from_basis(n, local[0], local[1], local[2])
            if dot(front, d) < _f4(0.0):
                d = scale(d, _f4(-1.0))
        if cones == 0:
            return _left(point, p, n, gap, d), d, beta, _f4(1.0)
    else:
        u = (u - _EVERYWHERE) / _NEAR * _f4(cones)
        k = min(_i8(u), cones - _i8(1))
        r_k = r * _f4(_i8(1) << k)
        local = square_to_cone(min(u - _f4(k), _f4(1.0)), v, _narrow(r_k * r_k / distance2))
        d = from_basis(axis, local[0], local[1], local[2])
    cos = abs(dot(n, d))
    if not point and not (cos > _f4(0.0) and dot(front, d) > _f4(0.0)):
        return p, d, beta, _f4(0.0)
    off = sub(d, axis)
    apart = _f4(0.5) * dot(off, off)  # 1 − cosine, which 1 − dot would round
    m = _f4(0.0)
    sin2 = r * r / distance2
    for _ in range(cones):
        one_minus_cos = _narrow(sin2)
        if apart <= one_minus_cos:
            m += _f4(2.0) / one_minus_cos if point else _f4(0.5) / (one_minus_cos * cos)
        sin2 *= _f4(4.0)
    return _left(point, p, n, gap, d), d, beta, _f4(1.0) / (_EVERYWHERE + _NEAR / _f4(cones) * m)


@device
def _narrow(sin2):
    """1 − cosine of an angle of that squared sine."""
    return sin2 / (_f4(1.0) + _f4(math.sqrt(max(_f4(1.0) - sin2, _f4(0.0)))))


@device
def _left(point, p, n, gap, d):
    """Where a photon starts that leaves a light at p."""
    return p if point else leave(p, n, gap, d[0], d[1], d[2])
