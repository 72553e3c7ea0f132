"""The state of caustic convergence at what the camera sees, for its view."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.maps.convergence import NO_CAUSTIC, Convergence, Criterion, other_light
from pmviewer.maps.record import decode_directions
from pmviewer.render.diagnostics.diagnostics import seen_places

Runner = Callable[[list[Callable[[], Any]]], list[Any]]
TILE = 2048


def convergence_plane(rendered: RenderedPass, run: Runner) -> NDArray[np.float32]:
    """State of the caustic map (pixels,) at the first surface seen through a pixel's middle that stores photons: MORE,
    CONVERGED or DENSE of `pmviewer.maps.convergence`, −1 where there is no caustic or no such surface. The rules of the
    pass have asked for its photons' `sample`."""
    photons, rules = rendered.maps.photons, rendered.maps.rules
    assert photons is not None
    assert rules.deposition is not None
    assert rules.deposition.criterion is not None
    assert rules.required is not None
    scene, eye = rendered.given.scene, rendered.given.eye
    pixels = int(eye[0]["width"]) * int(eye[0]["height"])
    points, normals = np.empty((pixels, 3), np.float32), np.empty(pixels, np.uint32)
    found = np.empty(pixels, bool)
    run(
        [
            partial(seen_places, scene, eye, points, normals, found, first, min(first + TILE, pixels))
            for first in range(0, pixels, TILE)
        ]
    )
    criterion: Criterion = rules.deposition.criterion
    others = other_light(criterion, photons.sample, photons.sample_unit)
    judge = Convergence(criterion, photons.caustic, photons.caustic_unit, others)
    points, normals = points[found], normals[found]
    required = rules.required["caustic"](points, normals)
    states = np.full(pixels, NO_CAUSTIC, np.float32)
    states[found] = judge.states(points, decode_directions(normals), required, False, run)
    return states


def prepare_convergence() -> None:
    """Compile, or load, what the criterion runs."""
    photons = np.zeros((1, 6), np.float32)
    criterion = Criterion(2, 1.0, 0b1010)
    judge = Convergence(criterion, photons, 1.0, other_light(criterion, photons, 1.0))
    normals, one = np.array([[0.0, 0.0, 1.0]], np.float32), np.ones(1, np.float32)
    judge.states(photons[:, :3], normals, one, True, lambda tasks: [task() for task in tasks])
