"""Where the passes of a series are rendered: in this process, or on a cluster that is borrowed for all its pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from pmviewer.commands.borrowing import borrowed, passes_of
from pmviewer.commands.progress_bar import Bar
from pmviewer.commands.series_plan import Plan
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.series.render import Steps
from pmviewer.errors import ClusterError


@contextmanager
def steps_on(where: str | None, threads: int | None, plan: Plan, bar: Bar) -> Iterator[Steps]:
    """What renders the pictures' passes while the context lasts, `where` being the cluster that was asked for. A
    picture during which the cluster is lost is not finished. Raises SettingError and ClusterError."""
    with borrowed(where, threads, plan.opened, plan.pictures[0]) as cluster:

        def steps(renderer: Renderer) -> AbstractContextManager[Callable[[], object]]:
            return _whole(passes_of(renderer, cluster, bar))

        yield steps


@contextmanager
def _whole(passes: AbstractContextManager[Callable[[], bool]]) -> Iterator[Callable[[], object]]:
    with passes as step:

        def whole_step() -> None:
            if not step():
                raise ClusterError("The picture on its way is not finished; with --resume the others are not lost.")

        yield whole_step
