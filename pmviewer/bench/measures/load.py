"""Opening large PLY, OBJ and STL files: time and memory from the file to the tree, against Mitsuba's and Embree's."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.errors import PmviewerError

MOST_RATIO, MOST_BYTES = 1.5, 250.0
MILLIONS, QUICK_MILLIONS = (1, 5, 10), (1,)
_GROUPS, _SECONDS_FOR_GROUPS = 50_000, 10.0


def bumpy_ball(triangles: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices (v, 3) and faces (about `triangles`, 3) of a ball with bumps of several sizes."""
    k = int((triangles / 2) ** 0.5)
    i, j = np.meshgrid(np.arange(k + 1), np.arange(k + 1), indexing="ij")
    u, v = i / k * 2 * np.pi, j / k * np.pi
    r = 1 + 0.1 * np.sin(9 * u) * np.sin(7 * v) + 0.003 * np.sin(300 * u) * np.sin(211 * v)
    vertices = np.stack([r * np.sin(v) * np.cos(u), r * np.cos(v), r * np.sin(v) * np.sin(u)], -1)
    a = (np.arange(k)[:, None] * (k + 1) + np.arange(k)).reshape(-1)
    faces = np.stack([a, a + 1, a + k + 2, a, a + k + 2, a + k + 1], 1).reshape(-1, 3)
    return vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def write_ply(path: Path, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    """Binary, as scanning programs write it."""
    rows = np.empty(len(faces), [("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with open(path, "wb") as file:
        file.write(header.encode())
        vertices.astype("<f4").tofile(file)
        rows.tofile(file)


def write_stl(path: Path, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    """Binary, without normals."""
    rows = np.zeros(len(faces), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows["v"] = vertices[faces]
    with open(path, "wb") as file:
        file.write(b"made by pmviewer bench load".ljust(80) + np.array(len(faces), "<u4").tobytes())
        rows.tofile(file)


def write_obj(path: Path, vertices: NDArray[np.float32], faces: NDArray[np.int32], groups: int = 1) -> None:
    """Positions and triangles, in that many groups."""
    with open(path, "w") as file:
        for points in np.array_split(vertices, max(1, len(vertices) // 100_000)):
            file.write("".join([f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points.tolist()]))
        pieces = groups if groups > 1 else max(1, len(faces) // 100_000)
        for k, part in enumerate(np.array_split(faces + 1, pieces)):
            name = f"g part{k}\nusemtl m{k % 100}\n" if groups > 1 else ""
            file.write(name + "".join([f"f {a} {b} {c}\n" for a, b, c in part.tolist()]))


WRITERS = {"ply": write_ply, "obj": write_obj, "stl": write_stl}
PEERS = {"ply": "mitsuba", "obj": "mitsuba", "stl": "embree"}
"""Mitsuba reads no STL: there NumPy reads the file and Embree builds its tree."""


def measure(who: str, path: Path, warm: Path) -> dict[str, float]:
    """Open the file in a process of its own, after a small one of its kind: `seconds`, `cpu`, and the `peak` and
    `resident` memory in bytes beyond that of the process before. Raises PmviewerError."""
    command = [sys.executable, "-m", "pmviewer.bench.measures.load_child", who, str(path), str(warm)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        said = done.stderr.strip().splitlines()
        raise PmviewerError(f"{who} could not open {path.name}: {said[-1][:300] if said else done.returncode}")
    result: dict[str, float] = json.loads(lines[-1])
    return result


def run(quick: bool = False) -> BenchResult:
    """Each file is opened by turns; the best of the rounds counts, for whatever else runs only adds."""
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    rounds = 3
    missing = {p for p in set(PEERS.values()) if importlib.util.find_spec({"embree": "embreex"}.get(p, p)) is None}
    with tempfile.TemporaryDirectory(prefix="pmviewer-bench-") as folder:
        for millions in QUICK_MILLIONS if quick else MILLIONS:
            mesh, small = bumpy_ball(millions * 1_000_000), bumpy_ball(200)
            for ending, write in WRITERS.items():
                path, warm = Path(folder) / f"large.{ending}", Path(folder) / f"small.{ending}"
                write(path, *mesh)
                write(warm, *small)
                peer = PEERS[ending]
                runs: dict[str, list[dict[str, Any]]] = {"pmviewer": [], peer: []}
                for _ in range(rounds):
                    for who, found in runs.items():
                        if who not in missing:
                            found.append(measure(who, path, warm))
                path.unlink()
                n = len(mesh[1])
                best = {who: min(r["seconds"] for r in found) for who, found in runs.items() if found}
                cpu = {who: min(r["cpu"] for r in found) for who, found in runs.items() if found}
                peak, resident = (max(r[k] for r in runs["pmviewer"]) / n for k in ("peak", "resident"))
                ratio = best["pmviewer"] / best[peer] if peer in best else float("nan")
                rows.append(
                    [
                        ending, n, best["pmviewer"], peer, best.get(peer, float("nan")), ratio, cpu["pmviewer"],
                        cpu.get(peer, float("nan")), peak, resident,
                    ]
                )  # fmt: skip
                what = f"{ending}, {millions} M triangles"
                targets.append(Target("L1", ratio, MOST_RATIO, "", False, f"{what}, time over {peer}'s"))
                targets.append(Target("L2", peak, MOST_BYTES, "bytes/triangle", False, f"{what}, peak while loading"))
        path, warm = Path(folder) / "groups.obj", Path(folder) / "small.obj"
        write_obj(path, *bumpy_ball(4 * _GROUPS), groups=_GROUPS)
        groups = measure("pmviewer", path, warm)["seconds"]
        targets.append(Target("L3", groups, _SECONDS_FOR_GROUPS, "s", False, f"OBJ of {_GROUPS:,} groups"))
    columns = [
        "file", "triangles", "s", "peer", "peer s", "ratio", "CPU s", "peer CPU s", "peak bytes/triangle",
        "resident bytes/triangle",
    ]  # fmt: skip
    notes = [f"{len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()} processors"]
    notes += [f"{peer} is not installed: nothing to compare with" for peer in sorted(missing)]
    return BenchResult("Opening large meshes: from the file to the tree", columns, rows, targets, notes)
