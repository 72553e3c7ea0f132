"""What the inspector is asked and what it tells, as plain data: the window reads it without waiting for kernels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Of linear Rec. 709 primaries."""


@dataclass(frozen=True)
class PhotonAt:
    """A photon by where it was stored in a pass: `index` the pass, `N` its trajectories, `position` its float32
    coordinates as numbers."""

    index: int
    N: int
    position: tuple[float, float, float]


@dataclass(frozen=True)
class Pinned:
    """What is inspected: a pixel (x, y) of the image, and a photon whose life is told."""

    x: int
    y: int
    photon: PhotonAt | None = None


@dataclass(frozen=True, eq=False)
class Found:
    """The m photons of a look-up by distance, nearest first.

    `index` are their rows in the map of the pass (`PhotonCloud.photons`), `records` (m, 6) these rows, `Phi` (m, 3)
    watts, `distance` (m,) scene units, `weight` (m,) of the kernel, `share` (m, 3) what the surface reflects of them
    (1/sr), `adds` (m, 3) the radiance that each adds to the pixel in this pass.
    """

    index: NDArray[np.int64]
    records: NDArray[np.float32]
    wi: NDArray[np.float32]
    Phi: Float
    distance: Float
    weight: Float
    share: Float
    adds: Float
    bounces: NDArray[np.int64]
    path_class: NDArray[np.int64]
    light: NDArray[np.int64]
    wavelength: Float
    """(m,) nm, NaN of photons that no glass has split."""

    @property
    def n(self) -> int:
        """How many there are."""
        return len(self.index)


@dataclass(frozen=True, eq=False)
class Curves:
    """Luminance of a look-up's estimate for the whole disc against its radius, `L` by the name of the kernel; `radii`
    and each of `L` are (n,), `count` (n,) are the photons within."""

    radii: Float
    count: NDArray[np.int64]
    L: dict[str, Float]


@dataclass(frozen=True, eq=False)
class LookUp:
    """One look-up of the pixel in a pass: in which `map`, for which term (`shows`), where, how far.

    `radius` is that of its disc (of the k nearest: where it ended), `covered` the share of it that the estimate takes
    to be covered by surfaces, 1 where it is for all of it; `k` how many were asked for, 0 with a fixed radius;
    `value` (3,) the radiance that the eye pass took from it for the pixel. `exact` is whether the photons' `adds` make
    up `value`: estimates of another area (convex hull, differential checking) share the photons and not the sum. What
    is not `used` shows what the map holds there; the pixel gathers instead.
    """

    map: str
    shows: str
    used: bool
    exact: bool
    depth: int
    p: Float
    n: Float
    wo: Float
    radius: float
    covered: float
    flatness: float
    k: int
    kernel: str
    value: Float
    found: Found
    curves: Curves

    @property
    def sum(self) -> Float:
        """(3,) of what the photons add."""
        return np.asarray(self.found.adds.sum(axis=0))


@dataclass(frozen=True, eq=False)
class LitPlace:
    """The m virtual lights of the latest pass that reach a surface of the pixel, by what they add, most first.

    `number` (m,) are their rows in the pass's cloud, `points` (m, 3) where they are, `Phi` (m, 3) watts, `distance`
    (m,) scene units, `adds` (m, 3) the radiance that the pixel gets from each in this pass, `weight` (m,) what each
    counts in the sum of weights, 0 of light that is not weighted; `blocked` (b, 3) are the points of those that face
    the surface and are hidden, `asked` how many the pixel asked at all, `quotient` what weighted light was multiplied
    by, 1 without.
    """

    shows: str
    depth: int
    p: Float
    n: Float
    asked: int
    quotient: float
    number: NDArray[np.int64]
    points: Float
    Phi: Float
    distance: Float
    adds: Float
    weight: Float
    bounces: NDArray[np.int64]
    light: NDArray[np.int64]
    objects: tuple[str, ...]
    blocked: Float

    @property
    def sum(self) -> Float:
        """(3,) of what they add."""
        return np.asarray(self.adds.sum(axis=0))


@dataclass(frozen=True, eq=False)
class History:
    """A pixel since it was pinned: `passes` (n,), the `mean` (n, 3) of all passes up to each, and the standard `error`
    (n,) of its luminance, by the spread of the single passes since then; NaN while there are fewer than two."""

    passes: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    mean: Float = field(default_factory=lambda: np.zeros((0, 3)))
    error: Float = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class PhotonLife:
    """The trajectory of a photon: `vertices` (n, 6) float32 records (`pmviewer.maps.record`) from the light on with its
    power on the way there, in `power_unit` watts; `stored_at` is the vertex that was asked about. `note` says why there
    is nothing to tell."""

    of: PhotonAt
    vertices: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 6), np.float32))
    power_unit: float = 1.0
    trajectory: int = -1
    stored_at: int = -1
    light: str = ""
    note: str = ""
    wavelengths: tuple[float, ...] = ()
    """In nm, of the photon on its way to each vertex, NaN as long as no glass has split it; () in scenes without."""


@dataclass(frozen=True, eq=False)
class Fisheye:
    """What a gather at the pixel's first surface sees: radiance `gathered` (rings, sectors, 3) by a ray in each cell of
    the hemisphere (`pmviewer.maps.hemisphere`), around the unit normal n with the tangents s and t, all of them and wo,
    the way to the viewer, (3,). `reprojected` (rings, sectors, 3) is what other gathers of the pass tell instead, and
    `shot` (rings, sectors) where they tell too little; None without reprojection. `estimate` (3,) W/m² is what
    the pass takes there, None where the pixel gathers as usual."""

    gathered: Float
    n: Float
    s: Float
    t: Float
    wo: Float
    reprojected: Float | None = None
    shot: NDArray[np.bool_] | None = None
    estimate: Float | None = None

    def irradiance(self, radiance: Float) -> Float:
        """(3,) W/m² of one of both: cells have equal projected solid angles."""
        return np.asarray(np.pi * radiance.mean(axis=(0, 1)))


@dataclass(frozen=True)
class Seen:
    """What the eye path met: names of shape and material, and the shape's `area` in square scene units; 0 of an
    instance, which is not looked into."""

    shape: str
    material: str = ""
    area: float = 0.0


@dataclass(frozen=True, eq=False)
class PixelReport:
    """What made a pixel in pass `index`.

    `way` (v, 3) is its eye path: the camera's ray origin and the points that it met; `objects` are what is there;
    `terms` (5, 3), with media (7, 3), its mean by term (`pmviewer.render.planes.terms_of`); `gathered` its gather rays
    (`pmviewer.render.gather.gather_points`); `measures` what importance says there, by the name of the view, with the
    map it is of; `samples` (n_lights,) how many light samples each of the `lights` gets there, None where direct light
    is not sampled.
    """

    of: Pinned
    index: int
    N: int
    terms: Float
    way: Float
    objects: tuple[Seen, ...]
    look_ups: tuple[LookUp, ...]
    gathered: NDArray[np.float32] | None
    measures: dict[str, float]
    measured_map: str
    history: History
    lights: tuple[str, ...]
    samples: NDArray[np.float32] | None
    life: PhotonLife | None = None
    notes: tuple[str, ...] = ()
    fisheye: Fisheye | None = None
    """With estimated gathers, where the first surface is a diffuse one."""
    lit: tuple[LitPlace, ...] = ()
    """With virtual lights, the surfaces of the pixel that they light."""


def luminance(colour: Any) -> Any:
    """Of (…, 3) colours."""
    return np.asarray(colour, np.float64) @ np.array(LUMINANCE)
