"""The light table: rows, powers and distributions of all lights, as kernels read them (`pmviewer.kernels.scene`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels import scene as K
from pmviewer.scene.arrays.glows import Glow
from pmviewer.scene.arrays.light_places import EVERYWHERE, Place, place_of_light, place_of_shape
from pmviewer.scene.arrays.sky_facing import facing_tables
from pmviewer.scene.arrays.sky_table import sky_table
from pmviewer.scene.description import (
    LUMINANCE,
    ConstantEnvironment,
    Cylinder,
    DirectionalLight,
    Disk,
    Environment,
    ImageEnvironment,
    Light,
    Mesh,
    Parallelogram,
    PointLight,
    ProjectorLight,
    Scene,
    Sphere,
    SpotLight,
)
from pmviewer.scene.emission import emitted_power
from pmviewer.scene.projector import brightest_intensity, projector_arrays

Float = NDArray[np.float32]
BRIGHTEST = 1e32
"""Radiance or intensity, a factor of a million from the end of float32: squares of small distances divide it."""


def _areas(corners: Float) -> NDArray[np.float64]:
    """Of triangles (n, 3, 3)."""
    corners64 = corners.astype(float)
    cross = np.cross(corners64[:, 1] - corners64[:, 0], corners64[:, 2] - corners64[:, 0])
    return np.asarray(np.linalg.norm(cross, axis=1) / 2)


class LightTable:
    """Emitting shapes in order, then the scene's other lights, then media that emit (`glows`).

    `more` tells whether there are lights of the kinds that need LIGHT_FIELDS, `sky` is the image environment,
    `projectors` are those in the order of their rows.
    """

    def __init__(
        self,
        scene: Scene,
        vertices: Float,
        shape_of_prim: NDArray[np.integer],
        radius: float,
        glows: Sequence[Glow] = (),
    ) -> None:
        self.of_shape = np.full(len(scene.shapes), -1, np.int64)
        self.environment = -1
        rows: list[list[float]] = []
        powers: list[NDArray[np.float64]] = []
        names: list[str] = []
        places: list[Place] = []
        triangles: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
        cdfs: list[NDArray[np.float64]] = [np.zeros(0)]
        listed = 0
        shape_of_triangle = shape_of_prim[: len(vertices)]  # in ascending order
        ends = np.searchsorted(shape_of_triangle, np.arange(len(scene.shapes) + 1, dtype=shape_of_prim.dtype))
        shine = np.array([shape.shines for shape in scene.shapes], bool)
        areas = np.zeros(len(vertices))
        if shine.any():
            lit = np.flatnonzero(np.repeat(shine, np.diff(ends)))
            areas[lit] = _areas(vertices[lit])
        for index, shape in enumerate(scene.shapes):
            if shape.radiance is None or not shine[index]:
                continue
            row = [0.0] * K.LIGHT_COLUMNS
            row[K.L_RADIANCE : K.L_RADIANCE + 3] = shape.radiance
            if isinstance(shape.geometry, Mesh):
                own = slice(ends[index], ends[index + 1])
                area = float(areas[own].sum())
                row[K.L_KIND], row[K.L_FIRST], row[K.L_COUNT] = K.MESH, listed, own.stop - own.start
                triangles.append(np.arange(own.start, own.stop))
                cdfs.append(np.cumsum(areas[own]) / area)
                listed += own.stop - own.start
            else:
                area = _fill_shape(row, shape.geometry)
            row[K.L_AREA] = area
            self.of_shape[index] = len(rows)
            rows.append(row)
            places.append(place_of_shape(shape, area))
            powers.append(math.pi * area * np.array(shape.radiance))
            names.append(shape.name)
        self.sky: ImageEnvironment | None = None
        self.projectors: list[ProjectorLight] = []
        self.more = False
        for light in scene.lights:
            if isinstance(light, Environment):
                self.environment = len(rows)
            if isinstance(light, ImageEnvironment):
                self.sky, self._sky_table = light, sky_table(light.pixels)
            self.more = self.more or isinstance(light, SpotLight | ProjectorLight | DirectionalLight | ImageEnvironment)
            places.append(place_of_light(light))
            powers.append(emitted_power(light, radius))
            rows.append(self._row(light))
            if isinstance(light, ProjectorLight):
                rows[-1][K.L_AREA] = float(powers[-1] @ LUMINANCE)
                rows[-1][K.L_FIRST] = len(self.projectors)
                self.projectors.append(light)
            names.append(light.name)
        self.first_glow = len(rows)
        for number, glow in enumerate(glows):
            row = [0.0] * K.LIGHT_COLUMNS
            row[K.L_KIND], row[K.L_FIRST] = K.GLOW, number
            row[K.L_RADIANCE : K.L_RADIANCE + 3] = (glow.power / (4 * math.pi)).tolist()
            row[K.L_A : K.L_A + 3] = glow.center.tolist()
            rows.append(row)
            places.append(EVERYWHERE)
            powers.append(glow.power)
            names.append(glow.name)
        if not rows or not any(p.max() > 0 for p in powers):
            raise SceneError("The scene has no light.", scene.path, hint="Add an emitter, or open it with one.")
        for name, row in zip(names, rows, strict=True):
            brightest = max(row[K.L_RADIANCE : K.L_RADIANCE + 3])
            if not brightest < BRIGHTEST:
                what = f"The light '{name}' is too bright: {brightest:g}, where {BRIGHTEST:g} is the most."
                raise SceneError(what, scene.path, hint="Scale all lights down alike.")
        self.rows = np.array(rows, np.float32)
        self.places = np.array(places, np.float32)
        self.power = np.array(powers)
        self.names = tuple(names)
        self.cdf = self._by_power()
        self.triangles = np.concatenate(triangles).astype(np.int32)
        self.triangle_cdf = np.concatenate(cdfs).astype(np.float32)

    def _by_power(self) -> Float:
        share = np.cumsum(self.power @ LUMINANCE)
        return np.concatenate([[0.0], share / share[-1]]).astype(np.float32)

    @property
    def spread(self) -> float:
        """The largest area of a surface that emits over the probability of its light; 0 without any."""
        areas, shares = self.rows[:, K.L_AREA].astype(np.float64), self.power @ LUMINANCE
        shown = self.of_shape[self.of_shape >= 0]
        with np.errstate(divide="ignore", over="ignore"):
            return float((areas[shown] / shares[shown]).max(initial=0.0) * shares.sum())

    def weaken_glows(self, shares: NDArray[np.float64]) -> None:
        """Media that emit have these shares (n,) of their power; rows and distribution change in place."""
        own = slice(self.first_glow, None)
        self.power[own] *= shares[:, None]
        self.rows[own, K.L_RADIANCE : K.L_RADIANCE + 3] *= shares[:, None].astype(np.float32)
        self.cdf[:] = self._by_power()

    def arrays(self) -> dict[str, NDArray]:
        """What all scenes have, by the record's field."""
        return {
            "lights": self.rows,
            "light_cdf": self.cdf,
            "light_places": self.places,
            "light_triangles": self.triangles,
            "light_triangle_cdf": self.triangle_cdf,
        }

    def sky_arrays(self) -> dict[str, NDArray]:
        """The image environment's arrays by the record's field; none without one."""
        if self.sky is None:
            return {}
        table = self._sky_table
        return {
            "sky_texels": self.sky.pixels,
            "sky_rows": table.rows,
            "sky_cells": table.cells,
            "sky_guide": table.guide,
            "sky_facings": facing_tables(table, self.sky.to_world),
        }

    def projector_arrays(self) -> dict[str, NDArray]:
        """The projectors' arrays by the record's field; none without one."""
        return projector_arrays(self.projectors)

    def _row(self, light: Light) -> list[float]:
        """Row of a light without a surface."""
        row = [0.0] * K.LIGHT_COLUMNS
        colour, a, b = slice(K.L_RADIANCE, K.L_RADIANCE + 3), slice(K.L_A, K.L_A + 3), slice(K.L_B, K.L_B + 3)
        if isinstance(light, PointLight):
            row[K.L_KIND], row[colour], row[a] = K.POINT, light.intensity, light.position
        elif isinstance(light, SpotLight):
            row[K.L_KIND], row[colour], row[a], row[b] = K.SPOT, light.intensity, light.position, light.axis
            row[K.L_CUTOFF], row[K.L_BEAM] = math.radians(light.cutoff), math.radians(light.beam)
        elif isinstance(light, ProjectorLight):
            row[K.L_KIND], row[colour], row[a] = K.PROJECTOR, (brightest_intensity(light),) * 3, light.position
            row[K.L_B : K.L_B + 6] = light.to_world.T[:2].ravel().tolist()
            row[K.L_FLIP] = 1.0 if np.linalg.det(light.to_world) > 0 else -1.0
            row[K.L_RADIUS], row[K.L_LENGTH] = light.half
        elif isinstance(light, DirectionalLight):
            row[K.L_KIND], row[colour], row[b] = K.DIRECTIONAL, light.irradiance, light.direction
        elif isinstance(light, ConstantEnvironment):
            row[K.L_KIND], row[colour] = K.ENVIRONMENT, light.radiance
        else:
            row[K.L_KIND], row[K.L_AREA] = K.IMAGE, 1 / self._sky_table.total
            row[K.L_A : K.L_A + 9] = light.to_world.T.ravel().tolist()
        return row


def _fill_shape(row: list[float], g: object) -> float:
    """Write an analytic light's geometry into its row; its area."""
    if isinstance(g, Parallelogram):
        row[K.L_KIND] = K.PARALLELOGRAM
        row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3], row[K.L_C : K.L_C + 3] = g.corner, g.edge_u, g.edge_v
        return float(np.linalg.norm(np.cross(g.edge_u, g.edge_v)))
    if isinstance(g, Disk):
        row[K.L_KIND], row[K.L_RADIUS] = K.DISK, g.radius
        row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3] = g.center, g.normal
        return math.pi * g.radius**2
    if isinstance(g, Sphere):
        row[K.L_KIND], row[K.L_RADIUS], row[K.L_FLIP] = K.SPHERE, g.radius, side_of(g)
        row[K.L_A : K.L_A + 3] = g.center
        return 4 * math.pi * g.radius**2
    assert isinstance(g, Cylinder)
    axis, length = axis_of(g)
    row[K.L_KIND], row[K.L_RADIUS], row[K.L_FLIP], row[K.L_LENGTH] = K.CYLINDER, g.radius, side_of(g), length
    row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3] = g.p0, axis
    return 2 * math.pi * g.radius * length


def side_of(g: Sphere | Cylinder) -> float:
    """1, or −1 when the normals are flipped."""
    return -1.0 if g.flip_normals else 1.0


def axis_of(g: Cylinder) -> tuple[NDArray[np.float64], float]:
    """Unit vector from `p0` to `p1`, and their distance."""
    offset = np.subtract(g.p1, g.p0)
    length = float(np.linalg.norm(offset))
    return offset / length, length
