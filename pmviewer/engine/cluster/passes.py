"""Passes of one renderer, rendered on a cluster and added in their order.

Each worker has one pass in work and one waiting. Which worker gets which pass is decided here, so that a worker that
has gone, is frozen or is far slower than the others costs its pass and no more: another is asked for the same pass, and
the first result counts, as both are the same bit for bit. At most as many passes are on their way or wait for their
turn as keeps all workers busy, so that memory doesn't grow.

A worker is brought the scene once, from here. From worker to worker it would travel faster, but one that freezes while
others wait for its data would hold them up for good.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import queue
import statistics
import time
import uuid
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from pmviewer.engine.apart import check_apart
from pmviewer.engine.cluster.cluster import Cluster
from pmviewer.engine.cluster.members import Member
from pmviewer.engine.cluster.shared_memory import Segment, Segments, Written
from pmviewer.engine.cluster.worker import Asked, Failed, Rendered, hold_scene, packed_settings, render_pass, stop
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import ClusterError
from pmviewer.progress import Cancelled
from pmviewer.render.film import Addable

BROUGHT = 4
"""Workers that are brought the scene at the same time."""
EACH = 2
"""Passes that a worker has at once: one in work, one waiting."""
AHEAD = 2
"""Passes beyond those that workers have, that may wait for their turn, a worker."""
MOST_FAILURES = 4
"""Workers that a pass may lose or fail on."""
FETCH = 60.0
"""Seconds within which a result must arrive once it is there."""
SLOW, LEAST_SLOW = 5.0, 10.0
"""From how many times the usual time of a pass, and from how many seconds on, another worker is asked for it."""
RECENT = 32
"""Passes whose times tell what is usual."""
MOMENT, LOOK = 0.02, 0.2
"""Seconds after which a cancelled pass is noticed, and between looks at the workers."""


@dataclass
class Order:
    """Pass `index`, asked of a worker."""

    index: int
    member: Member
    future: Any = None
    since: float = field(default_factory=time.monotonic)
    doubted: bool = False
    """Whether another was asked for the same pass."""
    segment: Segment | None = None
    """Memory for what the pass adds, which its worker sees."""


class Elsewhere:
    """Renders passes of `renderer` on a cluster: `step` in place of the renderer's own."""

    def __init__(self, cluster: Cluster, renderer: Renderer) -> None:
        """Raises SettingError where passes can't be rendered apart."""
        check_apart(renderer.facts)
        self.cluster, self.renderer = cluster, renderer
        self.run = uuid.uuid4().hex
        self._scene, self._settings = cluster.packed(renderer.scene), packed_settings(renderer.settings)
        self._orders: dict[str, Order] = {}
        self._brought: dict[str, Order] = {}
        """Workers that are being brought the scene."""
        self._again: list[int] = []
        self._next = renderer.passes
        self._done: dict[int, tuple[Rendered, Order]] = {}
        self._failures: dict[int, int] = {}
        self._took: list[float] = []
        self._numbers = itertools.count()
        self._arrived: queue.SimpleQueue[tuple[str, Rendered | Failed | str | None]] = queue.SimpleQueue()
        self._fetchers = ThreadPoolExecutor(4, "pmviewer fetch")
        self._segments = Segments(renderer.film)

    def step(
        self, most: int | None = None, tell: Callable[[str], None] = lambda text: None, patient: bool = True
    ) -> bool:
        """Have the next pass in the film. `most` passes will be wanted in all, as many as the settings say without.
        Where there are no workers `tell` hears that they are waited for, and who isn't `patient` is given False.

        Raises Cancelled when the renderer's pool is cancelled, ClusterError when the cluster has gone, and whatever a
        pass raises in a sentence; passes that are in the film stay there.
        """
        renderer, start = self.renderer, time.perf_counter()
        most, looked = renderer.settings.render.passes if most is None else most, 0.0
        self._ask(most)
        while renderer.passes not in self._done:
            if renderer.pool.cancel.is_set():
                raise Cancelled
            self.cluster.check()
            if not self.cluster.ready:
                if not patient:
                    return False
                tell(f"waiting for workers of {self.cluster.where}")
            if self._receive() or time.monotonic() - looked > LOOK:
                looked = time.monotonic()
                self._look_after()
                self._ask(most)
        rendered, order = self._done.pop(renderer.passes)
        renderer.add(_increment(rendered, order), rendered.told)
        self._segments.give_back(order.segment)
        renderer.tally.merge(rendered.tally)
        member = order.member
        share = renderer.tally.workers.get(member.address, (member.threads, 0))
        renderer.tally.workers[member.address] = member.threads, share[1] + 1
        self._ask(most)  # workers go on while the caller looks at the picture
        renderer.tally.seconds += time.perf_counter() - start
        return True

    def close(self) -> None:
        """Nobody wants what is still on its way: workers drop it within some 30 ms."""
        self._fetchers.shutdown(wait=False, cancel_futures=True)
        if self.cluster.is_connected:
            busy = {order.member.address for order in self._orders.values()} & self.cluster.members.here.keys()
            with contextlib.suppress(Exception):  # gone meanwhile
                if busy:
                    self.cluster.client.run(stop, self.run, workers=list(busy), wait=False, on_error="ignore")
                for order in (*self._orders.values(), *self._brought.values()):
                    order.future.release()
        for order in self._orders.values():
            self._segments.lose(order.segment)
        for _, order in self._done.values():
            self._segments.give_back(order.segment)
        self._segments.close()
        self._orders.clear()
        self._brought.clear()
        self._done.clear()

    def _ask(self, most: int) -> None:
        """Give workers that have too few passes the next ones."""
        ready = [member for member in self.cluster.ready if self._has_scene(member)]
        load = {member.address: 0 for member in ready}
        for order in self._orders.values():
            if order.member.address in load:
                load[order.member.address] += 1
        first = self.renderer.passes
        limit = min(most, first + (EACH + AHEAD) * max(len(ready), 1))
        for level in range(EACH):
            for member in ready:
                if load[member.address] == level:
                    index = self._index(limit, member, idle=level == 0)
                    if index is None:
                        return
                    self._order(index, member)
                    load[member.address] += 1

    def _index(self, limit: int, member: Member, idle: bool) -> int | None:
        """The pass to ask for next. An idle worker takes over what others are late with."""
        while self._again:
            index = heapq.heappop(self._again)
            if self._is_wanted(index):
                return index
        if self._next < limit:
            self._next += 1
            return self._next - 1
        return self._late(member) if idle else None

    def _late(self, member: Member) -> int | None:
        """A pass that waits behind another one on its worker, or takes far longer than usual."""
        now = time.monotonic()
        usual = statistics.median(self._took) if self._took else None
        in_work: set[str] = set()
        for order in sorted(self._orders.values(), key=lambda order: order.since):
            waits = order.member.address in in_work
            in_work.add(order.member.address)
            slow = usual is not None and now - order.since > max(LEAST_SLOW, SLOW * usual)
            if not order.doubted and order.member is not member and (waits or slow):
                order.doubted = True
                return order.index
        return None

    def _order(self, index: int, member: Member) -> None:
        segment = self._segments.take() if member.is_near else None
        handle = None if segment is None else segment.handle
        asked = Asked(self.run, self._scene.digest, self._settings, index, member.threads, handle)
        key = f"pmviewer-pass-{self.run}-{index}-{next(self._numbers)}"
        self._submit(self._orders, Order(index, member, segment=segment), key, render_pass, asked)

    def _has_scene(self, member: Member) -> bool:
        """Whether the worker has it; it is brought if not."""
        if self._scene.digest in member.scenes:
            return True
        under_way = {order.member.address for order in self._brought.values()}
        if member.address not in under_way and len(under_way) < BROUGHT:
            key = f"pmviewer-scene-{self.run}-{next(self._numbers)}"
            scene = self._scene
            self._submit(self._brought, Order(-1, member), key, hold_scene, scene.payload, scene.digest)
        return False

    def _submit(self, orders: dict[str, Order], order: Order, key: str, call: Callable[..., Any], *given: Any) -> None:
        address = order.member.address
        order.future = self.cluster.client.submit(call, *given, key=key, workers=[address], allow_other_workers=False)
        orders[key] = order
        order.future.add_done_callback(self._finished)

    def _finished(self, future: Any) -> None:
        """Called by a thread of Dask's."""
        try:
            self._fetchers.submit(self._fetch, future)
        except RuntimeError:  # closed meanwhile
            return

    def _fetch(self, future: Any) -> None:
        found: Rendered | Failed | str | None = None
        try:
            if future.status == "finished":
                found = future.result(timeout=FETCH)
            elif future.status == "error":
                found = Failed(_text(future.exception(timeout=FETCH)))
        except Exception:  # lost on its way: another worker is asked
            found = None
        self._arrived.put((future.key, found))

    def _receive(self) -> bool:
        """Take what has arrived, and tell whether anything has; wait a moment first."""
        some = False
        try:
            key, found = self._arrived.get(timeout=MOMENT)
            while True:
                some = True
                self._take(key, found)
                key, found = self._arrived.get_nowait()
        except queue.Empty:
            return some

    def _take(self, key: str, found: Rendered | Failed | str | None) -> None:
        if key in self._brought:
            self._take_scene(self._brought.pop(key), found)
            return
        order = self._orders.pop(key, None)
        if order is None:
            return
        order.future.release()
        if isinstance(found, Rendered):
            self._took = [*self._took[1 - RECENT :], time.monotonic() - order.since]
            if not self._is_wanted(order.index):
                self._segments.give_back(order.segment)
                return
            self._done[order.index] = found, order
            for other in [k for k, o in self._orders.items() if o.index == order.index]:
                self._drop(other)
            return
        self._segments.lose(order.segment)
        if isinstance(found, Failed) and found.final:
            raise ClusterError(f"Pass {order.index} failed on worker {order.member.address}: {found.text}")
        said, lacks = (found.text, found.lacks_scene) if isinstance(found, Failed) else ("", False)
        if lacks:
            order.member.scenes.discard(self._scene.digest)
        self._lose(order, said, counts=self.cluster.is_connected and not lacks)

    def _take_scene(self, order: Order, found: Any) -> None:
        order.future.release()
        member = order.member
        if isinstance(found, str):
            member.scenes.add(self._scene.digest)
            if found != self._scene.arrays:
                self.cluster.members.say_once(
                    f"Worker {member.address} makes other arrays of this scene than this machine: its passes may "
                    "differ in the last bits."
                )
        elif isinstance(found, Failed):
            self.cluster.members.judge(member, found.text)

    def _lose(self, order: Order, said: str, counts: bool = True) -> None:
        """Ask again for a pass. Raises ClusterError when it was lost too often."""
        if not self._is_wanted(order.index):
            return
        failures = self._failures[order.index] = self._failures.get(order.index, 0) + counts
        if failures > MOST_FAILURES:
            why = f"the last said: {said}" if said else "they have gone; is there enough memory?"
            raise ClusterError(f"Pass {order.index} failed on {failures} workers, {why}")
        if all(other.index != order.index or other.doubted for other in self._orders.values()):
            heapq.heappush(self._again, order.index)

    def _look_after(self) -> None:
        """Take back what workers have that are gone, and ask others for what silent ones have."""
        here = self.cluster.members.here
        for key, order in list(self._brought.items()):
            if here.get(order.member.address) is not order.member or order.member.is_silent:
                del self._brought[key]
                order.future.release()
        for key, order in list(self._orders.items()):
            if here.get(order.member.address) is not order.member:
                self._drop(key)
                self._lose(order, "")
            elif order.member.is_silent and not order.doubted:
                order.doubted = True
                heapq.heappush(self._again, order.index)

    def _drop(self, key: str) -> None:
        """An order whose worker is not waited for any more."""
        order = self._orders.pop(key)
        order.future.release()
        self._segments.lose(order.segment)

    def _is_wanted(self, index: int) -> bool:
        return index >= self.renderer.passes and index not in self._done


def _increment(rendered: Rendered, order: Order) -> Addable:
    """What the pass adds, from wherever it is."""
    if not isinstance(rendered.increment, Written):
        return rendered.increment
    assert order.segment is not None, "written to no segment"
    return order.segment.increment(rendered.increment)


def _text(error: BaseException | None) -> str:
    return f"{type(error).__name__}: {error}".splitlines()[0] if error is not None else "no reason given"
