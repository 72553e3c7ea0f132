"""Density control in the office (I5): photons stored, power kept, and how the picture differs.

At the defaults, for both methods, and as in the course guide (§3.7.2): one light pass serves all passes, a look-up
takes the k nearest. Compared are pictures made of the same photons by the same gather rays.

What sets two such pictures apart is mostly noise: fewer photons have more of it, in other places. It vanishes with the
passes, and the course guide compares finished pictures ("no visible differences"). So the target is the difference in
the mean over many pictures, the root of its mean square over pixels, from products of the differences of different
seeds, in which noise cancels (`deposited.bias`); the value is two standard errors above what was found. What noise
there is stands beside it: the error (relMSE) over that with all photons, which is the price of having fewer, and the
mean |ΔY| of one picture, where two with all photons and other seeds differ by so much. With one map for all passes its
noise stays, so that there the target is that |ΔY|.

Rules with 'nearest' are the source's own form (`importance.around`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from pmviewer.bench.measures.deposited import COLUMNS, CONTROL, Image, Measured, bias_of, measure, row, said
from pmviewer.bench.measures.error import reference
from pmviewer.bench.report import Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.settings.access import Settings, with_values

OFFICE = "office"
METHODS = ("gather", "progressive")
STEP = "density control, step"
CONTROLS: dict[str, dict[str, Any]] = {
    STEP: CONTROL,
    "density control, cosine": CONTROL | {"importance.acceptance": "cosine"},
}
OTHERS = "all, other seeds"
SOURCES = {f"{rule}, nearest": changes | {"importance.around": "nearest"} for rule, changes in CONTROLS.items()}
PASSES, SEEDS = 8, 4
"""Required densities grow from pass to pass (`importance.M_r`), so that later passes save fewer photons."""
QUICK_PASSES, QUICK_SEEDS = 4, 5
"""Of the default rule alone."""
FEW = 1
"""Seeds of the other rules, which decide no difference."""

DENSITY = 40.0
"""Constant density in photons per m² that stores about as many photons as importance does."""
CLASSICAL: dict[str, Any] = {
    "photons.renew": "once",
    "photons.N": 400_000,
    "estimate.lookup": "nearest",
    "estimate.k": 80,
}
CLASSICAL_PASSES, CLASSICAL_QUICK = 8, 2
CLASSICAL_RULES: dict[str, dict[str, Any]] = {
    rule: changes | {"importance.M_r": M_r} for (rule, changes), M_r in zip(CONTROLS.items(), (6.0, 4.0), strict=True)
} | {"constant density": {"importance.deposition": "constant density", "importance.density": DENSITY}}
"""The course guide's way, with the M_r at which the picture differs little: the default of 2 saves more."""


@dataclass(frozen=True)
class Case:
    """Rules that are compared with storing all, with the settings `base`."""

    base: dict[str, Any]
    rules: dict[str, dict[str, Any]]
    seeds: int
    passes: int

    @property
    def one_map(self) -> bool:
        """Whether one light pass serves all passes."""
        return "photons.renew" in self.base


def office(quick: bool, pool: WorkPool) -> tuple[list[list[Any]], list[Target]]:
    """Rows and targets of density control."""
    opened, target = open_scene(OFFICE), reference(OFFICE)
    seeds, passes = (QUICK_SEEDS, QUICK_PASSES) if quick else (SEEDS, PASSES)
    cases = [Case({"render.method": method}, CONTROLS | SOURCES, seeds, passes) for method in METHODS]
    passes = CLASSICAL_QUICK if quick else CLASSICAL_PASSES
    cases.append(Case({"render.method": "gather"} | CLASSICAL, CLASSICAL_RULES, 2, passes))
    rows: list[list[Any]] = []
    targets: list[Target] = []
    for case in cases:
        if quick:
            case = replace(case, rules={STEP: case.rules[STEP]})
        more = _compared(opened, target, case, pool)
        rows += more[0]
        targets += more[1]
    return rows, targets


def _compared(opened: OpenScene, target: Image, case: Case, pool: WorkPool) -> tuple[list[list[Any]], list[Target]]:
    """Rows and targets of a case's rules."""
    size, n = (target.shape[1], target.shape[0]), with_values(Settings(), case.base).photons.N
    method, seeds = case.base["render.method"], range(1, 1 + case.seeds)

    def made(changes: dict[str, Any], of: range) -> Measured:
        return measure(opened, case.base | changes, of, case.passes, pool, size)

    all_ = made({}, seeds)
    rows = [row(OFFICE, method, rule, n, some, all_, target) for rule, some in (("all", all_), (OTHERS, _turned(all_)))]
    rows[1][COLUMNS.index("in the mean %")] = math.nan  # the same pictures, whose mean is the same
    targets: list[Target] = []
    for rule, changes in case.rules.items():
        thinned = made(changes, seeds[:1] if case.one_map else seeds if rule == STEP else seeds[:FEW])
        rows.append(row(OFFICE, method, rule, n, thinned, all_, target))
        note = f"{OFFICE}, {said(case.base | changes)}"
        targets.append(Target("I5", 100 * thinned.power_off, 0.01, "% of the power", False, note))
        if rule == STEP or (case.one_map and rule in CONTROLS):
            targets += _targets(case, note, thinned, all_, [dict(zip(COLUMNS, cells, strict=True)) for cells in rows])
    return rows, targets


def _targets(
    case: Case, note: str, thinned: Measured, all_: Measured, rows: list[dict[str, Any]]
) -> tuple[Target, Target]:
    """Photons stored and how much the picture differs, by the rule of the last of `rows`, whose first two are of all
    photons and of other seeds."""
    all_row, others, made = rows[0], rows[1], rows[-1]
    error = f"error {made['relMSE'] / all_row['relMSE']:.3g} times that with all photons"
    fewer = Target("I5", 1 / made["of all"], 5.0, "× fewer photons", True, f"{note}, {case.passes} passes; {error}")
    apart = f"{made['difference %']:.3g} % with noise, {others['difference %']:.3g} % of other seeds"
    if case.one_map:
        return fewer, Target("I5", made["difference %"], 1.0, "% difference of pixels", False,
                             f"{note}, {case.passes} passes; {apart}")  # fmt: skip
    found = bias_of(thinned, all_)
    return fewer, Target("I5", found.at_most, 1.0, "% difference of pixels in the mean, at most", False,
                         f"{note}; {found.likely:.2g} % is likely, {case.seeds} seeds of {case.passes} passes; a "
                         f"picture: {apart}")  # fmt: skip


def _turned(all_: Measured) -> Measured:
    """The same pictures, each in the place of another seed's."""
    order = [*range(1, len(all_.images)), 0]
    return Measured(all_.images[order], all_.indirect[order], all_.held, all_.light, all_.cpu, all_.deposited)
