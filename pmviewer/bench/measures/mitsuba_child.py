"""Mitsuba 3 in a process of its own: `python -m pmviewer.bench.measures.mitsuba_child` reads a job as JSON from
standard input.

Its just-in-time compiler aborts the whole process when it meets an LLVM that it can't use, so the parent
(`pmviewer.bench.peer`) must survive it. Nothing of pmviewer's kernels is loaded here: the CPU time is Mitsuba's alone.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
from glob import glob
from typing import Any

import numpy as np

LIBRARIES = ("/usr/lib/*/libLLVM.so.*", "/usr/lib/*/libLLVM-*.so*", "/usr/lib/llvm-*/lib/libLLVM*.so*")
CHUNK = 64
"""Most samples per pixel rendered at once: more would not fit into memory as one wavefront."""


def newest_llvm() -> str | None:
    """The newest LLVM in the system's folders. Mitsuba's own choice may be too old for it, which ends the process."""
    named = [(re.search(r"libLLVM(?:\.so\.|-)(\d+)", file), file) for at in LIBRARIES for file in glob(at)]
    return max(((int(match[1]), file) for match, file in named if match), default=(0, None))[1]


def main() -> None:
    """Read {variant, path, parameters, mode, …} and write the arrays that the mode yields to the file `out` (.npz)."""
    job = json.load(sys.stdin)
    if library := newest_llvm():
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)
    import mitsuba as mi

    mi.set_variant(job["variant"])
    mi.set_log_level(mi.LogLevel.Error)
    integrator = None
    if job["mode"] == "file":
        from pmviewer.bench.files.mitsuba_file import small_scene

        scene, integrator, _ = small_scene(mi, {"path": job["path"], **job["request"]})
    else:
        scene = mi.load_file(job["path"], **job["parameters"])

    def render(spp: int, seed: int) -> Any:
        return np.array(mi.render(scene, spp=spp, seed=seed, integrator=integrator), np.float64)[..., :3]

    if job["mode"] == "runs":
        arrays = runs(render, job["runs"], job["spp"], job.get("first", 1))
    else:
        arrays = curve(render, job["budget"])
    if job["mode"] == "file":
        both = [averaged(render, job["references"], first) for first in (1_000_000, 2_000_000)]
        arrays["references"] = np.array(both, np.float32)
    np.savez(job["out"], **arrays)


def averaged(render: Any, budget: float, first: int) -> Any:
    """The mean image of that many CPU seconds, with seeds from `first` on."""
    total, count, end = 0.0, 0, time.process_time() + budget
    while count == 0 or time.process_time() < end:
        total = total + render(CHUNK, first + count)
        count += 1
    return total / count


def curve(render: Any, budget: float) -> dict[str, Any]:
    """The mean image after 1, 2, 4, … samples per pixel, until `budget` CPU seconds are spent.

    Each size of wavefront is rendered once before the clock runs, which compiles it.
    """
    total, spp, spent, seed = 0.0, 0, 0.0, 1
    samples, seconds, images = [], [], []
    known = 0
    while spent < budget:
        chunk = min(max(spp, 1), CHUNK)
        if chunk != known:
            render(chunk, 0)
            known = chunk
        start = time.process_time()
        total = total + chunk * render(chunk, seed)
        spent += time.process_time() - start
        spp, seed = spp + chunk, seed + 1
        if spp & (spp - 1) == 0 or spent >= budget:
            samples.append(spp)
            seconds.append(spent)
            images.append((total / spp).astype(np.float32))
    return {"spp": np.array(samples), "cpu": np.array(seconds), "images": np.array(images)}


def runs(render: Any, count: int, spp: int, first: int) -> dict[str, Any]:
    """`count` independent images of `spp` samples per pixel, with seeds from `first` on."""
    images = []
    for run in range(count):
        parts = [min(CHUNK, spp - done) for done in range(0, spp, CHUNK)]
        images.append(sum(n * render(n, first + run * len(parts) + i) for i, n in enumerate(parts)) / spp)
    return {"images": np.array(images, np.float32)}


if __name__ == "__main__":
    main()
