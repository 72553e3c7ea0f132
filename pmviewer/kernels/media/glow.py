"""Light that media emit, as lights: places in proportion to the emission, for photons and for light samples.

A glow is a lattice of densities q over the medium's box, interpolated as its emission is, so that a place drawn with
the density q/∫q needs no correction where q is the emission's luminance: a number of the lattice by its share, and
around it the hat that interpolation makes of it (two numbers a side of which the outermost ones are flat). Places in
the box that lie outside of the medium send nothing.

Light samples of places near by would vary without bound, with 1/distance². So a point in the box or a quarter of it
around (`near_glow`) gets this light from the rays that leave it, and any other from samples: no light counts twice.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.dimensions import GLOW_SALT, GLOW_SIDE_SALT
from pmviewer.kernels.media.lattice import value_at
from pmviewer.kernels.media.locate import UNKNOWN, medium_behind
from pmviewer.kernels.media.medium import MD_GLOW, MEDIUM_COLUMNS, emission_of
from pmviewer.kernels.media.varying import emission_at, has_grids
from pmviewer.kernels.memory import load_f4, load_f8
from pmviewer.kernels.random import hash3
from pmviewer.kernels.scene import L_FIRST, light_number
from pmviewer.kernels.vector import dot, scale, sub
from pmviewer.kernels.warp import square_to_sphere

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))

GLOW_COLUMNS = 33
GL_MEDIUM, GL_GRID, GL_AROUND, GL_NX, GL_NY, GL_NZ, GL_START, GL_MASS, GL_POWER = np.arange(9, dtype=np.int64)
GL_TO_WORLD, GL_TO_LATTICE = np.array([9, 21], np.int64)
"""Columns of a glow's row, float64: its medium; the grid of q, −1 where q is 1 everywhere; whether the medium fills all
that no boundary is met from; numbers along the axes, where its shares begin in `glow_cdf`, ∫q, the luminance of the
power that its light has in the table in watts; and the rows (3, 4) from the lattice's coordinates
(`pmviewer.kernels.media.lattice`) to the world and back."""
MARGIN = 0.25
"""Of a glow's box, on each side, relative to it: points there are near."""


@device
def _glow(scene, light):
    return _i8(light_number(scene, light, L_FIRST)) * GLOW_COLUMNS


@device
def _moved(scene, at, p):
    """The point moved by the rows (3, 4) that begin at `at`."""
    g = scene.glows
    return (
        load_f8(g, at) * p[0] + load_f8(g, at + 1) * p[1] + load_f8(g, at + 2) * p[2] + load_f8(g, at + 3),
        load_f8(g, at + 4) * p[0] + load_f8(g, at + 5) * p[1] + load_f8(g, at + 6) * p[2] + load_f8(g, at + 7),
        load_f8(g, at + 8) * p[0] + load_f8(g, at + 9) * p[1] + load_f8(g, at + 10) * p[2] + load_f8(g, at + 11),
    )


@device
def _number(scene, row, u):
    """The first number of the lattice whose cumulative share is above u."""
    start = _i8(load_f8(scene.glows, row + GL_START))
    size = load_f8(scene.glows, row + GL_NX) * load_f8(scene.glows, row + GL_NY) * load_f8(scene.glows, row + GL_NZ)
    low, high = _i8(0), _i8(size) - 1
    while low < high:
        middle = (low + high) >> 1
        if u < load_f8(scene.glow_cdf, start + middle):
            high = middle
        else:
            low = middle + 1
    return low


@device
def hat(i, n, u):
    """A coordinate around number i of n, as often as interpolation weighs that number: half of it on either side."""
    middle = _f8(i) + 1.0
    if u < 0.5:
        s = 2.0 * u
        return middle - 0.5 * s if i == 0 else middle - 1.0 + math.sqrt(s)
    s = 2.0 * u - 1.0
    return middle + 0.5 * s if i == n - 1 else middle + 1.0 - math.sqrt(1.0 - s)


@device
def _place(scene, row, u, v):
    """A place in the glow's box, of two numbers; what they leave open their bits decide."""
    a, b = _u4(u * _f4(16777216.0)), _u4(v * _f4(16777216.0))
    fine, sides = hash3(a, b, _u4(GLOW_SALT)), hash3(a, b, _u4(GLOW_SIDE_SALT))
    i = _number(scene, row, _f8(u) + _f8(fine >> _u4(16)) * 2.0**-40)
    nx, ny, nz = (
        _i8(load_f8(scene.glows, row + GL_NX)),
        _i8(load_f8(scene.glows, row + GL_NY)),
        _i8(load_f8(scene.glows, row + GL_NZ)),
    )
    x = hat(i % nx, nx, _f8(v))
    y = hat(i // nx % ny, ny, _f8(sides & _u4(0xFFFF)) * 2.0**-16)
    z = hat(i // (nx * ny), nz, _f8(sides >> _u4(16)) * 2.0**-16)
    p = _moved(scene, row + GL_TO_WORLD, (x, y, z))
    return _f4(p[0]), _f4(p[1]), _f4(p[2])


@specialised
def _emission_by_density(scene, row, p):
    """Radiance per length that is emitted at the place, over the density that it was drawn with."""
    if not has_grids(scene):

        def uniform(scene, row, p):
            medium = _i8(load_f8(scene.glows, row + GL_MEDIUM))
            return scale(emission_of(scene, medium), _f4(load_f8(scene.glows, row + GL_MASS)))

        return uniform

    def varying(scene, row, p):
        medium = _i8(load_f8(scene.glows, row + GL_MEDIUM))
        grid = _i8(load_f8(scene.glows, row + GL_GRID))
        q = _f4(1.0)
        if grid >= 0:
            q, _, _ = value_at(scene, grid, p, False)
        if not q > _f4(0.0):
            return _BLACK
        return scale(emission_at(scene, medium, p), _f4(load_f8(scene.glows, row + GL_MASS)) / q)

    return varying


@device
def glow_medium(scene, light):
    """The medium that the light's places have to lie in."""
    return _i8(load_f8(scene.glows, _glow(scene, light) + GL_MEDIUM))


@device
def emit_glow(scene, light, position, direction):
    """A photon of a glow, as `pmviewer.kernels.lights.light.emit_from`; black where its place is not in the medium."""
    row = _glow(scene, light)
    p = _place(scene, row, position[0], position[1])
    d = square_to_sphere(direction[0], direction[1])
    found = medium_behind(scene, p, d)
    inside = found == _i8(load_f8(scene.glows, row + GL_MEDIUM))
    if found == UNKNOWN:
        inside = load_f8(scene.glows, row + GL_AROUND) != 0.0
    if not inside:
        return p, d, _BLACK
    watts = scale(_emission_by_density(scene, row, p), _f4(4.0 * math.pi / load_f8(scene.glows, row + GL_POWER)))
    return p, d, watts


@device
def sample_glow(scene, light, x, u, v):
    """The direction from x to a place of the glow, as `pmviewer.kernels.lights.light.sample_one_light`; L/pdf is what
    the place emits over its density and the squared distance. Whether it lies in the medium is seen on the way."""
    row = _glow(scene, light)
    p = _place(scene, row, u, v)
    offset = sub(p, x)
    distance2 = dot(offset, offset)
    if not distance2 > _f4(0.0) or _in_wide_box(scene, row, x):
        return (_f4(0.0), _f4(0.0), _f4(1.0)), p, _BLACK, _f4(0.0), False
    inv = _f4(1.0) / _f4(math.sqrt(distance2))
    L = scale(_emission_by_density(scene, row, p), inv * inv)
    return scale(offset, inv), p, L, _f4(1.0), False


@device
def _in_wide_box(scene, row, x):
    p = _moved(scene, row + GL_TO_LATTICE, (_f8(x[0]), _f8(x[1]), _f8(x[2])))
    for k in range(3):
        n = load_f8(scene.glows, row + GL_NX + k)
        if not abs(p[k] - 0.5 - 0.5 * n) <= (0.5 + MARGIN) * n:
            return False
    return True


@device
def near_glow(scene, medium, x):
    """Whether rays that leave x bring what the medium emits, instead of light samples."""
    glow = _i8(load_f4(scene.media, medium * MEDIUM_COLUMNS + MD_GLOW))
    return glow < 0 or _in_wide_box(scene, glow * GLOW_COLUMNS, x)


@device
def near_a_glow(scene, x):
    """The same of any medium that emits."""
    near = False
    for glow in range(scene.emits):
        near = near or _in_wide_box(scene, _i8(glow) * GLOW_COLUMNS, x)
    return near
