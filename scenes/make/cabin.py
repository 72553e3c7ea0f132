"""The closed, glazed cabin of a car (after the cars of the course guide 2002, figures 6.33 to 6.48).

x is the car's right as the driver sees it, y up, and the car drives towards −z. All light comes in through the glass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from make.document import BLACK, MadeScene, bsdf, diffuse, lamp, mesh, number, rgb
from make.mesh import Mesh, block, joined, quad

SILL, WAIST, ROOF = 0.25, 0.95, 1.45
"""Heights of the floor, of the lower edge of the glass, and of its upper edge."""
FRONT, REAR = -1.3, 1.5
WINDSCREEN, BACKLIGHT = -0.35, 0.9
"""z of the upper edges of the windscreen and of the rear window."""


def _x(y: float) -> float:
    """Half width of the cabin at the height y: above the waist its sides lean inwards."""
    return 0.75 - 0.3 * max(0.0, y - WAIST)


def _side(low: tuple[float, float], high: tuple[float, float], sign: float) -> Mesh:
    """Part of a side above the waist, between these z along the lower and along the upper edge, facing inwards."""
    a, b = sign * _x(WAIST), sign * _x(ROOF)
    corners = [(a, WAIST, low[0]), (a, WAIST, low[1]), (b, ROOF, high[1]), (b, ROOF, high[0])]
    return quad(*(corners if sign > 0 else corners[::-1]))


def _extruded(outline: Sequence[tuple[float, float]], x0: float, x1: float) -> Mesh:
    """The convex outline (z, y), counter-clockwise, from x0 to x1, closed."""
    n = len(outline)
    ring = [np.array([[x, y, z] for z, y in outline]) for x in (x0, x1)]
    sides = [quad(ring[0][i], ring[1][i], ring[1][(i + 1) % n], ring[0][(i + 1) % n]) for i in range(n)]
    fan = np.array([[0, i, i + 1] for i in range(1, n - 1)], np.int32)
    return joined(*sides, Mesh(ring[0], fan), Mesh(ring[1], fan[:, ::-1].copy()))


def _turned(z: float, y: float, outline: Sequence[tuple[float, float]], degrees: float) -> list[tuple[float, float]]:
    """The outline turned about its origin, which is moved to (z, y)."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return [(z + c * a - s * b, y + s * a + c * b) for a, b in outline]


def _seat(x0: float, x1: float, z: float) -> Mesh:
    """Cushion, backrest leaning by 15° and headrest of a seat whose hinge lies at z."""
    back = [(0.0, 0.0), (0.13, 0.0), (0.10, 0.55), (0.02, 0.55)]
    head = [(0.03, 0.60), (0.10, 0.60), (0.10, 0.76), (0.03, 0.76)]
    middle = (x0 + x1) / 2
    return joined(
        _extruded([(z - 0.5, 0.28), (z + 0.02, 0.28), (z + 0.02, 0.48), (z - 0.5, 0.52)], x0, x1),
        _extruded(_turned(z, 0.42, back, -15.0), x0, x1),
        _extruded(_turned(z, 0.42, head, -15.0), middle - 0.12, middle + 0.12),
    )


def _wheel(x: float, y: float, z: float, radius: float, thick: float) -> Mesh:
    """The rim of a steering wheel that leans by 25° towards the driver, with smooth normals."""
    n, m = 40, 12
    u, v = (g.reshape(-1) for g in np.meshgrid(np.arange(n) / n, np.arange(m) / m, indexing="ij"))
    around, across = 2 * np.pi * u, 2 * np.pi * v
    out = np.stack([np.cos(around), np.sin(around), np.zeros(n * m)], 1)
    normals = np.cos(across)[:, None] * out + np.sin(across)[:, None] * np.array([0.0, 0.0, 1.0])
    points = radius * out + thick * normals
    c, s = np.cos(np.deg2rad(25.0)), np.sin(np.deg2rad(25.0))
    lean = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    i, j = (g.reshape(-1) for g in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b = i * m + j, (i + 1) % n * m + j
    d, e = i * m + (j + 1) % m, (i + 1) % n * m + (j + 1) % m
    faces = np.concatenate([np.stack([a, b, e], 1), np.stack([a, e, d], 1)]).astype(np.int32)
    return Mesh(points @ lean.T + (x, y, z), faces, normals @ lean.T)


def _meshes() -> dict[str, Mesh]:
    """By the stem of the file."""
    w, r = _x(WAIST), _x(ROOF)
    lining = joined(
        quad((-w, SILL, REAR), (w, SILL, REAR), (w, SILL, FRONT), (-w, SILL, FRONT)),
        quad((-w, SILL, FRONT), (w, SILL, FRONT), (w, WAIST, FRONT), (-w, WAIST, FRONT)),
        quad((w, SILL, REAR), (-w, SILL, REAR), (-w, WAIST, REAR), (w, WAIST, REAR)),
    )
    sides = [
        _side(low, high, sign)
        for sign in (-1.0, 1.0)
        for low, high in (
            ((FRONT, -1.15), (WINDSCREEN, -0.29)),
            ((0.2, 0.3), (0.2, 0.3)),
            ((1.35, REAR), (0.82, BACKLIGHT)),
        )
    ]
    roof = quad((-r, ROOF, WINDSCREEN), (r, ROOF, WINDSCREEN), (r, ROOF, BACKLIGHT), (-r, ROOF, BACKLIGHT))
    doors = [quad((-w, SILL, FRONT), (-w, WAIST, FRONT), (-w, WAIST, REAR), (-w, SILL, REAR))]
    doors += [quad((w, SILL, REAR), (w, WAIST, REAR), (w, WAIST, FRONT), (w, SILL, FRONT))]
    return {
        "lining": joined(lining, roof, *sides),
        "doors": joined(*doors),
        "seats": joined(_seat(-0.62, -0.1, 0.0), _seat(0.1, 0.62, 0.0), _seat(-0.66, 0.66, 0.95)),
        "dashboard": joined(
            _extruded([(FRONT, 0.6), (-0.75, 0.68), (-0.72, 0.84), (FRONT, 0.93)], -w, w),
            _extruded([(-0.75, SILL), (-0.55, SILL), (-0.62, 0.55), (-0.75, 0.68)], -0.1, 0.1),
        ),
        "wheel": _wheel(-0.36, 0.84, -0.62, 0.18, 0.017),
        "bonnet": joined(
            _extruded([(-2.6, 0.3), (FRONT - 0.01, 0.3), (FRONT - 0.01, 0.93), (-2.6, 0.78)], -0.7, 0.7),
            _extruded([(REAR + 0.01, 0.3), (2.3, 0.3), (2.3, 0.88), (REAR + 0.01, 0.93)], -0.7, 0.7),
        ),
        "windscreen": quad((-w, WAIST, FRONT), (w, WAIST, FRONT), (r, ROOF, WINDSCREEN), (-r, ROOF, WINDSCREEN)),
        "windows": joined(*(_side((-1.15, 0.2), (-0.29, 0.2), sign) for sign in (-1.0, 1.0))),
        "rear_windows": joined(
            *(_side((0.3, 1.35), (0.3, 0.82), sign) for sign in (-1.0, 1.0)),
            quad((w, WAIST, REAR), (-w, WAIST, REAR), (-r, ROOF, BACKLIGHT), (r, ROOF, BACKLIGHT)),
        ),
        "ground": quad((-8, 0, 8), (8, 0, 8), (8, 0, -8), (-8, 0, -8)),
        "wall": joined(block((-3.4, 0, -4.6), (-0.6, 1.5, -4.3)), block((0.9, 0, -4.9), (3.2, 2.2, -4.6))),
    }


def car_cabin() -> MadeScene:
    """Seen from the rear bench, forwards."""

    def glass(name: str, *tint: float) -> str:
        return bsdf("thindielectric", name, number("int_ior", 1.5), rgb("specular_transmittance", *tint))

    materials = {
        "lining": "lining",
        "doors": "doors",
        "seats": "leather",
        "dashboard": "dashboard",
        "wheel": "black_rim",
        "bonnet": "paint",
        "windscreen": "clear",
        "windows": "green",
        "rear_windows": "amber",
        "ground": "asphalt",
        "wall": "brick",
    }
    flat = {stem: stem != "wheel" for stem in materials}
    return MadeScene(
        "Cabin of a car",
        "The closed cabin of a car under a lamp and a bright sky, with a clear windscreen, green windows at the front "
        "and amber ones at the rear; glass is thin.",
        "All light comes in through glass: caustics everywhere, which thin glass that is passed straight spares.",
        (0.05, 1.2, 0.72),
        (-0.12, 0.86, -1.0),
        78,
        [
            diffuse("lining", 0.62, 0.6, 0.56),
            diffuse("doors", 0.5, 0.46, 0.4),
            diffuse("leather", 0.5, 0.3, 0.17),
            diffuse("dashboard", 0.3, 0.31, 0.34),
            diffuse("black_rim", 0.08),
            diffuse("paint", 0.55, 0.1, 0.08),
            diffuse("asphalt", 0.3),
            diffuse("brick", 0.5, 0.32, 0.25),
            glass("clear", 0.9, 0.96, 0.93),
            glass("green", 0.45, 0.8, 0.5),
            glass("amber", 0.95, 0.6, 0.2),
            BLACK,
        ],
        [
            *(mesh(stem, material, flat=flat[stem]) for stem, material in materials.items()),
            lamp((2.6, 4.2, -2.4), (0.0, 0.8, 0.0), (1.0, 1.0), (40, 37, 32)),
            f'<emitter type="constant">{rgb("radiance", 0.6, 0.72, 0.94)}</emitter>',
        ],
        _meshes(),
        aspect=(320, 240),
    )
