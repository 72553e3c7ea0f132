"""What density control decides about one photon."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_u4, stack_get_i8, stack_put_i8
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.vector import dot
from pmviewer.maps.density.growing_tree import M
from pmviewer.maps.photon_words import decode_direction

STEP, COSINE = 0, 1
ACCEPTANCE = ("step", "cosine")

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32
_PI = _f8(np.pi)


class Control(NamedTuple):
    """What is constant for a map: rule, int32, STEP or COSINE; seed, uint32; limits, of the tree's search."""

    rule: Any
    seed: Any
    limits: Any


@device
def farthest(control, need, index):
    """The squared distance up to which neighbours are looked for: with fewer than M of them within it, photon `index`,
    where the density `need` is required, is stored."""
    disc = _f8(M) / (_PI * _f8(need))  # of M at the required density
    if control.rule == STEP:
        return _f4(disc)
    rho = _f8(2.0) / _PI * np.arccos(_f8(2.0) * _f8(_random(control.seed, index)) - _f8(1.0))
    return _f4(_f8(1.001) * disc / rho)  # a little more, or rounding might decide


@device
def _rejected(density, need, rule, u):
    """Whether a photon is not stored at D_cur, where `need` is D_r; u: a random number."""
    rho = density / _f8(need)
    if rule == STEP:
        return not rho < _f8(1.0)
    return not (rho < _f8(2.0) and _f8(u) < _f8(0.5) * (_f8(1.0) + np.cos(_PI * rho * _f8(0.5))))


@device
def sharing(control, n, need, index, rows, count, r2, scratch):
    """How many stored photons share the power of photon `index`, their keys first in `scratch.keys`; 0 where it is
    stored itself. n, need: normal and required density at its place; rows: address of the stored rows; `count`
    neighbours were found, of M the squared distance r2 of the farthest."""
    if count < M:
        return _i8(0)
    u = _random(control.seed, index)
    if r2 > _f4(0.0) and not _rejected(_f8(M) / (_PI * _f8(r2)), need, control.rule, u):
        return _i8(0)
    if control.limits.one_side:
        return count
    facing = _i8(0)
    for j in range(count):
        key = stack_get_i8(scratch.keys, j)
        if dot(n, decode_direction(load_u4(rows, 6 * (key & _i8(0xFFFFFFFF)) + 3))) > _f4(0.0):
            stack_put_i8(scratch.keys, facing, key)
            facing += 1
    return facing


@device
def _random(seed, index):
    return unit_float(hash3(seed, _u4(index), _u4(index >> 32)))
