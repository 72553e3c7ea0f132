"""One line on the terminal that tells how far something is."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn


class Bar:
    """What the context of `progress_bar` gives."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task = progress.add_task("preparing", total=1.0)

    def update(self, text: str, share: float | None) -> None:
        """What is being done, and the share that is done, None where that is not known."""
        self._progress.update(self._task, description=text, completed=share or 0.0)

    def restart(self, text: str) -> None:
        """Something else begins: time counts from now on."""
        self._progress.reset(self._task, total=1.0, description=text)


@contextmanager
def progress_bar(remaining: bool = False) -> Iterator[Bar]:
    """Shows a bar on the standard error while the context lasts, `remaining` with the time that is left."""
    console = Console(stderr=True)
    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()]
    if remaining:
        columns.append(TimeRemainingColumn())
    # rich would turn what is printed meanwhile to its own console: right on a terminal, wrong for a redirected stdout.
    shown = sys.stdout.isatty()
    with Progress(*columns, console=console, transient=not console.is_terminal, redirect_stdout=shown) as progress:
        yield Bar(progress)
