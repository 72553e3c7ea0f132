"""`pmviewer compare-importance`: the picture with importance and without."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmviewer.commands.options import EditOption, ParameterOption, SceneArgument, SearchOption, SetOption, ThreadsOption


def compare_importance(
    scene: SceneArgument,
    equal: Annotated[str | None, typer.Option(help="What is equal: photons (stored) or error.")] = None,
    passes: Annotated[int | None, typer.Option(min=1, help="Passes with importance.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="PNG file: both pictures and the table.")
    ] = None,
    reference: Annotated[
        str, typer.Option(metavar="FILE", help="EXR to measure against; auto: the scene's own if it fits; none.")
    ] = "auto",
    threads: ThreadsOption = None,
    set_: SetOption = None,
    edit: EditOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
) -> None:
    """Compare the picture with importance and without, at as many stored photons or at equal error."""
    from pmviewer.commands.comparing import compare_job
    from pmviewer.commands.job import load_job

    job = load_job(scene, set_ or [], define or [], edit or [])
    compare_job(job, output, equal=equal, passes=passes, reference=reference, threads=threads)
