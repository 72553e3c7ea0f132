"""`pmviewer render`: a picture without a window."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmviewer.commands.options import (
    CheckpointFileOption,
    CheckpointOption,
    ClusterOption,
    EditOption,
    KeepCheckpointOption,
    ParameterOption,
    ResumeOption,
    SceneArgument,
    SetOption,
    ThreadsOption,
)
from pmviewer.errors import SettingError
from pmviewer.heap import importing


def render(
    scene: SceneArgument,
    output: Annotated[
        list[Path], typer.Option("-o", "--output", help="To write: .exr, .png or .toml; may be repeated.")
    ],
    passes: Annotated[int | None, typer.Option(min=1, help="Passes to render.")] = None,
    time: Annotated[float | None, typer.Option(min=0.001, metavar="S", help="Seconds to render, by the clock.")] = None,
    error: Annotated[
        float | None,
        typer.Option(min=1e-7, max=10.0, metavar="E", help="Render until the relMSE is estimated to be below this."),
    ] = None,
    auto: Annotated[
        bool | None,
        typer.Option(
            "--auto/--as-set",
            help="Let a short trial choose the method and its numbers, or render as set. By default it chooses where "
            "--time or --error is given and no setting of the method.",
        ),
    ] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image size, for example 1280x720.")] = None,
    threads: ThreadsOption = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the random streams.")] = None,
    set_: SetOption = None,
    edit: EditOption = None,
    half: Annotated[bool, typer.Option(help="Half-precision EXR.")] = False,
    denoise: Annotated[
        bool, typer.Option("--denoise", help="Add the picture without its noise to EXR files, as the layer 'denoised'.")
    ] = False,
    define: ParameterOption = None,
    reference: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="EXR to print the error against; auto: the bundled scene's own."),
    ] = None,
    cluster: ClusterOption = None,
    stats: Annotated[bool, typer.Option(help="Print photons, rays, times and the energy ledger.")] = False,
    checkpoint: CheckpointOption = None,
    resume: ResumeOption = False,
    checkpoint_file: CheckpointFileOption = None,
    keep_checkpoint: KeepCheckpointOption = False,
) -> None:
    """Render to a file without a window; the result is what the window shows after the same passes."""
    with importing():
        from pmviewer.commands.checkpointing import Asked
        from pmviewer.commands.job import Stop, load_job
        from pmviewer.commands.rendering import render_job

    if passes is not None and time is not None:
        raise SettingError("--passes and --time exclude each other: give one of them.")
    if passes is not None and error is not None:
        raise SettingError("--passes and --error exclude each other: give one of them.")
    job = load_job(scene, set_ or [], define or [], edit or [])
    render_job(
        job,
        output,
        stop=Stop(passes, time, error, auto),
        size=size,
        threads=threads,
        seed=seed,
        half=half,
        denoise=denoise,
        reference=reference,
        stats=stats,
        checkpoints=Asked(checkpoint, checkpoint_file, resume, keep_checkpoint, if_cut_short=cluster is not None),
        cluster=cluster,
    )
