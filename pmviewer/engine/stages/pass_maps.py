"""What the light stage makes of a pass: photons, the maps built from them, and how far they are looked up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pmviewer.engine.plan import Plan
from pmviewer.engine.stages.deposition import Rules
from pmviewer.maps.radiance import RadianceMap
from pmviewer.maps.search.grid import RECORD as GRID_RECORD
from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.maps.search.kdtree import RECORD as TREE_RECORD
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.maps.search.parts import PhotonParts, parts_of
from pmviewer.photons.emission.guided import Known
from pmviewer.photons.emission.light_importance import LightImportance
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.settings.access import Settings
from pmviewer.state import State

Structure = PhotonGrid | PhotonKdTree | PhotonParts


@dataclass(frozen=True, eq=False)
class LookUpMap:
    """Photons in a structure, and the `radius` of their look-ups in scene units: with k nearest the largest one; the
    `step` of ray marching through it, 0 without."""

    structure: Structure
    radius: float
    step: float = 0.0


@dataclass(frozen=True, eq=False)
class Carried:
    """What a pass takes over from those before it: what guided emission has `known`, and the radii in scene units of
    the `guides` and of the `chooser`, which the first pass has found; None for what is not there."""

    known: Known | None = None
    guides: float | None = None
    chooser: float | None = None

    def state(self) -> State:
        """All of it."""
        known = self.known.state() if self.known is not None else None
        return State.of_parts({"guides": self.guides, "chooser": self.chooser}, {}, known=known)

    @staticmethod
    def restored(state: State) -> Carried:
        """From what `state` has told. Raises ValueError for anything else."""
        radii = (state.number(name) for name in ("guides", "chooser"))
        known = Known.restored(state.part("known")) if "known" in state.numbers else None
        return Carried(known, *(None if radius is None else float(radius) for radius in radii))


@dataclass(frozen=True, eq=False)
class PassMaps:
    """The maps of pass `index` of N trajectories; nobody changes them. Their records are valid while this lives.

    `caustic` and `global_` are None where nothing looks them up, and so are `chooser`, the grid of direct photons
    that choose lights, `volume`, the photons in media, `guides`, that of photons that guide gather rays, and
    `radiance`, the radiance photons, which are used up to `radiance_reach`. `neighbours` nearest photons are looked
    up in each of the `parts` of a map, which count in the `share` of their disc's area; gather rays shorter than
    `corner` gather again. Lengths are in scene units. `rules` have decided about storing the `photons`, and
    `known_before` is what guided emission knew before the pass. `empty` and `empty_grid` stand in for maps that are not
    there: kernels take all maps, whether or not they look them up."""

    index: int
    N: int
    empty: Structure
    empty_grid: PhotonGrid
    photons: PhotonMaps | None = None
    rules: Rules = field(default_factory=Rules)
    notes: tuple[str, ...] = ()
    known_before: Known | None = None
    caustic: LookUpMap | None = None
    global_: LookUpMap | None = None
    neighbours: int = 0
    parts: int = 1
    share: float = 0.0
    radiance: RadianceMap | None = None
    radiance_reach: float = 0.0
    guides: PhotonGrid | None = None
    corner: float = 0.0
    chooser: PhotonGrid | None = None
    volume: LookUpMap | None = None
    free_paths: float = 0.0

    @property
    def by_name(self) -> dict[str, LookUpMap]:
        """The photon maps that were built."""
        maps = {"caustic": self.caustic, "global": self.global_, "volume": self.volume}
        return {name: made for name, made in maps.items() if made is not None}

    @property
    def radii(self) -> Mapping[str, float]:
        """Of look-ups, by what is looked up."""
        radii = {name: made.radius for name, made in self.by_name.items()}
        if self.guides is not None:
            radii["guides"] = self.guides.radius
        if self.chooser is not None:
            radii["light choice"] = self.chooser.radius
        return radii

    @property
    def bytes(self) -> int:
        """Memory of the maps of what is shown; the photons that choose lights are few."""
        parts = *(made.structure for made in self.by_name.values()), self.radiance, self.guides
        return sum(part.bytes for part in parts if part is not None)

    @property
    def n(self) -> int:
        """Photons in the photon maps."""
        return sum(made.structure.n for made in self.by_name.values())

    @property
    def lights(self) -> LightImportance | None:
        """Importance of the lights by guided emission."""
        return self.photons.guided.lights if self.photons is not None and self.photons.guided is not None else None

    def carried(self, index: int) -> Carried:
        """What pass `index` takes over from this one; what guided emission knows goes to the next pass alone."""
        guided = self.photons.guided if self.photons is not None else None
        known = guided.known if guided is not None and index == self.index + 1 else None
        return replace(self.taken_over, known=known)

    @property
    def taken_over(self) -> Carried:
        """What this pass has taken over: with it the same pass comes out again."""
        guides, chooser = (None if grid is None else grid.radius for grid in (self.guides, self.chooser))
        return Carried(self.known_before, guides, chooser)


def blank_grid() -> PhotonGrid:
    """A grid of the type that kernels compile for, without a photon and without memory: not to be looked up."""
    return PhotonGrid(0, np.empty((0, 6, 8), np.uint32), np.zeros(1, np.int32), 1.0, 1.0, np.zeros(1, GRID_RECORD))


def blank_tree() -> PhotonKdTree:
    """The same for kd-trees."""
    none = np.empty(0, np.float32)
    payload, planes = np.empty((0, 3), np.uint32), np.empty((0, 2), np.float32)
    return PhotonKdTree(none, none, none, payload, np.empty(0, np.int32), planes, 1.0, np.zeros(1, TREE_RECORD))


def blank_maps(settings: Settings, plan: Plan) -> PassMaps:
    """Maps of the types that passes with these settings have, for compiling ahead; not to be looked up."""
    structure: Structure = blank_grid()
    if plan.nearest:
        structure = parts_of([blank_tree()]) if plan.maps > 1 else blank_tree()
    grid = blank_grid()
    return PassMaps(
        index=0,
        N=0,
        empty=structure,
        empty_grid=grid,
        caustic=LookUpMap(structure, 0.0) if plan.caustic_classes else None,
        global_=LookUpMap(structure, 0.0) if plan.global_classes else None,
        radiance=RadianceMap(grid) if plan.radiance else None,
        guides=grid if plan.guided_rays else None,
        chooser=grid if plan.asks_photons else None,
        volume=LookUpMap(blank_tree() if settings.estimate.in_media == "nearest" else grid, 0.0)
        if plan.volume
        else None,
    )
