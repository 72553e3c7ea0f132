"""Who renders the passes of a session: this process, or the workers of a cluster that it has borrowed."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from pmviewer.engine.apart import bound_passes
from pmviewer.engine.cluster.address import check_address
from pmviewer.engine.published import Published
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import ClusterError, PmviewerError

if TYPE_CHECKING:  # Dask, which only those wait for who use it
    from pmviewer.engine.cluster.cluster import Cluster
    from pmviewer.engine.cluster.passes import Elsewhere


class PassMaker:
    """Renders passes here until the cluster answers and whenever it has no workers; the picture is the same. A cluster
    that is lost is a sentence in the log, and passes are rendered here from then on."""

    def __init__(self, published: Published, cluster: str | None, threads: int) -> None:
        """cluster: where it is (`pmviewer.engine.cluster`), None for this process alone."""
        self._published, self._threads = published, threads
        self.where: str | None = None
        """The cluster that is borrowed, or is being asked; None for none. From any thread."""
        self._cluster: Cluster | None = None
        self._elsewhere: Elsewhere | None = None
        self._lock, self._closed = threading.Lock(), False
        self._busy = threading.RLock()
        """Held while a pass is rendered."""
        self._at: str | None = None
        """Where the cluster is that passes are rendered on."""
        if cluster is not None:
            self.borrow(cluster)

    def borrow(self, where: str | None) -> None:
        """Use that cluster from the next pass on, with None none, and give back the one before. Returns at once; from
        any thread. Raises SettingError for what can't be the address of a cluster, ClusterError without Dask."""
        if where is not None:
            check_address(where)
        with self._lock:
            self.where = where
        threading.Thread(target=self._swap, args=(where,), name="pmviewer borrowing", daemon=True).start()

    def step(self, renderer: Renderer, most: int) -> None:
        """Have the next pass in the renderer's film; `most` will be wanted in all. Raises Cancelled."""
        with self._busy:
            if not self._stepped(renderer, most):
                renderer.step()

    def drop(self) -> None:
        """What is on its way is out of date."""
        with self._busy:
            if self._elsewhere is not None:
                self._elsewhere.close()
                self._elsewhere = None

    def close(self) -> None:
        """Leave the cluster."""
        with self._lock:
            self._closed, cluster = True, self._cluster
        self.drop()
        if cluster is not None:
            cluster.close()

    def _stepped(self, renderer: Renderer, most: int) -> bool:
        """Whether the cluster has rendered the pass."""
        cluster = self._cluster
        if cluster is None or bound_passes(renderer.facts):
            return False
        try:
            if self._elsewhere is None or self._elsewhere.renderer is not renderer:
                self.drop()
                cluster.check()
                if not cluster.ready:
                    return False
                from pmviewer.engine.cluster.passes import Elsewhere

                self._elsewhere = Elsewhere(cluster, renderer)
            if self._elsewhere.step(most, patient=False):
                return True
            self.drop()  # they begin anew when there are workers again
            return False
        except ClusterError as error:
            self.drop()
            with self._lock:
                self._cluster = None
                self.where = None if self.where == self._at else self.where
            self._published.say("error", f"{error} Passes are rendered here from now on.")
            cluster.close()
            return False
        finally:
            for sentence in cluster.take_messages():
                self._published.say("warning", sentence)

    def _swap(self, where: str | None) -> None:
        """Between two passes: leave the cluster, then enter the other one."""
        with self._busy:
            with self._lock:
                before, self._cluster = self._cluster, None
            if before is not None:
                self.drop()
        if before is not None:
            before.close()
            self._published.say("info", "The cluster is given back: passes are rendered here.")
        if where is not None and self._is_wanted(where):
            self._connect(where)

    def _is_wanted(self, where: str) -> bool:
        """Whether nobody has decided otherwise meanwhile."""
        return not self._closed and self.where == where

    def _connect(self, where: str) -> None:
        try:
            from pmviewer.engine.cluster.cluster import Cluster

            cluster = Cluster(where, self._threads)
        except PmviewerError as error:
            self._published.say("error", f"{error} Passes are rendered here.")
            with self._lock:
                self.where = None if self.where == where else self.where
            return
        with self._lock:
            unwanted = not self._is_wanted(where) or self._cluster is not None
            if not unwanted:
                self._cluster, self._at = cluster, where
        if unwanted:
            cluster.close()
        else:
            self._published.say("info", f"cluster {where}: its workers render the passes as soon as they are up")
