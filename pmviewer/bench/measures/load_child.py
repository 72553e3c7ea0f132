"""A process that opens one file and says how long it took and how much memory: `python -m … WHO FILE SMALL_FILE`."""

from __future__ import annotations

import json
import resource
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

_EVERY = 0.005
"""Seconds between two looks at the memory."""


def main(who: str, path: Path, warm: Path) -> None:
    """Open the small file first, so that neither compiling nor importing counts."""
    load = {"pmviewer": _ours, "mitsuba": _mitsuba, "embree": _embree}[who]()
    load(warm)
    before = _resident()
    watcher = _Watcher()
    cpu, start = time.process_time(), time.perf_counter()
    kept = load(path)
    seconds, spent = time.perf_counter() - start, time.process_time() - cpu
    peak, after = watcher.stop(), _resident()
    del kept
    result = {"seconds": seconds, "cpu": spent, "peak": peak - before, "resident": after - before}
    print(json.dumps(result), flush=True)


def _resident() -> int:
    """Bytes of memory that the process holds; the most it ever held where the system tells no more."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    except OSError:
        scale = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * scale


class _Watcher:
    """Notes the most memory from now on."""

    def __init__(self) -> None:
        self._most, self._done = _resident(), threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        while not self._done.wait(_EVERY):
            self._most = max(self._most, _resident())

    def stop(self) -> int:
        self._done.set()
        self._thread.join()
        return max(self._most, _resident())


def _ours() -> Callable[[Path], object]:
    from pmviewer.engine.opened import open_scene

    return open_scene


def _mitsuba() -> Callable[[Path], object]:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")

    def load(path: Path) -> object:
        mesh = {"type": path.suffix[1:], "filename": str(path), "face_normals": True}
        scene = mi.load_dict({"type": "scene", "mesh": mesh, "light": {"type": "constant"}})
        scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, -5), mi.Vector3f(0, 0, 1)))
        return scene

    return load


def _embree() -> Callable[[Path], object]:
    from pmviewer.bench.embree import EmbreeScene

    facet = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    return lambda path: EmbreeScene(np.ascontiguousarray(np.fromfile(path, facet, offset=84)["v"]))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
