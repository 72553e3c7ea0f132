"""`pmviewer shot`: a picture of the window."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pmviewer.commands.options import (
    EditOption,
    ParameterOption,
    SceneArgument,
    SearchOption,
    SetOption,
    SnapshotOption,
    ThreadsOption,
)
from pmviewer.errors import SettingError, WindowError

if TYPE_CHECKING:
    from pmviewer.commands.job import Job


def shot(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="PNG file to write.")],
    passes: Annotated[int | None, typer.Option(min=1, help="Passes to render before.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image size, for example 1280x720.")] = None,
    window: Annotated[bool, typer.Option("--window", help="The whole window instead of the picture.")] = False,
    window_size: Annotated[
        str | None, typer.Option(metavar="WxH[@SCALE]", help="Of the window and its interface, with --window.")
    ] = None,
    panel: Annotated[str | None, typer.Option(metavar="NAME", help="Panel in front, with --window: Snapshots.")] = None,
    pixel: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Pixel whose gather rays overlays.gather.show draws.")
    ] = None,
    pin: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="Pixel that is pinned: its photons, and the inspector with --window."),
    ] = None,
    hemisphere: Annotated[
        bool, typer.Option("--hemisphere", help="What a gather at the pinned pixel sees, instead of the picture.")
    ] = False,
    hold: Annotated[str, typer.Option(metavar="OBJECT", help="Object that has handles, with --window.")] = "",
    captions: Annotated[bool, typer.Option(help="Say in the picture which view it is.")] = True,
    threads: ThreadsOption = None,
    set_: SetOption = None,
    edit: EditOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
    snapshot: SnapshotOption = None,
) -> None:
    """Open the window, wait for the last pass, write the picture with all overlays, captions and legends, close it."""
    from pmviewer.commands.job import load_job, with_snapshots

    job = with_snapshots(load_job(scene, set_ or [], define or [], edit or []), snapshot or [])
    take_shot(
        job, output, passes, size, window, (pixel, pin, hold), captions, threads, panel or "", window_size, hemisphere
    )


def take_shot(
    job: Job,
    output: Path,
    passes: int | None,
    size: str | None,
    window: bool,
    shown: tuple[str | None, str | None, str],
    captions: bool,
    threads: int | None,
    panel: str = "",
    window_size: str | None = None,
    hemisphere: bool = False,
) -> None:
    """Open the window, take its picture (`pmviewer.viewer.shot`), close it. `shown`: of --pixel, --pin and --hold.
    Raises PmviewerError; WindowError without a display."""
    from pmviewer.commands.job import check_output, overrides
    from pmviewer.render.camera import resolve_camera
    from pmviewer.scene.load import load_scene  # numba; the window itself comes up before
    from pmviewer.settings.access import with_values
    from pmviewer.viewer.app import ViewerApp
    from pmviewer.viewer.shot import Shot
    from pmviewer.viewer.start import start_viewer

    check_output(output, (".png",))
    if hemisphere and shown[1] is None:
        raise SettingError("--hemisphere is of a pixel that is pinned: name it by --pin X,Y.")
    settings = with_values(job.settings, overrides(passes, None, size, None, job.passes))
    chosen, pinned = (_pixel(option, text) for option, text in zip(("--pixel", "--pin"), shown, strict=False))
    camera = resolve_camera(load_scene(job.scene, job.parameters, rig=settings.light.rig), settings.camera)
    shot = Shot(output, chosen, pinned, shown[2], panel, hemisphere)
    picture_size = None if window else (camera.width, camera.height)
    look: dict[str, Any] = {}
    if window and window_size is not None:
        look["window_size"], look["scale"] = _window_size(window_size)
    make = partial(ViewerApp, remember=False, shot=shot, picture_size=picture_size, captions=captions, **look)
    start_viewer(make, job.scene, settings, threads, job.parameters, snapshots=job.snapshots, clicks=False)
    if not shot.done:
        raise shot.error or WindowError("The window was closed before the picture was taken.")
    if shot.error is not None:
        raise shot.error
    print(f"wrote {output.absolute()}{shot.stored}")


def _window_size(text: str) -> tuple[tuple[int, int], float]:
    """Pixels of the window and scale of its interface. Raises SettingError."""
    from pmviewer.viewer.appearance import SCALES

    match = re.fullmatch(r"\s*(\d{3,5})\s*x\s*(\d{3,5})\s*(?:@\s*(\d(?:\.\d+)?))?\s*", text)
    scale = float(match[3] or 1) if match else 0.0
    if not match or scale not in SCALES:
        scales = ", ".join(f"{one:g}" for one in SCALES)
        raise SettingError(
            f"--window-size {text} is no size of a window: write WxH or WxH@SCALE, for example 2560x1440@2; scales are "
            f"{scales}."
        )
    return (int(match[1]), int(match[2])), scale


def _pixel(option: str, text: str | None) -> tuple[int, int] | None:
    """The pixel that an option names, if it was given."""
    if text is None:
        return None
    match = re.fullmatch(r"\s*(\d{1,6})\s*,\s*(\d{1,6})\s*", text)
    if not match:
        raise SettingError(f"{option} {text} is not a pixel: write X,Y, for example 120,80.")
    return int(match[1]), int(match[2])
