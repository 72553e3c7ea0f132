"""The comparison with and without importance as a job, with a progress bar."""

from __future__ import annotations

from pathlib import Path

from pmviewer.commands.job import Job, check_output
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.engine.comparison.importance_gain import Gain, compare
from pmviewer.engine.opened import OpenScene, arrangement_of, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.output.compare import Reference, load_reference
from pmviewer.output.frame_export import gain_sheet
from pmviewer.output.png import write_png
from pmviewer.render.camera import resolve_camera, size_only
from pmviewer.scene.load import reference_of
from pmviewer.settings.access import Settings, with_values


def compare_job(
    job: Job,
    output: Path | None,
    *,
    equal: str | None = None,
    passes: int | None = None,
    reference: str = "auto",
    threads: int | None = None,
) -> Gain:
    """Compare with a progress bar, print the table, write the sheet. Options override the settings `compare.*`.

    reference: an EXR file; "auto": the scene's own where it fits, "none": a longer run. Raises PmviewerError.
    """
    if output is not None:
        check_output(output, (".png",))
    asked = {"compare.equal": equal, "compare.passes": passes}
    settings = with_values(job.settings, {path: value for path, value in asked.items() if value is not None})
    opened = open_scene(job.scene, job.parameters, arrangement_of(settings))
    target = _reference(opened, settings, reference)
    pool = WorkPool(threads)
    try:
        gain = _compare(opened, settings, pool, target)
    finally:
        pool.close()
    print(table(gain))
    if output is not None:
        write_png(output, gain_sheet(gain), {"Title": opened.scene.name})
        print(f"wrote {output}")
    return gain


def _reference(opened: OpenScene, settings: Settings, source: str) -> Reference | None:
    if source == "none":
        return None
    camera = resolve_camera(opened.scene, settings.camera)
    if source != "auto":
        reference = load_reference(source)
        reference.check_size((camera.width, camera.height))
        return reference
    path = reference_of(opened.scene)
    own = camera.sees_like(resolve_camera(opened.scene, size_only(settings.camera)))
    if path is None or settings.free_camera.on or settings.camera.clip != "off" or not own:
        return None
    reference = load_reference(path)
    return reference if reference.size == (camera.width, camera.height) else None


def _compare(opened: OpenScene, settings: Settings, pool: WorkPool, target: Reference | None) -> Gain:
    truth = None
    if target is not None:
        truth = target.image, f"the reference {target.path.parent.name}/{target.path.name}"
    with progress_bar() as bar:
        return compare(opened, settings, pool, bar.update, truth)


def table(gain: Gain) -> str:
    """The comparison as text."""
    rows = gain.table()
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]
    return "\n".join([*lines, *gain.sentences()])
