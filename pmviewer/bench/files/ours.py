"""Our side of a file, in a process of its own: `python -m pmviewer.bench.files.ours` answers requests line by line.

"survey" says what kind of file it is, "load" opens it, "picture" renders it by the default method, which gives what a
user sees, and by the path tracer to the depth that Mitsuba renders, which gives what is compared.
"""

from __future__ import annotations

import base64
import io
import json
import os
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np

from pmviewer.bench.files.mitsuba_file import noise, small_size
from pmviewer.bench.guarded import requests
from pmviewer.errors import PmviewerError

DARK = 1 / 255
"""Displayed value up to which a pixel counts as black."""
LUMINANCE = (0.2126, 0.7152, 0.0722)
LEAST_PASSES = 16


def main() -> None:
    """Answer until standard input ends. An answer holds "error", a sentence for the user, or "crash", a traceback,
    where there is nothing else to say."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for request in requests():
        try:
            answer = _WORK[request["do"]](request)
        except PmviewerError as error:
            answer = {"error": str(error).removeprefix(f"{request['path']}: ").removeprefix(request["path"])}
        except Exception:  # exactly what this process is there to find
            answer = {"crash": traceback.format_exc(limit=-4)}
        print(json.dumps(answer), file=answers, flush=True)


_opened: dict[str, Any] = {}
"""The last file, so that it isn't loaded again for its picture."""


def load(request: dict[str, Any]) -> dict[str, Any]:
    """{"seconds", "cpu", "warnings", "triangles", "size"} of opening a file as the window does. Raises SceneError."""
    from pmviewer.engine.opened import open_scene

    _opened.clear()
    started, cpu = time.perf_counter(), time.process_time()
    opened = open_scene(request["path"])
    seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
    _opened[request["path"]] = opened
    scene = opened.scene
    dropped = [f"{count} × {reason} left out" for reason, count in scene.dropped.items()]
    faces = sum(len(getattr(shape.geometry, "faces", ())) for shape in scene.all_shapes)
    return {"seconds": seconds, "cpu": cpu, "warnings": [*scene.warnings, *dropped], "triangles": faces,
            "size": [scene.width, scene.height]}  # fmt: skip


def picture(request: dict[str, Any]) -> dict[str, Any]:
    """{"luminance", "dark", "png", "default"} of the default method's picture, and with "paths" the path tracer's
    {"means": (n, 3) of one pass each}. The request's "size" is Mitsuba's choice if it rendered the file."""
    from pmviewer.engine.opened import open_scene
    from pmviewer.engine.pool import WorkPool

    path = request["path"]
    opened = _opened.get(path) or open_scene(path)
    size = request.get("size") or small_size(opened.scene.width, opened.scene.height, request["longest"])
    pool = WorkPool(1)
    try:
        answer = _seen(opened, size, request["passes"], pool)
        if request.get("paths"):
            answer["means"] = _paths(opened, size, request, pool)
    finally:
        pool.close()
    return answer


def _renderer(opened: Any, values: dict[str, Any], pool: Any) -> Any:
    from pmviewer.engine.prepare import prepare
    from pmviewer.engine.renderer import Renderer
    from pmviewer.engine.store import StageStore
    from pmviewer.settings.access import Settings, with_values

    settings = with_values(Settings(), values)
    prepare(opened, settings, pool, lambda text, share: None)
    return Renderer(opened, settings, pool, StageStore(0))


def _seen(opened: Any, size: Any, passes: int, pool: Any) -> dict[str, Any]:
    from PIL import Image

    from pmviewer.output.frame_export import exposure_of
    from pmviewer.output.tone import display_image, to_uint8

    renderer = _renderer(opened, {"camera.width": size[0], "camera.height": size[1]}, pool)
    if opened.scene.exposure is None:
        renderer.coarse_frame(0)  # as in the window it decides the exposure
    for _ in range(passes):
        renderer.step()
    frame = renderer.frame(1)
    radiance = frame.image().astype(np.float64)
    display = frame.settings.display
    shown = display_image("beauty", frame.image(), exposure_of(frame, display), display.tone).pixels
    buffer = io.BytesIO()
    Image.fromarray(to_uint8(shown)).save(buffer, "PNG")
    return {
        "luminance": float(np.mean(radiance @ LUMINANCE)),
        "dark": float(np.mean(shown.max(axis=-1) <= DARK)),
        "grey": float(np.mean(shown @ np.array(LUMINANCE))),
        "default": [float(v) for v in radiance.mean(axis=(0, 1))],
        "png": base64.b64encode(buffer.getvalue()).decode("ascii"),
        "said": list(frame.statistics.warnings),
    }


def _paths(opened: Any, size: Any, request: dict[str, Any], pool: Any) -> list[list[float]]:
    values = {
        "camera.width": size[0], "camera.height": size[1], "render.method": "path",
        "render.max_depth": request["max_depth"],
    }  # fmt: skip
    renderer = _renderer(opened, values, pool)
    means: list[list[float]] = []
    total = np.zeros(3)
    started = time.process_time()
    while True:
        renderer.step()
        grown = renderer.frame(0).image().astype(np.float64).mean(axis=(0, 1)) * renderer.passes
        means.append([float(v) for v in grown - total])
        total = grown
        if len(means) < 2:
            continue
        spent = time.process_time() - started
        enough = len(means) >= LEAST_PASSES and noise(np.array(means)) < request["noise"]
        if spent > request["cpu"] or enough:
            return means


def survey(request: dict[str, Any]) -> dict[str, Any]:
    """`pmviewer.bench.files.survey.Survey` of a file, as a dictionary."""
    from pmviewer.bench.files.survey import survey as look

    return look(Path(request["path"])).as_dict()


_WORK = {"survey": survey, "load": load, "picture": picture}

if __name__ == "__main__":
    main()
