"""Gathers that take what others have found (R8; course guide §6.3.3): hit points of full gathers near by are
reprojected, and rays are cast in the directions about which they say too little.

A hit is of use elsewhere if the radiance that was found there holds in all directions: where a Lambertian surface was
met, with nothing coloured on the way, or nothing at all. Others hide what is behind them, and their cells are shot.
Which gathers are near is decided by `sources_of`, from what was known before the round, and on nothing else.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED, is_lambertian
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import CACHE_SALT, HEMISPHERE
from pmviewer.kernels.memory import row_of
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import basis, dot, mul
from pmviewer.maps.hemisphere import cell_direction, irradiance_and_gradients
from pmviewer.render.chain import BLACK, arrive
from pmviewer.render.counts import C_DROPPED
from pmviewer.render.gather.cache_fill import Origin, gather_cell
from pmviewer.render.gather.estimation import FACE, GAP, NORMAL, POINT, standard_error
from pmviewer.render.gather.zbuffer import FACE as HIT_FACE
from pmviewer.render.gather.zbuffer import HIT, LIGHT, PATCH, PLACE, USABLE, WAY, Hemisphere, clear, plot, resolve
from pmviewer.render.given import opened
from pmviewer.render.pixel import pixel_seed

NOT_GATHERED, PARTIAL, FULL = 0, 1, 2
"""Of a pixel's gather: none, some directions reprojected, all of them shot."""
SOURCES = 4
"""Gathers whose hits are reprojected: one in each quadrant around a pixel, as in the source."""
TURNED = 0.5
"""Least cosine between the normals of a point and of one whose hits it takes."""
STEEPEST = 1e-3
"""Cosines of patches are no less."""

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32
_INF = _f4(np.inf)


@device
def _vector(row, at):
    return row[at], row[at + 1], row[at + 2]


@kernel
def sources_of(pixels, samples, how, most, sources):
    """The full gathers around each of `pixels` into `sources`, int32 (n, SOURCES): the nearest in each quadrant of the
    picture within `most` pixels, −1 where there is none.

    pixels: int32 (n,); samples: float32 (pixels, SAMPLE); how: uint8 (h, w), FULL where the hits of a full gather are
    known.
    """
    height, width = how.shape
    for i in range(len(pixels)):
        pixel = pixels[i]
        x, y, n = pixel % width, pixel // width, _vector(samples[pixel], NORMAL)
        sources[i] = -1
        missing = SOURCES
        for ring in range(1, most + 1):
            for step in range(8 * ring):
                side, along = step // (2 * ring), step % (2 * ring) - ring
                u = x + (along if side == 0 else ring if side == 1 else -along if side == 2 else -ring)
                v = y + (-ring if side == 0 else along if side == 1 else ring if side == 2 else -along)
                if u < 0 or v < 0 or u >= width or v >= height:
                    continue
                quadrant = (1 if u > x or (u == x and v > y) else 0) + (2 if v > y or (v == y and u < x) else 0)
                other = v * width + u
                if sources[i, quadrant] >= 0 or how[v, u] != FULL:
                    continue
                if dot(n, _vector(samples[other], NORMAL)) > _f4(TURNED):
                    sources[i, quadrant] = other
                    missing -= 1
            if missing == 0:
                break


@device
def _usable(given, hit, wi, tint):
    """Whether the radiance of a gather ray of direction wi holds for other directions that meet the same point."""
    eye = given.eye
    si, beta = arrive(given.scene, eye.glossy, wi, hit, tint)
    if min(beta[0], beta[1], beta[2]) < _f4(1.0):
        return False
    if si.bsdf.groups & STORED != 0 and not is_lambertian(si.bsdf):
        return False
    return eye.gather_specular == 0 or si.bsdf.groups & FOLLOWED == 0


@device
def _shoot_cells(given, view, gap, seed, known, cells, found, counts):
    """Gather in the cells that are not known, into `cells`, and into `found`, float32 (≥ cells, HIT), as known hits;
    returns how many these are. The numbers are those of `gather_hemisphere`."""
    eye = given.eye
    origin = Origin(view.x, view.face, view.n, gap, None)  # never in scenes with media
    made = 0
    for k in range(view.sectors):
        for j in range(view.rings):
            here = j + view.rings * k
            if known[here]:
                continue
            u, v, _, _ = draw4(eye.sequence, seed, _u4(here), HEMISPHERE)
            wi = cell_direction(view.n, view.rings, view.sectors, j, k, u, v)
            cos = dot(wi, view.n)
            cell = cells[here]
            cell[0] = cell[1] = cell[2] = _f4(0.0)
            cell[3], cell[4] = _INF, _f4(1.0) - cos * cos
            if dot(wi, view.face) <= _f4(0.0):
                continue
            hit, far, tint, L = gather_cell(given, origin, wi, seed, here, counts)
            L = mul(tint, L)
            cell[0], cell[1], cell[2], cell[3] = L[0], L[1], L[2], far
            row = found[made]
            made += 1
            row[LIGHT], row[LIGHT + 1], row[LIGHT + 2], row[WAY] = L[0], L[1], L[2], far
            if hit.prim < 0:
                _fill(row, wi, BLACK, _f4(0.0), _f4(1.0))
                continue
            facing = dot(wi, hit.ng)
            ng = hit.ng if facing < _f4(0.0) else (-hit.ng[0], -hit.ng[1], -hit.ng[2])
            patch = far * far / (max(cos, _f4(STEEPEST)) * max(abs(facing), _f4(STEEPEST)))
            _fill(row, hit.p, ng, patch, _f4(1.0) if _usable(given, hit, wi, tint) else _f4(0.0))
    return made


@device
def _fill(row, place, face, patch, usable):
    for axis in range(3):
        row[PLACE + axis], row[HIT_FACE + axis] = place[axis], face[axis]
    row[PATCH], row[USABLE] = patch, usable


@device
def see_known(view, sources, begin, count, hits, cover, depth, owner, cells, known):
    """Plot the hits of `sources` (pixels, −1: none) and fill `cells` and `known` (`resolve`); returns how many cells
    are known."""
    points = 0
    for source in sources:
        points += 1 if source >= 0 else 0
    if points == 0:
        known[:] = False
        return 0
    clear(owner)
    for source in sources:
        if source >= 0:
            for row in range(begin[source], begin[source] + count[source]):
                plot(view, hits, row, points, depth, owner)
    return resolve(view, hits, cover, depth, owner, cells, known)


@device
def view_from(given, row, parts):
    """The hemisphere of a pixel's sample, a row of SAMPLE floats."""
    n = _vector(row, NORMAL)
    s, t = basis(n)
    rings, sectors = _i8(given.cache.rings), _i8(given.cache.sectors)
    return Hemisphere(_vector(row, POINT), n, _vector(row, FACE), s, t, rings, sectors, parts)


@kernel
def gather_reprojected(given, pixels, sources, samples, known_hits, rule, estimates, told, found, made, counts, span):
    """Gathers at the samples of pixels[first … last−1], each cell reprojected if the hits of its sources tell enough,
    else shot; without sources, in full.

    given: as for the eye pass; pixels: int32 (n,); sources: int32 (n, SOURCES); samples: float32 (pixels, SAMPLE);
    known_hits: begin int64 and count int32 (pixels,) of what is known of each pixel in hits, float32 (m, HIT); rule:
    the cover that `resolve` asks for, and into how many parts rings and sectors of cells are divided; estimates:
    float32 (pixels, ESTIMATE) and told: float32 (pixels, TOLD), filled in; found: float32 (cells · (last − first),
    HIT), what was shot, one pixel after the other, and made: int32 (last − first,), how many each; counts: int64
    (N_COUNTS,); span: first and last. A gather that is not finite is counted as dropped and left without an estimate.
    """
    given = opened(given)
    begin, count, hits = known_hits
    cover, parts = rule
    first, last = span
    eye, n, tally = given.eye, given.cache.rings * given.cache.sectors, row_of(counts, 0)
    cells, known = np.zeros((n, 5), np.float32), np.empty(n, np.bool_)
    depth, owner = np.empty(n * parts * parts, np.float32), np.empty(n * parts * parts, np.int32)
    E, rotation, translation = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    filled = 0
    for i in range(first, last):
        pixel = pixels[i]
        view = view_from(given, samples[pixel], parts)
        reprojected = see_known(view, sources[i], begin, count, hits, cover, depth, owner, cells, known)
        seed = hash3(pixel_seed(eye, pixel), eye.index, _u4(CACHE_SALT))
        shot = _shoot_cells(given, view, samples[pixel, GAP], seed, known, cells, found[filled:], tally)
        mean = irradiance_and_gradients(cells, view.rings, view.sectors, view.n, E, rotation, translation)
        if not E[0] + E[1] + E[2] < _f8(np.inf):
            tally[C_DROPPED] += 1
            made[i - first] = 0
            continue
        made[i - first] = shot
        filled += shot
        told[pixel, 0], told[pixel, 1], told[pixel, 2] = mean, standard_error(cells), _f4(reprojected) / _f4(n)
        estimates[pixel, 0], estimates[pixel, 1], estimates[pixel, 2] = E[0], E[1], E[2]
        estimates[pixel, 3] = _f4(1.0)


@kernel
def look_around(given, pixel, sources, samples, known_hits, rule, cells, known, axes, counts):
    """The hemisphere of one pixel's sample as `gather_reprojected` makes it: `cells` (rings·sectors, 5) float32, in
    `known`, bool (rings·sectors,), which of them were reprojected, and in `axes` (2, 3) the tangents from which
    azimuths count. sources: int32 (SOURCES,); the rest as there."""
    given = opened(given)
    begin, count, hits = known_hits
    cover, parts = rule
    n = given.cache.rings * given.cache.sectors
    depth, owner = np.empty(n * parts * parts, np.float32), np.empty(n * parts * parts, np.int32)
    view = view_from(given, samples[pixel], parts)
    see_known(view, sources, begin, count, hits, cover, depth, owner, cells, known)
    seed = hash3(pixel_seed(given.eye, pixel), given.eye.index, _u4(CACHE_SALT))
    found = np.empty((n, HIT), np.float32)
    _shoot_cells(given, view, samples[pixel, GAP], seed, known, cells, found, row_of(counts, 0))
    for axis in range(3):
        axes[0, axis], axes[1, axis] = view.s[axis], view.t[axis]
