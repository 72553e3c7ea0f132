"""A knot of polished marble: light that enters a dense medium through its surface."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, dielectric, diffuse, fog, lamp, panel
from make.mesh import F8, Mesh

SIZE, THICKNESS = 0.2, 0.46
"""Metres of a unit of the knot's curve, and its thickness in such units: neighbouring strands stay apart."""
STEPS, SIDES = 288, 32
SIGMA_T = 55.0
"""Extinction per metre: of real marble only a hundredth, so that paths come out again, too; the knot is ten mean free
paths thick."""
ALBEDO = (0.998, 0.994, 0.986)
"""Its colour comes of some hundred scatterings."""


def _curve(t: F8) -> F8:
    """The trefoil knot on a torus, (n, 3)."""
    ring = 2 + np.cos(3 * t)
    return np.stack([ring * np.sin(2 * t), ring * np.cos(2 * t), np.sin(3 * t)], 1)


def _knot() -> Mesh:
    """A tube around the curve. Its sections stand on the curve and on the torus, whose normals turn with it, so that
    the last joins the first."""
    t = np.linspace(0, 2 * np.pi, STEPS, endpoint=False)
    middle, step = _curve(t), 1e-4
    along = (_curve(t + step) - _curve(t - step)) / (2 * step)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    core = 2 * np.stack([np.sin(2 * t), np.cos(2 * t), np.zeros(STEPS)], 1)
    across = middle - core
    across -= (across * along).sum(1, keepdims=True) * along
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    aside = np.cross(along, across)
    angle = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    normals = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * aside[:, None]
    vertices = SIZE * (middle[:, None] + THICKNESS * normals)
    i, j = np.meshgrid(np.arange(STEPS), np.arange(SIDES), indexing="ij")
    a, b = i * SIDES + j, i * SIDES + (j + 1) % SIDES
    c, d = (i + 1) % STEPS * SIDES + (j + 1) % SIDES, (i + 1) % STEPS * SIDES + j
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3).astype(np.int32)
    return Mesh(vertices.reshape(-1, 3), faces, normals.reshape(-1, 3))


def marble() -> MadeScene:
    """The knot stands on edge before a dark wall, one lamp behind it and one before it."""
    height = SIZE * (3 + THICKNESS) + 0.002
    stone = (
        '<shape type="ply"><string name="filename" value="meshes/knot.ply"/>'
        f'<transform name="to_world"><rotate z="1" angle="60"/><translate y="{height:g}"/></transform>'
        '<ref id="polish"/><ref name="interior" id="marble"/></shape>'
    )
    return MadeScene(
        "A knot of marble",
        "A knot of polished, translucent stone, lit from behind by a warm lamp and from before by a cool one.",
        "Subsurface scattering: photons enter a dense medium through its boundary and are looked up within.",
        (0.35, 0.95, 2.6),
        (0.0, 0.6, 0.0),
        38,
        [
            diffuse("floor", 0.28, 0.25, 0.22),
            diffuse("wall", 0.08, 0.09, 0.11),
            dielectric("polish", 1.5),
            BLACK,
        ],
        [
            panel((0, 0, 0), (2.5, 0, 0), (0, 0, -2.5), "floor"),
            panel((0, 1.5, -1.6), (2.5, 0, 0), (0, 1.5, 0), "wall"),
            stone,
            lamp((-1.9, 2.0, -0.9), (0.0, 0.65, 0.0), (0.5, 0.5), (24, 19, 12.5)),
            lamp((1.6, 1.9, 1.6), (0.0, 0.6, 0.0), (0.5, 0.5), (2.2, 2.6, 3.2)),
        ],
        {"knot": _knot()},
        aspect=(256, 256),
        max_depth=256,
        media=(fog("marble", SIGMA_T, ALBEDO),),
    )
