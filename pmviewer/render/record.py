"""What the eye pass's kernels know besides the scene and the maps: camera, pass and settings, as one record."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.random import SOBOL
from pmviewer.maps.estimate.filters import FILTERS
from pmviewer.render.camera import CameraPose, hidden_from
from pmviewer.render.filter import BOX, filter_of, set_filter
from pmviewer.render.filter_samples import FILTER_FIELDS
from pmviewer.render.hidden_lights import HIDDEN_FIELDS
from pmviewer.render.lens import LENS_FIELDS
from pmviewer.render.pixel_samples import SAMPLE_FIELDS
from pmviewer.render.split import SPLIT_FIELDS
from pmviewer.settings.access import Settings

_FIELDS: list[tuple] = [
    *[(f"{axis}_{part}", "f4") for part in ("eye", "corner", "right", "down", "forward", "near") for axis in "xyz"],
    ("near", "f4"),
    ("far", "f4"),
    ("width", "i4"),
    ("height", "i4"),
    ("orthographic", "i4"),
    ("pixel_side", "f4"),  # of the part of a pixel that is seen, and how far it is from the pixel's left and top
    ("pixel_margin", "f4"),
    ("sequence", "i4"),
    ("seed", "u4"),
    ("index", "u4"),  # the pass: the sample index of every pixel's sequences
    ("max_depth", "i4"),
    ("glossy", "f4"),  # roughness from which glossy lobes are looked up
    ("outline_rays", "i4"),  # camera rays for emission in pixels on a light's outline
    ("direct", "i4"),  # whether direct light is sampled at lobes that photons are stored for
    ("followed_direct", "i4"),  # and at those that are followed
    ("light_samples", "i4"),  # at a surface
    ("mis", "i4"),
    ("choice", "i4"),  # of lights: index into `pmviewer.render.direct.choice.CHOICES`
    ("con_samples", "i4"),
    ("noncon_samples", "i4"),
    ("biased", "i4"),  # whether lights without photons near are left out
    ("choice_radius", "f4"),
    ("caustic_mask", "i4"),  # path classes shown from the caustic map, 0 for none
    ("unfound", "i4"),  # whether followed lobes look up what no path finds (`pmviewer.render.reflect.unfound`)
    ("global_mask", "i4"),  # path classes shown directly from the global map, as indirect light
    ("direct_mask", "i4"),  # and as direct light
    ("global_caustics", "i4"),  # and as caustics
    ("indirect_caustics", "i4"),  # whether caustics after a diffuse bounce belong to the term "caustic"
    ("gather_rays", "i4"),  # final-gather rays, 0 for none
    ("cache_rays", "i4"),  # those of surfaces that the irradiance cache is for, where no record serves
    ("gather_specular", "i4"),  # whether gather rays follow mirrors and glass
    ("guided_rays", "i4"),  # how many of them photons guide
    ("guide_mask", "i4"),  # path classes of these photons
    ("roulette", "f4"),  # gather rays that may bring less than this are thinned out
    ("corner", "f4"),  # gather rays shorter than this gather again where they land
    ("filter", "i4"),
    ("rim", "i4"),
    ("k", "i4"),  # nearest photons that are looked up in this pass
    ("share", "f4"),  # of their disc's area, in which they count
    ("cone_k", "f4"),
    ("flatness", "f4"),
    ("covered", "i4"),  # whether estimates are for the part of their disc that surfaces cover
    ("boundary", "f4"),  # what photons on a convex hull's boundary count
    ("caustic_radius", "f4"),
    ("global_radius", "f4"),
    ("radiance_cutoff", "f4"),  # radiance photons farther away are not used
    ("radiance_similarity", "f4"),  # least cosine between their normals and the surface's
]


MEDIA_FIELDS: list[tuple[str, str]] = [
    ("medium", "i8"),  # that the camera is in, VACUUM for none
    ("volume_light", "i4"),  # whether light that media scatter towards the camera is sampled
    ("phase_rays", "i4"),  # and found by the phase function, too: there are lights that rays can meet
    ("volume_radius", "f4"),  # of look-ups around rays
    ("free_paths", "f4"),  # and the largest, in mean free paths of the medium
]
"""Of scenes with participating media."""


def eye_dtype(
    lens: bool = False,
    filtered: bool = False,
    media: bool = False,
    split: bool = False,
    hides: bool = False,
    several: bool = False,
) -> np.dtype:
    """The record of a camera with a lens or without, a reconstruction filter other than the plain box or not, of a
    scene with media or without, of paths that split at glass or choose, that hides lights or not, and whose pixels
    may have several samples a pass or one: kernels are compiled for the record's type, so that what is not
    there costs nothing."""
    # In front, since numba warns where one record begins like another.
    extra = [*(LENS_FIELDS if lens else []), *(FILTER_FIELDS if filtered else []), *(MEDIA_FIELDS if media else [])]
    extra += [*(SPLIT_FIELDS if split else []), *(HIDDEN_FIELDS if hides else [])]
    extra += SAMPLE_FIELDS if several else []
    return np.dtype([*extra, *_FIELDS], align=True)


EYE_DTYPE = eye_dtype()
"""Of a pinhole and the box filter."""

RIMS = ("left out", "half", "whole")


@dataclass(frozen=True)
class Evaluation:
    """How a pass evaluates the terms of the picture: what it samples, and what it looks up in which maps. Each field is
    one of EYE_DTYPE by its name, the last of scenes with media, of paths that split and of several samples, but for
    `looked_for`, which sets `mis`, and `several`, which has the record have the last; radii and `corner` are in scene
    units. The defaults sample and look up nothing."""

    direct: bool = False
    followed_direct: bool = False
    unfound: bool = False
    caustic_mask: int = 0
    global_mask: int = 0
    direct_mask: int = 0
    global_caustics: int = 0
    indirect_caustics: bool = False
    gather_rays: int = 0
    cache_rays: int = 0
    gather_specular: bool = False
    guided_rays: int = 0
    guide_mask: int = 0
    corner: float = 0.0
    choice: int = 0
    light_samples: int = 1
    biased: bool = False
    choice_radius: float = 0.0
    k: int = 0
    share: float = 0.0
    caustic_radius: float = 0.0
    global_radius: float = 0.0
    radiance_cutoff: float = 0.0
    volume_light: bool = False
    phase_rays: bool = False
    looked_for: bool = False
    volume_radius: float = 0.0
    free_paths: float = 0.0
    splits: int = 0
    several: bool = False
    mirror_rays: int = 1
    edge_rays: int = 1


NOTHING_EVALUATED = Evaluation()


def eye_record(
    camera: CameraPose, settings: Settings, index: int, evaluation: Evaluation = NOTHING_EVALUATED
) -> NDArray[np.void]:
    """The record (1,) of an `eye_dtype` of pass `index`, complete: nobody writes to it afterwards. A lens must have
    been focused (`pmviewer.engine.focus`)."""
    chosen = filter_of(camera.filter, settings.render)
    in_media = camera.medium is not None
    hides = hidden_from(camera, settings.render)
    split, several = evaluation.splits > 0, evaluation.several
    record = np.zeros(1, eye_dtype(camera.aperture > 0, chosen != BOX, in_media, split, hides, several))
    r = record[0]
    if camera.medium is not None:
        r["medium"] = camera.medium
    _set_camera(r, camera)
    if camera.aperture > 0:
        _set_lens(r, camera)
    if chosen != BOX:
        set_filter(r, chosen, camera.pixel_side, index)
    if hides:
        r["hides"] = 1
    r["sequence"], r["seed"], r["index"] = SOBOL, settings.render.seed & 0xFFFFFFFF, index & 0xFFFFFFFF
    r["max_depth"] = settings.render.max_depth
    r["outline_rays"] = settings.render.outline_rays
    r["glossy"] = settings.photons.glossy
    direct = settings.direct
    r["mis"] = direct.mis or evaluation.looked_for
    r["con_samples"], r["noncon_samples"] = direct.con_samples, direct.noncon_samples
    estimate = settings.estimate
    r["filter"], r["rim"] = FILTERS.index(estimate.filter), RIMS.index(estimate.rim)
    r["cone_k"], r["flatness"], r["boundary"] = estimate.cone_k, estimate.flatness, estimate.boundary
    r["covered"] = estimate.area == "covered" and not estimate.differential
    r["roulette"] = settings.gather.roulette
    r["radiance_similarity"] = settings.gather.similarity
    for field in fields(evaluation):
        if field.name in (record.dtype.names or ()):
            r[field.name] = getattr(evaluation, field.name)
    return record


def _set_camera(r: np.void, camera: CameraPose) -> None:
    forward = camera.axes()[2]
    near = forward if camera.near_normal is None else camera.near_normal
    frame = np.concatenate([camera.ray_frame(), [forward, near]])
    for part, vector in zip(("eye", "corner", "right", "down", "forward", "near"), frame, strict=True):
        for axis, value in zip("xyz", vector, strict=True):
            r[f"{axis}_{part}"] = value
    r["near"], r["far"] = camera.near, camera.far
    r["width"], r["height"], r["orthographic"] = camera.width, camera.height, camera.orthographic
    r["pixel_side"], r["pixel_margin"] = camera.pixel_side, 0.5 * (1.0 - camera.pixel_side)


def _set_lens(r: np.void, camera: CameraPose) -> None:
    assert camera.focus is not None
    right, top, _ = camera.axes()
    for part, vector in (("right", right), ("top", top)):
        for axis, value in zip("xyz", vector * camera.aperture, strict=True):
            r[f"{axis}_lens_{part}"] = value
    r["inverse_focus"] = 1 / camera.focus
