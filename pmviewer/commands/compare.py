"""`pmviewer compare`: the error of a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def compare(
    image: Annotated[Path, typer.Argument(help="An EXR file.")],
    reference: Annotated[Path, typer.Argument(help="The EXR file to compare it with, of the same size.")],
) -> None:
    """Print the error of a picture against a reference."""
    from pmviewer.output.compare import compare_files

    typer.echo(compare_files(image, reference))
