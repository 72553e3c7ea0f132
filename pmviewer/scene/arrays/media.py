"""Participating media as the arrays that kernels read, and which of them points and lights are in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.lights.in_media import media_of_lights
from pmviewer.kernels.media.glow import GL_MEDIUM
from pmviewer.kernels.media.locate import UNKNOWN, media_at
from pmviewer.kernels.media.medium import MD_GLOW, MEDIUM_COLUMNS, SAME
from pmviewer.scene.arrays.shape_bounds import shape_bounds
from pmviewer.scene.description import Medium, Scene, Shape

_PHOTONS = 16
"""Photons of a light that tell which medium it shines into."""
_DIRECTIONS = ((0.36, 0.48, 0.8), (-0.6, 0.64, 0.48), (0.28, -0.96, 0.0), (-0.48, -0.36, -0.8), (0.8, 0.0, -0.6))
"""Unit vectors along no axis, in which a point asks for its medium."""


def has_media(scene: Scene) -> bool:
    """Are there media, and does something bound one or the camera stand in it?"""
    bounded = any(shape.media is not None and max(shape.media) >= 0 for shape in scene.all_shapes)
    cameras = (scene.camera, *(named.camera for named in scene.cameras))
    return bool(scene.media) and (bounded or any(camera.medium >= 0 for camera in cameras))


def media_bounds(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner (3,) of the box around what bounds media; around all surfaces where nothing does."""
    bounding = [s for s in scene.shapes if s.media is not None and max(s.media) >= 0]
    boxes = np.array([shape_bounds(shape) for shape in bounding or scene.shapes])
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def media_emitting(scene: Scene) -> int:
    """Media that emit light and that something bounds or a camera stands in."""
    bounded = {number for shape in scene.all_shapes for number in shape.media or ()}
    around = {camera.medium for camera in (scene.camera, *(named.camera for named in scene.cameras))}
    return sum(max(m.emission) > 0 and number in bounded | around for number, m in enumerate(scene.media))


def medium_rows(media: tuple[Medium, ...], glows: NDArray[np.float64]) -> NDArray[np.float32]:
    """(n, MEDIUM_COLUMNS), see `pmviewer.kernels.media.medium`; glows: rows of `pmviewer.kernels.media.glow`."""
    listed = [
        [
            *m.sigma_t,
            *m.albedo,
            *m.emission,
            m.phase.g,
            m.phase.g_beside,
            m.phase.beside,
            -1,
            m.free_path,
            m.shortest_path,
        ]
        for m in media
    ]
    rows = np.array(listed, np.float32).reshape(-1, MEDIUM_COLUMNS)
    rows[glows[:, GL_MEDIUM].astype(int), MD_GLOW] = np.arange(len(glows))
    return rows


def media_of_prims(shapes: tuple[Shape, ...], shape_of_prim: NDArray[np.int32]) -> NDArray[np.int32]:
    """(n_prims, 2): the media inside and outside of each stored primitive, SAME where none ends."""
    sides = np.array([shape.media if shape.media is not None else (SAME, SAME) for shape in shapes], np.int32)
    return sides[shape_of_prim]


def light_media(
    record: NDArray[np.void], names: tuple[str, ...], around: int, glows: NDArray[np.float64]
) -> tuple[NDArray[np.int32], list[str]]:
    """The medium that photons of each light start in, (n_lights,), and sentences about lights that are in several;
    `around` where nothing is met that tells. The last lights are media that emit, of those rows. The record (1,) is
    complete but for this."""
    found = np.empty((len(names), _PHOTONS), np.int64)
    media_of_lights(record, found)
    own = glows[:, GL_MEDIUM].astype(np.int64)
    found[len(names) - len(own) :] = own[:, None]
    chosen = np.array([_most_frequent(row, around) for row in found], np.int32).reshape(-1)
    mixed = [name for name, row, own in zip(names, found, chosen) if ((row != UNKNOWN) & (row != own)).any()]
    if not mixed:
        return chosen, []
    which = ", ".join(repr(name) for name in mixed[:3])
    return chosen, [
        f"Lights that shine into several media at once ({which}): all of their photons start in one of them. Give "
        "each medium a light of its own."
    ]


def medium_at(record: NDArray[np.void], point: NDArray[np.float64], around: int) -> int:
    """The medium around a point (3,); `around` where no boundary is met."""
    directions = np.array(_DIRECTIONS, np.float32)
    found = np.empty(len(directions), np.int64)
    media_at(record, np.ascontiguousarray(np.broadcast_to(point, (len(directions), 3)), np.float32), directions, found)
    return _most_frequent(found, around)


def _most_frequent(found: NDArray[np.int64], around: int) -> int:
    known = found[found != UNKNOWN]
    if not len(known):
        return around
    values, counts = np.unique(known, return_counts=True)
    return int(values[counts.argmax()])
