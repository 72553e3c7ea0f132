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

Office, density control: `density_control`. What a pass costs: `deposition_cost`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pmviewer.bench.measures.density_control import CLASSICAL, CONTROLS, FEW, METHODS, OFFICE, office
from pmviewer.bench.measures.deposited import COLUMNS, KELLER_WALD, Measured, measure, row, said, tell
from pmviewer.bench.measures.deposition_cost import costs
from pmviewer.bench.measures.error import reference
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.output.metric import block_means, z_test
from pmviewer.scene.arrays.flatten import LUMINANCE
from pmviewer.settings.access import Settings

ROOMS = "rooms_10x10"
SHARES = (1.0, 0.5, 0.25)
"""Trajectories of the curve of storing all, relative to the default."""
N = Settings().photons.N
CLAMP = "Keller-Wald, clamp"
RULES: dict[str, dict[str, Any]] = {
    CLAMP: KELLER_WALD,
    "Keller-Wald, discard": KELLER_WALD | {"importance.cut_off": "discard"},
    **CONTROLS,
}
Z_SEEDS, Z_SIZE, Z_PHOTONS = 32, 64, 50_000
FEW_SEEDS = 2
"""Of density control in the rooms, which decides no target."""


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
            rows.append(row(ROOMS, method, "all", round(share * N), some, curve[0], target))
        for rule, changes in RULES.items():
            thinned = made(changes, seeds[:FEW_SEEDS] if rule in CONTROLS else seeds)
            rows.append(row(ROOMS, method, rule, N, thinned, curve[0], target))
            if rule != CLAMP:
                continue
            for what, error in (("picture", Measured.error), ("indirect term", Measured.indirect_variance)):
                errors, held = [error(some, target) for some in curve], [some.held for some in curve]
                share = thinned.held / held_for(error(thinned, target), errors, held)
                setup = f"{said(values | changes)}, {size[0]} × {size[1]} pixels"
                note = f"{ROOMS}, {setup}: photons held at the same error of the {what}, over storing all"
                targets.append(Target("I4", share, 0.25, "×", False, note))
    return rows, targets


def unbiased(method: str, pool: WorkPool) -> list[Target]:
    """Z-test of the clamped rule, over Z_SEEDS seeds: of the picture's mean luminance, and of its 8 × 8 blocks."""
    opened, size = open_scene(ROOMS), (Z_SIZE, Z_SIZE)
    seeds = range(101, 101 + 2 * Z_SEEDS)
    base = {"render.method": method, "photons.N": Z_PHOTONS}
    all_ = measure(opened, base, seeds, 1, pool, size).images
    thinned = measure(opened, base | KELLER_WALD, seeds[:Z_SEEDS], 1, pool, size).images
    off, others = thinned - all_[:Z_SEEDS], all_[Z_SEEDS:]
    means = (off @ LUMINANCE).mean(axis=(1, 2))
    z = float(means.mean() / (means.std(ddof=1) / math.sqrt(Z_SEEDS)))
    a, b = (np.array([block_means(image) for image in images]) for images in (thinned, others))
    variances = a.var(axis=0, ddof=1) / Z_SEEDS, b.var(axis=0, ddof=1) / Z_SEEDS
    blocks = z_test(a.mean(axis=0), variances[0], b.mean(axis=0), variances[1], block=1)
    setup = f"{said(base | KELLER_WALD)}, {Z_SIZE} × {Z_SIZE} pixels"
    note = f"{ROOMS}, {setup}, {Z_SEEDS} seeds: against storing all"
    targets = [
        Target("I4", abs(z), 3.0, "σ", False, f"{note}, mean luminance"),
        Target("I4", blocks.p_value, 0.01, "", True, f"{note}, p-value of {blocks.blocks} blocks, max z "
               f"{blocks.max_z:.2f}"),
    ]  # fmt: skip
    for target in targets:
        tell(target.line())
    return targets


def run(quick: bool = False) -> BenchResult:
    """Measure all rules on both scenes."""
    pool = WorkPool()
    try:
        rows, targets = rooms(quick, pool)
        for method in METHODS:
            targets += unbiased(method, pool)
        more = office(quick, pool)
        targets += more[1] + costs(quick, pool)
    finally:
        pool.close()
    notes = [
        "photons in maps: of a pass, of the path classes that the method looks up; CPU light: importance, light pass "
        "and maps, CPU all: the whole pass, both relative to storing all in this run",
        "relMSE, indirect: variance of the indirect term and caustics between seeds; discarding is biased, and its "
        "bias, mean off, is not part of that",
        "difference: mean |ΔY| of pixels over the mean Y of the picture with all photons of the same light pass",
        "in the mean: of pixels after very many passes, the root of the mean square, by products of seeds; 0 where "
        "noise says less than nothing",
        f"{ROOMS}: density control with {FEW_SEEDS} seeds, the others with all; {OFFICE}: the default rule with all, "
        f"others with {FEW}",
        f"{OFFICE}: 320 × 240; N = {CLASSICAL['photons.N']:,}: {said(CLASSICAL)}; nearest: the source's own form of "
        "density control",
    ]
    return BenchResult("Deposition rules", COLUMNS, rows + more[0], targets, notes)
