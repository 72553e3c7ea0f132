"""What a scene doesn't use costs nothing (P14): the program as it comes against a configuration stripped by hand.

As it comes: default settings, what runs and what is compiled is worked out by `analyse`, `flatten` and `plan_of`.
Stripped: the table `NEEDS` below says by hand what a scene needs; the plan, the record's type and every switch follow
from it, and whatever the program would find out is given as a number. Both must render the same picture, bit for bit.

Other jobs on the machine make CPU seconds waver by several percent. Short runs of both sides alternate, in changing
order; the ratio of each pair is free of slow drifts, and the median of many pairs of the rest. Pairs are added until
the median is known to 0.4 %.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.method import EDGE_RAYS, MIRROR_RAYS
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.kernels.scene import scene_dtype
from pmviewer.maps.record import CAUSTIC, INDIRECT, INDIRECT_CAUSTIC
from pmviewer.render.camera import resolve_camera
from pmviewer.resources import data_folder
from pmviewer.settings.access import Settings, with_values

WIDTH = 160
"""Of the pictures; a run must be short, or too few pairs fit into the time."""
PHOTONS = 60_000
PASSES = 4
STORE_BYTES = 64 << 20
BOUND = 1.02
FEW = "how few trajectories tell radii was chosen with this scene among others"
"""FEW_TRACED of `pmviewer.engine.stages.spread`."""
EXACT = 0.004
"""The median's standard error at which a scene is done."""
FEWEST, MOST = 15, 150


@dataclass(frozen=True)
class Needs:
    """What a scene needs, said by hand: caustic maps, the choice of lights, light samples at a surface, camera rays
    along the outline of a light, several of them where mirrors and glass are seen, and the parts of the record that its
    kernels are compiled with (arguments of `scene_dtype`)."""

    caustics: bool = False
    choice: str = "power"
    samples: int = 2
    outline: bool = False
    mirrors: bool = False
    fields: tuple[str, ...] = ()


NEEDS: Mapping[str, Needs] = {
    "cornell_diffuse": Needs(outline=True),
    "cornell_caustic": Needs(caustics=True, mirrors=True, outline=True),
    "cornell_glossy": Needs(caustics=True, mirrors=True, outline=True, fields=("bsdfs",)),
    "cornell_lights": Needs(choice="distance", samples=4, outline=True),
    "cornell_water": Needs(caustics=True, mirrors=True, outline=True),
    # Smooth normals on diffuse rock: photons must know them, which the plain kernels don't.
    "cornell_fractal": Needs(outline=True, fields=("bsdfs", "instances")),
    "ring_caustic": Needs(caustics=True, mirrors=True, outline=True),
    "cardioid_010": Needs(caustics=True, mirrors=True, fields=("bsdfs",)),
    "colonnade": Needs(choice="distance", samples=4, fields=("bsdfs", "lights")),
    "corner_room": Needs(outline=True),
    "glossy_room": Needs(outline=True, fields=("bsdfs",)),
    "car_cabin": Needs(choice="distance", samples=4, caustics=True, mirrors=True, fields=("bsdfs",)),
    "rooms_10x10": Needs(choice="photons", samples=4, outline=True),
    "skylight_room": Needs(),
    "three_glasses": Needs(caustics=True, mirrors=True, fields=("bsdfs",)),
    "cognac": Needs(choice="distance", samples=4, caustics=True, mirrors=True, fields=("bsdfs",)),
    "museum": Needs(choice="distance", samples=4, caustics=True, mirrors=True, fields=("bsdfs", "textures")),
}
QUICK = ("cornell_diffuse", "cornell_caustic", "skylight_room", "cornell_lights")


def small(opened: OpenScene) -> dict[str, object]:
    """Settings of both sides: a small picture and few photons."""
    own = resolve_camera(opened.scene, Settings().camera)
    return {
        "camera.width": WIDTH,
        "camera.height": max(1, round(WIDTH * own.height / own.width)),
        "photons.N": PHOTONS,
    }


def stripped_plan(needs: Needs) -> Plan:
    """The stages of the progressive method in a scene with those needs."""
    indirect, caustics = 1 << INDIRECT, (1 << CAUSTIC | 1 << INDIRECT_CAUSTIC) if needs.caustics else 0
    return Plan(
        direct=True,
        followed_direct=True,
        caustic_mask=caustics,
        global_mask=indirect,
        global_classes=indirect,
        choice=needs.choice,
        light_samples=needs.samples,
        mirror_rays=MIRROR_RAYS if needs.mirrors else 1,
        edge_rays=EDGE_RAYS,
    )


def stripped_scene(opened: OpenScene, needs: Needs) -> OpenScene:
    """The scene with a record of those fields alone. Raises ValueError where the program's own lacks one of them."""
    dtype = scene_dtype(**dict.fromkeys(needs.fields, True))
    full = opened.flat.record
    missing = set(dtype.names or ()) - set(full.dtype.names or ())
    if missing:
        raise ValueError(f"{opened.scene.name} is said to need {sorted(missing)}, which its record lacks")
    record = np.zeros(1, dtype)
    for name in dtype.names or ():
        record[name] = full[name]
    return replace(opened, flat=replace(opened.flat, record=record))


class Side:
    """One of the two configurations of a scene."""

    def __init__(self, opened: OpenScene, settings: Settings, plan: Plan | None, pool: WorkPool) -> None:
        self.opened, self.settings, self.plan, self.pool = opened, settings, plan, pool
        prepare(opened, settings, pool, lambda text, share: None)

    def renderer(self) -> Renderer:
        """A new one with a stage store of its own, so that every run starts from nothing."""
        return Renderer(self.opened, self.settings, self.pool, StageStore(STORE_BYTES), plan=self.plan)

    def picture(self) -> np.ndarray:
        """The image (h, w, 3) after one pass."""
        renderer = self.renderer()
        renderer.step()
        return renderer.frame(0).image()

    def seconds(self) -> float:
        """CPU seconds of the whole process, all threads, for some passes."""
        start = time.process_time()
        renderer = self.renderer()
        for _ in range(PASSES):
            renderer.step()
        return time.process_time() - start


def sides(opened: OpenScene, needs: Needs, pool: WorkPool) -> tuple[Side, Side]:
    """As it comes, and stripped."""
    values = small(opened)
    automatic = with_values(Settings(), values)
    radius = Renderer(opened, automatic, pool, StageStore(0)).first_radius / opened.flat.radius
    by_hand = values | {
        "estimate.radius": float(radius),
        "direct.choice": needs.choice,
        "direct.shadow_photons": False,
        "gather.radiance_photons": "off",
        "estimate.differential": False,
        "photons.indirect_caustics": needs.caustics,
        "render.outline_rays": Settings().render.outline_rays if needs.outline else 0,
    }
    plan = replace(stripped_plan(needs), split=opened.traits.has_smooth_glass)  # glass is in use where there is some
    stripped = Side(stripped_scene(opened, needs), with_values(Settings(), by_hand), plan, pool)
    return Side(opened, automatic, None, pool), stripped


def median_ratio(first: Side, second: Side, budget: float) -> tuple[float, float, int, float]:
    """(median of first's over second's CPU seconds, its standard error, pairs, first's median seconds).

    `budget`: CPU seconds after which no further pair begins.
    """
    ratios: list[float] = []
    taken: list[float] = []
    start = time.process_time()
    error = np.inf
    while len(ratios) < FEWEST or (len(ratios) < MOST and error > EXACT and time.process_time() - start < budget):
        order = (first, second) if len(ratios) % 2 == 0 else (second, first)
        spent = {id(side): side.seconds() for side in order}
        ratios.append(spent[id(first)] / spent[id(second)])
        taken.append(spent[id(first)])
        # Of a median: 1.253 σ/√n, σ from the quartiles, which strays don't move.
        low, high = np.percentile(ratios, (25, 75))
        error = 1.253 * (high - low) / 1.349 / np.sqrt(len(ratios))
    return float(np.median(ratios)), float(error), len(ratios), float(np.median(taken))


def lacking() -> list[str]:
    """Bundled scenes that nobody has said the needs of."""
    return sorted(
        path.parent.name for path in data_folder("scenes").glob("*/scene.xml") if path.parent.name not in NEEDS
    )


def run(quick: bool = False) -> BenchResult:
    """Compare both configurations of every scene in `NEEDS`."""
    rows: list[list[Cell]] = []
    targets = []
    # One thread: waiting for the last tile costs nothing, and another job takes the other core.
    pool = WorkPool(1)
    started = time.perf_counter()
    try:
        for name, needs in NEEDS.items():
            if quick and name not in QUICK:
                continue
            came, stripped = sides(open_scene(name), needs, pool)
            same = np.array_equal(came.picture(), stripped.picture())
            came.seconds(), stripped.seconds()
            ratio, error, pairs, seconds = median_ratio(came, stripped, 8.0 if quick else 40.0)
            extra = set(came.opened.flat.record.dtype.names or ()) - set(stripped.opened.flat.record.dtype.names or ())
            rows.append([name, 1000 * seconds, f"{ratio:.4f}", f"{error:.4f}", pairs, len(extra), same])
            note = f"CPU time as it comes over stripped by hand, {name}, ± {error:.4f}; {FEW}"
            print(f"{name}: {ratio:.4f} ± {error:.4f} of {pairs} pairs", file=sys.stderr, flush=True)
            if not same:
                note += "; the pictures differ, so that the times don't compare"
            targets.append(Target("P14", ratio if same else float("nan"), BOUND, "", False, note))
    finally:
        pool.close()
    columns = ["scene", "CPU ms", "ratio", "±", "pairs", "fields too many", "same picture"]
    notes = [
        f"{WIDTH} pixels wide, {PHOTONS:,} photons, {PASSES} passes a run, whole process's CPU time, median of pairs",
        "not in the table: " + (", ".join(lacking()) or "none"),
        f"{time.perf_counter() - started:.0f} s in all",
    ]
    return BenchResult("What a scene doesn't use", columns, rows, targets, notes)
