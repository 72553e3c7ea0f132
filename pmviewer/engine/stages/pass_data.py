"""What the kernels of a pass are given: its settings, masks and radii as one record, its maps as records."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.look_up_plan import estimator_of
from pmviewer.engine.plan import Plan
from pmviewer.engine.radius import volume_neighbours
from pmviewer.engine.stages.estimation import Estimates, blank_estimates
from pmviewer.engine.stages.gather_guides import gather_records
from pmviewer.engine.stages.irradiance_cache import cache_rays
from pmviewer.engine.stages.pass_maps import LookUpMap, PassMaps, Structure, blank_grid, blank_maps
from pmviewer.engine.stages.shadow_photons import ShadowMap
from pmviewer.engine.stages.virtual_lights import VirtualMap, blank_photons, virtual_dtype
from pmviewer.maps.irradiance_cache import NO_CACHE, IrradianceCache
from pmviewer.maps.irradiance_cache import RECORD as CACHE_RECORD
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.maps.search.parts import PhotonParts
from pmviewer.maps.shadow import shadow_record
from pmviewer.maps.variant import looked_up_by
from pmviewer.render.camera import CameraPose
from pmviewer.render.direct.choice import CHOICES
from pmviewer.render.direct.shadow import NO_SHADOWS
from pmviewer.render.given import NO_VOLUME, PassData
from pmviewer.render.lookup import NO_RADIANCE_PHOTONS
from pmviewer.render.media.march import march_record
from pmviewer.render.pixel_samples import samples_by_marks
from pmviewer.render.record import Evaluation, eye_dtype, eye_record
from pmviewer.settings.access import Settings


@dataclass(frozen=True, eq=False)
class RenderedPass:
    """A pass that is in the picture: what its kernels were `given`, and what its records belong to."""

    given: PassData
    maps: PassMaps
    marks: NDArray[np.uint8] = field(default_factory=lambda: np.zeros(0, np.uint8))
    """Of pixels, as the eye pass takes them."""
    shadows: ShadowMap | None = None
    cache: IrradianceCache | None = None
    virtual: VirtualMap | None = None
    estimates: Estimates | None = None

    def samples(self, pixel: int) -> int:
        """Of a pixel in this pass."""
        eye = self.given.eye[0]
        if "mirror_rays" not in (eye.dtype.names or ()) or len(self.marks) == 0:
            return 1
        rays = int(eye["mirror_rays"]), int(eye["edge_rays"])
        return int(samples_by_marks(self.marks[pixel : pixel + 1], *rays)[0])


def pass_record(camera: CameraPose, settings: Settings, plan: Plan, maps: PassMaps, index: int) -> NDArray[np.void]:
    """The eye record (1,) of pass `index`, which looks these maps up."""
    return eye_record(camera, settings, index, _evaluation(settings, plan, maps, index))


def _evaluation(settings: Settings, plan: Plan, maps: PassMaps, index: int) -> Evaluation:
    indirect_caustics = settings.photons.indirect_caustics
    return Evaluation(
        direct=plan.direct,
        followed_direct=plan.followed_direct,
        unfound=plan.unfound,
        caustic_mask=plan.caustic_mask,
        global_mask=plan.global_mask,
        direct_mask=plan.direct_mask,
        global_caustics=plan.global_caustics,
        indirect_caustics=indirect_caustics,
        gather_rays=settings.gather.rays if plan.gather else 0,
        cache_rays=cache_rays(settings.gather) if plan.cache else 0,
        gather_specular=not indirect_caustics,
        guided_rays=plan.guided_rays,
        guide_mask=plan.guide_mask,
        corner=maps.corner,
        choice=CHOICES.index(plan.choice),
        light_samples=plan.light_samples,
        biased=plan.asks_photons and settings.direct.biased,
        choice_radius=maps.chooser.radius if maps.chooser is not None else 0.0,
        k=maps.neighbours,
        share=maps.share,
        caustic_radius=maps.caustic.radius if maps.caustic is not None else 0.0,
        global_radius=maps.global_.radius if maps.global_ is not None else 0.0,
        radiance_cutoff=maps.radiance_reach,
        volume_light=plan.volume,
        phase_rays=plan.phase_rays,
        looked_for=plan.looked_for,
        splits=settings.render.splits if plan.split else 0,
        several=not plan.one_sample,
        mirror_rays=plan.mirror_rays,
        edge_rays=plan.edge_rays,
        volume_radius=maps.volume.radius if maps.volume is not None else 0.0,
        free_paths=maps.free_paths,
    )


def pass_data(
    scene: NDArray[np.void],
    eye: NDArray[np.void],
    settings: Settings,
    plan: Plan,
    maps: PassMaps,
    shadows: NDArray[np.void] | None = None,
) -> PassData:
    """The records that the kernels of a pass take, before there is an irradiance cache or estimates."""
    estimator = estimator_of(settings)

    def photon_map(made: LookUpMap | None) -> NDArray[np.void]:
        structure = made.structure if made is not None else maps.empty
        if isinstance(structure, PhotonParts):
            return structure.combined_by(settings.estimate.combine)
        return looked_up_by(structure.record, estimator)

    guides, corner = gather_records(plan, maps.guides)
    return PassData(
        scene=scene,
        eye=eye,
        caustic_map=photon_map(maps.caustic),
        global_map=photon_map(maps.global_),
        choice_map=(maps.chooser if maps.chooser is not None else maps.empty_grid).record,
        radiance=maps.radiance.record if maps.radiance is not None else NO_RADIANCE_PHOTONS,
        cache=NO_CACHE,
        shadows=shadows if shadows is not None else NO_SHADOWS,
        guides=guides,
        corner=corner,
        volume_map=_volume_record(settings, maps),
    )


def _volume_record(settings: Settings, maps: PassMaps) -> NDArray[np.void]:
    if maps.volume is None:
        return NO_VOLUME
    structure = maps.volume.structure
    if settings.estimate.in_media == "beam":
        return structure.record
    k, share = volume_neighbours(maps.index, settings.estimate)
    return march_record(structure.record, maps.volume.step, k, share, box_of(structure))


def box_of(structure: Structure) -> NDArray[np.float64]:
    """Box (2, 3) around the photons of a grid or kd-tree, of nothing where there are none."""
    if structure.n == 0:
        return np.zeros((2, 3))
    if isinstance(structure, PhotonKdTree):
        return np.array(
            [[part(along) for along in (structure.x, structure.y, structure.z)] for part in (np.min, np.max)]
        )
    record = structure.record[0]
    low = np.array([float(record[f"origin_{axis}"]) for axis in "xyz"])
    sides = np.array([float(record[f"n{axis}"]) for axis in "xyz"])
    return np.array([low, low + sides / float(record["cells_per_length"])])


def blank_eye(settings: Settings, plan: Plan) -> NDArray[np.void]:
    """An eye record (1,) without contents. The free camera is a pinhole."""
    lens = plan.lens and not settings.free_camera.on
    return np.zeros(1, eye_dtype(lens, plan.filtered, plan.media, plan.split, plan.hides, not plan.one_sample))


def blank_pass(scene: NDArray[np.void], settings: Settings, plan: Plan) -> PassData:
    """The records of a pass with these settings, of the types that kernels compile for and without contents: for calls
    for no pixel."""
    shadows = shadow_record(blank_grid(), 1) if plan.shadows else None
    given = pass_data(scene, blank_eye(settings, plan), settings, plan, blank_maps(settings, plan), shadows)
    if plan.virtual:
        dtype = virtual_dtype(settings.virtual)
        given = given._replace(virtual=np.zeros(1, dtype), virtual_map=blank_photons(dtype))
    if plan.estimation:
        return given._replace(cache=blank_estimates())
    return given._replace(cache=np.zeros(1, CACHE_RECORD)) if plan.cache else given
