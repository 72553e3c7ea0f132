"""Meshes and pictures of random scenes: made from a few numbers, named by them, the same bytes every time."""

from __future__ import annotations

import hashlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.exr import write_exr
from pmviewer.output.png import write_png

Mesh = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]
"""Vertices, triangles, unit normals by vertex, texture coordinates by vertex."""
BUMPS = 0.25
"""Relative height of a blob's bumps."""


def _name(spec: dict[str, Any], ending: str) -> str:
    digest = hashlib.sha256(json.dumps(spec, sort_keys=True).encode()).hexdigest()[:10]
    return f"{spec['kind']}_{digest}.{ending}"


def _unit(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _octahedron(levels: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The unit sphere in 8·4^levels triangles that face outwards."""
    points: list[tuple[float, float, float]] = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}

        def between(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in middle:
                m = _unit(np.add(points[a], points[b]))
                points.append((float(m[0]), float(m[1]), float(m[2])))
                middle[key] = len(points) - 1
            return middle[key]

        split = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = split
    return np.array(points, np.float64), np.array(faces)


def _smooth(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Normals by vertex, faces weighed by area."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], across)
    return _unit(normals)


def make_mesh(spec: dict[str, Any]) -> Mesh:
    """The mesh of {"kind": blob, sheet, tetra or quad, "seed", "detail", "tilt": degrees that normals are tilted}.

    Blobs and tetrahedra are closed, within the unit ball; sheets and quads span −1…1 in x and y and face +z.
    """
    rng = np.random.default_rng(spec["seed"])
    detail, kind = int(spec["detail"]), spec["kind"]
    if kind in ("blob", "tetra"):
        if kind == "blob":
            vertices, faces = _octahedron(detail)
            waves = rng.normal(0, 1, (3, 3))
            vertices = vertices * (1 - BUMPS * (0.5 + 0.5 * np.sin(3 * vertices @ waves).mean(axis=1, keepdims=True)))
        else:
            vertices = _unit(
                np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) + rng.uniform(-0.3, 0.3, (4, 3))
            )
            faces = np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])
        u = np.arctan2(vertices[:, 1], vertices[:, 0]) / (2 * np.pi) + 0.5
        uv = np.stack([u, 0.5 + 0.5 * vertices[:, 2]], axis=-1)
    else:
        n = detail + 1 if kind == "sheet" else 2
        v, u = np.mgrid[0 : 1 : n * 1j, 0 : 1 : n * 1j]
        uv = np.stack([u.ravel(), v.ravel()], axis=-1)
        phase = rng.uniform(0, 2 * np.pi, 2)
        height = (
            0.15 * (np.sin(4 * uv[:, 0] + phase[0]) + np.cos(5 * uv[:, 1] + phase[1]))
            if kind == "sheet"
            else 0 * u.ravel()
        )
        vertices = np.stack([2 * uv[:, 0] - 1, 2 * uv[:, 1] - 1, height], axis=-1)
        a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
        faces = np.concatenate([np.stack([a, a + 1, a + n + 1], axis=-1), np.stack([a, a + n + 1, a + n], axis=-1)])
    normals = _smooth(vertices, faces)
    if spec["tilt"]:
        size = np.tan(np.radians(spec["tilt"]))
        towards = rng.normal(0, 1, 3) if kind == "quad" else rng.normal(0, 1, vertices.shape)
        aside = towards - (towards * normals).sum(axis=-1, keepdims=True) * normals
        normals = _unit(normals + size * _unit(aside))
    return vertices, faces, normals, uv


def mesh_file(spec: dict[str, Any], folder: Path) -> str:
    """Write the mesh unless it is there; its file's name. "format" is obj, ply or ascii ply; "normals" says whether the
    file has normals, "uv" whether it has texture coordinates."""
    name = _name(spec, "obj" if spec["format"] == "obj" else "ply")
    path = folder / name
    if not path.exists():
        mesh = make_mesh(spec)
        path.write_bytes(_obj(spec, mesh) if spec["format"] == "obj" else _ply(spec, mesh))
    return name


def _obj(spec: dict[str, Any], mesh: Mesh) -> bytes:
    vertices, faces, normals, uv = mesh
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"vt {u:.9g} {v:.9g}" for u, v in uv] if spec["uv"] else []
    lines += [f"vn {x:.9g} {y:.9g} {z:.9g}" for x, y, z in normals] if spec["normals"] else []
    for face in faces + 1:
        lines.append(
            "f " + " ".join(f"{i}/{i if spec['uv'] else ''}/{i if spec['normals'] else ''}".rstrip("/") for i in face)
        )
    return "\n".join([*lines, ""]).encode("ascii")


def _ply(spec: dict[str, Any], mesh: Mesh) -> bytes:
    vertices, faces, normals, uv = mesh
    columns, names = [vertices], ["x", "y", "z"]
    if spec["normals"]:
        columns, names = [*columns, normals], [*names, "nx", "ny", "nz"]
    if spec["uv"]:
        columns, names = [*columns, uv], [*names, "u", "v"]
    rows = np.concatenate(columns, axis=1).astype("<f4")
    binary = spec["format"] == "ply"
    header = ["ply", f"format {'binary_little_endian' if binary else 'ascii'} 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {n}" for n in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    head = "\n".join(header).encode("ascii")
    if binary:
        return head + rows.tobytes() + b"".join(struct.pack("<B3i", 3, *face) for face in faces.tolist())
    body = [" ".join(f"{x:.9g}" for x in row) for row in rows] + [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    return head + "\n".join([*body, ""]).encode("ascii")


def make_picture(spec: dict[str, Any]) -> NDArray[np.float64]:
    """(h, w, 3) from 0 to 1 of {"kind": colour, height, normal, roughness or sky, "seed", "width", "height"}.

    Some waves of whole periods, so that a repeated picture has no seam.
    """
    rng = np.random.default_rng(spec["seed"])
    h, w = int(spec["height"]), int(spec["width"])
    y, x = (np.mgrid[0:h, 0:w] + 0.5) * 2 * np.pi / np.array([h, w]).reshape(2, 1, 1)
    channels = []
    for _ in range(3):
        a, b = rng.integers(1, 3, 2)
        channels.append(np.sin(a * x + rng.uniform(0, 6)) * np.cos(b * y + rng.uniform(0, 6)))
    waves = np.stack(channels, axis=-1)
    kind = spec["kind"]
    if kind == "height":
        return 0.5 + 0.5 * np.repeat(waves[..., :1], 3, axis=-1)
    if kind == "roughness":
        return 0.35 + 0.25 * np.repeat(waves[..., :1], 3, axis=-1)
    if kind == "normal":
        tilted = np.stack([0.35 * waves[..., 0], 0.35 * waves[..., 1], np.ones((h, w))], axis=-1)
        return 0.5 + 0.5 * _unit(tilted)
    if kind == "sky":
        sun = np.exp(-8 * ((x - rng.uniform(1, 5)) ** 2 + (y - rng.uniform(0.5, 3)) ** 2))
        return 0.3 + 0.2 * waves + 6 * sun[..., None]
    return 0.5 + 0.4 * waves


def picture_file(spec: dict[str, Any], folder: Path) -> str:
    """Write the picture unless it is there; its file's name. Skies are EXR files, so are those that say "exr"."""
    hdr = spec["kind"] == "sky" or spec.get("exr", False)
    name = _name(spec, "exr" if hdr else "png")
    path = folder / name
    if not path.exists():
        pixels = make_picture(spec)
        if hdr:
            write_exr(path, {"": pixels.astype(np.float32)}, {})
        else:
            write_png(path, np.round(255 * pixels).clip(0, 255).astype(np.uint8))
    return name


def grid_file(spec: dict[str, Any], folder: Path) -> str:
    """Write the volume unless it is there; its file's name. Nothing is at its border, where Mitsuba lets turned
    lattices go on up to the corners of the box around them."""
    name = _name(spec, "vol")
    path = folder / name
    if not path.exists():
        nx, ny, nz = spec["sides"]
        values = np.random.default_rng(spec["seed"]).random((nz, ny, nx, spec["channels"]), np.float32) ** 2
        values = np.pad(values, ((1, 1), (1, 1), (1, 1), (0, 0)))
        head = struct.pack("<3sB5i6f", b"VOL", 3, 1, nx + 2, ny + 2, nz + 2, spec["channels"], 0, 0, 0, 1, 1, 1)
        path.write_bytes(head + values.astype("<f4").tobytes())
    return name
