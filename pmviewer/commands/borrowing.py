"""Rendering on a borrowed cluster from the command line: what is waited for, and what is said when it goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pmviewer.commands.patience import print_warnings
from pmviewer.commands.progress_bar import Bar
from pmviewer.engine.cluster.address import check_address
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.radius import check_apart
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import ClusterError
from pmviewer.settings.access import Settings
from pmviewer.settings.needs import Facts

if TYPE_CHECKING:  # Dask, which only those wait for who use it
    from pmviewer.engine.cluster.cluster import Cluster

Step = Callable[[], bool]
"""Renders the next pass into the film; False where no more will come of what there is."""


def check_cluster(where: str | None) -> None:
    """Raises SettingError and ClusterError for what can't be a cluster, before anything is read or rendered."""
    if where is not None:
        check_address(where)


@contextmanager
def borrowed(where: str | None, threads: int | None, opened: OpenScene, settings: Settings) -> Iterator[Cluster | None]:
    """The cluster that was asked for, while the context lasts; None for this process. Raises SettingError, for settings
    whose passes can't be rendered apart too, and ClusterError."""
    if where is None:
        yield None
        return
    check_apart(Facts(settings, plan_of(settings, opened.traits), opened.traits))
    from pmviewer.engine.cluster.cluster import Cluster

    cluster = Cluster(where, threads)
    try:
        yield cluster
    finally:
        cluster.close()


@contextmanager
def passes_of(renderer: Renderer, cluster: Cluster | None, bar: Bar) -> Iterator[Step]:
    """What renders the renderer's next pass: itself, or the workers of a cluster. When the cluster is lost after some
    passes it says so and gives False: what there is is kept. Raises ClusterError when there is nothing."""

    def here() -> bool:
        renderer.step()
        return True

    if cluster is None:
        yield here
        return
    from pmviewer.engine.cluster.passes import Elsewhere

    elsewhere = Elsewhere(cluster, renderer)

    def step() -> bool:
        try:
            elsewhere.step(tell=lambda text: bar.update(text, None))
        except ClusterError as error:
            if not renderer.passes:
                raise
            print_warnings([f"{error} The {renderer.passes} passes that there are are kept."], {})
            return False
        finally:
            print_warnings(cluster.take_messages(), {})
        return True

    try:
        cluster.wait_for_workers(lambda text: bar.update(text, None))
        yield step
    finally:
        print_warnings(cluster.take_messages(), {})
        elsewhere.close()
