"""The look-ups of a pixel with their photons: the pixel is replayed, and the photons are looked for naively."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspector.curves import WEIGHTS, WIDER, curves_of, disc_mean
from pmviewer.engine.inspector.near import (
    Chosen,
    Disc,
    Near,
    Neighbours,
    nearest,
    nearest_of_parts,
    photons_near,
    within,
)
from pmviewer.engine.inspector.report import Float, Found, LookUp, luminance
from pmviewer.engine.look_up_plan import estimator_of
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.engine.stages.pass_maps import PassMaps
from pmviewer.engine.stages.virtual_lights import lights_asked
from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED
from pmviewer.maps.estimate.filters import FILTERS
from pmviewer.maps.record import UNFOUND, bands, unpack
from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.maps.search.parts import Combination, PhotonParts
from pmviewer.render.diagnostics.pixel_replay import (
    AS_CAUSTICS,
    AS_DIRECT,
    AS_INDIRECT,
    GATHERED,
    NOT_FOUND,
    OF_CAUSTICS,
    WEAKLY,
    as_lit,
    as_look_ups,
    empty_lights,
    empty_rows,
    replay_pixel,
)
from pmviewer.render.pixel_samples import own_eye
from pmviewer.scene.spectrum import of_bands
from pmviewer.settings.access import Settings

MOST_LOOK_UPS, MOST_POINTS = 64, 64
MOST_SURFACES, MOST_LIT = 16, 1 << 20
"""Of a pixel at which all virtual lights are told, and how many of them at all."""
_SHOWS = {
    OF_CAUSTICS: "caustic",
    AS_INDIRECT: "indirect",
    AS_DIRECT: "direct",
    AS_CAUSTICS: "caustic",
    NOT_FOUND: "specular",
    GATHERED: "indirect",
    WEAKLY: "specular",
}
Shares = Callable[[int, int, NDArray[np.float32]], NDArray[np.float32]]


class Replay:
    """A pixel of a pass, replayed: `rows` (n,) are its look-ups (`pmviewer.render.diagnostics.pixel_replay.ROW`),
    `covered` (n,) what surfaces cover of their discs, `way` (v, 3) the camera ray's origin and the points met, `prims`
    (v − 1,) the primitives there, `samples` (n_lights,) the light samples that are expected on each light where light
    is sampled, None where it is nowhere; `lights` are the virtual lights that face its surfaces
    (`pmviewer.render.diagnostics.pixel_replay.LIT`)."""

    def __init__(self, rendered: RenderedPass, radii: NDArray[np.float32] | None, pixel: int, n_lights: int) -> None:
        self._arguments = own_eye(rendered.given), radii
        self._pixel = pixel, rendered.samples(pixel)
        self._expected = np.zeros(n_lights, np.float32)
        self._lights = empty_lights(min(MOST_SURFACES * lights_asked(rendered.given.virtual), MOST_LIT))
        self.samples: NDArray[np.float32] | None = None
        whole = self._of_whole_discs()
        self.rows, self.way, self.prims, _, lit = self._run(-1, 0, np.zeros((0, 3), np.float32))
        self.covered = _ratio(whole, self.rows)
        self.lights = as_lit(self._lights[:lit])
        self._lights = empty_lights(0)  # they are asked once

    def shares(self, surface: int, group: int, wi: NDArray[np.float32]) -> NDArray[np.float32]:
        """(m, 3), 1/sr: what the lobes of that group reflect at that surface of light from wi (m, 3)."""
        return self._run(surface, group, wi)[3]

    def _of_whole_discs(self) -> np.ndarray:
        """The rows as they were if surfaces covered the discs of all look-ups."""
        eye = self._arguments[0].eye
        asked = eye["covered"].copy()
        eye["covered"] = 0
        rows = self._run(-1, 0, np.zeros((0, 3), np.float32))[0]
        eye["covered"] = asked
        return rows

    def _run(
        self, surface: int, group: int, wi: NDArray[np.float32]
    ) -> tuple[np.ndarray, Float, NDArray[np.int64], NDArray[np.float32], int]:
        asked, counts = np.array([*self._pixel, surface, group], np.int64), np.zeros(4, np.int64)
        rows, shares = empty_rows(MOST_LOOK_UPS), np.zeros((len(wi), 3), np.float32)
        way, prims = np.zeros((MOST_POINTS, 3), np.float32), np.full(MOST_POINTS, -1, np.int64)
        wi = np.ascontiguousarray(wi, np.float32)
        replay_pixel(*self._arguments, asked, wi, shares, rows, way, prims, self._expected, self._lights, counts)
        self.samples = self._expected if counts[2] else None
        made = as_look_ups(rows[: counts[0]])
        return made, way[: counts[1]].astype(np.float64), prims[1 : counts[1]].copy(), shares, int(counts[3])


def _ratio(rows: np.ndarray, others: np.ndarray) -> Float:
    """Of the radiances of look-ups, 1 where there are none."""
    L, of = (row["L"].astype(np.float64).sum(axis=1) for row in (rows, others))
    return np.divide(L, of, out=np.ones(len(L)), where=of > 0)


def look_ups_of(replay: Replay, rendered: RenderedPass, settings: Settings, banded: bool) -> tuple[LookUp, ...]:
    """Everything that the pixel looked up, in the order of the eye pass. `banded`: photons tell their wavelengths."""
    return tuple(
        _look_up(row, float(covered), replay, rendered, settings, banded)
        for row, covered in zip(replay.rows, replay.covered, strict=True)
    )


def _look_up(
    row: np.void, covered: float, replay: Replay, rendered: RenderedPass, settings: Settings, banded: bool
) -> LookUp:
    eye, maps, purpose = rendered.given.eye[0], rendered.maps, int(row["purpose"])
    name = "caustic" if purpose in (OF_CAUSTICS, NOT_FOUND) else "global"
    stored, unit = _stored(maps, name)
    group, flags = (FOLLOWED, UNFOUND) if purpose == NOT_FOUND else (STORED, 0)
    both = bool(row["both_sides"])
    disc = Disc(row["p"], row["n"], float(eye["flatness"]), int(row["class_mask"]), both, flags)
    near, chosen = _chosen(maps, name, disc, float(row["radius"]), eye, settings.estimate.combine)
    records = np.ascontiguousarray(stored[near.rows])
    unpacked = unpack(records, unit)
    unpacked["wavelength"] = of_bands(bands(records) if banded else np.zeros(len(records), np.int64))
    share = replay.shares(int(row["surface"]), int(group), unpacked["wi"]).astype(np.float64)
    beta = row["beta"].astype(np.float64)
    brings = beta * share * unpacked["Phi"]
    kernel, cone_k = FILTERS[int(eye["filter"])], float(eye["cone_k"])
    weight = chosen.factor * WEIGHTS[kernel](chosen.x2, cone_k)
    adds = weight[:, None] * brings[chosen.places] / (disc_mean(kernel, cone_k) * math.pi * chosen.radius**2 * covered)
    return LookUp(
        map=name,
        shows=_SHOWS[purpose] if int(row["depth"]) == 0 else "specular",
        used=purpose != GATHERED,
        exact=estimator_of(settings) == "disc",
        depth=int(row["depth"]),
        p=row["p"].astype(np.float64),
        n=row["n"].astype(np.float64),
        wo=row["wo"].astype(np.float64),
        radius=chosen.radius,
        covered=covered,
        flatness=disc.flatness,
        k=_asked(maps, name, eye),
        kernel=kernel,
        value=beta * row["L"],
        found=_found(stored, near, chosen, unpacked, share, weight, adds),
        curves=curves_of(near.d2, near.reach, luminance(brings), chosen.radius, cone_k),
    )


def _chosen(
    maps: PassMaps, name: str, disc: Disc, radius: float, eye: np.void, combination: Combination
) -> tuple[Near, Chosen]:
    """The photons of that map around the place, farther than the look-up goes, and those that it takes."""
    made = maps.by_name.get(name)
    structure = made.structure if made is not None else None
    stored = _stored(maps, name)[0]
    if structure is None or isinstance(structure, PhotonGrid):
        radius = min(radius, structure.radius) if structure is not None else radius
        near = photons_near(stored, disc, WIDER * radius)
        return near, within(near, radius)
    near = photons_near(stored, disc, radius)
    if isinstance(structure, PhotonParts):
        assert maps.photons is not None
        return near, nearest_of_parts(
            near,
            maps.photons.cuts[name],
            _neighbours(structure, radius, eye),
            combination,
            FILTERS[int(eye["filter"])] == "constant",
        )
    return near, nearest(near, _neighbours(structure, radius, eye))


def _stored(maps: PassMaps, name: str) -> tuple[NDArray[np.float32], float]:
    """The photons (n, 6) of the map of that name as they are stored, and their unit; none where it isn't there."""
    photons = maps.photons
    if photons is None or name not in maps.by_name:
        return np.zeros((0, 6), np.float32), 1.0
    if name == "caustic":
        return photons.caustic, photons.caustic_unit
    return photons.global_, photons.global_unit


def _asked(maps: PassMaps, name: str, eye: np.void) -> int:
    """How many nearest photons a look-up in that map asks for, in all its parts; 0 with a fixed radius."""
    made = maps.by_name.get(name)
    if made is None or isinstance(made.structure, PhotonGrid):
        return 0
    return int(eye["k"]) * maps.parts


def _neighbours(structure: PhotonKdTree | PhotonParts, largest: float, eye: np.void) -> Neighbours:
    tree = structure.trees[0] if isinstance(structure, PhotonParts) else structure
    smallest = float(tree.record["smallest_radius"][0])
    return Neighbours(int(eye["k"]), largest, float(eye["share"]), int(eye["rim"]), smallest)


def _found(
    stored: NDArray[np.float32],
    near: Near,
    chosen: Chosen,
    unpacked: dict[str, np.ndarray],
    share: Float,
    weight: Float,
    adds: Float,
) -> Found:
    """The chosen photons as the inspector lists them, nearest first."""
    at = chosen.places
    distance = np.sqrt(near.d2[at].astype(np.float64))
    order = np.argsort(distance, kind="stable")
    at, index = at[order], near.rows[at][order]
    return Found(
        index=index,
        records=np.ascontiguousarray(stored[index]),
        wi=unpacked["wi"][at],
        Phi=unpacked["Phi"][at].astype(np.float64),
        distance=distance[order],
        weight=weight[order],
        share=share[at],
        adds=adds[order],
        bounces=unpacked["bounces"][at].astype(np.int64),
        path_class=unpacked["path_class"][at].astype(np.int64),
        light=unpacked["light"][at].astype(np.int64),
        wavelength=unpacked["wavelength"][at],
    )
