"""Smoke in a Cornell box: a plume whose density is a formula on a lattice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from make.boxes import BACK, CEILING, FLOOR, FOV, GREEN, ORIGIN, RED, TARGET, WHITE, walls
from make.document import BLACK, MadeScene, boundary, panel, smoke

SHAPE = (40, 72, 40)
"""Numbers along x, y and z."""
LOW, HIGH = (0.14, 0.01, 0.14), (0.86, 0.97, 0.86)
SIGMA = 30.0
"""Extinction per metre of density 1."""


def plume() -> NDArray[np.float32]:
    """Density (nz, ny, nx) in 0 … 1: a column that widens and winds upwards, torn by folded sines, 0 around it."""
    sides = [a + (np.arange(n) + 0.5) / n * (b - a) for a, b, n in zip(LOW, HIGH, SHAPE)]
    z, y, x = np.meshgrid(sides[2], sides[1], sides[0], indexing="ij")
    # Sines of sines, each octave moved by the one before, look like something stirred.
    a, b, c = x - 0.5, y, z - 0.5
    swirl = np.zeros_like(a)
    for octave in range(5):
        f = 5.0 * 1.9**octave
        u = np.sin(f * a + 1.7 * np.sin(0.6 * f * b + octave) + 2.1 * octave)
        v = np.sin(f * b + 1.9 * np.sin(0.7 * f * c - octave) + 0.8 * octave)
        w = np.sin(f * c + 1.5 * np.sin(0.8 * f * a + 2 * octave) + 1.3 * octave)
        swirl += 0.55**octave * (u * v + v * w + w * u) / 3
        a, b, c = a + 0.03 / 1.5**octave * v, b + 0.03 / 1.5**octave * w, c + 0.03 / 1.5**octave * u
    middle_x = 0.5 + 0.07 * np.sin(5.5 * y + 0.4) * y
    middle_z = 0.5 + 0.06 * np.sin(6.5 * y + 2.0) * y
    radius = 0.045 + 0.26 * y**1.2
    r = np.hypot(x - middle_x, z - middle_z) / radius
    body = np.clip(1.15 - r, 0, 1) * np.clip(3.5 * (0.9 - y), 0, 1)
    density = np.clip(1.5 * body + 1.1 * swirl * np.sqrt(body) - 0.35, 0, 1) * (1 - 0.7 * y)
    return (np.round(density * 1024) / 1024).astype(np.float32)  # the same on every machine


def cornell_smoke() -> MadeScene:
    """Smoke that rises from the floor under the lamp; around it nothing."""
    meshes, shapes = walls(FLOOR, CEILING, BACK)
    return MadeScene(
        "Smoke in a Cornell box",
        "A plume of smoke under the lamp of the box, its density a formula on a lattice of 115,200 numbers.",
        "A medium whose density varies: exact depths along rays, shadows in smoke and of smoke, multiple scattering.",
        ORIGIN,
        TARGET,
        FOV,
        [WHITE, RED, GREEN, BLACK],
        [
            *shapes,
            boundary(LOW, HIGH, "smoke"),
            panel((0.5, 0.998, 0.5), (0.16, 0, 0), (0, 0, 0.14), "black", (17, 15, 11.5)),
        ],
        meshes,
        max_depth=64,
        media=(smoke("smoke", "plume", LOW, HIGH, SIGMA, (0.96, 0.96, 0.96)),),
        grids={"plume": plume()},
    )
