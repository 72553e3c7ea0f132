"""`pmviewer settings`: every setting."""

from __future__ import annotations

import typer


def settings() -> None:
    """List every setting with its default and range."""
    from pmviewer.settings.access import SETTINGS, range_text

    for path, entry in SETTINGS.items():
        typer.echo(f"{path} = {entry.default}   [{range_text(entry)}]\n    {entry.description}")
