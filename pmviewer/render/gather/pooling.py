"""Full gathers that take what the gathers around them have found as well as their own (beyond the course guide, whose
full gathers stand alone).

Rays of gathers beside each other end on the same surfaces at other places. Entered together into one z-buffer, seen
from one of them, they tell its irradiance with the noise of all of them, and no ray is cast for it. Cells about which
they tell too little keep what their own ray has found.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import CACHE_SALT, HEMISPHERE
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import dot
from pmviewer.maps.hemisphere import cell_direction, irradiance_and_gradients
from pmviewer.render.gather.estimation import standard_error
from pmviewer.render.gather.reprojection import see_known, view_from
from pmviewer.render.gather.zbuffer import LIGHT, WAY
from pmviewer.render.given import opened
from pmviewer.render.pixel import pixel_seed

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_INF = _f4(np.inf)


@device
def _keep_own(sequence, view, seed, hits, row, known, cells):
    """The cells that are not known get what their own ray found; rows of hits are in the order of
    `gather_reprojected`, whose numbers these are, from `row` on."""
    for k in range(view.sectors):
        for j in range(view.rings):
            here = j + view.rings * k
            u, v, _, _ = draw4(sequence, seed, _u4(here), HEMISPHERE)
            wi = cell_direction(view.n, view.rings, view.sectors, j, k, u, v)
            above = dot(wi, view.face) > _f4(0.0)
            if not known[here]:
                cos = dot(wi, view.n)
                cell = cells[here]
                cell[0] = cell[1] = cell[2] = _f4(0.0)
                cell[3], cell[4] = _INF, _f4(1.0) - cos * cos
                if above:
                    for c in range(3):
                        cell[c] = hits[row, LIGHT + c]
                    cell[3] = hits[row, WAY]
            if above:
                row += 1


@kernel
def pool_gathers(given, pixels, sources, samples, known_hits, rule, estimates, told, first, last):
    """Irradiance at the samples of pixels[first … last−1], which have gathered in full, from all that their sources
    have found, themselves among them, into estimates and told.

    given, samples, known_hits, rule, estimates, told: as in `gather_reprojected`; pixels: int32 (n,); sources: int32
    (n, m), each pixel itself in the first column.
    """
    given = opened(given)
    begin, count, hits = known_hits
    cover, parts = rule
    eye, n = given.eye, given.cache.rings * given.cache.sectors
    cells, known = np.zeros((n, 5), np.float32), np.empty(n, np.bool_)
    depth, owner = np.empty(n * parts * parts, np.float32), np.empty(n * parts * parts, np.int32)
    E, rotation, translation = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for i in range(first, last):
        pixel = pixels[i]
        view = view_from(given, samples[pixel], parts)
        see_known(view, sources[i], begin, count, hits, cover, depth, owner, cells, known)
        seed = hash3(pixel_seed(eye, pixel), eye.index, _u4(CACHE_SALT))
        _keep_own(eye.sequence, view, seed, hits, begin[pixel], known, cells)
        mean = irradiance_and_gradients(cells, view.rings, view.sectors, view.n, E, rotation, translation)
        if not E[0] + E[1] + E[2] < _f8(np.inf):
            continue
        told[pixel, 0], told[pixel, 1] = mean, standard_error(cells)
        estimates[pixel, 0], estimates[pixel, 1], estimates[pixel, 2] = E[0], E[1], E[2]
