"""How far from itself a photon in a medium counts.

In a medium that is the same everywhere all photons have one radius, some share of its mean free path at most. On a
lattice the free path varies: where smoke is dense, light is scattered hundreds of times within a depth that a radius
made for its thin parts blurs away, into places that the camera sees through nothing. A cube of random density up to 300
in a furnace came out 11 % too bright that way, up to 3000 by 37 %. So there each photon has a radius of its own, by the
extinction where it is. What it adds is spread over its own disc or ball, and the mean is right as all of them shrink.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.specialise import is_a, specialised
from pmviewer.kernels.media.column import Column
from pmviewer.kernels.media.lattice import value_at
from pmviewer.kernels.vector import largest, mul

_f4 = np.float32


@specialised
def reach2_of(scene, column, p, r2, paths):
    """Squared radius of a photon at p of a map looked up with r2, which is `paths` free paths at most."""
    if not is_a(column, Column):
        return lambda scene, column, p, r2, paths: r2

    def on_lattice(scene, column, p, r2, paths):
        least = paths * column.shortest
        if column.grid < 0 or r2 <= least * least:
            return r2
        sigma = largest(mul(column.sigma, value_at(scene, column.grid, p, True)))
        if not sigma > _f4(0.0):
            return r2
        own = max(paths / sigma, least)
        return min(r2, own * own)

    return on_lattice


@specialised
def more_in_disc(column, r2, reach2):
    """What a photon counts for in a look-up over the disc of radius² r2, when its own has radius² reach2."""
    if not is_a(column, Column):
        return lambda column, r2, reach2: _f4(1.0)
    return lambda column, r2, reach2: r2 / reach2


@specialised
def more_in_ball(column, r2, reach2):
    """The same of balls."""
    if not is_a(column, Column):
        return lambda column, r2, reach2: _f4(1.0)
    return lambda column, r2, reach2: r2 / reach2 * _f4(math.sqrt(r2 / reach2))
