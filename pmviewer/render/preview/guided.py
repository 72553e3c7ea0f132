"""A small picture made a large one along what the large one's first hits tell: joint bilateral upsampling (Kopf et al.
2007), and what an earlier picture knows of the same places: reprojection (Walter et al. 1999).

Neighbours count as far as they lie in the pixel's tangent plane and face its way. Both work on two signals a pixel:
light from diffuse surfaces divided by their albedo, which textures do not disturb, and light that followed lobes send
back. Places are those of the first hits: pixel and distance along the view.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.render.camera import CameraPose

VIEW = 20
"""Columns of `view_row`."""
SIGNALS = 6
"""Diffuse light over albedo, and light of followed lobes: (…, 6)."""
NORMAL, DEPTH, GUIDES = 0, 3, 4
"""Columns of guides (…, 4): normal towards the eye, 0 where nothing is met, and distance along the view."""
_OFF_PLANE = np.float32(1.5)
"""Distance from the tangent plane, in widths of a tap's pixel, at which a tap counts 1/e."""
_FACING = 0.8
"""Cosine below which normals are of different surfaces."""
_ANYHOW = np.float32(1e-4)
"""What a tap of another surface counts where there is no other; what counts less is not known."""
_f4 = np.float32


def view_row(camera: CameraPose) -> NDArray[np.float32]:
    """(VIEW,) the camera as the kernels below know it: eye, corner, right, down and forward, a pixel's width at
    distance 1 and at distance 0, whether it is orthographic, and its size."""
    frame = camera.ray_frame()
    row = np.zeros(VIEW, np.float32)
    row[:12], row[12:15] = frame.ravel(), camera.axes()[2]
    row[15:20] = camera.pixel_angle(), camera.pixel_size(), camera.orthographic, camera.width, camera.height
    return row


@device
def _place(view, x, y, depth):
    """The point at that distance along the view behind the place (x, y) of the picture."""
    px = view[3] + x * view[6] + y * view[9]
    py = view[4] + x * view[7] + y * view[10]
    pz = view[5] + x * view[8] + y * view[11]
    if view[17] != _f4(0.0):
        return (
            view[0] + px + depth * view[12],
            view[1] + py + depth * view[13],
            view[2] + pz + depth * view[14],
        )
    return view[0] + depth * px, view[1] + depth * py, view[2] + depth * pz


@device
def _likeness(p, n, q, m, width):
    """How much a tap at q with the normal m belongs to the surface at p with the normal n; width: of the tap's pixel
    there."""
    cos = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
    if cos < _f4(_FACING):
        return _f4(0.0)
    off = abs(n[0] * (q[0] - p[0]) + n[1] * (q[1] - p[1]) + n[2] * (q[2] - p[2]))
    facing = (cos - _f4(_FACING)) / _f4(1.0 - _FACING)
    off /= _OFF_PLANE * width + _f4(1e-30)
    return _f4(math.exp(-min(off * off, _f4(80.0)))) * facing * facing


@kernel
def upsample(small, small_guides, view, guides, shrink, out, first, last):
    """Rows first … last−1 of the large picture's signals.

    small: float32 (h, w, SIGNALS); small_guides: float32 (h, w, GUIDES); view: `view_row` of the large picture; guides:
    float32 (H, W, GUIDES) of it; shrink: how many of its pixels lie along a side of a small one, both pictures having
    one middle; out: float32 (H, W, SIGNALS).
    """
    h, w = small.shape[0], small.shape[1]
    s = _f4(shrink)
    left = _f4(guides.shape[1]) * _f4(0.5) - _f4(w) * _f4(0.5) * s
    top = _f4(guides.shape[0]) * _f4(0.5) - _f4(h) * _f4(0.5) * s
    for Y in range(first, last):
        for X in range(guides.shape[1]):
            n = (guides[Y, X, 0], guides[Y, X, 1], guides[Y, X, 2])
            depth = guides[Y, X, DEPTH]
            nothing = n[0] == _f4(0.0) and n[1] == _f4(0.0) and n[2] == _f4(0.0)
            p = _place(view, _f4(X) + _f4(0.5), _f4(Y) + _f4(0.5), depth)
            fx, fy = (_f4(X) + _f4(0.5) - left) / s - _f4(0.5), (_f4(Y) + _f4(0.5) - top) / s - _f4(0.5)
            x0, y0 = np.int64(np.floor(fx)), np.int64(np.floor(fy))
            total = _f4(0.0)
            a0, a1, a2, a3, a4, a5 = _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0)
            for y in range(y0 - 1, y0 + 3):
                for x in range(x0 - 1, x0 + 3):
                    if x < 0 or y < 0 or x >= w or y >= h:
                        continue
                    near = max(_f4(2.0) - abs(_f4(x) - fx), _f4(0.0)) * max(_f4(2.0) - abs(_f4(y) - fy), _f4(0.0))
                    m = (small_guides[y, x, 0], small_guides[y, x, 1], small_guides[y, x, 2])
                    there = small_guides[y, x, DEPTH]
                    like = _f4(0.0)
                    if nothing:
                        if there == _f4(0.0):
                            like = _f4(1.0)
                    elif there != _f4(0.0):
                        q = _place(view, left + (_f4(x) + _f4(0.5)) * s, top + (_f4(y) + _f4(0.5)) * s, there)
                        like = _likeness(p, n, q, m, (view[15] * depth + view[16]) * s)
                    weight = near * near * (like + _ANYHOW)
                    total += weight
                    a0 += weight * small[y, x, 0]
                    a1 += weight * small[y, x, 1]
                    a2 += weight * small[y, x, 2]
                    a3 += weight * small[y, x, 3]
                    a4 += weight * small[y, x, 4]
                    a5 += weight * small[y, x, 5]
            share = _f4(1.0) / max(total, _f4(1e-30))
            out[Y, X, 0], out[Y, X, 1], out[Y, X, 2] = a0 * share, a1 * share, a2 * share
            out[Y, X, 3], out[Y, X, 4], out[Y, X, 5] = a3 * share, a4 * share, a5 * share


@kernel
def reproject(old, old_guides, old_view, view, guides, out, known, first, last):
    """Rows first … last−1 of what an earlier picture knows of the diffuse light that another camera sees.

    old: float32 (h, w, ≥ 3); old_guides: float32 (h, w, GUIDES); old_view, view: `view_row` of both; guides: float32
    (H, W, GUIDES) of the new picture; out: float32 (H, W, 3); known: float32 (H, W), how much of it belongs to the same
    surfaces, 0–1. Where that is 0, `out` stays as it is.
    """
    h, w = old.shape[0], old.shape[1]
    for Y in range(first, last):
        for X in range(guides.shape[1]):
            known[Y, X] = _f4(0.0)
            depth = guides[Y, X, DEPTH]
            if depth == _f4(0.0):
                continue
            n = (guides[Y, X, 0], guides[Y, X, 1], guides[Y, X, 2])
            p = _place(view, _f4(X) + _f4(0.5), _f4(Y) + _f4(0.5), depth)
            fx, fy, ahead = _seen(old_view, p)
            if not ahead > _f4(0.0) or not (abs(fx) < _f4(1e7) and abs(fy) < _f4(1e7)):
                continue
            fx, fy = fx - _f4(0.5), fy - _f4(0.5)
            x0, y0 = np.int64(np.floor(fx)), np.int64(np.floor(fy))
            width = old_view[15] * ahead + old_view[16]
            total = _f4(0.0)
            a0, a1, a2 = _f4(0.0), _f4(0.0), _f4(0.0)
            for y in range(y0, y0 + 2):
                for x in range(x0, x0 + 2):
                    if x < 0 or y < 0 or x >= w or y >= h or old_guides[y, x, DEPTH] == _f4(0.0):
                        continue
                    near = (_f4(1.0) - abs(_f4(x) - fx)) * (_f4(1.0) - abs(_f4(y) - fy))
                    m = (old_guides[y, x, 0], old_guides[y, x, 1], old_guides[y, x, 2])
                    q = _place(old_view, _f4(x) + _f4(0.5), _f4(y) + _f4(0.5), old_guides[y, x, DEPTH])
                    weight = near * _likeness(p, n, q, m, width)
                    total += weight
                    a0 += weight * old[y, x, 0]
                    a1 += weight * old[y, x, 1]
                    a2 += weight * old[y, x, 2]
            if total > _ANYHOW:
                share = _f4(1.0) / total
                out[Y, X, 0], out[Y, X, 1], out[Y, X, 2] = a0 * share, a1 * share, a2 * share
                known[Y, X] = min(total, _f4(1.0))


@device
def _seen(view, p):
    """Place in the picture and distance along the view of a point."""
    ox, oy, oz = p[0] - view[0], p[1] - view[1], p[2] - view[2]
    ahead = ox * view[12] + oy * view[13] + oz * view[14]
    if view[17] == _f4(0.0):
        if not ahead > _f4(0.0):
            return _f4(0.0), _f4(0.0), _f4(0.0)
        ox, oy, oz = ox / ahead, oy / ahead, oz / ahead
    ox, oy, oz = ox - view[3], oy - view[4], oz - view[5]
    right = view[6] * view[6] + view[7] * view[7] + view[8] * view[8]
    down = view[9] * view[9] + view[10] * view[10] + view[11] * view[11]
    x = (ox * view[6] + oy * view[7] + oz * view[8]) / right
    y = (ox * view[9] + oy * view[10] + oz * view[11]) / down
    if view[17] != _f4(0.0) and not ahead > _f4(0.0):
        return x, y, _f4(0.0)
    return x, y, ahead
