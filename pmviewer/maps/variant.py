"""How kernels tell what they are given: by the fields of its record's type.

Kernels specialise on types (`pmviewer.kernels.compile.specialise`), so that what a record has no field for is not
compiled. Each thing that may be there in several variants, or not at all, is told by one field, its mark:

===============  ===================================================================================
field            record of
===============  ===================================================================================
`absent`         nothing: ABSENT stands for a map that there is none of
`blocks`         a grid (`pmviewer.maps.search.grid`)
`planes`         a kd-tree (`pmviewer.maps.search.kdtree`)
`parts`          several kd-trees (`pmviewer.maps.search.parts`)
`hull`           either, looked up by the convex hull of photons (`pmviewer.maps.estimate.hull`)
`differential`   either, looked up with differential checking (`pmviewer.maps.estimate.differential`)
`importons`      a kd-tree of importons (`pmviewer.maps.importance`)
`fewest`         a grid of shadow photons (`pmviewer.maps.shadow`), and how many it takes to decide
`cones`          a grid of photons that guide gather rays through cones
`cells`          a grid of photons that guide gather rays by cells of the hemisphere
`virtual`        virtual lights (`pmviewer.maps.virtual_lights`)
`paths`          virtual lights for estimators that whole light paths weigh
`descent`        virtual lights that pixels choose from by a tree (`pmviewer.photons.virtual.tree`)
`modes`          projection maps (`pmviewer.photons.projection`)
`strata`         strata of guided emission (`pmviewer.photons.emission.strata`)
`march`          a grid or kd-tree of photons in media, looked up by ray marching (`pmviewer.render.media.march`)
`scattered`      importons that are scattered on (`pmviewer.photons.emission.scattered`)
===============  ===================================================================================

A grid or kd-tree without a mark is looked up by the plain disc. `marked` adds a mark to a record, in front: numba
compiles for each record exactly, but warns where one begins like another (tests/maps/test_variant.py shows both).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.specialise import has

Estimator = Literal["disc", "hull", "differential"]
Mark = Literal["hull", "differential", "normals", "fewest", "cones", "cells", "paths", "descent", "march"]

ABSENT = np.zeros(1, np.dtype([("absent", np.int32)]))
"""Stands for what is not there: `pmviewer.kernels.compile.specialise.absent` tells it from all else."""


def with_mark(dtype: np.dtype, mark: Mark, more: list[tuple[str, Any]] | None = None) -> np.dtype:
    """The type of a map's record with a mark, an int32, and perhaps more fields."""
    fields = [(name, field[0]) for name, field in (dtype.fields or {}).items()]
    return np.dtype([(mark, np.int32), *fields, *(more or [])], align=True)


def marked(record: NDArray[np.void], mark: Mark, value: int = 1) -> NDArray[np.void]:
    """A copy of the record (1,) of a map with a mark of that value. Valid while the map lives."""
    copy = np.zeros(1, with_mark(record.dtype, mark))
    for name in record.dtype.names or ():
        copy[name] = record[name]
    copy[mark] = value
    return copy


def looked_up_by(record: NDArray[np.void], estimator: Estimator) -> NDArray[np.void]:
    """The record (1,) of a map for look-ups by that estimate."""
    return record if estimator == "disc" else marked(record, estimator)


def is_parts(record: Any) -> bool:
    """Whether a record, or its type, is that of a map in several parts."""
    return has(record, "parts")


def is_kdtree(record: Any) -> bool:
    """Whether a record, or its type, is that of a kd-tree, not of a grid."""
    return has(record, "planes")
