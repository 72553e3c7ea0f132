"""Mitsuba 3 for many small scenes: `python -m pmviewer.bench.agree.mitsuba_server` answers requests line by line.

A request is a line of JSON on standard input, the answer one on standard output; pictures go through files. The variant
is `scalar_rgb`: nothing is compiled for a scene, which pays for tiny pictures. The program is a process of its own,
because a Mitsuba that gives up takes its process along.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import numpy as np

RR_DEPTH = 8
THREADS = 2
"""With one alone, as where a process may use one processor, Mitsuba 3.9.1 waits for ever when it reads an EXR file."""
GRID = 2
"""Rays along a pixel's edge that look for smooth mirrors and glass."""


def main() -> None:
    """Answer {"path", "mode", …} until standard input ends. `mode` is an integrator or "mask"."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what Mitsuba prints is no answer
    import drjit
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    drjit.set_thread_count(THREADS)
    mi.set_log_level(mi.LogLevel.Error)
    loaded: tuple[str, Any] = ("", None)
    for line in sys.stdin:
        request = json.loads(line)
        if request["mode"] == "file":  # a file that somebody wrote: pmviewer.bench.files
            from pmviewer.bench.files.mitsuba_file import answer as answer_of

            print(json.dumps(answer_of(mi, request)), file=answers, flush=True)
            continue
        try:
            if loaded[0] != request["path"]:
                loaded = request["path"], mi.load_file(request["path"], parallel=False)
            work = seen_plainly if request["mode"] == "mask" else pictures
            np.save(request["out"], work(mi, loaded[1], request))
            answer = {}
        except RuntimeError as error:
            answer = {"error": " ".join(str(error).split())[:300]}
        print(json.dumps(answer), file=answers, flush=True)


def pictures(mi: Any, scene: Any, request: dict[str, Any]) -> Any:
    """(runs, h, w, 3) images by the integrator `mode` ("path", "ptracer" or "direct bsdf") of `spp` samples each, with
    the seeds that `seeds` lists."""
    depth = {"max_depth": request["max_depth"], "rr_depth": RR_DEPTH}
    if request["mode"] == "direct bsdf":
        integrator = mi.load_dict({"type": "direct", "emitter_samples": 0, "bsdf_samples": 1})
    else:
        integrator = mi.load_dict({"type": request["mode"], **depth})
    images = [
        np.array(mi.render(scene, integrator=integrator, spp=request["spp"], seed=seed), np.float64)[..., :3]
        for seed in request["seeds"]
    ]
    return np.array(images)


def seen_plainly(mi: Any, scene: Any, request: dict[str, Any]) -> Any:
    """(h, w): whether no ray of a pixel or its neighbours first meets a surface with a lobe of one direction."""
    sensor = scene.sensors()[0]
    width, height = sensor.film().size()
    delta = np.zeros((height, width), bool)
    steps = (np.arange(GRID) + 0.5) / GRID
    for y in range(height):
        for x in range(width):
            for v in steps:
                for u in steps:
                    place = mi.Point2f(float((x + u) / width), float((y + v) / height))
                    ray, _ = sensor.sample_ray(0.0, 0.5, place, mi.Point2f(0.5, 0.5))
                    hit = scene.ray_intersect(ray)
                    if hit.is_valid() and mi.has_flag(hit.bsdf(ray).flags(), mi.BSDFFlags.Delta):
                        delta[y, x] = True
                if delta[y, x]:
                    break
    padded = np.pad(delta, 1)
    near = [padded[j : j + height, i : i + width] for j in range(3) for i in range(3)]
    return ~np.any(near, axis=0)


if __name__ == "__main__":
    main()
