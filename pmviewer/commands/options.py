"""Options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

DEFAULT_SCENE = "cornell_caustic"

SceneArgument = Annotated[
    str,
    typer.Argument(help="A bundled scene's name, a scene file (.xml .glb .gltf .obj .ply .stl) or a session (.toml)."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a setting, for example photons.N=200000."),
]
EditOption = Annotated[
    list[str] | None,
    typer.Option(
        "--edit",
        metavar="NAME=VALUE",
        help="Change a light, material or object, for example light.1.power=2 or material.wall.colour=0.8,0.2,0.2.",
    ),
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


ResumeSeriesOption = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Keep finished pictures in a folder beside the first output, and leave out those that an earlier run with "
        "the same words has finished.",
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
SnapshotOption = Annotated[
    list[Path] | None,
    typer.Option("--snapshot", metavar="FILE", help="EXR or PNG file to open as a snapshot; may be repeated."),
]
CheckpointOption = Annotated[
    str | None,
    typer.Option(
        "--checkpoint",
        metavar="TIME",
        help="Keep a checkpoint, so that never more than this time is lost: 60s, 10min, 1h. Ctrl+C and SIGTERM write "
        "one, too.",
    ),
]
ResumeOption = Annotated[
    bool, typer.Option("--resume", help="Go on from the checkpoint, bit for bit; begin anew where there is none yet.")
]
CheckpointFileOption = Annotated[
    Path | None,
    typer.Option("--checkpoint-file", metavar="FILE", help="The checkpoint; by default OUTPUT.checkpoint."),
]
KeepCheckpointOption = Annotated[
    bool, typer.Option("--keep-checkpoint", help="Keep it when all is rendered, to go on to more passes later.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="WHERE",
        help="Render the passes on a Dask cluster: local:N for N processes here, a scheduler's address "
        "(tcp://host:8786, tls://…) or its scheduler file (.json).",
    ),
]
