"""Opens hostile files in a process of its own: `python -m pmviewer.bench.hostile.server` answers line by line."""

from __future__ import annotations

import gc
import json
import os
import time
import traceback
from typing import Any

from pmviewer.bench.guarded import forget_peak, requests, resident_bytes
from pmviewer.errors import SceneError

FRAMES = 3
"""Of a traceback, from its end."""


def main() -> None:
    """Answer until standard input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    from pmviewer.engine.opened import open_scene

    for request in requests():
        path = request["path"]
        gc.collect()
        gc.freeze()  # modules and what they keep: looking through them for each file took most of the time
        forget_peak()
        before, started = resident_bytes(), time.process_time()
        answer = _opened(open_scene, path)
        answer["cpu"] = time.process_time() - started
        answer["memory"] = max(resident_bytes(peak=True) - before, 0)
        print(json.dumps(answer), file=answers, flush=True)


def _opened(open_scene: Any, path: str) -> dict[str, Any]:
    """{"outcome": "scene" | "refused" | "traceback", "said": sentences, "where": file:line of a traceback}."""
    try:
        scene = open_scene(path).scene
        dropped = [f"{count} × {reason} left out" for reason, count in scene.dropped.items()]
        return {"outcome": "scene", "said": [*scene.warnings, *dropped]}
    except SceneError as error:
        return {"outcome": "refused", "said": [str(error).replace(path, "")]}
    except BaseException as error:  # whatever else comes is what we look for
        frames = traceback.extract_tb(error.__traceback__)
        own = [f"{f.filename.rsplit('pmviewer/', 1)[-1]}:{f.lineno}" for f in frames if "pmviewer" in f.filename]
        text = f"{type(error).__name__}: {str(error)[:200]}"
        return {"outcome": "traceback", "said": [text], "where": " < ".join(reversed(own[-FRAMES:]))}


if __name__ == "__main__":
    main()
