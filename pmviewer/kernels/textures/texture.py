"""Textures: bitmaps and checkerboards looked up at texture coordinates, and their gradient.

All bitmaps lie in one array of float32 numbers, row by row; the conventions are Mitsuba 3's (`pmviewer.scene.texture`,
which has the same look-up in NumPy).
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_i8
from pmviewer.kernels.scene import (
    CHECKERBOARD,
    CLAMP,
    REPEAT,
    T_CHANNELS,
    T_COLOR0,
    T_COLOR1,
    T_HEIGHT,
    T_KIND,
    T_NEAREST,
    T_TO_UV,
    T_WIDTH,
    T_WRAP,
    TEXTURE_COLUMNS,
    load3,
)
from pmviewer.kernels.vector import luminance, mul

_f4 = np.float32


@device
def _number(scene, texture, column):
    return load_f4(scene.textures, texture * TEXTURE_COLUMNS + column)


@device
def _transformed(scene, texture, u, v):
    at = texture * TEXTURE_COLUMNS + T_TO_UV
    t = scene.textures
    return (
        load_f4(t, at) * u + load_f4(t, at + 1) * v + load_f4(t, at + 2),
        load_f4(t, at + 3) * u + load_f4(t, at + 4) * v + load_f4(t, at + 5),
    )


@device
def _wrapped(k, size, wrap):
    """A texel number in 0 … size − 1."""
    if 0 <= k < size:  # nearly all, without a division
        return k
    if wrap == CLAMP:
        return max(np.int64(0), min(k, size - 1))
    if wrap == REPEAT:
        return k % size
    k = k % (2 * size)
    return min(k, 2 * size - 1 - k)


@device
def _texel(scene, start, channels, width, i, j):
    at = start + (j * width + i) * channels
    if channels == 1:
        value = load_f4(scene.texels, at)
        return value, value, value
    return load3(scene.texels, at)


@device
def _corners(scene, texture, u, v):
    """The four texels around a point of a bitmap (00, 10, 01, 11) and the place between them. Without interpolation all
    four are the one that the point lies in."""
    width, height = np.int64(_number(scene, texture, T_WIDTH)), np.int64(_number(scene, texture, T_HEIGHT))
    channels, wrap = np.int64(_number(scene, texture, T_CHANNELS)), np.int32(_number(scene, texture, T_WRAP))
    start = load_i8(scene.texel_starts, texture)
    x, y = u * _f4(width), v * _f4(height)
    step = np.int64(0)
    if _number(scene, texture, T_NEAREST) == _f4(0.0):
        x -= _f4(0.5)
        y -= _f4(0.5)
        step = np.int64(1)
    left, top = np.floor(x), np.floor(y)
    i0, j0 = _wrapped(np.int64(left), width, wrap), _wrapped(np.int64(top), height, wrap)
    i1, j1 = _wrapped(np.int64(left) + step, width, wrap), _wrapped(np.int64(top) + step, height, wrap)
    return (
        _texel(scene, start, channels, width, i0, j0),
        _texel(scene, start, channels, width, i1, j0),
        _texel(scene, start, channels, width, i0, j1),
        _texel(scene, start, channels, width, i1, j1),
        x - left,
        y - top,
    )


@device
def _mixed(a, b, s):
    r = _f4(1.0) - s
    return r * a[0] + s * b[0], r * a[1] + s * b[1], r * a[2] + s * b[2]


@device
def texture_rgb(scene, texture, u, v):
    """Linear RGB of texture number `texture` at a surface's texture coordinates."""
    u, v = _transformed(scene, texture, u, v)
    at = texture * TEXTURE_COLUMNS
    first = load3(scene.textures, at + T_COLOR0)
    if np.int32(_number(scene, texture, T_KIND)) == CHECKERBOARD:
        half = _f4(0.5)
        if (u - np.floor(u) > half) == (v - np.floor(v) > half):
            return first
        return load3(scene.textures, at + T_COLOR1)
    a, b, c, d, s, t = _corners(scene, texture, u, v)
    return mul(first, _mixed(_mixed(a, b, s), _mixed(c, d, s), t))


@device
def texture_value(scene, texture, u, v):
    """The texture's luminance."""
    return luminance(texture_rgb(scene, texture, u, v))


@device
def texture_gradient(scene, texture, u, v):
    """Derivatives of the texture's luminance by the surface's texture coordinates u and v; 0 where it is made of flat
    fields."""
    x, y = _transformed(scene, texture, u, v)
    flat = _number(scene, texture, T_NEAREST) != _f4(0.0)
    if flat or np.int32(_number(scene, texture, T_KIND)) == CHECKERBOARD:
        return _f4(0.0), _f4(0.0)
    a, b, c, d, s, t = _corners(scene, texture, x, y)
    at = texture * TEXTURE_COLUMNS
    tint = load3(scene.textures, at + T_COLOR0)
    a, b = luminance(mul(tint, a)), luminance(mul(tint, b))
    c, d = luminance(mul(tint, c)), luminance(mul(tint, d))
    one = _f4(1.0)
    dx = _number(scene, texture, T_WIDTH) * ((one - t) * (b - a) + t * (d - c))
    dy = _number(scene, texture, T_HEIGHT) * ((one - s) * (c - a) + s * (d - b))
    at += T_TO_UV
    m = scene.textures
    return dx * load_f4(m, at) + dy * load_f4(m, at + 3), dx * load_f4(m, at + 1) + dy * load_f4(m, at + 4)
