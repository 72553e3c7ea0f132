"""What runs on a worker: one pass, on all of the worker's threads.

A worker renders one pass at a time, whatever Dask gives it at once: the next waits, so that its threads have work while
a result travels. Scenes and renderers are kept between passes, the newest few.
"""

from __future__ import annotations

import hashlib
import pickle
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from pmviewer.engine.cluster.packed import PackedIncrement, pack
from pmviewer.engine.cluster.shared_memory import Handle, Writer, Written
from pmviewer.engine.opened import OpenScene, expected_traits, opened_of
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.engine.told import Told
from pmviewer.errors import PmviewerError
from pmviewer.heap import give_back
from pmviewer.progress import Cancelled
from pmviewer.scene.arrays.flatten import FlatScene, flatten
from pmviewer.settings.access import Settings

KEPT_SCENES, KEPT_RENDERERS, KEPT_STOPS = 2, 2, 64
"""How many a worker keeps."""
KEPT_BYTES = 1 << 28
"""Of a renderer's stage store."""

T = TypeVar("T")


@dataclass(frozen=True)
class Asked:
    """Pass `index` of the scene with that digest and these settings (`packed_settings`), in the course of `run`. What
    it adds goes to `handle` where the worker is on the same machine. Small: the scheduler remembers the last thousands
    of what it was asked."""

    run: str
    scene: str
    settings: bytes
    index: int
    threads: int
    handle: Handle | None = None


@dataclass(frozen=True)
class Rendered:
    """A pass: what it adds (or that it has been written to its handle), what was counted and what is told of it, and
    the seconds it took."""

    increment: PackedIncrement | Written
    tally: Tally
    told: Told
    seconds: float


@dataclass(frozen=True)
class Failed:
    """Why there is no pass. `final`: it would fail everywhere; `cancelled`: nobody wants it any more; `lacks_scene`:
    the worker doesn't have the scene, or no longer."""

    text: str
    final: bool = False
    cancelled: bool = False
    lacks_scene: bool = False


class _Bench:
    """What a worker process has at hand."""

    def __init__(self) -> None:
        self.turn, self.lock = threading.Lock(), threading.Lock()
        self.scenes: OrderedDict[str, tuple[OpenScene, str]] = OrderedDict()
        self.renderers: OrderedDict[tuple[str, bytes], Renderer] = OrderedDict()
        self.stopped: OrderedDict[str, None] = OrderedDict()
        self.running = ""
        self.pool: WorkPool | None = None
        self.writer = Writer()

    def pool_of(self, threads: int) -> WorkPool:
        """The pool, with so many threads."""
        if self.pool is None or self.pool.threads != threads:
            if self.pool is not None:
                self.pool.close()
                self.renderers.clear()
            self.pool = WorkPool(threads)
        return self.pool


_bench = _Bench()


def packed_scene(opened: OpenScene) -> bytes:
    """The scene as it is rendered, with all its arrays: nothing is read where it arrives."""
    from lz4.frame import compress

    return bytes(compress(pickle.dumps((opened.scene, opened.source), pickle.HIGHEST_PROTOCOL)))


def packed_settings(settings: Settings) -> bytes:
    """What differs from the defaults, or all of them where that would not give the same again."""
    changed = settings.model_dump(by_alias=True, exclude_defaults=True)
    try:
        same = Settings.model_validate(changed) == settings
    except ValueError:
        same = False
    return pickle.dumps(changed if same else settings)


def _settings(packed: bytes) -> Settings:
    found = pickle.loads(packed)
    return found if isinstance(found, Settings) else Settings.model_validate(found)


def digest_of(flat: FlatScene) -> str:
    """Of the arrays that are derived from a scene's own: the tree and the lights."""
    found = hashlib.blake2b(digest_size=16)
    for array in (flat.bvh.nodes, flat.bvh.blocks, flat.bvh.quadrics, flat.lights, flat.light_power):
        found.update(array.tobytes())
    return found.hexdigest()


def hold_scene(payload: bytes, digest: str) -> str | Failed:
    """Keep a scene for the passes that follow; returns the digest of the arrays that are derived from it here."""
    with _bench.turn:
        try:
            return _kept(_bench.scenes, digest, KEPT_SCENES, lambda: _opened(payload))[1]
        except MemoryError:
            return Failed("not enough memory for this scene")
        except Exception as error:  # whatever it is, the client must hear of it
            return Failed(f"{type(error).__name__}: {error}")


def render_pass(asked: Asked) -> Rendered | Failed:
    """The pass, of a scene that is held. What goes wrong is told, not raised: Dask's log has no use for it."""
    with _bench.turn:
        with _bench.lock:
            if asked.run in _bench.stopped:
                return Failed("stopped", cancelled=True)
            if asked.scene not in _bench.scenes:
                return Failed("the scene is not there", lacks_scene=True)
            pool = _bench.pool_of(asked.threads)
            pool.cancel.clear()
            _bench.running = asked.run
        try:
            return _rendered(asked, pool)
        except Cancelled:
            return Failed("stopped", cancelled=True)
        except PmviewerError as error:
            return Failed(str(error), final=True)
        except MemoryError:
            _bench.renderers.clear()
            _bench.scenes.clear()
            return Failed("not enough memory for this scene and these settings")
        except Exception as error:  # whatever it is, the client must hear of it
            _bench.renderers.clear()
            return Failed(f"{type(error).__name__}: {error}")
        finally:
            with _bench.lock:
                _bench.running = ""


def stop(run: str) -> None:
    """Nobody wants the passes of this run any more: the one that is being rendered ends within some 30 ms."""
    with _bench.lock:
        _bench.stopped[run] = None
        while len(_bench.stopped) > KEPT_STOPS:
            _bench.stopped.popitem(last=False)
        if _bench.running == run and _bench.pool is not None:
            _bench.pool.cancel.set()


def _rendered(asked: Asked, pool: WorkPool) -> Rendered:
    start = time.perf_counter()
    opened, _ = _bench.scenes[asked.scene]
    _bench.scenes.move_to_end(asked.scene)

    def make() -> Renderer:
        made = Renderer(opened, _settings(asked.settings), pool, StageStore(KEPT_BYTES))
        made.tally.in_parts = True
        return made

    key = asked.scene, asked.settings
    renderer: Renderer = _kept(_bench.renderers, key, KEPT_RENDERERS, make)
    try:
        increment = renderer.increment(asked.index, lent=True)
    except BaseException:
        del _bench.renderers[key]  # what was counted of half a pass
        raise
    spans = renderer.film.spans(asked.index)
    tally, told = renderer.tally.take(asked.index), renderer.told()
    written = None
    if asked.handle is not None and spans == ((0, len(increment.sums)),):
        written = _bench.writer.write(asked.run, asked.handle, increment)
    return Rendered(written or pack(increment, spans), tally, told, time.perf_counter() - start)


def _opened(payload: bytes) -> tuple[OpenScene, str]:
    from lz4.frame import decompress

    scene, source = pickle.loads(decompress(payload))
    flat = flatten(scene)
    return opened_of(scene, flat, expected_traits(scene), source), digest_of(flat)


def _kept(held: OrderedDict[Any, T], key: Any, most: int, make: Callable[[], T]) -> T:
    """What is held by that key, or made now; what was unused for longest goes."""
    if key not in held:
        while len(held) >= most:
            held.popitem(last=False)
            give_back()
        held[key] = make()
    held.move_to_end(key)
    return held[key]
