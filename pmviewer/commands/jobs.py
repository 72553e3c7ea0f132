"""What the command line does without a window: rendering to files, scene reports."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from pmviewer.engine.cache import StageCache
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.energy import ENTRIES
from pmviewer.engine.frame import Frame, Statistics
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import SceneError, SettingError
from pmviewer.job import Job, check_output, overrides
from pmviewer.output.compare import ERROR_COLUMNS, Reference, error_row, load_reference
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.output.frame_export import LAYERS, write_frame_exr, write_frame_png
from pmviewer.output.metric import metrics
from pmviewer.progress import watched
from pmviewer.render.camera import resolve_camera, size_only
from pmviewer.scene.analysis import analyse
from pmviewer.scene.describe import describe
from pmviewer.scene.description import Scene
from pmviewer.scene.load import load_scene, reference_of
from pmviewer.scene.meshes.recentre import recentred
from pmviewer.settings.access import Settings, with_values

FORMATS = (".exr", ".png")
_PATIENCE = 2.0
"""Seconds that a scene may take to load without a word."""


def render_job(
    job: Job,
    outputs: list[Path],
    *,
    passes: int | None = None,
    seconds: float | None = None,
    size: str | None = None,
    threads: int | None = None,
    seed: int | None = None,
    half: bool = False,
    reference: str | None = None,
    stats: bool = False,
) -> Frame:
    """Render with a progress bar and write the files; with a reference (a file or "auto") also print the error at
    passes 1, 2, 4, … and at the end; with `stats` photons, rays, times and the energy ledger.

    Raises PmviewerError; refuses bad file names and references that don't fit before rendering.
    """
    for path in outputs:
        check_output(path, FORMATS)
    settings = with_values(job.settings, overrides(passes, seconds, size, seed, job.passes))
    with _patiently() as tell, watched(tell, threads=threads):
        opened = open_scene(job.scene, job.parameters, settings.light.rig)
    _print_warnings(opened.scene.warnings, opened.scene.dropped)
    target = None if reference is None else _reference(reference, opened.scene, settings)
    view = _view(settings, opened)
    pool = WorkPool(threads)
    try:
        renderer = Renderer(opened, settings, pool, StageCache(0))
        if opened.scene.exposure is None and settings.display.exposure == "auto":
            renderer.coarse_frame(0)  # as in the window it decides the exposure
        _run(renderer, pool, None if target is None else partial(_print_error, target))
        frame = renderer.frame(1)
    finally:
        pool.close()
    statistics = frame.statistics
    if statistics.cache_records:
        print(
            f"irradiance cache: {statistics.cache_records:,} records in the last pass, "
            f"{statistics.gathers_per_pixel:.3f} gathers a pixel and pass, {statistics.interpolated:.1%} interpolated"
        )
    if statistics.importons:
        stored = statistics.stored_in_pass["importons"]
        print(f"importance: {statistics.importons:,} importons, stored at {stored:,} places")
    for name, map_ in statistics.deposited.items():
        if map_.arrived:
            lost = map_.discarded_power / map_.arrived_power if map_.arrived_power > 0 else 0.0
            biased = f"; biased: {lost:.2%} of the power discarded" if lost > 0 else ""
            saved = f"{map_.saved_bytes / 2**20:.1f} MiB saved"
            print(f"{name} map: {map_.stored:,} of {map_.arrived:,} photons stored in the last pass, {saved}{biased}")
    caustic = statistics.deposited.get("caustic")
    if caustic is not None and caustic.converged is not None:
        found = caustic.converged
        print(
            f"caustic map: {1 - found.more:.1%} of its light converged, {found.dense:.1%} dense enough, "
            f"{found.spared:,} trajectories spared in the last pass"
            if found.photons
            else "caustic map: no photons, so nothing has converged"
        )
    if stats:
        print(statistics_report(statistics))
    _print_warnings(statistics.warnings, {})
    for path in outputs:
        if path.suffix.lower() == ".exr":
            write_frame_exr(path, frame, half=half)
        else:
            write_frame_png(path, frame, view=view)
        print(f"wrote {path}")
    return frame


@contextmanager
def _patiently() -> Iterator[Callable[[str], None]]:
    """Gives what prints the loader's stages once loading has taken `_PATIENCE` seconds, first the one it is in then."""
    lock, current, late = threading.Lock(), "", False

    def show(text: str) -> None:
        print(f"{text} …", file=sys.stderr, flush=True)

    def tell(text: str) -> None:
        nonlocal current
        with lock:
            current = text
            if late:
                show(text)

    def begin() -> None:
        nonlocal late
        with lock:
            late = True
            if current:
                show(current)

    timer = threading.Timer(_PATIENCE, begin)
    timer.daemon = True
    timer.start()
    try:
        yield tell
    finally:
        timer.cancel()


def _view(settings: Settings, opened: OpenScene) -> str:
    """The view to write as PNG; what the window alone draws gives the image. Raises SettingError for a diagnostic view
    that has nothing to show."""
    view = settings.display.view
    if view in DIAGNOSTICS:
        reason = inactive_reason(f"display.view={view}", settings, opened.traits)
        if reason is not None:
            raise SettingError(f"display.view = {view}: {reason}")
        return view
    return view if view in LAYERS else "beauty"


def _reference(source: str, scene: Scene, settings: Settings) -> Reference:
    """Read the reference, checked against the picture that will be rendered. Raises SceneError."""
    if settings.free_camera.on:
        raise SettingError("References are seen by the render camera: leave out free_camera.on, or --reference.")
    camera = resolve_camera(scene, settings.camera)
    path = reference_of(scene) if source == "auto" else Path(source)
    if path is None:
        raise SceneError(f"The scene '{scene.name}' has no reference of its own.", hint="Name an EXR file.")
    if source == "auto" and not camera.sees_like(resolve_camera(scene, size_only(settings.camera))):
        raise SceneError(
            "The scene's reference is seen by the scene's own camera: leave out the camera settings.", path
        )
    reference = load_reference(path)
    reference.check_size((camera.width, camera.height))
    return reference


def _print_error(reference: Reference, renderer: Renderer) -> None:
    if renderer.passes == 1:
        print(ERROR_COLUMNS)
    measured = metrics(renderer.frame(0).image(), reference.image)
    print(error_row(renderer.passes, renderer.tally.seconds, measured))


def _run(renderer: Renderer, pool: WorkPool, measure: Callable[[Renderer], None] | None) -> None:
    """Render until a stop rule holds; `measure` is called after passes 1, 2, 4, … and the last one."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    render = renderer.settings.render
    by_time = render.time_limit > 0
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    # rich would turn what is printed meanwhile to its own console: right on a terminal, wrong for a redirected stdout.
    shown = sys.stdout.isatty()
    with Progress(*columns, console=console, transient=not console.is_terminal, redirect_stdout=shown) as progress:
        bar = progress.add_task("preparing", total=1.0)
        prepare(
            renderer.scene,
            renderer.settings,
            pool,
            lambda text, share: progress.update(bar, description=text, completed=share),
        )
        progress.reset(bar, total=1.0, description="rendering")
        while not renderer.finished:
            renderer.step()
            if measure is not None and (renderer.passes & (renderer.passes - 1) == 0 or renderer.finished):
                measure(renderer)
            share = renderer.tally.seconds / render.time_limit if by_time else renderer.passes / render.passes
            progress.update(bar, completed=min(share, 1.0), description=f"pass {renderer.passes}")


def _print_warnings(warnings: Iterable[str], dropped: Mapping[str, int]) -> None:
    for warning in warnings:
        print(f"pmviewer: warning: {warning}", file=sys.stderr)
    for reason, count in dropped.items():
        print(f"pmviewer: warning: {count} × {reason} left out", file=sys.stderr)


def statistics_report(s: Statistics) -> str:
    """Text of `pmviewer render --stats`."""
    rows = [("passes", f"{s.passes:,}"), ("rays", f"{s.rays:,}"), ("rendering time", f"{s.seconds:.2f} s")]
    rows += [(f"CPU time, {stage}", f"{seconds:.2f} s") for stage, seconds in s.stage_seconds.items()]
    if s.emitted:
        rows.append(("photons emitted", f"{s.emitted:,}"))
        rows += [(f"photons in the {name} map", f"{count:,}") for name, count in s.stored.items()]
        rows.append(("memory of the maps", f"{s.map_bytes / 2**20:.1f} MiB"))
    rows += [(f"{place} dropped, not finite", f"{count:,}") for place, count in s.dropped.items()]
    if s.energy is not None:
        rows.append(("energy emitted a pass", f"{s.energy.watts[0]:.6g} W"))
        for entry in ENTRIES[1:]:
            share, error = s.energy.share(entry), s.energy.share_error(entry)
            known = "" if math.isnan(error) else f" ± {error:.2%}"
            rows.append((f"energy {entry}", f"{share:.3%}{known}"))
        if s.energy.uncounted > 0:
            rows.append(("energy of test photons, not in the ledger", f"{s.energy.uncounted:.6g} W"))
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:{width}s}  {text}" for label, text in rows)


def scene_report(job: Job) -> str:
    """Text of `pmviewer info`: what is in the scene, what was ignored, which stages run."""
    scene = recentred(load_scene(job.scene, job.parameters, rig=job.settings.light.rig))
    plan = plan_of(job.settings, analyse(scene))
    rows = describe(scene)
    needed = [
        name
        for name, runs in (
            ("light pass", plan.photons),
            ("caustic map", plan.caustic_classes),
            ("global map", plan.global_classes),
            ("direct light", plan.direct),
            ("light choice by photons", plan.choice != "power"),
            ("final gather", plan.gather),
            ("irradiance cache", plan.cache),
            ("importance", plan.importance),
            ("path tracer", plan.path),
        )
        if runs
    ]
    rows.append((f"stages ({job.settings.render.method})", ", ".join(needed) or "none"))
    rows += [(f"skips {stage}", reason) for stage, reason in plan.skipped]
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:{width}s}  {text}" for label, text in rows)
