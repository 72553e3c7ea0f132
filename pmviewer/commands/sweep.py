"""`pmviewer sweep`: every combination of some settings, compared on a sheet and in a table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmviewer.commands.options import (
    ClusterOption,
    EditOption,
    ParameterOption,
    ResumeSeriesOption,
    SceneArgument,
    SetOption,
    ThreadsOption,
)
from pmviewer.errors import OutputError, SettingError


def sweep(
    scene: SceneArgument,
    vary: Annotated[
        list[str],
        typer.Option(
            metavar="NAME=A,B,C",
            help="A setting or edit and its values, or NAME=FROM..TO for --steps values. May be repeated: every "
            "combination is rendered. The last one goes along the columns of the sheet, all others along its rows.",
        ),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option("-o", "--output", help="Pictures (.png, .exr; numbered behind the name); may be repeated."),
    ] = None,
    sheet: Annotated[Path | None, typer.Option(metavar="FILE", help="All pictures on one sheet, a PNG file.")] = None,
    table: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Settings, times and errors of all pictures: .csv or .md.")
    ] = None,
    steps: Annotated[int, typer.Option(min=2, max=1000, help="Values of FROM..TO.")] = 4,
    reference: Annotated[
        str | None, typer.Option(metavar="FILE", help="EXR to print the errors against; auto: the scene's own.")
    ] = None,
    passes: Annotated[int | None, typer.Option(min=1, help="Passes to render for each.")] = None,
    time: Annotated[float | None, typer.Option(min=0.001, metavar="S", help="Seconds to render each.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image size, for example 1280x720.")] = None,
    resume: ResumeSeriesOption = False,
    cluster: ClusterOption = None,
    threads: ThreadsOption = None,
    set_: SetOption = None,
    edit: EditOption = None,
    define: ParameterOption = None,
) -> None:
    """Render every combination of some settings, and compare them: a sheet with labels, times and errors."""
    from pmviewer.commands.borrowing import check_cluster
    from pmviewer.commands.picture_files import Outputs
    from pmviewer.commands.rendering_sweep import render_sweep
    from pmviewer.commands.sweep_plan import load_sweep, plan_sweep

    if passes is not None and time is not None:
        raise SettingError("--passes and --time exclude each other: give one of them.")
    if not (output or sheet or table):
        raise OutputError("Nothing would be written: name files with -o, a sheet with --sheet or a table with --table.")
    check_cluster(cluster)
    outputs = Outputs(output or [], sheet, resume=resume, table=table)
    job = load_sweep(scene, (set_ or [], define or [], edit or []), passes, time, size)
    render_sweep(plan_sweep(job, vary, steps, threads), outputs, reference, threads, cluster)
