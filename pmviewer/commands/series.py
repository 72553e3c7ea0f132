"""`pmviewer series`: many pictures of one scene, as files, a film or a contact sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmviewer.commands.options import (
    ClusterOption,
    EditOption,
    ParameterOption,
    ResumeSeriesOption,
    SetOption,
    ThreadsOption,
)


def series(
    keys: Annotated[
        list[str],
        typer.Argument(help="A scene or session, or several sessions (.toml) of one scene: the keys of a film."),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            help="Pictures (.png, .exr; numbered behind the name) or a film (.mp4, .gif, .webp); may be repeated.",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FROM..TO",
            help="A setting or edit that changes from picture to picture: from one value to another (or over several, "
            "A..B..C), or NAME=A,B,C for these values. Several vary together, with --orbit and between keys too.",
        ),
    ] = None,
    orbit: Annotated[
        float | None, typer.Option(metavar="DEGREES", help="The camera goes round its target by that angle.")
    ] = None,
    pictures: Annotated[
        int | None, typer.Option(min=1, max=100_000, help="How many; 24 between keys if not given.")
    ] = None,
    sheet: Annotated[Path | None, typer.Option(metavar="FILE", help="All pictures on one sheet, a PNG file.")] = None,
    fps: Annotated[float, typer.Option(min=0.1, max=240.0, help="Pictures a second, of a film.")] = 24.0,
    resume: ResumeSeriesOption = False,
    passes: Annotated[int | None, typer.Option(min=1, help="Passes to render for each.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image size, for example 1280x720.")] = None,
    cluster: ClusterOption = None,
    threads: ThreadsOption = None,
    set_: SetOption = None,
    edit: EditOption = None,
    define: ParameterOption = None,
) -> None:
    """Render a series of pictures: a camera's way, an object's, or what a setting does."""
    from pmviewer.commands.borrowing import check_cluster
    from pmviewer.commands.picture_files import Outputs
    from pmviewer.commands.rendering_series import render_series
    from pmviewer.commands.series_plan import load_keys, plan_series

    check_cluster(cluster)
    outputs = Outputs(output or [], sheet, fps, resume)
    loaded = load_keys(keys, (set_ or [], define or [], edit or []), passes, size)
    render_series(plan_series(loaded, vary or [], orbit, pictures, threads), outputs, threads, cluster)
