"""The benches by name. A bench is a function `run(quick: bool, …) -> BenchResult`, imported when it is called."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from pathlib import Path

from pmviewer.bench.report import BenchResult, print_result, to_csv, to_markdown
from pmviewer.errors import SettingError
from pmviewer.output.files import check_target, write_file

BENCHES: dict[str, tuple[str, str]] = {
    "rays": ("Rays per second against Embree (P6)", "pmviewer.bench.measures.rays:run"),
    "instances": ("Rays through instances against the scene written out (X3)", "pmviewer.bench.measures.instances:run"),
    "lookup": ("Photon look-ups against scipy's cKDTree (P7)", "pmviewer.bench.measures.lookup:run"),
    "combined": (
        "Several photon maps: bias and noise of the combined look-up (M4)",
        "pmviewer.bench.measures.combined:run",
    ),
    "photons": ("Photons per second and bytes per photon (P8, P13)", "pmviewer.bench.measures.photons:run"),
    "error": ("Error against CPU time on the bundled scenes (P1–P5)", "pmviewer.bench.measures.error:run"),
    "auto": ("Automatic mode: against Mitsuba, and errors asked for (P17, P21)", "pmviewer.bench.measures.auto:run"),
    "mitsuba": ("Agreement with Mitsuba 3 on the same files, block by block", "pmviewer.bench.measures.mitsuba:run"),
    "agree": ("Random scenes: every method against Mitsuba 3 and the others", "pmviewer.bench.agree.bench:run"),
    "files": ("Real files of a folder: which open, and against Mitsuba 3", "pmviewer.bench.files.bench:run"),
    "hostile": (
        "Broken files by the thousand: errors in words, bounded time and memory",
        "pmviewer.bench.hostile.bench:run",
    ),
    "coherence": ("Photons kept when one of three glasses moves (T2)", "pmviewer.bench.measures.coherence:run"),
    "lights": ("Shadow rays by choice of lights (R2)", "pmviewer.bench.measures.lights:run"),
    "shadows": ("Shadow rays saved by shadow photons (T8)", "pmviewer.bench.measures.shadows:run"),
    "latency": ("Slider to first new frame (P9)", "pmviewer.bench.measures.latency:run"),
    "preview": (
        "What the window shows after a change: error over time (P18)",
        "pmviewer.bench.measures.preview:run",
    ),
    "start": ("Start to first image, cold and warm (P10)", "pmviewer.bench.measures.start:run"),
    "unused": ("Cost of what a scene does not use (P14)", "pmviewer.bench.measures.unused:run"),
    "window": ("Frames per second while computing (P11)", "pmviewer.bench.measures.window:run"),
    "actions": (
        "A thousand random actions in the window: nothing is lost",
        "pmviewer.bench.measures.actions:run",
    ),
    "guide": ("Directions of gather rays: variance at equal rays (R4)", "pmviewer.bench.measures.guide:run"),
    "corners": ("Secondary gathering: error at edges and elsewhere (R5)", "pmviewer.bench.measures.corners:run"),
    "cache": ("Irradiance cache against the plain final gather (R6)", "pmviewer.bench.measures.irradiance_cache:run"),
    "estimation": (
        "Estimated and reprojected gathers against the plain one and the cache (R7, R8)",
        "pmviewer.bench.measures.estimation:run",
    ),
    "gather": ("Radiance photons against the plain final gather (R3)", "pmviewer.bench.measures.gather:run"),
    "denoise": ("Denoised pictures: error against time (P16)", "pmviewer.bench.measures.denoise:run"),
    "media": ("Media: formulas, against Mitsuba, error over time (T9, E7)", "pmviewer.bench.measures.media:run"),
    "lens": ("Lens and filters: circle of confusion, and against Mitsuba (R13)", "pmviewer.bench.measures.lens:run"),
    "dispersion": (
        "Dispersion: prism angles, white, paths and photons (T10)",
        "pmviewer.bench.measures.dispersion:run",
    ),
    "virtual-many": ("Very many virtual lights, few for each pixel (R10)", "pmviewer.bench.measures.virtual_many:run"),
    "virtual": ("Virtual lights: estimators against the plain sum (R10)", "pmviewer.bench.measures.virtual:run"),
    "series": ("Series: time saved on a camera's way, and flicker", "pmviewer.bench.measures.series:run"),
    "thin-glass": (
        "Thin glass ignored or tinted against exact caustics (R9)",
        "pmviewer.bench.measures.thin_glass:run",
    ),
    "importance": ("Importance against the path tracer, and its cost (I1)", "pmviewer.bench.measures.importance:run"),
    "deposition": (
        "Deposition rules: photons at equal error, power, cost (I4, I5)",
        "pmviewer.bench.measures.deposition:run",
    ),
    "emission": ("Guided emission: photons traced for the same error (I6)", "pmviewer.bench.measures.emission:run"),
    "stress": ("Extremes of every kind: finite, unbiased or said so, bounded", "pmviewer.bench.stress.suite:run"),
    "load": ("Opening large PLY, OBJ and STL files against Mitsuba and Embree", "pmviewer.bench.measures.load:run"),
    "projection": ("Caustic photons by projection maps (T7)", "pmviewer.bench.measures.projection:run"),
    "threads": (
        "Two threads against one, serial share by stage (P19)",
        "pmviewer.bench.measures.threads:run",
    ),
    "checkpoint": (
        "Renderings killed and resumed, full disks, damaged files, cost (X5)",
        "pmviewer.bench.measures.checkpoint:run",
    ),
    "cluster": (
        "Passes on a cluster: faults, memory, throughput against one process (X5)",
        "pmviewer.bench.measures.cluster:run",
    ),
    "all": ("Every bench, each in its own process, within 40 minutes", "pmviewer.bench.measures.everything:run"),
    "report": ("The page of what bench all has found", "pmviewer.bench.measures.everything:report"),
}
"""Name: what it measures, and where its function is."""


def run_bench(
    name: str,
    quick: bool = False,
    csv_path: Path | None = None,
    markdown_path: Path | None = None,
    options: Mapping[str, object] | None = None,
) -> BenchResult:
    """Run a bench, print its table and targets, and write the table to the files asked for.

    `options` are further arguments of the bench's function; those that are None were not given. Raises SettingError for
    an unknown name and for options that the bench does not have, and OutputError for a file that can't be written; all
    of this is found before the bench runs.
    """
    if name not in BENCHES:
        raise SettingError(f"There is no bench '{name}'. There are {', '.join(BENCHES)}.")
    outputs = [(csv_path, to_csv, (".csv",)), (markdown_path, to_markdown, (".md",))]
    for path, _, suffixes in outputs:
        if path is not None:
            check_target(path, suffixes)
    module, _, function = BENCHES[name][1].partition(":")
    run = getattr(importlib.import_module(module), function)
    given = {key: value for key, value in (options or {}).items() if value is not None}
    for key in given:
        if key not in inspect.signature(run).parameters:
            raise SettingError(f"The bench '{name}' has no option --{key}.")
    result: BenchResult = run(quick=quick, **given)
    print_result(result)
    for path, text_of, suffixes in outputs:
        if path is not None:
            write_file(path, text_of(result).encode("utf-8"), suffixes)
    return result
