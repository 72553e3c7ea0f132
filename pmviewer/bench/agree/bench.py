"""`pmviewer bench agree`: random scenes by every method and by Mitsuba 3, and what does not agree."""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pmviewer.bench import peer
from pmviewer.bench.agree.features import GROUPS, features
from pmviewer.bench.agree.generate import DENSE_FROM, GLOWING_FROM, PROJECTED_FROM, STAGED_FROM, scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.ours import AROUND, METHODS, NEAREST_REACH, VIRTUAL
from pmviewer.bench.agree.pooled import SURE, Pooled, farthest_off, pooled
from pmviewer.bench.agree.results import Results
from pmviewer.bench.agree.shares import LOTS, MAIN, PANES, SCATTERING
from pmviewer.bench.agree.stages import FOLLOWED
from pmviewer.bench.agree.statistics import LEVEL, rejected
from pmviewer.bench.agree.triage import save, saved, smallest, without_all
from pmviewer.bench.agree.trial import FIRST, FORGIVEN, STAGES
from pmviewer.bench.agree.verdict import Comparison, Verdict
from pmviewer.bench.agree.workers import OWN_KERNELS, try_scenes
from pmviewer.bench.agree.xml import MAX_DEPTH, SIZE
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.errors import PmviewerError, SettingError

SCENES, QUICK_SCENES, SEED = 500, 12, 1
EXTRA = ((9, GLOWING_FROM), (9, DENSE_FROM), (9, PROJECTED_FROM), (9, STAGED_FROM))
"""How many scenes from which number on a whole run adds: media that emit, dense ones, projectors, and wide stages."""
SHRINK_TRIES, MOST_SHRUNK = 120, 20
OTHERS = ("estimation", *VIRTUAL)
"""Methods whose settings the notes tell."""


@dataclass(frozen=True)
class Disagreement:
    """What disagrees in a scene: its largest rejected comparison and all methods that take part; why, if that is known,
    and the file of the smallest scene that shows it."""

    index: int
    worst: Comparison | None
    methods: tuple[str, ...]
    text: str
    known: str = ""
    file: str = ""


def run(
    quick: bool = False,
    scenes: int | None = None,
    seed: int = SEED,
    first: int = 0,
    keep: Path | None = None,
    json: Path | None = None,
    again: bool = False,
) -> BenchResult:
    """Try the scenes `first` … `first` + `scenes` − 1 of `seed` and save what disagrees into `keep`, a folder beside
    `json` or a temporary one if not given. Where `scenes` is not given and `quick` is not asked for, scenes with media
    that emit, with dense ones and with projectors come on top.

    `json` takes each verdict as soon as it is there, and scenes whose verdicts are in it are not run; with `again`,
    those that other sources gave are.

    Raises PmviewerError without Mitsuba, OutputError where `json` can't be written.
    """
    count = (QUICK_SCENES if quick else SCENES) if scenes is None else scenes
    if count < 1 or seed < 0:
        raise SettingError(f"agree needs at least one scene and a seed from 0 on, found {count} and {seed}.")
    if not peer.installed():
        raise PmviewerError(peer.MISSING)
    started = time.perf_counter()
    results = Results(json, seed)
    beside = json.parent / f"{json.stem}-scenes" if json is not None else None
    folder = keep or beside or Path(tempfile.mkdtemp(prefix=f"agree-{seed}-"))
    folder.mkdir(parents=True, exist_ok=True)
    parts = ((count, first), *(EXTRA if scenes is None and not quick else ()))
    wanted = {index for n, begin in parts for index in range(begin, begin + n)}
    verdicts = results.kept(wanted, again)
    if verdicts:
        print(f"{len(verdicts)} of {len(wanted)} scenes are in {json}", file=sys.stderr, flush=True)
    for index, verdict in try_scenes(seed, sorted(wanted - verdicts.keys())):
        verdicts[index] = verdict
        results.keep(index, verdict)
        _tell(seed, index, verdict, len(verdicts), len(wanted), time.perf_counter() - started)
    found = judged(seed, verdicts, folder)
    return report(seed, verdicts, found, results.revisions(wanted), time.perf_counter() - started)


def _tell(seed: int, index: int, verdict: Verdict, done: int, count: int, seconds: float) -> None:
    doubts = [
        f"{c.method} {c.what} {c.outcome.ratio:.3f} (p {c.p:.0e}{', ' * bool(c.known)}{c.known})"
        for c in verdict.comparisons
        if c.final
    ]
    said = verdict.refused or ("in doubt: " + ", ".join(doubts) if doubts else "agrees")
    profile = scene_of(seed, index)["profile"]
    print(f"[{done}/{count}, {seconds:.0f} s] scene {index} ({profile}): {said}", file=sys.stderr, flush=True)


def judged(seed: int, verdicts: dict[int, Verdict], folder: Path) -> list[Disagreement]:
    """The disagreements of a run, explained or shrunk and saved; a scene that was refused is one too."""
    pairs = [(index, c) for index, verdict in sorted(verdicts.items()) for c in verdict.comparisons]
    fallen = rejected([c.p for _, c in pairs])
    by_scene: dict[int, list[Comparison]] = {}
    for (index, comparison), is_rejected in zip(pairs, fallen, strict=True):
        if is_rejected:
            by_scene.setdefault(index, []).append(comparison)
    found = [Disagreement(i, None, tuple(METHODS), v.refused) for i, v in sorted(verdicts.items()) if v.refused]
    for index, comparisons in by_scene.items():
        found.append(_judged(seed, index, comparisons, folder, len(found)))
    return found


def _judged(seed: int, index: int, comparisons: list[Comparison], folder: Path, shrunk_before: int) -> Disagreement:
    scene, salt = scene_of(seed, index), (seed, index)
    methods = tuple(dict.fromkeys(c.method for c in comparisons))
    unknown, known = [c for c in comparisons if not c.known], [c.known for c in comparisons if c.known]
    worst = max(unknown or comparisons, key=lambda c: (c.method == "path", abs(np.log(max(c.outcome.ratio, 1e-9)))))
    text = (
        f"{worst.method} against {worst.peer}, {worst.what}: ratio {worst.outcome.ratio:.4f}, p {worst.outcome.p:.1g}"
    )
    if not unknown:
        return Disagreement(index, worst, methods, text, known[0])
    name = f"scene_{seed}_{index}"
    if (path := saved(worst, folder, name)) is not None:  # by the run that this one goes on with
        return Disagreement(index, worst, methods, text, file=str(path))
    print(f"scene {index} disagrees: {text}; shrinking", file=sys.stderr, flush=True)
    if shrunk_before < MOST_SHRUNK:
        if worst.peer.startswith("Mitsuba"):
            scene = without_all(scene)  # or a known deviation might be what is left in the end
        scene = smallest(scene, worst, salt, SHRINK_TRIES)
    return Disagreement(index, worst, methods, text, file=str(save(scene, worst, folder, name)))


def report(
    seed: int, verdicts: dict[int, Verdict], found: list[Disagreement], revisions: str, seconds: float
) -> BenchResult:
    """The table by feature and method, disagreements, known deviations, the revisions at which scenes ran, targets."""
    open_ = [d for d in found if not d.known]
    by_feature: dict[str, set[int]] = {}
    for index in verdicts:
        for name in features(scene_of(seed, index)):
            by_feature.setdefault(name, set()).add(index)
    order = sorted(by_feature, key=lambda name: (GROUPS.index(name.partition(":")[0]), name))
    rows: list[list[Cell]] = [_row("all", set(verdicts), verdicts, found)]
    rows += [_row(name, by_feature[name], verdicts, found) for name in order]
    comparisons = [c for verdict in verdicts.values() for c in verdict.comparisons]
    notes = [f"scene {d.index}: {d.text}{f'; known: {d.known}' if d.known else ''}{f'; {d.file}' if d.file else ''}"
             for d in found]  # fmt: skip
    notes += [f"known deviation, {d.name}: {d.reason}" for d in DEVIATIONS]
    over_all = pooled(seed, verdicts)
    notes += map(str, over_all)
    notes += _settings_notes()
    notes.append(
        f"{len(comparisons)} comparisons of {sum(c.outcome.tests for c in comparisons)} tests; this run took "
        f"{seconds:.0f} s"
    )
    notes.append(f"scenes by revision: {revisions}")
    agreement = Target(
        "agreement", len(open_), 0, "scenes", False,
        f"scenes of seed {seed} that disagree, of {len(verdicts)} from {min(verdicts)} on; "
        f"{len(found) - len(open_)} more by known deviations; "
        f"at radius {STAGES[0].radius:g}–{STAGES[-1].radius:g} of the scene, N = {STAGES[0].photons:,}–"
        f"{STAGES[-1].photons:,}, max_depth {MAX_DEPTH}",
    )  # fmt: skip
    return BenchResult("Agreement on random scenes", COLUMNS, rows, [agreement, *_bias(over_all)], notes)


def _bias(over_all: list[Pooled]) -> list[Target]:
    """What no single scene shows; nothing where the scenes are too few to tell."""
    worst = farthest_off(over_all)
    if worst is None:
        return []
    note = f"the farthest off beyond {SURE:g} standard errors, {worst}"
    return [Target("agreement over scenes", 100 * worst.off, 100 * FORGIVEN * STAGES[-1].radius, "%", False, note)]


COLUMNS = ("feature", "scenes", "lit", *(f"{m} differs" for m in METHODS), "by known", "noise", "in doubt")


def _row(name: str, indices: set[int], verdicts: dict[int, Verdict], found: list[Disagreement]) -> list[Cell]:
    """Scenes with the feature, how many of them show light, those that disagree by method, the median standard error of
    a test, and the share of comparisons that needed a stage of fresh seeds."""
    mine = [d for d in found if d.index in indices]
    comparisons = [c for i in indices for c in verdicts[i].comparisons]
    noise = float(np.median([c.outcome.noise for c in comparisons])) if comparisons else 0.0
    doubt = sum(c.stage > FIRST + 1 for c in comparisons) / max(len(comparisons), 1)
    by_method = [sum(m in d.methods for d in mine if not d.known) for m in METHODS]
    lit = sum(verdicts[i].lit > 0 for i in indices)
    return [name, len(indices), lit, *by_method, sum(bool(d.known) for d in mine), noise, doubt]


def _settings_notes() -> list[str]:
    stages = "; ".join(
        f"{e.runs} runs{' more' * e.adds} of {e.spp} samples a pixel, photons {e.passes} passes of {e.photons:,} "
        f"at radius {e.radius:g}"
        for e in STAGES
    )
    return [
        f"{SIZE}² pixels; stages, with fresh seeds where not said otherwise, as long as there is doubt: {stages}",
        f"each scene is rendered by path, {', '.join(MAIN)} and, drawn by lot, one of {', '.join(LOTS)} (single step "
        f"or every vertex), those with media by all; one in {PANES} with panes by thin glass; one in {SCATTERING} is "
        "compared in paths of one scattering, too",
        f"photon methods may be off by {FORGIVEN:g} × this radius, {FORGIVEN * STAGES[-1].radius:.0%} of a block in "
        "the last stage: look-ups lose light at edges, in proportion to the radius",
        "weighted virtual lights: sums of light and of weights are compared before one is divided by the other, these "
        "with what gathering walks count",
        f"each scene whose number {OWN_KERNELS} divides runs kernels for what is in it alone, the others those for all "
        "kinds of materials, textures and lights",
        "Mitsuba renders every scene at scale 1: its rays leave surfaces by 9e-5 of a unit at least",
        f"radii are relative to the scene's, on wide stages to {AROUND:g} times that of what stands there; domes there "
        f"reflect nothing in the profiles {', '.join(FOLLOWED)}, where so narrow look-ups hardly meet their photons",
        f"nearest: estimate.lookup=nearest with k = 10 within {NEAREST_REACH:g} of these radii",
        *(f"{name}: {', '.join(f'{k}={v}' for k, v in METHODS[name].items())}" for name in OTHERS),
        f"a disagreement is one by Holm's correction at {LEVEL:g} over all comparisons of the run",
        "where point, spot or directional lights or projectors meet smooth mirrors, glass or coats, photon methods are "
        "compared with Mitsuba's particle tracer in the pixels that see none of these, or with each other if there are "
        "none",
    ]
