"""Tracing importons of small scenes, and brute-force importance to compare with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pmviewer.engine.immersion import immersed
from pmviewer.engine.opened import open_scene
from pmviewer.importance.importons import Rule, joined, trace
from pmviewer.maps.importance.build import build_importance
from pmviewer.maps.importance.look_up import importances
from pmviewer.render.camera import resolve_camera
from pmviewer.render.record import eye_record
from pmviewer.scene.description import PointLight
from pmviewer.settings.access import Settings

SHOWN = Rule(caustic=False, global_=True, gather=False, gather_specular=False, corner=0.0, glossy=0.2, max_depth=32)
GATHER = Rule(caustic=True, global_=True, gather=True, gather_specular=False, corner=0.0, glossy=0.2, max_depth=32)


def in_turn(tasks):
    return [task() for task in tasks]


def traced(scene, rule, N, run=in_turn, seed=1, first=0):
    """Importons of the scene's camera: what `trace` gives, the eye record and the opened scene."""
    if not scene.lights:  # importons don't care, but a scene has to have one
        scene = replace(scene, lights=(PointLight("lamp", (0.3, 0.9, 0.2), (1.0, 1.0, 1.0)),))
    opened = open_scene(scene)
    camera = immersed(opened.flat, resolve_camera(opened.scene, Settings().camera))
    eye = eye_record(camera, Settings(), 0)
    return trace(opened.flat, eye, rule, seed, first, N, run), eye, opened


def importons_of(scene, rule, N):
    """(caustic, global) importons with weights in pixels."""
    found, eye, _ = traced(scene, rule, N)
    return joined([found], int(eye[0]["width"]) * int(eye[0]["height"]))


def integral(importons, scene_radius, points, normal, area, even, kind="screen"):
    """∫Γ dA over a patch of that area, of which `points` (m, 3) are uniform ones."""
    built = build_importance(importons, kind, scene_radius, even=even)
    out = np.zeros(len(points), np.float32)
    normals = np.tile(np.array([normal], np.float32), (len(points), 1))
    importances(built.record, np.ascontiguousarray(points, np.float32), normals, out, 0, len(points))
    return float(out.mean(dtype=np.float64)) * area


def inside_polygon(points, polygon):
    """Which of points (m, 2) lie inside the polygon (k, 2), by crossings."""
    x, y = points.T
    inside = np.zeros(len(points), bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= ((y0 > y) != (y1 > y)) & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


def area_of(polygon):
    x, y = np.asarray(polygon).T
    return 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def cosine_directions(n, normals, rng):
    """Directions (n, 3) around unit normals (n, 3) with density cosθ/π."""
    z = np.sqrt(rng.random(n))
    phi, r = 2 * np.pi * rng.random(n), np.sqrt(1 - z * z)
    helper = np.where(np.abs(normals[:, :1]) > 0.5, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    s = np.cross(normals, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    t = np.cross(normals, s)
    return (r * np.cos(phi))[:, None] * s + (r * np.sin(phi))[:, None] * t + z[:, None] * normals


def to_cube(origins, directions):
    """Where rays from inside leave the cube [-1, 1]³, and its normal there, inwards."""
    with np.errstate(divide="ignore"):
        t = (np.sign(directions) - origins) / directions
    t = np.where(np.isfinite(t), t, np.inf)
    axis = t.argmin(axis=1)
    rows = np.arange(len(axis))
    points = origins + t[rows, axis][:, None] * directions
    normals = np.zeros_like(points)
    normals[rows, axis] = -np.sign(directions[rows, axis])
    return points, normals
