"""`pmviewer bench`: measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def bench(
    name: Annotated[str, typer.Argument(help="A bench's name, or list.")] = "list",
    folder: Annotated[
        Path | None, typer.Argument(help="Of files and auto: of scene files; of report: of results.")
    ] = None,
    quick: Annotated[bool, typer.Option(help="Fewer rounds and smaller inputs.")] = False,
    csv: Annotated[Path | None, typer.Option(help="Also write the table as CSV.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Also write the table as Markdown.")] = None,
    scenes: Annotated[
        int | None, typer.Option(min=1, help="Of agree, auto, files and hostile: how many scenes or files.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of agree, auto, files and hostile: which ones.")] = None,
    first: Annotated[int | None, typer.Option(min=0, help="Of agree: the number to begin with.")] = None,
    keep: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Of agree and hostile: where failing scenes go; of all: results."),
    ] = None,
    json: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Of agree and files: keep results here, and go on with those kept."),
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Of agree with --json: run again what other sources found.")
    ] = False,
    sheet: Annotated[Path | None, typer.Option(metavar="FILE", help="Of files: all pictures as one PNG.")] = None,
) -> None:
    """Measure: a table, then a line for each target."""
    from pmviewer.bench.registry import BENCHES, run_bench

    if name == "list":
        for key, (description, _) in BENCHES.items():
            typer.echo(f"{key:10s} {description}")
        return
    options = {"folder": folder, "scenes": scenes, "seed": seed, "first": first, "keep": keep, "json": json}
    options |= {"sheet": sheet, "again": again or None}
    run_bench(name, quick, csv, markdown, options)
