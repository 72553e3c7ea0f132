"""A candle on a table: its flame is the only light, what it emits a formula on a lattice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from make.document import (
    MadeScene,
    boundary,
    bsdf,
    cylinder,
    dielectric,
    diffuse,
    disk,
    flame,
    number,
    panel,
    sphere,
)

SHAPE = (28, 72, 28)
"""Numbers along x, y and z."""
WAX = 0.085
"""Height of the candle in metres; its radius is 0.028."""
LOW, HIGH = (-0.024, WAX + 0.004, -0.024), (0.024, WAX + 0.104, 0.024)
SIGMA = 40.0
"""Extinction per metre where soot is densest."""
BRIGHT = 3200.0
"""Radiance per metre of a red of 1."""


def _step(a: float, b: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
    s = np.clip((x - a) / (b - a), 0, 1)
    return s * s * (3 - 2 * s)


def flame_numbers() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Soot (nz, ny, nx) in 0 … 1, and emission (nz, ny, nx, 3): a drop that leans a little, bright and yellow above,
    orange at its rim and tip, dark around the wick, with a thin blue cup below."""
    x, y, z = ((np.arange(n) + 0.5) / n for n in SHAPE)
    z, y, x = np.meshgrid(2 * z - 1, y, 2 * x - 1, indexing="ij")
    t = np.clip((y - 0.03) / 0.93, 1e-6, 1 - 1e-6)
    lean = 0.10 * t**2 * np.sin(2.4 * t)
    width = 1.55 * t**0.5 * (1 - t) ** 0.9 + 0.02
    s = np.hypot(x - lean, z + 0.5 * lean) / width
    body = _step(1.0, 0.55, s) * _step(0.0, 0.04, t)
    dark = 1 - 0.85 * _step(0.42, 0.10, t) * _step(0.95, 0.2, s)
    hot = body * dark * _step(0.10, 0.42, t) * (1.15 - 0.35 * t)
    cup = _step(1.05, 0.8, s) * _step(0.45, 0.85, s) * _step(0.26, 0.10, t) * _step(0.0, 0.05, t)
    orange, yellow, blue = (np.array(c) for c in ((1.0, 0.30, 0.035), (1.0, 0.46, 0.10), (0.015, 0.045, 0.16)))
    inner = _step(1.0, 0.35, s) * _step(1.0, 0.6, t)
    colour = orange + (yellow - orange) * inner[..., None]
    emission = BRIGHT * (hot[..., None] * colour + cup[..., None] * blue)
    rounded = [np.round(values * 1024) / 1024 for values in (hot, emission)]  # the same on every machine
    return rounded[0].astype(np.float32), rounded[1].astype(np.float32)


def candle_flame() -> MadeScene:
    """The candle stands in a brass dish, beside it a glass ball and a clay one."""
    soot, light = flame_numbers()
    brass = bsdf("roughconductor", "brass", '<string name="material" value="Au"/>', number("alpha", 0.12))
    return MadeScene(
        "A candle flame",
        "A candle on a table, a glass ball beside it. The flame is the only light: radiance that a formula puts on a "
        "lattice of 56,448 places.",
        "A medium that emits light: photons start in it, and direct light and soft shadows come from its places; what "
        "the glass ball focuses is a caustic.",
        (0.05, 0.22, 0.58),
        (0.012, 0.077, 0.0),
        34,
        [
            diffuse("table", 0.58, 0.42, 0.28),
            diffuse("wall", 0.52, 0.54, 0.58),
            diffuse("wax", 0.85, 0.80, 0.68),
            diffuse("wick", 0.03),
            diffuse("clay", 0.55, 0.22, 0.13),
            brass,
            dielectric("glass", 1.5),
        ],
        [
            panel((0, 0, 0), (0.9, 0, 0), (0, 0, -0.7), "table"),
            panel((0, 0.5, -0.26), (0.9, 0, 0), (0, 0.5, 0), "wall"),
            cylinder((0, 0.002, 0), (0, WAX, 0), 0.028, "wax"),
            disk((0, WAX, 0), 0.028, "wax"),
            cylinder((0, WAX, 0), (0, WAX + 0.018, 0), 0.0016, "wick"),
            disk((0, WAX + 0.018, 0), 0.0016, "wick"),
            cylinder((0, 0, 0), (0, 0.008, 0), 0.07, "brass"),
            disk((0, 0.008, 0), 0.07, "brass"),
            sphere((0.125, 0.0451, 0.045), 0.045, "glass"),
            sphere((-0.135, 0.0351, 0.03), 0.035, "clay"),
            boundary(LOW, HIGH, "flame"),
        ],
        aspect=(256, 192),
        max_depth=32,
        media=(flame("flame", "soot", "light", (LOW, HIGH), SIGMA, (0.15, 0.15, 0.15)),),
        grids={"soot": soot, "light": light},
    )
