"""Mitsuba 3 as a peer: error curves and independent images of the very files that pmviewer renders.

Needs the optional package (`pip install pmviewer[mitsuba]`). The variant `llvm_ad_rgb` is taken when its compiler works
on this machine, `scalar_rgb` otherwise. CPU seconds are the process's own around each render, all threads summed;
loading and compiling are left out.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import PmviewerError
from pmviewer.resources import data_folder

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
MISSING = "Mitsuba 3 is not installed: nothing to compare with. Install the extra: pip install 'pmviewer[mitsuba]'."
PROBE = "cornell_diffuse"


def installed() -> bool:
    """Whether the package is there; whether it works is only known by trying."""
    return importlib.util.find_spec("mitsuba") is not None


def _child(job: Mapping[str, Any]) -> tuple[dict[str, NDArray[Any]] | None, str]:
    """The arrays that a job yields, or None and the last line of what the process said before it failed."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "result.npz"
        text = json.dumps({**job, "out": str(out)})
        command = [sys.executable, "-m", "pmviewer.bench.measures.mitsuba_child"]
        done = subprocess.run(command, input=text, capture_output=True, text=True, errors="replace")
        if done.returncode == 0 and out.is_file():
            with np.load(out) as arrays:
                return {name: arrays[name] for name in arrays.files}, ""
    said = [line for line in done.stderr.splitlines() if line.strip()]
    return None, said[-1].strip()[:300] if said else f"exit status {done.returncode}"


@cache
def variant() -> str:
    """The first variant that renders a small picture. Raises PmviewerError when none does."""
    if not installed():
        raise PmviewerError(MISSING)
    reason = ""
    for name in VARIANTS:
        job = _job(PROBE, {"res": "16"}, name) | {"mode": "runs", "runs": 1, "spp": 1}
        arrays, reason = _child(job)
        if arrays is not None:
            return name
    raise PmviewerError(f"Mitsuba 3 is installed but renders nothing: {reason}")


def _job(scene: str | Path, parameters: Mapping[str, str], of_variant: str) -> dict[str, Any]:
    path = scene if isinstance(scene, Path) else data_folder("scenes") / scene / "scene.xml"
    return {"path": str(path), "parameters": dict(parameters), "variant": of_variant}


def _run(scene: str | Path, parameters: Mapping[str, str], **job: Any) -> dict[str, NDArray[Any]]:
    arrays, reason = _child(_job(scene, parameters, variant()) | job)
    if arrays is None:
        raise PmviewerError(f"Mitsuba 3 ({variant()}) could not render {scene}: {reason}")
    return arrays


def error_images(scene: str, budget: float) -> tuple[list[int], list[float], NDArray[np.float32]]:
    """Samples per pixel, CPU seconds and images (n, h, w, 3) of the path integrator up to `budget` CPU seconds.

    Raises PmviewerError when Mitsuba is missing or can't render the scene.
    """
    arrays = _run(scene, {}, mode="curve", budget=budget)
    return arrays["spp"].tolist(), arrays["cpu"].tolist(), arrays["images"]


def independent_images(
    scene: str | Path, parameters: Mapping[str, str], runs: int, spp: int, first: int = 1
) -> NDArray[np.float32]:
    """(runs, h, w, 3) images of a bundled scene or a file with different seeds, from `first` on; those of
    `error_images` are small. Raises PmviewerError as above."""
    return _run(scene, parameters, mode="runs", runs=runs, spp=spp, first=first)["images"]


def file_images(path: Path, longest: int, depth: int, budget: float, references: float) -> dict[str, NDArray[Any]]:
    """Of a file that somebody wrote, with sides of at most so many pixels and paths of at most `depth` scatterings:
    `spp`, `cpu` and `images` as from `error_images`, and two `references` (2, h, w, 3) of that many CPU seconds each.
    Raises PmviewerError as above."""
    request = {"longest": longest, "max_depth": depth + 1, "media_depth": depth + 1}
    return _run(path, {}, mode="file", budget=budget, references=references, request=request)
