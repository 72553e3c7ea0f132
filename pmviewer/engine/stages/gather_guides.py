"""The photons of a pass that guide its gather rays: which, and within which radius."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.plan import Plan
from pmviewer.maps.radius import neighbourhood
from pmviewer.maps.search.grid import PhotonGrid, build_grid
from pmviewer.render.gather.corner import CORNERS, NO_CORNERS
from pmviewer.render.gather.guide import NO_GUIDES, guides_of

GUIDING_PHOTONS = 1 << 17
"""Most photons in the map that guides rays: directions vary slowly over surfaces, and a small map is quick."""


def guide_grid(photons: NDArray[np.float32], unit: float, radius: float) -> PhotonGrid:
    """A grid of the first photons of (n, 6); `unit` is watts of one unit of their power."""
    return build_grid(photons[:GUIDING_PHOTONS], radius, unit)


def guide_radius(photons: NDArray[np.float32], asked: float | str, scene_radius: float) -> float:
    """The radius asked for, relative to the scene, or one within which some dozens of the guiding photons lie."""
    relative = float(asked) if asked != "auto" else neighbourhood(photons[:GUIDING_PHOTONS, :3]) / scene_radius
    return min(max(relative, 1e-4), 1.0) * scene_radius


def gather_records(plan: Plan, guides: PhotonGrid | None) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """What kernels are compiled for and given: the record of the photons that guide, and whether rays gather again."""
    guiding = NO_GUIDES
    if plan.directions != "BSDF":
        assert guides is not None
        guiding = guides_of(guides, plan.directions)
    return guiding, CORNERS if plan.corners else NO_CORNERS
