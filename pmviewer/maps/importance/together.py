"""Importance of many places: those that follow one another with the same normal are looked up together.

Such places are near each other (`pmviewer.maps.density.groups`), and so are their nearest importons: with the one of a
place r away, those of all places within δ of it are no farther from it than r + 2δ. These are found once, in blocks of
eight as they lie in the trees of their facets, and each place measures nothing but distances. It finds what
`pmviewer.maps.importance.look_up.importance_at` finds.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import (
    load_f4,
    load_i4,
    stack_get_f4,
    stack_get_i4,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.kernels.vector import normalize
from pmviewer.maps.importance.facets import MOST, faces, farness, reached_at
from pmviewer.maps.importance.look_up import STEEPNESS
from pmviewer.maps.importance.nearest_one import ROOT, nearest_in_block, nearest_one, squared_distance
from pmviewer.maps.photon_words import decode_direction
from pmviewer.maps.search.simd import WIDTH, nearer8

RUN = 32
"""Places that are looked up together, at most."""
FEWEST = 3
"""And at least."""
BLOCKS = 64
"""Of importons that may be the nearest of such places; where there are more, places search for themselves."""
WAITING = 64
"""Subtrees that wait in a search: one for each level."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_INFINITE = np.float32(np.inf)


@kernel
def importances_on(maps, shapes, boxes, reached, points, codes, out, i0, i1):
    """Γ at points[i0:i1] (m, 3) float32 with normal codes (m,) uint32, into out (m,) float32, as `importance_at` has
    it. maps, shapes, boxes, reached: of `Facets`."""
    facing, far, latest, leaf = stack_i4(MOST), stack_i4(MOST), stack_i4(MOST), stack_i4(MOST)
    of_facet, begins, squared = stack_i4(BLOCKS), stack_i4(BLOCKS), stack_i4(16)
    for facet in range(len(maps)):
        stack_put_i4(latest, facet, _i4(0))
        stack_put_i4(leaf, facet, _i4(ROOT))
    end = _i8(i0)
    while end < i1:
        begin = end
        count, n = _i8(0), normalize(decode_direction(codes[begin]))
        for facet in range(len(maps)):
            stack_put_i4(facing, count, _i4(facet))
            count += _i8(faces(shapes, facet, n))
        while end < i1 and codes[end] == codes[begin]:
            first = end
            while end < min(first + RUN, i1) and codes[end] == codes[begin]:
                end += 1
            blocks = _i8(-1)
            if end - first >= FEWEST:
                middle, delta = _middle(points, first, end, n)
                g, j, r2 = _nearest(maps, shapes, count, facing, far, latest, leaf, middle, n, delta)
                if j < 0:
                    blocks = _i8(0)
                elif r2 < _INFINITE:
                    most = _f4(1.001) * (_f4(np.sqrt(r2)) + _f4(2.0) * delta)
                    blocks = _around(maps, shapes, count, facing, far, middle, n, most * most, of_facet, begins)
            for i in range(first, end):
                p = (points[i, 0], points[i, 1], points[i, 2])
                if blocks < 0:
                    g, j, r2 = _nearest_of(maps, shapes, boxes, reached, count, facing, far, latest, leaf, p, n)
                elif blocks > 0:
                    g, j, r2 = _nearest_among(maps, blocks, of_facet, begins, squared, p, n, g, j)
                gamma = _f4(0.0)
                if j >= 0:
                    reach = load_f4(maps[g].reach, j)
                    if r2 <= reach * reach:
                        gamma = load_f4(maps[g].payload, 3 * j + 1)
                out[i] = gamma


@device
def _middle(points, first, end, n):
    """The middle of the box of some places with the unit normal n, and how far from it the farthest is, as importons
    count; infinite where one is nowhere."""
    inf = _INFINITE
    low, high = (inf, inf, inf), (-inf, -inf, -inf)
    for i in range(first, end):
        low = (min(low[0], points[i, 0]), min(low[1], points[i, 1]), min(low[2], points[i, 2]))
        high = (max(high[0], points[i, 0]), max(high[1], points[i, 1]), max(high[2], points[i, 2]))
    half = _f4(0.5)
    middle = (half * (low[0] + high[0]), half * (low[1] + high[1]), half * (low[2] + high[2]))
    most = _f4(0.0)
    for i in range(first, end):
        dx, dy, dz = points[i, 0] - middle[0], points[i, 1] - middle[1], points[i, 2] - middle[2]
        h = n[0] * dx + n[1] * dy + n[2] * dz
        d2 = max(dx * dx + dy * dy + dz * dz, STEEPNESS * h * h)
        if not d2 <= most:
            most = d2 if d2 < inf else inf
    return middle, _f4(np.sqrt(most))


@device
def _nearest(maps, shapes, count, facing, far, latest, leaf, p, n, delta):
    """The importon nearest to p, with unit normal n, if it is no farther than δ and the farthest reach: its facet, its
    number there, −1 without one, and its squared distance. `far` receives what `farness` says of the facets that face
    it. Infinitely far is one of places that are nowhere."""
    r, first, least = _f4(0.0), _i8(0), _INFINITE
    for place in range(count):
        g = _i8(stack_get_i4(facing, _i8(place)))
        r = max(r, maps[g].farthest)
        away = farness(shapes, g, p, n)
        stack_put_f4(far, g, away)
        if away < least:
            least, first = away, _i8(place)
    if not delta < _INFINITE:
        return _i8(0), _i8(0), _INFINITE
    r = _f4(1.001) * (r + delta)
    return _search(maps, count, first, facing, far, latest, leaf, p, n, r * r)


@device
def _nearest_of(maps, shapes, boxes, reached, count, facing, far, latest, leaf, p, n):
    """The importon nearest to p, with unit normal n, as far as any reaches: as `_nearest` has it."""
    r2, first, least = _f4(0.0), _i8(0), _INFINITE
    for place in range(count):
        g = _i8(stack_get_i4(facing, _i8(place)))
        away, within = farness(shapes, g, p, n), reached_at(shapes, boxes, reached, g, p)
        stack_put_f4(far, g, away)
        if away < within * within:
            r2 = max(r2, within * within)
        if away < least:
            least, first = away, _i8(place)
    return _search(maps, count if r2 > _f4(0.0) else _i8(0), first, facing, far, latest, leaf, p, n, r2)


@device
def _search(maps, count, first, facing, far, latest, leaf, p, n, r2):
    """The importon nearest to p, closer than sqrt(r2), among the facets that face it: that of place `first` before the
    others. It starts where it found one last."""
    e2, of_facet, number = _INFINITE, _i8(0), _i8(-1)
    for turn in range(count):
        at = first if turn == 0 else _i8(turn) - _i8(turn <= first)
        g, j, start = _i8(stack_get_i4(facing, at)), _i8(-1), ROOT
        if stack_get_f4(far, g) < r2:
            before = _i8(stack_get_i4(latest, g))
            d2, e = squared_distance(maps[g], before, p, n, STEEPNESS)
            if d2 < r2 or (d2 == r2 and e < e2):
                r2, e2, j, start = d2, e, before, _i8(stack_get_i4(leaf, g))
            j, r2, e2, start = nearest_one(maps[g], p, n, STEEPNESS, start, j, r2, e2)
            if j >= 0:
                of_facet, number = g, j
                stack_put_i4(latest, g, _i4(j))
                stack_put_i4(leaf, g, _i4(start))
    return of_facet, number, r2


@device
def _around(maps, shapes, count, facing, far, p, n, r2, of_facet, begins):
    """Blocks of eight importons of which some are no farther than sqrt(r2) from p: their facets and where they begin
    there. Returns how many, −1 where there are too many."""
    point, stack, squared, blocks = stack_i4(4), stack_i4(WAITING), stack_i4(16), _i8(0)
    for axis in range(3):
        stack_put_f4(point, axis, p[axis])
    for place in range(count):
        g = _i8(stack_get_i4(facing, _i8(place)))
        if not stack_get_f4(far, g) <= r2:
            continue
        tree = maps[g]
        leaves, waiting = _i8(1) << tree.depth, _i8(1)
        stack_put_i4(stack, 0, _i4(ROOT))
        while waiting > 0:
            waiting -= 1
            node = _i8(stack_get_i4(stack, waiting))
            while node < leaves:
                along = _i8(load_i4(tree.planes, 2 * node + 1))
                side = stack_get_f4(point, along) - load_f4(tree.planes, 2 * node)
                near = 2 * node + _i8(side >= _f4(0.0))
                stack_put_i4(stack, waiting, _i4(near ^ 1))
                waiting += _i8(side * side <= r2)
                node = near
            j, end = (tree.n * (node - leaves)) >> tree.depth, (tree.n * (node - leaves + 1)) >> tree.depth
            while j < end:
                x, y, z = tree.x + 4 * j, tree.y + 4 * j, tree.z + 4 * j
                if nearer8(x, y, z, p, n, STEEPNESS, r2, _INFINITE, squared) != 0:
                    if blocks == BLOCKS:
                        return _i8(-1)
                    stack_put_i4(of_facet, blocks, _i4(g))
                    stack_put_i4(begins, blocks, _i4(j))
                    blocks += 1
                j += WIDTH
    return blocks


@device
def _nearest_among(maps, blocks, of_facet, begins, squared, p, n, g, j):
    """The importon nearest to p, with unit normal n, in some blocks: as `_nearest` has it. Where it is may be guessed:
    importon j of facet g."""
    r2, e2 = squared_distance(maps[g], j, p, n, STEEPNESS)
    for at in range(blocks):
        facet, begin = _i8(stack_get_i4(of_facet, at)), _i8(stack_get_i4(begins, at))
        best, r2, e2 = nearest_in_block(maps[facet], begin, maps[facet].n, p, n, STEEPNESS, _i8(-1), r2, e2, squared)
        if best >= 0:
            g, j = facet, best
    return g, j, r2
