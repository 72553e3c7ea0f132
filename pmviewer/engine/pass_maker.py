"""Who renders the passes of a session: this process, or the workers of a cluster that it has borrowed."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from pmviewer.engine.published import Published
from pmviewer.engine.radius import radii_of_pixels
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
        self._published, self._where, self._threads = published, cluster, threads
        self._cluster: Cluster | None = None
        self._elsewhere: Elsewhere | None = None
        self._lock, self._closed = threading.Lock(), False
        if cluster is not None:
            threading.Thread(target=self._connect, name="pmviewer borrowing", daemon=True).start()

    def step(self, renderer: Renderer, most: int) -> None:
        """Have the next pass in the renderer's film; `most` will be wanted in all. Raises Cancelled."""
        if not self._stepped(renderer, most):
            renderer.step()

    def drop(self) -> None:
        """What is on its way is out of date."""
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
        if cluster is None or radii_of_pixels(renderer.facts):
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
            self._cluster = None
            self._published.say("error", f"{error} Passes are rendered here from now on.")
            cluster.close()
            return False
        finally:
            for sentence in cluster.take_messages():
                self._published.say("warning", sentence)

    def _connect(self) -> None:
        assert self._where is not None
        try:
            from pmviewer.engine.cluster.cluster import Cluster

            cluster = Cluster(self._where, self._threads)
        except PmviewerError as error:
            self._published.say("error", f"{error} Passes are rendered here.")
            return
        with self._lock:
            unwanted = self._closed
            if not unwanted:
                self._cluster = cluster
        if unwanted:
            cluster.close()
        else:
            self._published.say("info", f"cluster {self._where}: its workers render the passes as soon as they are up")
