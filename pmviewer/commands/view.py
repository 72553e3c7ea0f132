"""`pmviewer view`: the window."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmviewer.commands.options import (
    DEFAULT_SCENE,
    ClusterOption,
    EditOption,
    ParameterOption,
    SceneArgument,
    SearchOption,
    SetOption,
    SnapshotOption,
    ThreadsOption,
)
from pmviewer.commands.render import render
from pmviewer.errors import WindowError

FALLBACK_PASSES = 64
"""Rendered to a file where no window can be opened."""


def view(
    scene: SceneArgument = DEFAULT_SCENE,
    set_: SetOption = None,
    edit: EditOption = None,
    threads: ThreadsOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
    snapshot: SnapshotOption = None,
    cluster: ClusterOption = None,
    listen: Annotated[bool, typer.Option("--listen", help="Let Python programs attach: pmviewer.attach().")] = False,
) -> None:
    """Open the window (the default command)."""
    from pmviewer.commands.job import load_job, with_snapshots
    from pmviewer.engine.cluster.address import check_address
    from pmviewer.settings.presets import given

    if cluster is not None:
        check_address(cluster)

    job = with_snapshots(load_job(scene, set_ or [], define or [], edit or []), snapshot or [])
    chosen = job.passes is not None or bool(given(job.settings, job.told))
    try:
        from pmviewer.library.attaching.listening import attachable
        from pmviewer.viewer.app import ViewerApp, run_viewer

        make = attachable(ViewerApp, listen)
        code = run_viewer(job.scene, job.settings, threads, job.parameters, job.snapshots, cluster, make, chosen=chosen)
    except WindowError as error:
        typer.echo(f"{error}", err=True)
        target = Path(f"{Path(job.scene).stem}.png")
        typer.echo(f"Rendering {FALLBACK_PASSES} passes to {target} instead.", err=True)
        render(
            scene,
            [target, target.with_suffix(".exr")],
            FALLBACK_PASSES,
            set_=set_,
            edit=edit,
            threads=threads,
            define=define,
            cluster=cluster,
        )
        code = 0
    raise typer.Exit(code)
