"""The scene as kernels are given it where light passes some panes straight (R9)."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.kernels.scene import thin_dtype
from pmviewer.scene.arrays.material_row import THIN_RULES
from pmviewer.settings.access import Settings


def with_thin_glass(scene: OpenScene, settings: Settings, plan: Plan) -> OpenScene:
    """The scene, its record told of its panes; the very same where all glass is as it is."""
    if not plan.thin_glass:
        return scene
    return replace(scene, flat=replace(scene.flat, record=thin_record(scene.flat.record, settings, plan)))


def thin_record(record: NDArray[np.void], settings: Settings, plan: Plan) -> NDArray[np.void]:
    """A scene's record (1,) for the kernels of the plan."""
    if not plan.thin_glass:
        return record
    told = np.zeros(1, thin_dtype(record.dtype))
    for name in record.dtype.names or ():
        told[name] = record[name]
    told["thin"] = THIN_RULES[settings.render.thin_glass]
    return told


def thin_key(settings: Settings, plan: Plan) -> Hashable:
    """What tells results with different rules apart."""
    return (plan.thin_glass, settings.render.thin_glass) if plan.thin_glass else ()
