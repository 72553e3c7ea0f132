"""`pmviewer info`: what is in a scene, and which stages it needs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import typer

from pmviewer.commands.options import EditOption, ParameterOption, SceneArgument, SearchOption

if TYPE_CHECKING:
    from pmviewer.commands.job import Job


def info(
    scene: SceneArgument,
    edit: EditOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
) -> None:
    """Say what is in a scene, what was ignored, and which stages it needs or skips; or what a checkpoint holds."""
    from pmviewer.commands.job import load_job

    if scene.lower().endswith(".checkpoint"):
        typer.echo(checkpoint_report(scene))
        return
    typer.echo(scene_report(load_job(scene, [], define or [], edit or [])))


def scene_report(job: Job) -> str:
    """What is in the scene, what was ignored, which stages run and which do not. Raises SceneError."""
    from pmviewer.engine.method import plan_of
    from pmviewer.scene.analysis import analyse
    from pmviewer.scene.describe import describe
    from pmviewer.scene.editing.apply import edited
    from pmviewer.scene.load import load_scene
    from pmviewer.scene.meshes.recentre import recentred

    scene = recentred(
        edited(load_scene(job.scene, job.parameters, rig=job.settings.light.rig), job.settings.edit.changes)
    )
    plan = plan_of(job.settings, analyse(scene))
    rows = describe(scene)
    rows.append((f"stages ({job.settings.render.method})", ", ".join(plan.running) or "none"))
    rows += [(f"skips {stage}", reason) for stage, reason in plan.skipped]
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:{width}s}  {text}" for label, text in rows)


def checkpoint_report(path: str) -> str:
    """What a checkpoint holds. Raises SceneError."""
    from pmviewer.output.checkpoint_header import read_header
    from pmviewer.settings.access import SETTINGS, flat

    head = read_header(path)
    made = head.program
    rows = [
        ("scene", head.scene),
        ("size", f"{head.width} x {head.height}"),
        ("passes", f"{head.passes:,} in {head.seconds:.1f} s"),
        ("written", time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(head.when))),
        ("program", f"pmviewer {made['version']} ({made['sources']}), numba {made.get('numba', 'unknown')}"),
        ("processor", made.get("processor", "unknown").partition(" ")[0]),
    ]
    rows += [(f"parameter {name}", value) for name, value in head.parameters.items()]
    changed = {name: value for name, value in flat(head.settings).items() if value != SETTINGS[name].default}
    rows += [(name, str(value)) for name, value in changed.items()]
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:{width}s}  {text}" for label, text in rows)
