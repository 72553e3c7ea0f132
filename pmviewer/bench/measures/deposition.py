"""Which photons the maps store: what each deposition rule saves and costs (I4, I5).

Rooms, Keller and Wald's rule: photons that the maps hold for the same error as with all photons stored. The curve of
the latter is interpolated at the rule's error, of the whole picture against the reference, and of the indirect term,
whose error is the variance between seeds, relative as relMSE is. Both count photons of the path classes that the method
looks up alone: what a rule saves by leaving out the others is no merit of importance.

Z-test: pictures with the rule against pictures with all photons. The mean luminance is compared seed by seed, where
light pass and camera rays are the same, so that the difference is the rule's alone. Blocks of pixels are compared with
pictures of other seeds: differences seed by seed are rare and strong there (photons that stand for fifty), far from
normal, and such a test would find their skewness. Pixels of a block see the same photons, so that its variance is
taken from its means over the seeds.

Office, density control: at the defaults, for both methods, and as in the course guide (§3.7.2): one light pass serves
all passes, a look-up takes the k nearest. Compared are pictures made of the same photons by the same gather rays; the
difference is the mean over all pixels of |ΔY|, in percent of the picture's mean luminance. It holds the noise of
having fewer photons: beside it stands how much two pictures with all photons differ that have other seeds. Rules with
'nearest' are the source's own form (`importance.around`).
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.measures.error import reference
from pmviewer.bench.report import BenchResult, Target, format_cell
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import EPSILON, block_means, relmse, z_test
from pmviewer.photons.deposition.deposited import Deposited
from pmviewer.scene.arrays.flatten import LUMINANCE
from pmviewer.settings.access import Settings, with_values

ROOMS, OFFICE = "rooms_10x10", "office"
METHODS = ("gather", "progressive")
SHARES = (1.0, 0.5, 0.25)
"""Trajectories of the curve of storing all, relative to the default."""
N = Settings().photons.N
KELLER_WALD = {"importance.map": "screen", "importance.deposition": "Keller-Wald"}
CONTROL = {"importance.map": "average", "importance.deposition": "density control"}
RULES: dict[str, dict[str, Any]] = {
    "Keller-Wald, clamp": KELLER_WALD,
    "Keller-Wald, discard": KELLER_WALD | {"importance.cut_off": "discard"},
    "density control, step": CONTROL,
    "density control, cosine": CONTROL | {"importance.acceptance": "cosine"},
}
CONTROLS = {rule: changes for rule, changes in RULES.items() if "control" in rule}
SOURCES = {f"{rule}, nearest": changes | {"importance.around": "nearest"} for rule, changes in CONTROLS.items()}
CLAMP, DISCARD = list(RULES)[:2]
Z_SEEDS, Z_SIZE = 32, 64
FEW_SEEDS = 2
"""Of density control in the rooms, which takes twenty times as long there and decides no target."""

OFFICE_DENSITY = 40.0
"""Constant density in photons per m² that stores about as many photons as importance does."""
CLASSICAL: dict[str, Any] = {
    "photons.renew": "once",
    "photons.N": 400_000,
    "estimate.lookup": "nearest",
    "estimate.k": 80,
}
"""The course guide's way; with the M_r at which the picture differs little: the default of 2 saves more."""
CLASSICAL_M_R = {"density control, step": 6.0, "density control, cosine": 4.0}
COLUMNS = ["scene", "method", "rule", "N", "photons in maps", "of all", "relMSE", "relMSE, indirect", "difference %",
           "mean off %", "discarded %", "CPU light", "CPU all"]  # fmt: skip

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """Pictures of some seeds by one rule: `images` and their `indirect` terms, caustics included, (seeds, h, w, 3);
    `held` photons in the maps of a pass; CPU seconds of `light` (importance, light pass, maps) and of everything, a
    pass; `deposited` of the last."""

    images: Image
    indirect: Image
    held: float
    light: float
    cpu: float
    deposited: dict[str, Deposited]

    @property
    def power_off(self) -> float:
        """Largest relative difference between stored and arrived power of a map."""
        maps = [d for d in self.deposited.values() if d.arrived_power > 0]
        return max((abs(d.stored_power / d.arrived_power - 1) for d in maps), default=0.0)

    @property
    def discarded(self) -> float:
        """Share of the arrived power that was discarded."""
        arrived = sum(d.arrived_power for d in self.deposited.values())
        return sum(d.discarded_power for d in self.deposited.values()) / arrived if arrived > 0 else 0.0

    def error(self, target: Image) -> float:
        """Mean relMSE of the seeds' pictures against `target` (h, w, 3)."""
        return float(np.mean([relmse(image, target) for image in self.images]))

    def indirect_variance(self, target: Image) -> float:
        """Variance of the indirect term between seeds, weighed as by relMSE."""
        return float((self.indirect.var(axis=0, ddof=1) / (target**2 + EPSILON)).mean())


def measure(
    opened: OpenScene, values: dict[str, Any], seeds: range, passes: int, pool: WorkPool, size: tuple[int, int]
) -> Measured:
    """Render the scene with each seed, `size` (width, height)."""
    settings = with_values(Settings(), values | {"camera.width": size[0], "camera.height": size[1]})
    prepare(opened, settings, pool, lambda text, share: None)
    small = with_values(settings, {"camera.width": 8, "camera.height": 8, "photons.N": 1000, "importance.N": 100})
    Renderer(opened, small, pool, StageStore(0)).step()  # what is left to load
    images, indirect, held, light, cpu = [], [], 0.0, 0.0, 0.0
    deposited: dict[str, Deposited] = {}
    for seed in seeds:
        renderer = Renderer(opened, with_values(settings, {"render.seed": seed}), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
            held += renderer.tally.map_photons / passes / len(seeds)
        frame, spent = renderer.frame(0), renderer.tally.stage_seconds
        images.append(frame.image().astype(np.float64))
        indirect.append(frame.image("indirect").astype(np.float64) + frame.image("caustic"))
        light += sum(spent.get(stage, 0.0) for stage in ("importance", "light pass", "maps")) / passes / len(seeds)
        cpu += renderer.tally.cpu_seconds / passes / len(seeds)
        deposited = renderer.tally.deposited
    return Measured(np.array(images), np.array(indirect), held, light, cpu, deposited)


def held_for(error: float, errors: list[float], held: list[float]) -> float:
    """Photons at which a falling curve of errors has that error, by log-log interpolation; beyond it, error ∝ 1/photons
    is assumed."""
    order = np.argsort(errors)
    e, n = np.array(errors)[order], np.array(held)[order]
    if error <= e[0]:
        return float(n[0] * e[0] / error)
    if error >= e[-1]:
        return float(n[-1] * e[-1] / error)
    return math.exp(np.interp(math.log(error), np.log(e), np.log(n)))


def _row(scene: str, method: str, rule: str, n: int, made: Measured, all_: Measured, target: Image) -> list[Any]:
    plain = all_.images[: len(made.images)]  # of the same seeds
    off, mean = made.images - plain, (plain @ LUMINANCE).mean()
    differs = 100 * float(np.abs(off @ LUMINANCE).mean() / mean)
    variance = made.indirect_variance(target) if len(made.images) > 1 else math.nan
    row: list[Any] = [scene, method, rule, n, round(made.held), made.held / all_.held, made.error(target), variance,
                      differs, 100 * float((off @ LUMINANCE).mean() / mean), 100 * made.discarded,
                      made.light / all_.light, made.cpu / all_.cpu]  # fmt: skip
    _tell(", ".join(f"{name} {format_cell(cell)}" for name, cell in zip(COLUMNS, row, strict=True)))
    return row


def _tell(line: str) -> None:
    """What is known so far, while the rest is measured."""
    print(line, file=sys.stderr, flush=True)


def rooms(quick: bool, pool: WorkPool) -> tuple[list[list[Any]], list[Target]]:
    """Rows and targets of the equal-error comparison, for both methods."""
    opened, full = open_scene(ROOMS), reference(ROOMS)
    target = block_means(full, 2)
    size = target.shape[1], target.shape[0]
    seeds, passes = (range(1, 5), 1) if quick else (range(1, 7), 2)
    rows: list[list[Any]] = []
    targets: list[Target] = []
    for method in METHODS:
        values: dict[str, Any] = {"render.method": method}

        def made(more: dict[str, Any], of: range = seeds, values: dict[str, Any] = values) -> Measured:
            return measure(opened, values | more, of, passes, pool, size)

        curve = [made({"photons.N": round(share * N)}) for share in SHARES]
        for share, some in zip(SHARES, curve, strict=True):
            rows.append(_row(ROOMS, method, "all", round(share * N), some, curve[0], target))
        for rule, changes in RULES.items():
            thinned = made(changes, seeds[:FEW_SEEDS] if rule in CONTROLS else seeds)
            rows.append(_row(ROOMS, method, rule, N, thinned, curve[0], target))
            if rule not in (CLAMP, DISCARD):
                continue
            for what, error in (("picture", Measured.error), ("indirect term", Measured.indirect_variance)):
                errors, held = [error(some, target) for some in curve], [some.held for some in curve]
                share = thinned.held / held_for(error(thinned, target), errors, held)
                if rule == CLAMP:
                    setup = f"{said(values | changes)}, {size[0]} × {size[1]} pixels"
                    note = f"{ROOMS}, {setup}: photons held at the same error of the {what}, over storing all"
                    targets.append(Target("I4", share, 0.25, "×", False, note))
    return rows, targets


def unbiased(method: str, pool: WorkPool) -> list[Target]:
    """Z-test of the clamped rule, over Z_SEEDS seeds: of the picture's mean luminance, and of its 8 × 8 blocks."""
    opened, size = open_scene(ROOMS), (Z_SIZE, Z_SIZE)
    seeds = range(101, 101 + 2 * Z_SEEDS)
    all_ = measure(opened, {"render.method": method}, seeds, 1, pool, size).images
    thinned = measure(opened, {"render.method": method, **KELLER_WALD}, seeds[:Z_SEEDS], 1, pool, size).images
    off, others = thinned - all_[:Z_SEEDS], all_[Z_SEEDS:]
    means = (off @ LUMINANCE).mean(axis=(1, 2))
    z = float(means.mean() / (means.std(ddof=1) / math.sqrt(Z_SEEDS)))
    a, b = (np.array([block_means(image) for image in images]) for images in (thinned, others))
    variances = a.var(axis=0, ddof=1) / Z_SEEDS, b.var(axis=0, ddof=1) / Z_SEEDS
    blocks = z_test(a.mean(axis=0), variances[0], b.mean(axis=0), variances[1], block=1)
    setup = f"{said({'render.method': method} | KELLER_WALD)}, {Z_SIZE} × {Z_SIZE} pixels"
    note = f"{ROOMS}, {setup}, {Z_SEEDS} seeds: against storing all"
    targets = [
        Target("I4", abs(z), 3.0, "σ", False, f"{note}, mean luminance"),
        Target("I4", blocks.p_value, 0.01, "", True, f"{note}, p-value of {blocks.blocks} blocks, max z "
               f"{blocks.max_z:.2f}"),
    ]  # fmt: skip
    for target in targets:
        _tell(target.line())
    return targets


def said(values: dict[str, Any]) -> str:
    """The settings that differ from the defaults, for a target's line."""
    return ", ".join(f"{path}={value}" for path, value in values.items())


def office(quick: bool, pool: WorkPool) -> tuple[list[list[Any]], list[Target]]:
    """Rows and targets of density control."""
    opened, target = open_scene(OFFICE), reference(OFFICE)
    size, passes = (target.shape[1], target.shape[0]), 2 if quick else 8
    rows: list[list[Any]] = []
    targets: list[Target] = []

    def compared(method: str, values: dict[str, Any], rules: dict[str, dict[str, Any]]) -> None:
        base = {"render.method": method} | values
        n = with_values(Settings(), base).photons.N
        all_ = measure(opened, base, range(1, 2), passes, pool, size)
        other = measure(opened, base, range(2, 3), passes, pool, size)
        rows.append(_row(OFFICE, method, "all", n, all_, all_, target))
        rows.append(_row(OFFICE, method, "all, other seed", n, other, all_, target))
        noise = rows[-1][COLUMNS.index("difference %")]
        for rule, changes in rules.items():
            made = measure(opened, base | changes, range(1, 2), passes, pool, size)
            rows.append(row := _row(OFFICE, method, rule, n, made, all_, target))
            note = f"{OFFICE}, {said(base | changes)}"
            targets.append(Target("I5", 100 * made.power_off, 0.01, "% of the power", False, note))
            if rule in CONTROLS:
                fewer, differs = 1 / row[COLUMNS.index("of all")], row[COLUMNS.index("difference %")]
                of_noise = f"; other seeds, all photons: {noise:.3g} %, {passes} passes"
                targets.append(Target("I5", fewer, 5.0, "× fewer photons", True, note))
                targets.append(Target("I5", differs, 1.0, "% difference of pixels", False, note + of_noise))

    for method in METHODS:
        compared(method, {}, CONTROLS | SOURCES)
    constant = {"importance.deposition": "constant density", "importance.density": OFFICE_DENSITY}
    rules = {rule: changes | {"importance.M_r": CLASSICAL_M_R[rule]} for rule, changes in CONTROLS.items()}
    compared("gather", CLASSICAL, rules | {"constant density": constant})
    return rows, targets


def run(quick: bool = False) -> BenchResult:
    """Measure all rules on both scenes."""
    pool = WorkPool()
    try:
        rows, targets = rooms(quick, pool)
        for method in METHODS:
            targets += unbiased(method, pool)
        more = office(quick, pool)
    finally:
        pool.close()
    notes = [
        "photons in maps: of a pass, of the path classes that the method looks up; CPU light: importance, light pass "
        "and maps, CPU all: the whole pass, both relative to storing all in this run",
        "relMSE, indirect: variance of the indirect term and caustics between seeds; discarding is biased, and its "
        "bias, mean off, is not part of that",
        "difference: mean |ΔY| of pixels over the mean Y of the picture with all photons of the same light pass",
        f"{ROOMS}: density control with {FEW_SEEDS} seeds, the others with all",
        f"{OFFICE}: 320 × 240; N = {CLASSICAL['photons.N']:,}: {said(CLASSICAL)}, importance.M_r="
        f"{' and '.join(f'{m:g}' for m in CLASSICAL_M_R.values())}; nearest: the source's own form of density control",
    ]
    return BenchResult("Deposition rules", COLUMNS, rows + more[0], targets + more[1], notes)
