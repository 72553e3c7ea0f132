"""Emission through projection maps (T7): photons start only where and in which directions something can be met.

The tables are made in `pmviewer.photons.projection.projection`. A light is picked with probability proportional to its
covered power Φ·c, so that all photons have the same power Σ Φ·c / n (the power correction of the course guide's eq.
2.2). How a light's photons are confined depends on its kind:

==========  ===================================  ==========================================================
mode        lights                               what is confined
==========  ===================================  ==========================================================
WHOLE       projectors, media that emit, and     nothing, c = 1
            any whose map would cover all
DIRECTIONS  points, spots, parallelograms, disks cells of directions around the light's axis
PLACES      directional lights                   cells of the disc that photons start on
WORLD       spheres, cylinders, meshes           cells of directions in the world; a photon is kept with the
                                                 cosine to the light's normal as probability, c = 4·(share on)
DISC        environments                         the disc, to one around what is to be met
SCALES      environments, directional lights     nothing; photons start more densely near what is small on a
                                                 wide floor (`pmviewer.photons.projection.scales`)
CONES       points, all with a surface           the same by their directions
                                                 (`pmviewer.photons.projection.cones`)
==========  ===================================  ==========================================================

With SCALES and CONES c is 1 over how many times as densely photons start for what is small, and a photon's power has a
factor 1/c beside its own: those that aim there have the power of all others, whatever is wasted elsewhere.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, specialised
from pmviewer.kernels.dimensions import PROJECTION_ACCEPT
from pmviewer.kernels.lights.light import emit_from, emit_photon, light_point
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import load_f4, load_i4
from pmviewer.kernels.random import draw1
from pmviewer.kernels.scene import DISK, L_KIND, L_RADIANCE, PARALLELOGRAM, light_number, light_vector
from pmviewer.kernels.surface import leave
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.vector import along, basis, dot, largest, luminance, scale
from pmviewer.kernels.warp import square_to_disk, square_to_sphere
from pmviewer.maps.variant import ABSENT
from pmviewer.photons.emission.scattered import emit_scattered
from pmviewer.photons.emission.stratified import emit_stratified
from pmviewer.photons.projection.cones import start_in_cones
from pmviewer.photons.projection.scales import start_at_scales

WHOLE, DIRECTIONS, PLACES, WORLD, DISC, SCALES, CONES = range(7)
ROWS, COLUMNS = 64, 64

NO_PROJECTION = np.repeat(ABSENT, 2)
"""Stands for projection maps where there are none."""

PROJECTION_DTYPE = np.dtype(
    [
        ("cdf", "i8"),  # float32 (n_lights + 1): distribution over covered power
        ("modes", "i8"),  # int32 (n_lights)
        ("first", "i8"),  # int32 (n_lights + 1): each light's cells
        ("gains", "i8"),  # float32 (n_lights): 1/c of SCALES and CONES, 1 of others
        ("cells", "i8"),  # int32: row · COLUMNS + column of the cells that are on
        ("center_x", "f4"),  # of a sphere around everything to be met
        ("center_y", "f4"),
        ("center_z", "f4"),
        ("radius", "f4"),
        ("small_x", "f4"),  # of a sphere around what is small on a wide floor
        ("small_y", "f4"),
        ("small_z", "f4"),
        ("small_radius", "f4"),
        ("scales", "i8"),  # discs around it
        ("most_factor", "f4"),  # of power that photons may have which aim at it from surfaces far away; 0: none does
    ],
    align=True,
)
"""Two records: of the trajectories that fill the global map, and of the others."""

_f4 = np.float32
_i8 = np.int64
_BELOW_ONE = _f4(0.99999994)


@device
def concentric_from_polar(u, v):
    """The numbers for which `square_to_disk` gives the point of the unit disc at radius √u and angle 2πv."""
    r = _f4(math.sqrt(u))
    phi = _f4(2.0 * math.pi) * v
    if phi >= _f4(1.75 * math.pi):
        phi -= _f4(2.0 * math.pi)
    if phi < _f4(0.25 * math.pi):
        a, b = r, _f4(4.0 / math.pi) * phi * r
    elif phi < _f4(0.75 * math.pi):
        a, b = _f4(-4.0 / math.pi) * (phi - _f4(0.5 * math.pi)) * r, r
    elif phi < _f4(1.25 * math.pi):
        a, b = -r, _f4(-4.0 / math.pi) * (phi - _f4(math.pi)) * r
    else:
        a, b = _f4(4.0 / math.pi) * (phi - _f4(1.5 * math.pi)) * r, -r
    a, b = _f4(0.5) * (a + _f4(1.0)), _f4(0.5) * (b + _f4(1.0))
    return min(max(a, _f4(0.0)), _BELOW_ONE), min(max(b, _f4(0.0)), _BELOW_ONE)


@device
def _from_curved_light(scene, light, position, d, u):
    """A place on the light for a photon in direction d, kept with the cosine as probability."""
    p, n, front, gap = light_point(scene, light, position[0], position[1])
    L = light_vector(scene, light, L_RADIANCE)
    beta = scale(L, _f4(1.0) / luminance(L))
    return leave(p, n, gap, d[0], d[1], d[2]), d, beta, dot(front, d) > _f4(0.0) and u < abs(dot(n, d))


@specialised
def emission(scene, projection, i, sequence, seed, index, u_pick, position, direction):
    """A photon leaving a light: origin, unit direction, power of luminance 1, light, whether it is to be traced, and
    the factor by which its power counts in the units of the map. `projection` is one record of PROJECTION_DTYPE, of
    NO_PROJECTION, of strata (`pmviewer.photons.emission.strata`) or of importons
    (`pmviewer.photons.emission.scattered`); i is its
    trajectory's number in the pass; the rest as `emit_photon`."""
    if absent(projection) and has_media(scene):

        def in_media(scene, projection, i, sequence, seed, index, u_pick, position, direction):
            p, d, beta, light = emit_photon(scene, u_pick, position, direction)
            return p, d, beta, light, largest(beta) > _f4(0.0), _f4(1.0)

        return in_media

    if absent(projection):

        def everywhere(scene, projection, i, sequence, seed, index, u_pick, position, direction):
            p, d, beta, light = emit_photon(scene, u_pick, position, direction)
            return p, d, beta, light, True, _f4(1.0)

        return everywhere

    if has(projection, "strata"):

        def stratified(scene, projection, i, sequence, seed, index, u_pick, position, direction):
            p, d, beta, light, weight = emit_stratified(scene, projection, i, seed, index, u_pick, position, direction)
            return p, d, beta, light, True, weight

        return stratified

    if has(projection, "scattered"):

        def scattered(scene, projection, i, sequence, seed, index, u_pick, position, direction):
            p, d, importance = emit_scattered(projection, i, direction)
            return p, d, (_f4(1.0), _f4(1.0), _f4(1.0)), _i8(0), True, importance

        return scattered

    def projected(scene, projection, i, sequence, seed, index, u_pick, position, direction):
        light = find_interval(projection.cdf, scene.n_lights, _i8(1), u_pick)
        mode = load_i4(projection.modes, light)
        first = _i8(load_i4(projection.first, light))
        count = _i8(load_i4(projection.first, light + 1)) - first
        if mode == CONES:
            p, d, beta, factor = start_in_cones(scene, projection, light, position, direction)
            return p, d, beta, light, factor > _f4(0.0), factor * load_f4(projection.gains, light)
        if mode in (WHOLE, DISC, SCALES):
            p, d, beta = emit_from(scene, light, position, direction)
            if mode == SCALES:
                p, factor = start_at_scales(scene, projection, d, position)
                return p, d, beta, light, factor > _f4(0.0), factor * load_f4(projection.gains, light)
            if mode == DISC:
                p = _on_disc(scene, projection, d, position)
            return p, d, beta, light, largest(beta) > _f4(0.0), _f4(1.0)
        low = load_f4(projection.cdf, light)
        rest = min((u_pick - low) / (load_f4(projection.cdf, light + 1) - low), _BELOW_ONE)
        cell = _i8(load_i4(projection.cells, first + min(_i8(rest * _f4(count)), count - 1)))
        pair = position if mode == PLACES else direction
        u = (_f4(cell // COLUMNS) + pair[0]) * _f4(1.0 / ROWS)
        v = (_f4(cell % COLUMNS) + pair[1]) * _f4(1.0 / COLUMNS)
        if mode == WORLD:
            accept = draw1(sequence, seed, index, PROJECTION_ACCEPT)
            p, d, beta, kept = _from_curved_light(scene, light, position, square_to_sphere(u, v), accept)
            return p, d, beta, light, kept, _f4(1.0)
        if mode == PLACES:
            p, d, beta = emit_from(scene, light, concentric_from_polar(u, v), direction)
            return p, d, beta, light, True, _f4(1.0)
        kind = np.int32(light_number(scene, light, L_KIND))
        if kind in (PARALLELOGRAM, DISK):
            u, v = concentric_from_polar(u, v)
        p, d, beta = emit_from(scene, light, position, (u, v))
        return p, d, beta, light, True, _f4(1.0)

    return projected


@device
def _on_disc(scene, projection, d, position):
    """Where a photon in direction d starts: behind the scene, within the sphere to be met as seen from there."""
    x, y = square_to_disk(position[0], position[1])
    c = (projection.center_x, projection.center_y, projection.center_z)
    away = (c[0] - scene.center_x, c[1] - scene.center_y, c[2] - scene.center_z)
    s, t = basis(d)
    p = along(along(c, s, projection.radius * x), t, projection.radius * y)
    return along(p, d, -(scene.radius + _f4(math.sqrt(dot(away, away)))))
