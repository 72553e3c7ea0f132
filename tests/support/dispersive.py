"""Dispersive glass for tests, with numbers that are not the program's."""

from __future__ import annotations

from pmviewer.scene.description import Camera, Material, Parallelogram, Scene, Shape, Sphere

SCHOTT = {
    "F2": ((1.34533359, 0.209073176, 0.937357162), (0.00997743871, 0.0470450767, 111.886764)),
    "SF11": ((1.73759695, 0.313747346, 1.89878101), (0.013188707, 0.0623068142, 155.23629)),
}
"""B and C of Sellmeier's equation in µm², from Schott's data sheets of F2 and N-SF11."""


def lit_sphere(glass, size=24, kind="dielectric", eta=None, albedo=0.6):
    """A glass sphere over a floor under a lamp; `glass` None bends all light alike."""
    camera = Camera((0.0, 1.4, -3.0), (0.0, 0.25, 0.0), (0, 1, 0), 42.0)
    index = eta if eta is not None else glass.n_d
    materials = (
        Material("floor", "diffuse", (albedo,) * 3, two_sided=True),
        Material("glass", kind, (1.0,) * 3, eta=index, alpha=(0.2, 0.2), dispersion=glass),
        Material("black", "diffuse", (0.0,) * 3),
    )
    shapes = (
        Shape("floor", Parallelogram((-2, 0, -2), (0, 0, 4), (4, 0, 0)), 0),
        Shape("ball", Sphere((0, 0.5, 0), 0.45), 1),
        Shape("lamp", Parallelogram((0.2, 2.4, -0.7), (1.4, 0, 0), (0, 0, 1.4)), 2, (6.0,) * 3),
    )
    return Scene("lit sphere", None, shapes, materials, (), camera, size, size)
