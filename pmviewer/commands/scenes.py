"""`pmviewer scenes`: the bundled scenes."""

from __future__ import annotations

import typer


def scenes() -> None:
    """List the bundled scenes."""
    from pmviewer.scene.load import bundled_scenes

    for bundled in bundled_scenes():
        typer.echo(f"{bundled.name:18s} {bundled.title}")
