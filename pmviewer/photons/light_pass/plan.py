"""What one light pass traces and in which units its photons are, before any is traced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.random import INDEPENDENT, SOBOL
from pmviewer.photons.bounces import most_bounces
from pmviewer.photons.emission.guided import Guided
from pmviewer.photons.emission.window import MOST_PIECES
from pmviewer.photons.light_pass.ledger import E_ABSORBED, E_DROPPED, E_EMITTED, E_ESCAPED, E_TERMINATED
from pmviewer.photons.light_pass.roulette import MOST_COPIES, RULES
from pmviewer.photons.light_pass.trace import LIGHT_PASS_DTYPE
from pmviewer.photons.projection.projected import NO_PROJECTION
from pmviewer.photons.projection.projection import Projection
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Photons

LARGEST_SCALE = 2.0**12
"""Most that indirect caustics count, in units of the caustic map, times what photons weigh that start beside what is
small: powers of stored photons end at 2¹⁷."""


@dataclass(frozen=True, eq=False)
class PassPlan:
    """One light pass. For kernels: `record` (1,) of LIGHT_PASS_DTYPE, `emission` (2,) that says how photons start.

    Of its `traced` trajectories the first `filling` fill the global map, in `global_unit` watts a unit of power; the
    first has the number `first_index` over all passes. `unit` watts of luminance are emitted; by projection maps the
    first share `surface_power`, the others `caustic_power`, and the first start with `covered` of them; direct caustics
    count `direct_scale` in the caustic map. `most_stored`: photons that a trajectory stores at most; `media`: the first
    trajectories also fill the volume map.
    """

    record: NDArray[np.void]
    emission: NDArray[np.void]
    traced: int
    filling: int
    first_index: int
    global_unit: float
    unit: float
    surface_power: float
    caustic_power: float
    covered: float
    direct_scale: float
    most_stored: int
    projected: bool
    guided: Guided | None
    media: bool

    @property
    def global_photons(self) -> int:
        """Trajectories that the power of global photons is shared by."""
        return self.filling if self.guided is None else self.guided.N

    @property
    def store_probability(self) -> float:
        """With which a global photon is stored."""
        return float(self.record[0]["store_probability"])

    def caustic_unit(self, n: int) -> float:
        """That of the caustic map when the first n trajectories are traced, of those that make caustics."""
        if self.guided is not None:
            return self.unit / self.guided.N
        if not self.projected:
            return self.unit / n
        first = min(n, self.filling)
        found = first / self.surface_power + ((n - first) / self.caustic_power if n > first else 0.0)
        return 1.0 / (found * self.direct_scale)

    def energy(self, ledgers: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the ledger of trajectories that fill the global map says of the scene's light, `PhotonMaps.energy`: they
        start where they can meet something, so that what no trajectory starts with has escaped."""
        entries = ledgers[0, [E_EMITTED, E_ABSORBED, E_ESCAPED, E_TERMINATED, E_DROPPED]]
        if self.guided is not None:
            return np.asarray(entries * (self.unit / self.guided.N))
        watts = entries * (self.covered / max(entries[0], 1.0))
        return np.asarray(watts + (self.unit - self.covered) * np.array([1.0, 0.0, 1.0, 0.0, 0.0]))


def trajectories(settings: Photons, N: int, has_specular: bool) -> tuple[int, int, float]:
    """Trajectories traced, trajectories that fill the global map, and the probability of storing a global photon.

    Trajectories that would fill the caustic map alone are not traced when nothing in the scene makes caustics.
    """
    if settings.q_rule == "photons":
        return N, N, settings.q
    filling = max(1, int(settings.q * N))
    return (N if has_specular else filling), filling, 1.0


def plan_pass(
    scene: FlatScene,
    settings: Photons,
    seed: int,
    first_index: int,
    N: int,
    has_specular: bool,
    projection: Projection | None,
    guided: Guided | None,
) -> PassPlan:
    """The plan of a pass of N trajectories.

    Photon powers are the same for all trajectories of a map: Φ/N in the caustic map, Φ/⌊qN⌋ in the global one
    (trajectory split) or Φ/(qN) (photon rule), Keller and Wald 2000, §2.4.

    With projection maps the first ⌊qN⌋ trajectories start where they can meet surfaces, with power W₁ in all, and
    the others where they can meet what makes caustics, with W₂. A light's path L S⁺ D is found by a = ⌊qN⌋/W₁
    trajectories a watt of the first kind and b = (N − ⌊qN⌋)/W₂ of the second, so that each of its photons has the
    power 1/(a + b). The second kind ends there: caustics after a diffuse bounce may come from anywhere, they are the
    first kind's, with 1/a.

    With `guided` emission, which takes no projection, its n trajectories are traced after its test photons, and all of
    them fill both maps: q is the probability of storing a global photon whatever its rule.
    """
    traced, filling, probability = trajectories(settings, N, has_specular)
    unit = scene.total_luminance
    emission, surface_power, caustic_power, covered, gain = NO_PROJECTION, unit, unit, unit, 1.0
    if projection is not None:
        emission, surface_power, caustic_power = projection.records, projection.surface_power, projection.caustic_power
        covered, gain = projection.covered, projection.gain
        if not caustic_power > 0:  # no light reaches what makes caustics
            traced = filling
    global_unit = surface_power / (filling * probability)
    if guided is not None:
        traced = filling = guided.n
        probability, emission = settings.q, guided.table.records
        global_unit = unit / (guided.N * probability)
    density = filling / surface_power
    direct_density = density + ((traced - filling) / caustic_power if traced > filling else 0.0)
    indirect_scale = direct_density / density if projection is not None else 1.0
    direct_scale = min(1.0, LARGEST_SCALE / (indirect_scale * gain))
    record = pass_record(settings, seed, first_index, filling, has_specular, scene.has_media)
    record["store_probability"] = probability
    record["only_direct"] = projection is not None or not settings.indirect_caustics
    record["indirect_scale"], record["direct_scale"] = indirect_scale * direct_scale, direct_scale
    record["unfound"] = scene.delta_lights and has_specular
    return PassPlan(
        record=record,
        emission=emission,
        traced=traced,
        filling=filling,
        first_index=first_index,
        global_unit=global_unit,
        unit=unit,
        surface_power=surface_power,
        caustic_power=caustic_power,
        covered=covered,
        direct_scale=direct_scale,
        most_stored=most_bounces(settings, scene.has_media)
        * (MOST_COPIES if settings.roulette == "equal" else 1)
        * (MOST_PIECES if guided is not None else 1),
        projected=projection is not None,
        guided=guided,
        media=scene.has_media,
    )


def pass_record(
    settings: Photons, seed: int, first_index: int, filling: int, has_specular: bool, media: bool
) -> NDArray[np.void]:
    """LIGHT_PASS_DTYPE (1,) of a pass whose first `filling` trajectories fill the global map and store all that
    arrives."""
    record = np.zeros(1, LIGHT_PASS_DTYPE)
    record["seed"], record["first_index"] = seed & 0xFFFFFFFF, first_index
    record["sequence"] = SOBOL if settings.sequence == "sobol" else INDEPENDENT
    record["max_bounces"], record["roulette"] = most_bounces(settings, media), RULES.index(settings.roulette)
    record["glossy"], record["global_trajectories"] = settings.glossy, filling
    record["caustics"], record["indirect_caustics"] = has_specular, settings.indirect_caustics
    record["store_probability"] = record["indirect_scale"] = record["direct_scale"] = 1.0
    return record
