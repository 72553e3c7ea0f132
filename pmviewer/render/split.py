"""Both ways at glass: camera paths that split where smooth glass reflects and refracts, in place of choosing one at
random.

At the first `splits` such surfaces of a path both ways are followed, weighted by the share R of the light that is
reflected and by 1 − R. The stronger goes on, the other waits until the path has ended. What a weak way brings hardly
counts unless it is a light: emission counts as it is, over mirrors and glass and on the first surface with STORED
lobes, where it is dear to say more. There the way is thinned out by roulette with the probability w/THINNING, w being
its throughput. So the reflection of a lamp on a glass ball, which a choice would hit with 4 % of the samples at 25
times its weight, is seen by all, for little more than a ray. Where the method gathers, the global map tells the rest
(`pmviewer.render.gather.weak`).

What a surface with lobes of both kinds reflects beside what it scatters, varnish say, is a weak way likewise.

Eye records without the field `splits` split nothing, and compile none of it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED, chain_numbers, mirrored_share
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import CHAIN
from pmviewer.kernels.vector import largest, scale
from pmviewer.render.chain import BLACK, CERTAIN, WHITE, follow, follow_camera_path

_f4 = np.float32
_i8 = np.int64
MOST_SPLITS = 2
THINNING = 0.2
"""Throughput from which a way is never thinned out."""
SPLIT_FIELDS: list[tuple[str, str]] = [("splits", "i4")]
"""Of eye records: smooth glass surfaces of a path at which it splits."""
_ZERO, _HALF, _ONE, _BELOW_ONE = _f4(0.0), _f4(0.5), _f4(1.0), _f4(1.0 - 2.0**-24)
_THINNING = _f4(THINNING)


class Way(NamedTuple):
    """A part of a camera path: its first ray, the throughput beta up to its end, the depth of the surface there, the
    splits before it, and the number that roulette has for it, or CERTAIN where there is none."""

    ray: Any
    beta: Any
    depth: Any
    splits: Any
    u: Any


class Ways(NamedTuple):
    """Those that wait: n of them, the last at place n − 1."""

    n: Any
    a: Any
    b: Any


@device
def first_way(ray):
    """The camera ray, and nothing that waits."""
    way = Way(ray, WHITE, _i8(0), _i8(0), CERTAIN)
    return way, Ways(_i8(0), way, way)


@device
def _waiting(ways, way):
    """The ways with one more. A path has never more than its splits."""
    if ways.n == 0:
        return Ways(_i8(1), way, ways.b)
    return Ways(_i8(2), ways.a, way)


@device
def next_way(ways):
    """The last that waits, and the others; there must be one."""
    way = ways.a
    if ways.n == 2:
        way = ways.b
    return way, Ways(_i8(ways.n - 1), ways.a, ways.b)


@specialised
def split_camera_path(scene, eye, si, beta, u, seed, depth, splits, ways):
    """`follow_camera_path`, or both ways: the ray, beta, the density, the number for roulette, the splits so far and
    the ways that wait."""
    if not has(eye, "splits"):

        def one(scene, eye, si, beta, u, seed, depth, splits, ways):
            ray, beta, pdf, u = follow_camera_path(scene, eye, si, beta, u, seed, depth)
            return ray, beta, pdf, u, splits, ways

        return one

    def both(scene, eye, si, beta, u, seed, depth, splits, ways):
        share = _ONE
        if splits < eye.splits:
            share = mirrored_share(scene, si.bsdf, si.wo)
        if not (share > _ZERO and share < _ONE):
            ray, beta, pdf, u = follow_camera_path(scene, eye, si, beta, u, seed, depth)
            return ray, beta, pdf, u, splits, ways
        mirrored, reflected, _ = follow(scene, si, beta, _ZERO, _ZERO, _ZERO)
        bent, refracted, _ = follow(scene, si, beta, _BELOW_ONE, _BELOW_ONE, _ZERO)
        reflected, refracted = scale(reflected, share), scale(refracted, _ONE - share)
        _, another, _, _ = chain_numbers(scene, eye.sequence, seed, eye.index, CHAIN + depth)
        if share > _HALF:
            ways = _waiting(ways, Way(bent, refracted, _i8(depth + 1), splits + 1, another))
            return mirrored, reflected, _ZERO, u, splits + 1, ways
        ways = _waiting(ways, Way(mirrored, reflected, _i8(depth + 1), splits + 1, another))
        return bent, refracted, _ZERO, u, splits + 1, ways

    return both


@device
def is_weak(beta, u):
    """Whether a way with that throughput and number for roulette is thinned out where there is more to it than a
    mirror or glass."""
    return u >= _ZERO and largest(beta) < _THINNING


@device
def thinned(beta, u, groups):
    """beta at a surface whose BSDF has these groups of lobes, after a way with that number for roulette; black where
    the way ends."""
    if groups & STORED == 0 or not is_weak(beta, u):
        return beta
    survival = largest(beta) / _THINNING
    return scale(beta, _ONE / survival) if u < survival else BLACK
