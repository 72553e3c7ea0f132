"""Glasses with drinks: objects of revolution whose boundaries are told apart.

Glass to air, liquid to glass and liquid to air are three surfaces with their own indices; none overlap.
"""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, bsdf, dielectric, diffuse, lamp, mesh, number, rgb
from make.mesh import F8, Mesh, height_field, lathe, quad
from make.noise import fractal

GLASS, LIQUID = 1.5, 1.36


def spline(points: list[tuple[float, float]], steps: int) -> F8:
    """Catmull-Rom curve through (radius, y), never left of the axis."""
    p = np.array([points[0], *points, points[-1]], np.float64)
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    pieces = []
    for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True):
        pieces.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    curve = np.concatenate([*pieces, p[-1:]])
    curve[:, 0] = np.maximum(curve[:, 0], 0)
    curve[[0, -1]] = points[0], points[-1]
    return curve


def rounded_rim(outer: tuple[float, float], inner: tuple[float, float], steps: int = 8) -> F8:
    """Half circle from the top of the outer wall over to the inner one, both at the same height."""
    radius, middle = (outer[0] - inner[0]) / 2, (outer[0] + inner[0]) / 2
    angle = np.linspace(0, np.pi, steps + 1)
    rim = np.stack([middle + radius * np.cos(angle), outer[1] + radius * np.sin(angle)], 1)
    rim[0], rim[-1] = outer, inner
    return rim


def filled(outside: F8, inside: F8, level: float, segments: int) -> dict[str, Mesh]:
    """Meshes of a glass and its drink.

    outside: profile from the axis at the bottom to the rim; inside: from the axis at the bottom of the bowl to the
    rim. The liquid stands at the height `level`: the inside is cut there and shared by both parts.
    """
    radius = float(np.interp(level, inside[:, 1], inside[:, 0]))
    wet = np.concatenate([inside[inside[:, 1] < level], [[radius, level]]])
    dry = np.concatenate([[[radius, level]], inside[inside[:, 1] > level]])
    rim = rounded_rim(tuple(outside[-1]), tuple(dry[-1]))
    shell = np.concatenate([outside[:-1], rim, dry[-2::-1]])
    surface = np.array([[radius, level], [0.0, level]])
    return {
        "glass": lathe([shell], segments),
        "wet": lathe([wet], segments),
        "surface": lathe([surface], segments),
    }


def _drink(absorption: tuple[float, float, float]) -> list[str]:
    return [
        dielectric("glass", GLASS),
        dielectric("wet", LIQUID, GLASS, absorption),
        dielectric("surface", LIQUID, 1.0, absorption),
    ]


def _snifter() -> dict[str, Mesh]:
    """A cognac glass of 13 cm: foot, stem, bowl."""
    foot = [(0.0, 0.0), (0.030, 0.0), (0.0335, 0.0012), (0.0330, 0.0026), (0.020, 0.0050), (0.0075, 0.0095)]
    bowl = [(0.0050, 0.018), (0.0062, 0.028), (0.0200, 0.0375), (0.0345, 0.052), (0.0395, 0.070), (0.0370, 0.092)]
    outside = spline([*foot, *bowl, (0.0300, 0.115), (0.0270, 0.130)], 7)
    inner = [(0.0, 0.0345), (0.0100, 0.0352), (0.0215, 0.0405), (0.0330, 0.0535), (0.0378, 0.070), (0.0355, 0.092)]
    inside = spline([*inner, (0.0287, 0.115), (0.0258, 0.130)], 9)
    return filled(outside, inside, 0.066, 72)


def _sand(x: F8, z: F8) -> F8:
    """Ripples and grain; a hollow under the foot lets the glass stand."""
    coarse = 0.006 * fractal(x, z, 9.0, 3, 0.5, salt=3)
    fine = 0.0016 * fractal(x, z, 90.0, 4, 0.62, salt=11)
    away = np.clip((np.hypot(x, z) - 0.030) / 0.03, 0, 1)
    blend = away * away * (3 - 2 * away)
    return blend * coarse + (0.25 + 0.75 * blend) * fine - 0.0021


def cognac() -> MadeScene:
    """A snifter on sand (Jensen, "Rendering Caustics on Non-Lambertian Surfaces", figure 3)."""
    # Finer where the caustic falls: the grid's coordinates crowd around the glass.
    s = np.linspace(-1, 1, 151)
    along = 0.14 * s + 0.46 * s**5
    meshes = {
        **_snifter(),
        "sand": height_field(along + 0.03, along, _sand, smooth=False),
        "wall": quad((-1.5, -0.1, -0.59), (1.5, -0.1, -0.59), (1.5, 1.2, -0.59), (-1.5, 1.2, -0.59)),
    }
    sand = bsdf("schlick", "sand", rgb("reflectance", 0.62, 0.5, 0.36), number("alpha", 0.6), two_sided=True)
    return MadeScene(
        "A glass of cognac on sand",
        "A snifter a third full of cognac, which absorbs by Beer and Lambert, on a fractal surface with Schlick's "
        "model, α = 0.6.",
        "The red caustic through glass and liquid; without caustics the sand below the glass would be black.",
        (0.05, 0.23, 0.42),
        (0.03, 0.04, 0.0),
        31,
        [*_drink((6.0, 26.0, 70.0)), sand, diffuse("wall", 0.35, 0.42, 0.5), BLACK],
        [
            *(mesh(stem, stem) for stem in ("glass", "wet", "surface")),
            mesh("sand", "sand", flat=True),
            mesh("wall", "wall", flat=True),
            lamp((-0.42, 0.40, -0.30), (0.0, 0.04, 0.0), (0.035, 0.035), (150, 142, 128)),
            lamp((0.5, 0.9, 0.9), (0.0, 0.0, 0.0), (0.3, 0.28), (1.3, 1.5, 1.8)),
        ],
        meshes,
        aspect=(320, 320),
        max_depth=48,
    )


def _tumbler() -> dict[str, Mesh]:
    """A whisky glass of 9.5 cm with a thick base."""
    side = [(0.0, 0.0), (0.030, 0.0), (0.0345, 0.0018), (0.036, 0.006)]
    outside = spline([*side, (0.0372, 0.04), (0.0385, 0.07), (0.0395, 0.095)], 6)
    inside = spline(
        [(0.0, 0.014), (0.020, 0.0142), (0.0300, 0.0165), (0.0335, 0.022), (0.0352, 0.05), (0.0373, 0.095)], 7
    )
    return filled(outside, inside, 0.046, 64)


def three_glasses() -> MadeScene:
    """Three whisky glasses in a row (course guide, figure 5.1); the parameters move and turn the middle one aside."""
    stems = ("glass", "wet", "surface")
    places = ['x="-0.13" y="0.0005" z="0.02"', 'x="$x" y="0.0005" z="$z"', 'x="0.13" y="0.0005" z="0.02"']
    return MadeScene(
        "Three whisky glasses",
        "Three glasses of whisky in a row under one small light; the parameters x and z move the middle one.",
        "Frame coherence: when one glass moves (-D x=0.02), the photons of the other two stay where they are.",
        (0.0, 0.27, 0.56),
        (0.0, 0.035, 0.05),
        40,
        [*_drink((5.0, 16.0, 48.0)), diffuse("table", 0.6, 0.56, 0.5), diffuse("wall", 0.45, 0.5, 0.55), BLACK],
        [
            mesh("table", "table", flat=True),
            mesh("wall", "wall", flat=True),
            *(mesh(stem, stem, transform=f"<translate {place}/>") for place in places for stem in stems),
            lamp((0.0, 0.55, -0.5), (0.0, 0.0, 0.02), (0.025, 0.025), (400, 365, 315)),
        ],
        {
            **_tumbler(),
            "table": quad((-0.8, 0, -0.6), (-0.8, 0, 0.8), (0.8, 0, 0.8), (0.8, 0, -0.6)),
            "wall": quad((-0.8, 0, -0.6), (0.8, 0, -0.6), (0.8, 0.7, -0.6), (-0.8, 0.7, -0.6)),
        },
        defaults={"x": "0", "z": "0.02"},
        aspect=(384, 256),
        max_depth=48,
    )
