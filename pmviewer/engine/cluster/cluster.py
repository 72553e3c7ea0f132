"""A Dask cluster: found or started, watched, and given back.

Dask brings tasks and results from place to place, knows which workers there are, and encrypts. Who renders which pass
is decided in `pmviewer.engine.cluster.passes`.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import threading
import time
import warnings
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pmviewer.engine.cluster.address import LOCAL, check_address
from pmviewer.engine.cluster.identity import ASK
from pmviewer.engine.cluster.members import Member, Members
from pmviewer.engine.cluster.worker import digest_of, packed_scene
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.program import program
from pmviewer.errors import ClusterError
from pmviewer.progress import available_threads

CONNECT = 10.0
"""Seconds within which a scheduler must answer, or be back."""
WATCH = 0.5
"""Seconds between looks at the workers."""
KEPT_SCENES = 2


@dataclass(frozen=True, eq=False)
class PackedScene:
    """A scene for workers: its bytes, their digest, and the digest of what is derived from it here."""

    payload: bytes
    digest: str
    arrays: str


class Cluster:
    """Workers for passes. `members` are those there are; `lost` is a sentence once the scheduler has gone for good."""

    def __init__(self, where: str, threads: int | None = None) -> None:
        """where: local:N, an address, or a scheduler file; `threads` of this machine are shared by local workers, all
        without. Raises SettingError and ClusterError."""
        check_address(where)
        from distributed import Client

        _quiet()
        self.where, self.lost, self._closed = where, "", threading.Event()
        self.members = Members(program())
        self._scenes: OrderedDict[int, PackedScene] = OrderedDict()
        self._local: Any = None
        try:
            with _settings():
                if local := LOCAL.fullmatch(where):
                    self._local = _started(int(local[1]), threads)
                    self.client = Client(self._local, timeout=CONNECT, set_as_default=False, direct_to_workers=True)
                elif where.endswith(".json"):
                    self.client = Client(scheduler_file=where, timeout=CONNECT, set_as_default=False)
                else:
                    # Results come through the scheduler, which may be all that can be reached from here.
                    self.client = Client(where, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError, ImportError) as error:
            self._give_up_local()
            raise ClusterError(_unreachable(where, error)) from error
        except BaseException:
            self._give_up_local()
            raise
        self._watcher = threading.Thread(target=self._watch, name="pmviewer cluster", daemon=True)
        self._watcher.start()

    def wait_for_workers(self, tell: Callable[[str], None], unwanted: Callable[[], bool] = lambda: False) -> None:
        """Return as soon as a worker can render. `tell` hears what is waited for. Raises ClusterError when all are
        refused or the scheduler has gone."""
        told = ""
        while not self.ready and not unwanted():
            self.check()
            waits = "starting workers" if self._local is not None else "waiting for workers"
            text = "checking workers" if self.members.here else f"{waits} of {self.where}"
            if text != told:
                tell(told := text)
            time.sleep(0.05)

    def check(self) -> None:
        """Raises ClusterError when nothing can be rendered there any more."""
        if self.lost:
            raise ClusterError(self.lost)
        if self.members.refused:
            raise ClusterError(self.members.take_refusal())

    def take_messages(self) -> list[str]:
        """Sentences for the user since the last call."""
        taken, self.members.messages = self.members.messages, []
        return taken

    def packed(self, opened: OpenScene) -> PackedScene:
        """The scene for workers; the newest few are kept."""
        made = self._scenes.get(opened.uid)
        if made is None:
            payload = packed_scene(opened)
            digest = hashlib.blake2b(payload, digest_size=16).hexdigest()
            made = self._scenes[opened.uid] = PackedScene(payload, digest, digest_of(opened.flat))
            while len(self._scenes) > KEPT_SCENES:
                self._scenes.popitem(last=False)
        self._scenes.move_to_end(opened.uid)
        return made

    @property
    def ready(self) -> list[Member]:
        """Workers that can be given a pass now."""
        return self.members.ready if self.is_connected else []

    @property
    def is_connected(self) -> bool:
        """Whether the scheduler can be asked."""
        return not self.lost and self.client.status == "running"

    def close(self) -> None:
        """Leave the cluster; a local one ends. Nothing is waited for that doesn't answer."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._scenes.clear()
        with contextlib.suppress(Exception):
            self.client.close(timeout=2)
        self._give_up_local()
        self._watcher.join(timeout=2)

    def _give_up_local(self) -> None:
        if self._local is not None:
            processes = [nanny.process for nanny in self._local.workers.values() if nanny.process is not None]
            with contextlib.suppress(Exception):
                self._local.close(timeout=5)
            for process in processes:  # frozen ones don't hear that they are to end
                with contextlib.suppress(Exception):
                    process.process._process.kill()

    def _watch(self) -> None:
        while not self._closed.wait(WATCH):
            try:
                told = self.client.sync(self.client.scheduler.identity, n_workers=-1, callback_timeout=CONNECT)
                new = self.members.update(told["workers"])
            except Exception:  # not connected just now: Dask tries again for CONNECT seconds
                if self.client.status in ("closed", "closing", "newly-created") and not self._closed.is_set():
                    self.lost = f"The scheduler of the cluster {self.where} has gone."
                    return
                continue
            for member in new:
                with contextlib.suppress(Exception):
                    self._ask(member)

    def _ask(self, member: Member) -> None:
        """Find out what a new worker is."""
        key = f"pmviewer-identity-{member.address}-{time.monotonic_ns()}"
        future = self.client.submit(eval, ASK, key=key, workers=[member.address], allow_other_workers=False)

        def answered(future: Any) -> None:
            if future.status == "error":
                self.members.judge(member, _why_not(future.exception()))
            elif future.status == "finished":
                self.members.judge(member, future.result(timeout=CONNECT))

        future.add_done_callback(answered)


def _started(count: int, threads: int | None) -> Any:
    from distributed import LocalCluster

    each = max(1, (threads or available_threads()) // count)
    return LocalCluster(
        n_workers=count,
        threads_per_worker=each,
        processes=True,
        host="127.0.0.1",
        dashboard_address=":0",
        memory_limit=0,
        silence_logs=logging.CRITICAL,
        preload=["pmviewer.engine.cluster.preload"],
    )


@contextlib.contextmanager
def _settings() -> Any:
    """Dask's settings for what is started here."""
    import dask

    with dask.config.set(
        {
            "distributed.comm.timeouts.connect": f"{CONNECT:.0f}s",
            "distributed.scheduler.worker-ttl": "60s",
            "distributed.worker.multiprocessing-method": "spawn",
            "distributed.worker.profile.enabled": False,  # a hundred looks a second, which nobody asks for
        }
    ):
        yield


def _quiet() -> None:
    """What is to be said is said in a sentence; Dask's own log of connections lost is silent."""
    for name in ("distributed", *logging.root.manager.loggerDict):
        if name.split(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)
    warnings.filterwarnings("ignore", message="(?s).*Sending large graph.*", category=UserWarning)


def _unreachable(where: str, error: BaseException) -> str:
    first = (str(error) or type(error).__name__).splitlines()[0]
    if where.startswith("local:"):
        return f"Workers of {where} can't be started: {first}"
    return (
        f"No Dask scheduler answers at {where} within {CONNECT:.0f} s. Is it running, and can it be reached? ({first})"
    )


def _why_not(error: BaseException | None) -> str:
    if isinstance(error, ModuleNotFoundError):
        return f"there is no {error.name} there; install pmviewer[cluster] in the same version."
    return f"{type(error).__name__}: {error}"
