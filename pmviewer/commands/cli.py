"""The command line: the table of commands. Each imports what it needs when it runs, so that `--help` and the window are
quick."""

from __future__ import annotations

import sys
from collections.abc import Callable

import typer

from pmviewer.commands.bench import bench
from pmviewer.commands.compare import compare
from pmviewer.commands.compare_importance import compare_importance
from pmviewer.commands.compile import compile_
from pmviewer.commands.info import info
from pmviewer.commands.photons import photons
from pmviewer.commands.render import render
from pmviewer.commands.scenes import scenes
from pmviewer.commands.series import series
from pmviewer.commands.settings import settings
from pmviewer.commands.shot import shot
from pmviewer.commands.sweep import sweep
from pmviewer.commands.view import view
from pmviewer.errors import PmviewerError
from pmviewer.version import __version__

COMMANDS: dict[str, Callable[..., None]] = {
    "view": view,
    "render": render,
    "photons": photons,
    "series": series,
    "sweep": sweep,
    "shot": shot,
    "compare": compare,
    "compare-importance": compare_importance,
    "scenes": scenes,
    "info": info,
    "bench": bench,
    "compile": compile_,
    "settings": settings,
}
"""By name, in the order of `--help`."""

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    no_args_is_help=False,
    rich_markup_mode=None,
    help="Interactive previewer for photon-mapping global illumination.",
)
for _name, _command in COMMANDS.items():
    app.command(_name)(_command)


def main(arguments: list[str] | None = None) -> None:
    """Entry point: `pmviewer SCENE` means `pmviewer view SCENE`. Errors are one line and exit code 2."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["--version"]:
        print(f"pmviewer {__version__}")
        return
    if not words or (words[0] not in COMMANDS and words[0] not in ("--help", "-h")):
        words.insert(0, "view")
    try:
        app(words, prog_name="pmviewer")
    except PmviewerError as error:
        print(f"pmviewer: error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("pmviewer: stopped", file=sys.stderr)
        sys.exit(130)
