"""Automatic mode on other people's files: relMSE over Mitsuba's path tracer at equal CPU time (P17).

Mitsuba renders the same file at the same size (`pmviewer.bench.files.mitsuba_file`) to the depth of our default. No
file brings a reference: two of Mitsuba's pictures, each of many times that time, stand in for one. The error is the
mean of (I − A)(I − B)/(R² + ε), R their mean, without the noise of either. Where the program shows something else than
Mitsuba, that is part of its error; what opening said of what it leaves out or approximates stands in the row.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.files.bench import drawn
from pmviewer.bench.files.survey import candidates, surveys
from pmviewer.bench.measures.error import PEER
from pmviewer.bench.measures.timed import error_at, geometric_mean, name_of, picture, rendered, silent
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.auto.choose import Goal, choose
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.errors import PmviewerError, SettingError
from pmviewer.output.metric import EPSILON
from pmviewer.settings.access import Settings, with_values

LONGEST = 256
"""Pixels of the longer side at most."""
REFERENCE = 6.0
"""CPU seconds of each of the two references, over those of the comparison."""
COLUMNS = ("file", "triangles", "chosen", "trial", "relMSE", "expected", "Mitsuba's", "ours / Mitsuba's", "mean ratio",
           "said")  # fmt: skip
RATIO = COLUMNS.index("ours / Mitsuba's")
CHOSEN = (
    "; which gather rays gather again was chosen with three files, a coated ball, bricks and a staircase, second "
    "gathers with the cache with a living room, lights by what gloss reflects of them with Veach's plates, what bias "
    "noise may hide with the staircase, what a trial overlooks with the bricks, who gets adaptive samples with a box, "
    "the bricks and the staircase, what second gathers farther out bring with the bricks, which power of the radius "
    "the bias of gather rays has with a hall, that radii wait with eight files, how noise is taken to fall with ten, "
    "how wide look-ups are where photons lie far apart with a coated ball, five lamps, a hall, a living room and a "
    "staircase, what fewer photons have to promise with a living room, a staircase, Veach's room and three boxes, "
    "how far look-ups near edges are trusted with the living room, from how many times as many on photons aim at what "
    "is small with a ship under a dome, a coated torus, rings and two boxes, where the nearest photons are looked up, "
    "and how many, with the ship, a coffee pot and four random stages, how the covered part of discs is told with the "
    "bricks and a bathroom, how far second gathers go with the bricks, a staircase and a hall, and what photons shown "
    "directly have to promise with all of them"
)
"""ENOUGH and MOSTLY of `pmviewer.render.covered`, CORNERS, CACHE_CORNERS, LESS_BIAS, MORE_COST, RECORDS, EDGES, SHOWN
and NEAREST of `pmviewer.engine.auto.candidates`, `pmviewer.render.direct.by_lobes`, HIDDEN of
`pmviewer.engine.auto.widths`, `pmviewer.render.adaptive`, GATHERED_ORDER and STEADY of `pmviewer.engine.auto.bias`, the
powers of `pmviewer.engine.auto.model` and `measured`, HELD and MOST of `pmviewer.engine.auto.sparse`, LEAST_GAIN of
`pmviewer.photons.projection.aim`, FEWER_PHOTONS of `pmviewer.engine.auto.choose`, and NEIGHBOURS of
`pmviewer.engine.look_up_plan`, said in the targets' own lines."""


def error_against(image: NDArray[Any], references: NDArray[np.float64]) -> float:
    """relMSE of an image (h, w, 3) against two references (2, h, w, 3), whose noise is no part of it."""
    a, b = references
    return float(((image - a) * (image - b) / (references.mean(axis=0) ** 2 + EPSILON)).mean())


def over_peer(ratios: list[float], seconds: float, of: str, chosen: str) -> list[Target]:
    """P17 of errors over Mitsuba's, of what they are, and what was chosen with them."""
    note = f"relMSE over {PEER}, {peer.variant()}, at {seconds:g} CPU s, the trial counted{chosen}"
    return [
        Target("P17", geometric_mean(ratios), 0.08, "", False, f"{note}, geometric mean of {of}"),
        Target("P17", max(ratios, default=float("nan")), 0.3, "", False, f"{note}, worst of {of}"),
    ]


def _on_file(path: Path, name: str, seconds: float, pool: WorkPool) -> tuple[list[str | float | int], float]:
    """A row, and our error over Mitsuba's. Raises PmviewerError where either does not open it or shows nothing."""
    depth = Settings().render.max_depth
    theirs = peer.file_images(path, LONGEST, depth, seconds, REFERENCE * seconds)
    references = theirs["references"].astype(np.float64)
    if not (np.isfinite(references).all() and references.mean() > 0):
        raise PmviewerError("Mitsuba's picture is black or has no numbers: nothing to compare with.")
    curve = [error_against(image, references) for image in theirs["images"]]
    opened = open_scene(str(path))
    height, width = references.shape[1:3]
    base = with_values(Settings(), {"camera.width": width, "camera.height": height})
    choice = choose(opened, base, Goal(seconds=seconds), pool, silent)
    renderer = rendered(opened, with_values(base, dict(choice.values)), seconds - choice.trial.cpu_seconds, pool)
    image = picture(renderer)
    error, at = error_against(image, references), error_at(theirs["cpu"].tolist(), curve, seconds)
    faces = sum(len(getattr(shape.geometry, "faces", ())) for shape in opened.scene.all_shapes)
    said = "; ".join(opened.scene.warnings)
    row: list[str | float | int] = [name, faces, name_of(choice), choice.trial.cpu_seconds, error, choice.expected, at]
    return [*row, error / at, f"{image.mean() / references.mean():.4f}", said[:160]], error / at


def on_files(folder: Path, seconds: float, count: int | None, seed: int) -> BenchResult:
    """The Mitsuba files below the folder, or `count` of them. Raises SettingError where there are none, PmviewerError
    without Mitsuba."""
    variant = peer.variant()
    files = [path for path in candidates(folder) if path.suffix.lower() == ".xml"] if folder.is_dir() else []
    complete = drawn([path for path, found in surveys(files).items() if found.state == "complete"], count, seed)
    if not complete:
        raise SettingError(f"{folder} holds no complete Mitsuba file.")
    rows: list[list[str | float | int]] = []
    ratios: list[float] = []
    notes = [f"Mitsuba 3, {variant}; longer side {LONGEST} pixels at most; ours and theirs {seconds:g} CPU s, two "
             f"references of {REFERENCE * seconds:g} each"]  # fmt: skip
    pool = WorkPool()
    try:
        for path in complete:
            name = path.relative_to(folder).as_posix()
            try:
                row, ratio = _on_file(path, name, seconds, pool)
            except PmviewerError as error:
                notes.append(f"{name}: {error}")
                print(notes[-1], file=sys.stderr, flush=True)
                continue
            print(*row, file=sys.stderr, flush=True)
            rows.append(row)
            ratios.append(ratio)
    finally:
        pool.close()
    targets = over_peer(ratios, seconds, f"{len(ratios)} files", CHOSEN)
    return BenchResult(f"Automatic mode on {len(rows)} files", COLUMNS, rows, targets, notes)
