"""The command line. Each command imports what it needs, so that `--help` and the window are quick."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from pmviewer import __version__
from pmviewer.errors import PmviewerError, SettingError, WindowError

DEFAULT_SCENE = "cornell_caustic"
FALLBACK_PASSES = 64

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    no_args_is_help=False,
    rich_markup_mode=None,
    help="Interactive previewer for photon-mapping global illumination.",
)

SceneArgument = Annotated[
    str,
    typer.Argument(help="A bundled scene's name, a scene file (.xml .glb .gltf .obj .ply .stl) or a session (.toml)."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a setting, for example photons.N=200000."),
]
ThreadsOption = Annotated[int | None, typer.Option(min=1, max=1024, help="Threads; all processors if not given.")]
ParameterOption = Annotated[
    list[str] | None,
    typer.Option(
        "--define",
        "-D",
        metavar="NAME=VALUE",
        help="A scene file's <default> parameter; scene, camera or variant of a glTF file.",
    ),
]


def _search(folders: list[Path] | None) -> list[Path] | None:
    if folders:
        from pmviewer.scene.load import search_also

        search_also(folders)
    return folders


SearchOption = Annotated[
    list[Path] | None,
    typer.Option("--search-path", metavar="FOLDER", callback=_search, expose_value=False,
                 help="Look here too for the files that a scene names."),
]  # fmt: skip


@app.command()
def view(
    scene: SceneArgument = DEFAULT_SCENE,
    set_: SetOption = None,
    threads: ThreadsOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
) -> None:
    """Open the window (the default command)."""
    from pmviewer.job import load_job

    job = load_job(scene, set_ or [], define or [])
    try:
        from pmviewer.viewer.app import run_viewer

        code = run_viewer(job.scene, job.settings, threads=threads)
    except WindowError as error:
        typer.echo(f"{error}", err=True)
        target = Path(f"{Path(job.scene).stem}.png")
        typer.echo(f"Rendering {FALLBACK_PASSES} passes to {target} instead.", err=True)
        render(scene, [target, target.with_suffix(".exr")], FALLBACK_PASSES, set_=set_, threads=threads, define=define)
        code = 0
    raise typer.Exit(code)


@app.command()
def render(
    scene: SceneArgument,
    output: Annotated[list[Path], typer.Option("-o", "--output", help="File to write, .exr or .png; may be repeated.")],
    passes: Annotated[int | None, typer.Option(min=1, help="Passes to render.")] = None,
    time: Annotated[float | None, typer.Option(min=0.001, metavar="S", help="Seconds to render.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image size, for example 1280x720.")] = None,
    threads: ThreadsOption = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the random streams.")] = None,
    set_: SetOption = None,
    half: Annotated[bool, typer.Option(help="Half-precision EXR.")] = False,
    define: ParameterOption = None,
    reference: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="EXR to print the error against; auto: the bundled scene's own."),
    ] = None,
    stats: Annotated[bool, typer.Option(help="Print photons, rays, times and the energy ledger.")] = False,
) -> None:
    """Render to a file without a window; the result is what the window shows after the same passes."""
    from pmviewer.commands.jobs import render_job
    from pmviewer.job import load_job

    if passes is not None and time is not None:
        raise SettingError("--passes and --time exclude each other: give one of them.")
    job = load_job(scene, set_ or [], define or [])
    render_job(
        job,
        output,
        passes=passes,
        seconds=time,
        size=size,
        threads=threads,
        seed=seed,
        half=half,
        reference=reference,
        stats=stats,
    )


@app.command()
def shot(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="PNG file to write.")],
    passes: Annotated[int | None, typer.Option(min=1, help="Passes to render before.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image size, for example 1280x720.")] = None,
    window: Annotated[bool, typer.Option("--window", help="The whole window instead of the picture.")] = False,
    pixel: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Pixel whose gather rays overlays.gather.show draws.")
    ] = None,
    captions: Annotated[bool, typer.Option(help="Say in the picture which view it is.")] = True,
    threads: ThreadsOption = None,
    set_: SetOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
) -> None:
    """Open the window, wait for the last pass, write the picture with all overlays, captions and legends, close it."""
    from pmviewer.job import load_job
    from pmviewer.viewer.shot import shot_job

    shot_job(load_job(scene, set_ or [], define or []), output, passes, size, window, pixel, captions, threads)


@app.command()
def compare(
    image: Annotated[Path, typer.Argument(help="An EXR file.")],
    reference: Annotated[Path, typer.Argument(help="The EXR file to compare it with, of the same size.")],
) -> None:
    """Print the error of a picture against a reference."""
    from pmviewer.output.compare import compare_files

    typer.echo(compare_files(image, reference))


@app.command("compare-importance")
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
    define: ParameterOption = None,
    search_path: SearchOption = None,
) -> None:
    """Compare the picture with importance and without, at as many stored photons or at equal error."""
    from pmviewer.commands.gain_job import gain_job
    from pmviewer.job import load_job

    job = load_job(scene, set_ or [], define or [])
    gain_job(job, output, equal=equal, passes=passes, reference=reference, threads=threads)


@app.command()
def scenes() -> None:
    """List the bundled scenes."""
    from pmviewer.scene.load import bundled_scenes

    for bundled in bundled_scenes():
        typer.echo(f"{bundled.name:18s} {bundled.title}")


@app.command()
def info(scene: SceneArgument, define: ParameterOption = None, search_path: SearchOption = None) -> None:
    """Say what is in a scene, what was ignored, and which stages it needs or skips."""
    from pmviewer.commands.jobs import scene_report
    from pmviewer.job import load_job

    typer.echo(scene_report(load_job(scene, [], define or [])))


@app.command()
def bench(
    name: Annotated[str, typer.Argument(help="A bench's name, or list.")] = "list",
    folder: Annotated[Path | None, typer.Argument(help="Of files: the folder with scene files.")] = None,
    quick: Annotated[bool, typer.Option(help="Fewer rounds and smaller inputs.")] = False,
    csv: Annotated[Path | None, typer.Option(help="Also write the table as CSV.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Also write the table as Markdown.")] = None,
    scenes: Annotated[
        int | None, typer.Option(min=1, help="Of agree, files and hostile: how many scenes or files.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of agree, files and hostile: which ones.")] = None,
    keep: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Of agree and hostile: where scenes go that fail.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of files: keep results here, and go on with those kept.")
    ] = None,
    sheet: Annotated[Path | None, typer.Option(metavar="FILE", help="Of files: all pictures as one PNG.")] = None,
) -> None:
    """Measure: a table, then a line for each target."""
    from pmviewer.bench.registry import BENCHES, run_bench

    if name == "list":
        for key, (description, _) in BENCHES.items():
            typer.echo(f"{key:10s} {description}")
        return
    options = {"folder": folder, "scenes": scenes, "seed": seed, "keep": keep, "json": json, "sheet": sheet}
    run_bench(name, quick, csv, markdown, options)


@app.command()
def settings() -> None:
    """List every setting with its default and range."""
    from pmviewer.settings.access import SETTINGS, range_text

    for path, entry in SETTINGS.items():
        typer.echo(f"{path} = {entry.default}   [{range_text(entry)}]\n    {entry.description}")


def main(arguments: list[str] | None = None) -> None:
    """Entry point: `pmviewer SCENE` means `pmviewer view SCENE`. Errors are one line and exit code 2."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["--version"]:
        print(f"pmviewer {__version__}")
        return
    commands = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    if not words or (words[0] not in commands and words[0] not in ("--help", "-h")):
        words.insert(0, "view")
    try:
        app(words, prog_name="pmviewer")
    except PmviewerError as error:
        print(f"pmviewer: error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("pmviewer: stopped", file=sys.stderr)
        sys.exit(130)
