"""A sweep's pictures, its sheet and its table."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Sequence
from typing import Any

from pmviewer.bench.report import BenchResult, Cell, format_number, print_result, to_csv, to_markdown
from pmviewer.commands.kept_pictures import Pixels, Row
from pmviewer.commands.picture_files import Outputs, PictureFiles, check_sizes
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.commands.series_steps import steps_on
from pmviewer.commands.sweep_plan import Sweep
from pmviewer.engine.comparison.reference import reference_for
from pmviewer.engine.frame import Frame
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.series.render import missing
from pmviewer.output.compare import Reference
from pmviewer.output.contact_sheet import grid_sheet
from pmviewer.output.files import write_file
from pmviewer.output.metric import metrics
from pmviewer.output.png import write_png

COUNTS = ("passes", "seconds", "CPU s", "photons")
ESTIMATE = "estimated relMSE"
ERRORS = ("relMSE", "relMSE, 0.1 % left out", "mean ratio", "block error")


def render_sweep(
    sweep: Sweep, outputs: Outputs, reference: str | None, threads: int | None, cluster: str | None = None
) -> None:
    """Render what is missing, on the `cluster` if one is named, print the table and write everything. Raises
    PmviewerError, before anything is rendered for a reference that does not fit all pictures."""
    plan = sweep.plan
    check_sizes(outputs, plan.pictures)
    target = None if reference is None else _reference(sweep, None if reference == "auto" else reference)
    measured = {} if target is None else {"reference": hashlib.sha256(target.image.tobytes()).hexdigest()[:32]}
    rows: list[Row] = []
    seen: list[Pixels] = []
    files, pool = PictureFiles(outputs, len(plan.pictures), measured), WorkPool(threads)
    try:
        with progress_bar(remaining=True) as bar, steps_on(cluster, threads, plan, bar) as steps:
            for picture, frame in missing(
                plan.opened, plan.pictures, pool, bar.update, files.is_there, steps, share=False
            ):
                pixels, row = files.take(picture, frame, lambda frame: _row(frame, target))
                rows.append(row)
                if outputs.sheet is not None and pixels is not None:
                    seen.append(pixels)
    finally:
        pool.close()
    result = _table(sweep, rows)
    print_result(result)
    if outputs.sheet is not None:
        write_png(outputs.sheet, grid_sheet(seen, sweep.rows, sweep.columns, [_figures(row) for row in rows]))
        print(f"wrote {outputs.sheet}: {len(rows)} pictures")
    if outputs.table is not None:
        text = to_csv(result) if outputs.table.suffix.lower() == ".csv" else to_markdown(result)
        write_file(outputs.table, text.encode(), (".csv", ".md"))
        print(f"wrote {outputs.table}: {len(rows)} rows")
    files.say()


def _reference(sweep: Sweep, source: str | None) -> Reference:
    """What all pictures are measured against. Raises SceneError and SettingError where it does not fit one of them."""
    checked: dict[Hashable, Reference] = {}
    for one in sweep.plan.pictures:
        seen = one.camera, one.free_camera.on, bool(one.edit.changes), one.render.filter
        if seen not in checked:
            checked[seen] = reference_for(source, sweep.plan.opened.scene, one)
    return next(iter(checked.values()))


def _row(frame: Frame, target: Reference | None) -> Row:
    """A picture's figures, by the table's columns; what is not known is None."""
    told = frame.statistics
    row: dict[str, Any] = dict(zip(COUNTS, (told.passes, told.seconds, told.cpu_seconds, told.emitted), strict=True))
    if target is not None:
        found = metrics(frame.image(), target.image)
        errors = found.relmse_all, found.relmse_drop, found.mean_ratio, found.block_error
        row |= dict(zip(ERRORS, errors, strict=True))
    row[ESTIMATE] = None if told.remaining is None else told.remaining.relmse
    return row


def _figures(row: Row) -> str:
    """What stands below a picture."""
    error = row.get(ERRORS[0])
    said = f"relMSE {format_number(error)}" if error is not None else ""
    if not said and row[ESTIMATE] is not None:
        said = f"relMSE about {format_number(row[ESTIMATE], 2)}"
    return "  ".join(part for part in (said, f"{row['seconds']:.2g} s") if part)


def _table(sweep: Sweep, rows: Sequence[Row]) -> BenchResult:
    names = list(rows[0])
    told = [["" if row[name] is None else row[name] for name in names] for row in rows]
    cells: list[list[Cell]] = [[*values, *figures] for values, figures in zip(sweep.values, told, strict=True)]
    return BenchResult(sweep.plan.opened.scene.name, [*sweep.names, *names], cells, [])
