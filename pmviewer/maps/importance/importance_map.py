"""Importance maps: importons with the importance at each (I1, I2; course guide §3.4, Christensen).

Importons are to the camera what photons are to the lights: places that the final pass looks at, each with the share Ψ
of the image's pixels that it stands for. The importance Γ at a place says how many pixels look at a unit of area there:

- screen importance: the density of the importance that arrives, ΣΨ/A over the k nearest importons, A being the area
  that they span (`pmviewer.maps.estimate.hull`): a disc over an edge would halve it, just where gather rays need the
  map most;
- footprint importance: the mean of 1/A over the same importons, A being the area that one pixel sees there.

Both are in pixels per unit area, and the required density of photons is Γ·M_r/A_pix (`required_density`).

Γ is made at one importon in eight of every leaf of the kd-tree (`pmviewer.maps.importance.build`), the others take that
of the nearest one that has it: their twin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4, load_u4
from pmviewer.kernels.vector import dot, normalize, sub
from pmviewer.maps.photon_words import decode_direction, encode_power
from pmviewer.maps.record import decode_directions
from pmviewer.maps.search.kdtree import RECORD, PhotonKdTree
from pmviewer.maps.variant import ABSENT, with_mark

Kind = Literal["screen", "footprint", "average"]
KINDS: tuple[Kind, ...] = ("screen", "footprint", "average")

OF_TWIN = np.float32(-1.0)
"""In place of the importance of an importon that takes another one's."""

IMPORTON_DTYPE = with_mark(
    RECORD,
    "normals",
    [
        ("reach", np.int64),  # float32 (n,): how far the importance at an importon is used
        ("weight", np.int64),  # float32 (n,): Ψ
        ("farthest", np.float32),  # the largest reach
        ("sum_radius", np.float32),  # of `importance_sum`
    ],
)
"""What kernels see of an importance map: a kd-tree whose payload is normal, Γ and footprint importance."""
NO_IMPORTANCE = ABSENT
"""Stands for an importance map where there is none."""

_f4 = np.float32
_i8 = np.int64


@dataclass(frozen=True, eq=False)
class Importons:
    """Importons as they were traced: `positions` (n, 3) float32; `normals` (n,) uint32, codes of
    `pmviewer.maps.photon_words.encode_direction` of the surface on the side seen; `weights` (n,) float32, Ψ in pixels;
    `footprints` (n,) float32, importance 1/A of the pixel's footprint A, 0 where it is not known."""

    positions: NDArray[np.float32]
    normals: NDArray[np.uint32]
    weights: NDArray[np.float32]
    footprints: NDArray[np.float32]

    @property
    def n(self) -> int:
        """Of importons."""
        return len(self.weights)

    @property
    def bytes(self) -> int:
        """Of the arrays, without a tree."""
        return self.positions.nbytes + self.normals.nbytes + self.weights.nbytes + self.footprints.nbytes

    @staticmethod
    def joined(parts: list[Importons]) -> Importons:
        """All importons of the parts, in order."""
        return Importons(
            np.concatenate([p.positions for p in parts] or [np.empty((0, 3), np.float32)]),
            np.concatenate([p.normals for p in parts] or [np.empty(0, np.uint32)]),
            np.concatenate([p.weights for p in parts] or [np.empty(0, np.float32)]),
            np.concatenate([p.footprints for p in parts] or [np.empty(0, np.float32)]),
        )


@dataclass(frozen=True, eq=False)
class ImportanceMap:
    """An importance map. All arrays are in the order of the tree, which differs from that of the importons it was
    built from; `tree.index` tells their places there. `record` (1,) of IMPORTON_DTYPE is valid while this lives;
    `spikes`: importons whose footprint was left out. `screen` and `footprint` (n,) are both estimates, OF_TWIN where
    an importon takes another one's, and `ratio` brings the latter to the mean of the former."""

    tree: PhotonKdTree
    record: NDArray[np.void]
    reach: NDArray[np.float32]
    weights: NDArray[np.float32]
    spikes: int
    screen: NDArray[np.float32]
    footprint: NDArray[np.float32]
    ratio: float

    @property
    def n(self) -> int:
        """Of importons."""
        return self.tree.n

    @property
    def bytes(self) -> int:
        """Of the tree and what it keeps at each importon, for the stage store."""
        return self.tree.bytes + sum(a.nbytes for a in (self.reach, self.weights, self.screen, self.footprint))

    @property
    def positions(self) -> NDArray[np.float32]:
        """(n, 3) float32, scene units."""
        n = self.n
        return np.stack([self.tree.x[:n], self.tree.y[:n], self.tree.z[:n]], axis=1)

    @property
    def normals(self) -> NDArray[np.float32]:
        """(n, 3) float32 unit normals of the surface on the side seen."""
        return decode_directions(np.ascontiguousarray(self.tree.payload[:, 0]))

    @property
    def gamma(self) -> NDArray[np.float32]:
        """(n,) float32 importance Γ in pixels per unit area."""
        return np.ascontiguousarray(self.tree.payload[:, 1]).view(np.float32)

    def gamma_of(self, kind: Kind) -> NDArray[np.float32]:
        """(n,) float32 importance Γ by one of the estimates or their average, whichever the map uses."""
        gamma = np.zeros(self.n, np.float32)
        if self.n:
            number = KINDS.index(kind)
            fill_gamma(self.record, self.screen, self.footprint, self.reach, gamma, number, np.float32(self.ratio))
        return gamma

    def cloud(self, unit: float | None = None) -> tuple[NDArray[np.float32], float]:
        """The importons as photon records (n, 6) with the normal as direction and the importance as power: red Γ, green
        screen, blue footprint importance; and the power's unit: the mean of Γ unless given."""
        gamma = self.gamma
        if unit is None:
            unit = float(gamma.mean(dtype=np.float64)) if self.n else 0.0
            unit = unit if unit > 0 else 1.0
        rows = np.zeros((self.n, 6), np.float32)
        rows[:, :3] = self.positions
        words = rows.view(np.uint32)
        words[:, 3] = self.tree.payload[:, 0] & 0xFFFFFF00
        codes = np.empty((3, self.n), np.uint32)
        for values, row in zip((gamma, self.gamma_of("screen"), self.gamma_of("footprint")), codes, strict=True):
            _encode(values / np.float32(unit), row)
        words[:, 4], words[:, 5] = codes[0] | codes[1] << 16, codes[2]
        return rows, unit


def required_density(gamma: Any, M_r: float, pixel_area: float = 1.0) -> Any:
    """Photons per unit area that importance Γ asks for: Γ·M_r/A_pix (course guide, eq. 3.2).

    gamma: number or array, in pixels per unit area; M_r: photons wanted per pixel; pixel_area: that of a pixel in the
    units of the importance emitted, 1 for importons of `pmviewer.importance`.
    """
    return gamma * (M_r / pixel_area)


@kernel
def _encode(values, codes):
    for i in range(len(values)):
        codes[i] = encode_power(values[i])


@device
def twin_of(tree, n, screen, begin, end):
    """The nearest of importons begin … end−1 to importon `end` that has its importance and a similar normal n; −1
    without."""
    p = (load_f4(tree.x, end), load_f4(tree.y, end), load_f4(tree.z, end))
    best, least = _i8(-1), _f4(np.inf)
    for i in range(begin, end):
        if screen[i] < _f4(0.0):
            continue
        if dot(normalize(decode_direction(load_u4(tree.payload, 3 * i))), n) > _f4(0.9):
            way = sub((load_f4(tree.x, i), load_f4(tree.y, i), load_f4(tree.z, i)), p)
            d2 = dot(way, way)
            if d2 < least:
                least, best = d2, _i8(i)
    return best


@kernel
def fill_gamma(maps, screen, footprint, reach, gamma, kind, ratio):
    """Γ of all importons from the two estimates; those without one take their twin's."""
    tree = maps[0]
    for leaf in range(_i8(1) << tree.depth):
        begin, stop = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        for i in range(begin, stop):
            j = _i8(i)
            if screen[i] < _f4(0.0):
                n = normalize(decode_direction(load_u4(tree.payload, 3 * i)))
                j = twin_of(tree, n, screen, begin, i)
                reach[i] = reach[j]
            if kind == 0:
                gamma[i] = screen[j]
            elif kind == 1:
                gamma[i] = ratio * footprint[j]
            else:
                gamma[i] = _f4(0.5) * (screen[j] + ratio * footprint[j])
