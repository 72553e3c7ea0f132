"""What a renderer counts while it works: photons, rays, seconds, memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.energy import EnergyLedger
from pmviewer.engine.pool import WorkPool
from pmviewer.photons.deposition.deposited import Deposited
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.render.counts import C_CACHED, C_CUT, C_DROPPED, C_GATHERED, C_RAYS, C_SAVED, C_SHADOW_RAYS
from pmviewer.state import State

NUMBERS = "emitted", "rays", "shadow_rays", "saved_rays", "cached", "cut", "gathered", "records", "cpu_seconds"
BY_NAME = "stored", "dropped", "estimates", "stage_seconds"
OF_LATEST = "stored_in_pass", "deposited", "radius", "map_bytes", "map_photons"


@dataclass
class Tally:
    """Sums over all passes, but for `stored_in_pass`, `deposited`, `radius`, `map_bytes` and `map_photons`: those of
    the latest. `shared` is what was counted of things made once for many passes, by what they are, with the first pass
    that needs them: of passes rendered in several places it counts once."""

    emitted: int = 0
    rays: int = 0
    shadow_rays: int = 0
    saved_rays: int = 0
    cached: int = 0
    cut: int = 0
    gathered: int = 0
    records: int = 0
    estimates: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    stored: dict[str, int] = field(default_factory=lambda: {"caustic": 0, "global": 0})
    stored_in_pass: dict[str, int] = field(default_factory=dict)
    deposited: dict[str, Deposited] = field(default_factory=dict)
    radius: dict[str, float] = field(default_factory=dict)
    stage_seconds: dict[str, float] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=lambda: {"photons": 0, "samples": 0})
    energy: EnergyLedger = field(default_factory=EnergyLedger)
    map_bytes: int = 0
    map_photons: int = 0
    shared: dict[str, tuple[int, Tally]] = field(default_factory=dict)
    workers: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Threads and passes of the workers of a cluster, by address."""
    in_parts: bool = False
    """Whether sums leave out what is shared, because `take` hands them on."""

    @contextmanager
    def once(self, name: str, index: int = 0) -> Iterator[None]:
        """What is counted meanwhile is of that name, made once, needed from pass `index` on."""
        before = self._swapped()
        yield
        made = self._swapped(before)
        self.shared[name] = index, made
        if not self.in_parts:
            self._sum(made)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """What is counted meanwhile counts for nothing."""
        latest = {name: getattr(self, name) for name in OF_LATEST}
        before, shared = self._swapped(), dict(self.shared)
        self.radius, self.deposited = dict(self.radius), dict(self.deposited)
        try:
            yield
        finally:
            self._swapped(before)
            self.shared = shared
            for name, value in latest.items():
                setattr(self, name, value)

    def take(self, index: int) -> Tally:
        """What was counted since the last `take`, of pass `index` alone, for `merge`; the sums begin anew. What is
        shared is told each time, as nobody knows which passes arrive."""
        part = self._swapped()
        part.shared = {name: (first, made) for name, (first, made) in self.shared.items() if first <= index}
        for name in OF_LATEST:
            value = getattr(self, name)
            setattr(part, name, dict(value) if isinstance(value, dict) else value)
        return part

    def merge(self, part: Tally) -> None:
        """Add what `take` gave elsewhere; seconds are the caller's."""
        self._sum(part)
        for name, (index, made) in part.shared.items():
            if name not in self.shared:
                self.shared[name] = index, made
                self._sum(made)
        for name in OF_LATEST:
            setattr(self, name, getattr(part, name))

    def _swapped(self, other: Tally | None = None) -> Tally:
        """The sums, which are those of `other` from now on, 0 without."""
        held, other = Tally(), other or Tally()
        for name in (*NUMBERS, *BY_NAME, "energy"):
            setattr(held, name, getattr(self, name))
            setattr(self, name, getattr(other, name))
        return held

    def _sum(self, part: Tally) -> None:
        for name in NUMBERS:
            setattr(self, name, getattr(self, name) + getattr(part, name))
        for name in BY_NAME:
            mine = getattr(self, name)
            for key, value in getattr(part, name).items():
                mine[key] = mine.get(key, 0) + value
        self.energy.merge(part.energy)

    def state(self) -> State:
        """All counts; of what is `shared` only that it has been counted."""
        counts = asdict(replace(self, shared={}, energy=EnergyLedger()))
        shared = {name: index for name, (index, _) in self.shared.items()}
        return State({**counts, "shared": shared, "energy": self.energy.state().numbers})

    def restore(self, state: State) -> None:
        """Go on counting from there. Raises ValueError where that is nothing counted."""
        for known in fields(self):
            value = state.number(known.name)
            if known.name == "deposited":
                value = {name: Deposited.from_numbers(of_map) for name, of_map in value.items()}
            elif known.name == "energy":
                value = EnergyLedger.restored(state.part("energy"))
            elif known.name == "shared":
                value = {name: (int(index), Tally()) for name, index in value.items()}
            elif known.name == "workers":
                value = {address: (int(threads), int(passes)) for address, (threads, passes) in value.items()}
            setattr(self, known.name, value)

    def timed(self, pool: WorkPool, stage: str, run: Callable[[], Any]) -> Any:
        """What `run` returns; the CPU seconds that the pool spends on it count for the stage."""
        before, pool.stage = pool.cpu_seconds, stage
        result = run()
        spent = pool.cpu_seconds - before
        self.stage_seconds[stage] = self.stage_seconds.get(stage, 0.0) + spent
        self.cpu_seconds += spent
        return result

    def add_photons(self, photons: PhotonMaps, lights: float) -> None:
        """Photons that have just been traced, from lights of that power in watts."""
        self.energy.add(photons.energy, lights)
        self.emitted += photons.emitted
        self.rays += photons.rays
        self.dropped["photons"] += photons.dropped
        self.stored_in_pass = {"caustic": len(photons.caustic), "global": len(photons.global_)}
        if len(photons.volume):
            self.stored_in_pass["volume"] = len(photons.volume)
        self.deposited = dict(photons.deposited)
        for name, count in self.stored_in_pass.items():
            self.stored[name] = self.stored.get(name, 0) + count

    def set_maps(self, radii: Mapping[str, float], size: int, photons: int) -> None:
        """The maps of the latest pass: radii of look-ups by name, bytes, and photons in the photon maps."""
        self.radius.update(radii)
        self.map_bytes, self.map_photons = size, photons

    def add_cache(self, records: int, size: int) -> None:
        """An irradiance cache of so many records and bytes."""
        self.records += records
        self.map_bytes += size

    def add_estimates(self, counts: Mapping[str, int]) -> None:
        """Estimates of gathers by what became of pixels (`pmviewer.engine.stages.estimation.Estimates.counts`)."""
        for name, count in counts.items():
            self.estimates[name] = self.estimates.get(name, 0) + count
        self.records += counts["gathered"]

    def add_counts(self, counts: NDArray[np.int64]) -> None:
        """Counts of an eye-pass kernel (`pmviewer.render.counts`)."""
        self.rays += int(counts[C_RAYS])
        self.shadow_rays += int(counts[C_SHADOW_RAYS])
        self.cached += int(counts[C_CACHED])
        self.cut += int(counts[C_CUT])
        self.gathered += int(counts[C_GATHERED])
        self.saved_rays += int(counts[C_SAVED])
        self.dropped["samples"] += int(counts[C_DROPPED])
