"""A plane lit from the side, on which redistribution of photons is easy to see (course guide, figures 3.2 and 3.3)."""

from __future__ import annotations

from make.document import BLACK, MadeScene, bsdf, lamp, mesh, rgb
from make.mesh import quad


def lit_plane() -> MadeScene:
    """A grey square of 2 m; the lamp stands beside its left edge and shines along it."""
    return MadeScene(
        "Plane lit from the side",
        "A grey plane of 2 m, and a lamp beside its left edge: dense photons there, few on the right.",
        "Density control: photons of the bright side are given to their neighbours, and the picture stays.",
        (0.0, 3.2, 0.75),
        (0.0, 0.0, 0.04),
        38,
        [bsdf("diffuse", "grey", rgb("reflectance", 0.5), two_sided=True), BLACK],
        [
            mesh("plane", "grey", flat=True),
            lamp((-1.15, 0.45, 0.0), (0.0, 0.0, 0.0), (0.06, 0.06), (210, 200, 185)),
        ],
        {"plane": quad((-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1))},
        aspect=(320, 320),
    )
