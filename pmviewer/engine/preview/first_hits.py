"""What the camera sees first in each pixel, without its light: the eye pass of a pass that looks nothing up."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.eye import render_into
from pmviewer.engine.stages.pass_data import pass_record
from pmviewer.engine.stages.pass_maps import PassMaps
from pmviewer.render.camera import CameraPose
from pmviewer.render.film import Film
from pmviewer.render.given import PassData
from pmviewer.render.record import Evaluation
from pmviewer.settings.access import Settings


def first_hits(
    given: PassData,
    maps: PassMaps,
    camera: CameraPose,
    settings: Settings,
    plan: Plan,
    outline: NDArray[np.uint8],
    pool: WorkPool,
) -> NDArray[np.float32]:
    """Planes (h, w, channels) of the camera's picture with emission and the properties of the first hits alone.

    given, maps: of any pass of the same plan, so that no kernel is compiled for it; what they belong to is not looked
    at. Raises Cancelled.
    """
    eye = pass_record(camera, settings, plan, maps, 0).copy()
    nothing = Evaluation()
    for field in fields(nothing):
        if field.name in (eye.dtype.names or ()):
            eye[0][field.name] = getattr(nothing, field.name)
    eye[0]["max_depth"], eye[0]["mis"] = 0, 0
    film = Film(camera.width, camera.height)
    render_into(film, given._replace(eye=eye), outline, plan, pool)
    film.passes = 1
    return film.planes()
