"""Rendering a job to files, with a progress bar."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pmviewer.commands.borrowing import borrowed, check_cluster, passes_of
from pmviewer.commands.checkpointing import NO_CHECKPOINTS, Asked, Keeper, checkpoints_of
from pmviewer.commands.choosing import Chosen, wants_choice, with_choice
from pmviewer.commands.job import DEFAULT_PASSES, Job, Stop, check_output, overrides
from pmviewer.commands.patience import patiently, print_warnings
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.commands.statistics import pass_report, remaining_report, statistics_report
from pmviewer.engine.ahead.beside import beside
from pmviewer.engine.comparison.reference import reference_for
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import OpenScene, arrangement_of, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.engine.wanted import wanted_of
from pmviewer.errors import SettingError
from pmviewer.output.compare import ERROR_COLUMNS, Reference, error_row
from pmviewer.output.diagnostic_views import DENOISED, HELD_WHILE_SHOWN
from pmviewer.output.frame_export import LAYERS, VOLUME_LAYERS, write_frame_exr, write_frame_png
from pmviewer.output.metric import metrics
from pmviewer.output.session_file import write_session
from pmviewer.progress import watched
from pmviewer.settings.access import Settings, with_values

if TYPE_CHECKING:  # Dask, which only those wait for who use it
    from pmviewer.engine.cluster.cluster import Cluster

FORMATS = (".exr", ".png", ".toml")
STOPS = {"render.time_limit": 0.0, "render.error": 0.0, "render.passes": DEFAULT_PASSES}
"""In a session file the number of passes alone says when to stop: it gives the same picture again."""


def render_job(
    job: Job,
    outputs: list[Path],
    *,
    stop: Stop | None = None,
    size: str | None = None,
    threads: int | None = None,
    seed: int | None = None,
    half: bool = False,
    denoise: bool = False,
    reference: str | None = None,
    stats: bool = False,
    checkpoints: Asked = NO_CHECKPOINTS,
    cluster: str | None = None,
) -> Frame:
    """Render and write the files; with a reference (a file or "auto") also print the error at passes 1, 2, 4, … and at
    the end; with `stats` photons, rays, times and the energy ledger.

    `denoise` adds the picture without its noise as a layer of EXR files; `checkpoints` are kept and gone on from as
    asked for; `cluster` renders the passes elsewhere (`pmviewer.engine.cluster`).

    Raises PmviewerError; refuses bad file names and references that don't fit before rendering.
    """
    for path in outputs:
        check_output(path, FORMATS)
    check_cluster(cluster)
    stop = stop or Stop()
    settings = with_values(job.settings, overrides(stop.passes, stop.seconds, size, seed, job.passes, stop.error))
    with checkpoints_of(checkpoints, job, outputs) as keeper:
        with patiently() as tell, watched(tell, threads=threads):
            opened = open_scene(job.scene, job.parameters, arrangement_of(settings), beside(settings, threads))
        print_warnings(opened.scene.warnings, opened.scene.dropped)
        target = None
        if reference is not None:
            target = reference_for(None if reference == "auto" else reference, opened.scene, settings)
        view = _view(settings, opened)
        if denoise and (reason := inactive_reason(f"display.view={DENOISED}", settings, opened.traits)) is not None:
            raise SettingError(f"--denoise: {reason}")
        pool, choice = WorkPool(threads), Chosen(settings)
        try:
            if keeper is not None and keeper.found is not None:
                choice = Chosen(keeper.settings(settings))
            elif wants_choice(stop, job):
                choice = with_choice(opened, settings, pool, cluster is not None)
            if keeper is not None:
                keeper.trial(settings, choice.seconds)
            with borrowed(cluster, threads, opened, choice.settings) as elsewhere:
                frame = _rendered(opened, choice, pool, target, denoise, keeper, elsewhere)
        finally:
            pool.close()
        _report(frame, stats)
        for path in outputs:
            if path.suffix.lower() == ".exr":
                write_frame_exr(path, frame, half=half)
            elif path.suffix.lower() == ".toml":
                stored = with_values(frame.settings, STOPS)
                write_session(path, stored, job.scene, frame.statistics.passes, job.parameters)
            else:
                write_frame_png(path, frame, view=view)
            print(f"wrote {path}")
        if keeper is not None:
            keeper.written()
    return frame


def _report(frame: Frame, stats: bool) -> None:
    """What is printed of a picture that is finished."""
    found, remaining = frame.statistics, frame.statistics.remaining
    told = stats or frame.settings.render.error > 0 or (remaining is not None and remaining.bias is not None)
    if told and (said := remaining_report(found)):
        print(said)
    if said := pass_report(found):
        print(said)
    if stats:
        print(statistics_report(found))
    print_warnings(found.warnings, {})


def _rendered(
    opened: OpenScene,
    choice: Chosen,
    pool: WorkPool,
    target: Reference | None,
    denoise: bool,
    keeper: Keeper | None,
    elsewhere: Cluster | None,
) -> Frame:
    renderer = Renderer(opened, choice.settings, pool, StageStore(0))
    renderer.error.bias = choice.bias
    if keeper is not None:
        keeper.check(renderer)
    resumed = keeper is not None and keeper.found is not None
    if opened.scene.exposure is None and choice.settings.display.exposure == "auto" and not resumed:
        renderer.coarse_frame(0)  # as in the window it decides the exposure
    _run(renderer, pool, None if target is None else partial(_print_error, target), keeper, elsewhere)
    wanted = wanted_of(renderer.facts)
    return renderer.frame(1, replace(wanted, denoised=True) if denoise else wanted)


def _run(
    renderer: Renderer,
    pool: WorkPool,
    measure: Callable[[Renderer], None] | None,
    keeper: Keeper | None,
    elsewhere: Cluster | None,
) -> None:
    """Render until a stop rule holds; `measure` is called after passes 1, 2, 4, … and the last one."""
    with progress_bar(remaining=True) as bar:
        prepare(renderer.scene, renderer.settings, pool, bar.update)
        with (
            nullcontext() if keeper is None else keeper.watching(renderer),
            passes_of(renderer, elsewhere, bar) as step,
        ):
            bar.restart("rendering")
            while not renderer.finished:
                if not step():
                    if keeper is not None:
                        keeper.cut_short(renderer)
                    return
                if measure is not None and (renderer.passes & (renderer.passes - 1) == 0 or renderer.finished):
                    measure(renderer)
                bar.update(*_progress(renderer))
                if keeper is not None:
                    keeper.after_pass(renderer)


def _progress(renderer: Renderer) -> tuple[str, float]:
    """What is said of a pass that is through, and the share of all that is done by the rule that will stop it."""
    render, remaining = renderer.settings.render, renderer.error.latest
    share, said = renderer.passes / render.passes, f"pass {renderer.passes}"
    if render.time_limit > 0:
        share = max(share, renderer.tally.seconds / render.time_limit)
    if render.error > 0 and remaining is not None:
        share, said = max(share, render.error / remaining.relmse), f"{said}, relMSE {remaining.relmse:.1e}"
    return said, min(share, 1.0)


def _view(settings: Settings, opened: OpenScene) -> str:
    """The view to write as PNG; what the window alone draws gives the image. Raises SettingError for a diagnostic view
    that has nothing to show."""
    view = settings.display.view
    if view in HELD_WHILE_SHOWN:
        reason = inactive_reason(f"display.view={view}", settings, opened.traits)
        if reason is not None:
            raise SettingError(f"display.view = {view}: {reason}")
        return view
    return view if view in (*LAYERS, *VOLUME_LAYERS) else "beauty"


def _print_error(reference: Reference, renderer: Renderer) -> None:
    if renderer.passes == 1:
        print(ERROR_COLUMNS)
    measured = metrics(renderer.frame(0).image(), reference.image)
    print(error_row(renderer.passes, renderer.tally.seconds, measured))
