"""How much light a file's lights bring to what its camera sees: enough to show the scene, or next to nothing.

Files that were made for viewers with lights of their own often have something that glows, an indicator or a screen, and
nothing that lights. A few hundred points that the camera sees are asked for the light that reaches them straight from
the lights and over one more surface, in the scene's coarse triangles. Mirrors don't count, glass is not in the way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.blends import mean_colour
from pmviewer.scene.arrays.tessellate import triangles_of
from pmviewer.scene.defaults.picture_rating import picture_rays
from pmviewer.scene.defaults.proxy import Proxy
from pmviewer.scene.description import (
    LUMINANCE,
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Light,
    Material,
    PointLight,
    ProjectorLight,
    Scene,
    Shape,
    SpotLight,
)
from pmviewer.scene.projector import intensity_towards
from pmviewer.scene.texture import Bitmap

Float = NDArray[np.float64]
SIDE = 16
SAMPLES = 24
BOUNCED = 4
ALBEDO = 0.5
LIT = 0.02
"""Radiance of a white surface from which on it is lit by surfaces that glow; a white screen shows 1."""
LIT_SHARE = 0.3
"""Of the points that must be lit."""
GLOWING_SHARE = 0.5
"""Of the picture, that needs no light."""
GLOW = 0.02
GLOW_OF_ALBEDO = 0.1
"""Glow darker than this part of the albedo, by luminance, is a tint: exporters leave it on things that want light."""
LIGHTS_SHARE = 0.2
"""Of the points that must be reached by the file's point, spot and directional lights, or its environment."""


def lights_enough(scene: Scene, proxy: Proxy, occluders: Proxy | None, camera: Camera) -> bool:
    """Do the scene's lights show what the camera sees? `occluders` are its surfaces without those that let light
    through, which cast no shadows here."""
    if not scene.lights and not any(s.radiance for s in scene.shapes):
        return False
    rays = picture_rays(camera, SIDE)
    hits = proxy.closest(np.broadcast_to(camera.origin, rays.shape), rays)
    if not hits.met.any():
        return True  # nothing to light
    shapes = proxy.shape[hits.triangle[hits.met]]
    glowing = np.array([_glowing_share(shape, scene.materials[shape.material]) for shape in scene.all_shapes])
    if glowing[shapes].mean() >= GLOWING_SHARE:
        return True
    rays = rays[hits.met]
    points = np.asarray(camera.origin) + hits.distance[hits.met, None] * rays
    normals = proxy.normals[hits.triangle[hits.met]]
    normals = normals * np.where((normals * rays).sum(axis=1) > 0, -1.0, 1.0)[:, None]
    rng = np.random.default_rng(1)
    reach = _Reach(scene, occluders, rng)
    bounced, owner, after = _bounce(proxy, points, normals, rng)
    glow = reach.from_surfaces(points, normals)
    glow += np.bincount(owner, reach.from_surfaces(*bounced) * after, len(points))
    if (glow >= LIT).mean() >= LIT_SHARE:
        return True
    light = reach.from_lights(points, normals)
    light += np.bincount(owner, reach.from_lights(*bounced) * after, len(points))
    return bool((light > 1e-3 * light.max()).mean() >= LIGHTS_SHARE) if light.max() > 0 else False


def _glowing_share(shape: Shape, material: Material) -> float:
    """Share of the shape's surface that glows visibly, and so that it shows more than light on it would."""
    if shape.radiance is None or not max(shape.radiance) > 0:
        return 0.0
    albedo = np.dot(mean_colour(material, lambda part: part.reflectance), LUMINANCE)
    if np.dot(shape.radiance, LUMINANCE) < GLOW_OF_ALBEDO * albedo:
        return 0.0
    if not isinstance(shape.emission, Bitmap):
        return float(max(shape.radiance) >= GLOW)
    brightest = shape.emission.pixels.max(axis=2).astype(np.float64)
    return float((brightest > GLOW * float(brightest.max())).mean())


Bounced = tuple[tuple[Float, Float], NDArray[np.int64], float]


def _bounce(proxy: Proxy, points: Float, normals: Float, rng: np.random.Generator) -> Bounced:
    """Where rays from the points meet surfaces: (places, normals), which point each is of, and its weight."""
    many, facing = np.repeat(points, BOUNCED, axis=0), np.repeat(normals, BOUNCED, axis=0)
    rays = _cosine(facing, rng)
    hits = proxy.closest(many, rays)
    places = many[hits.met] + hits.distance[hits.met, None] * rays[hits.met]
    other = proxy.normals[hits.triangle[hits.met]]
    other = other * np.where((other * rays[hits.met]).sum(axis=1) > 0, -1.0, 1.0)[:, None]
    return (places, other), np.repeat(np.arange(len(points)), BOUNCED)[hits.met], ALBEDO / BOUNCED


def _cosine(normals: Float, rng: np.random.Generator) -> Float:
    """Directions with the density of the cosine: the normal plus a point on the unit sphere."""
    sphere = rng.normal(size=normals.shape)
    d = normals + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    return d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-12)


class _Reach:
    """Radiance (luminance) that white surfaces at points (n, 3) with normals (n, 3) reflect."""

    def __init__(self, scene: Scene, occluders: Proxy | None, rng: np.random.Generator) -> None:
        self.scene, self.occluders, self.rng = scene, occluders, rng
        corners, radiance = [np.zeros((0, 3, 3))], [np.zeros(0)]
        for shape in scene.shapes:
            if shape.radiance is not None and max(shape.radiance) > 0:
                found, _ = triangles_of(shape.geometry, 16)
                corners.append(found)
                radiance.append(np.full(len(found), float(np.dot(shape.radiance, LUMINANCE))))
        self.corners, self.radiance = np.concatenate(corners), np.concatenate(radiance)
        cross = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self.areas = np.linalg.norm(cross, axis=1) / 2

    def _free(self, points: Float, normals: Float, rays: Float, distance: Float | float) -> NDArray[np.bool_]:
        facing = (rays * normals).sum(axis=1) > 0
        if self.occluders is None:
            return facing
        away = points + 2e-4 * self.occluders.radius * normals
        return facing & ~self.occluders.occluded(away, rays, distance)

    def from_surfaces(self, points: Float, normals: Float) -> Float:
        """Of surfaces that glow, on both sides."""
        power = np.cumsum(self.radiance * self.areas)
        if not len(power) or not power[-1] > 0:
            return np.zeros(len(points))
        n = len(points) * SAMPLES
        at = np.minimum(np.searchsorted(power, self.rng.random(n) * power[-1]), len(power) - 1)
        u, v = self.rng.random(n), self.rng.random(n)
        u, v = np.where(u + v > 1, 1 - u, u)[:, None], np.where(u + v > 1, 1 - v, v)[:, None]
        a, b, c = (self.corners[at, k] for k in range(3))
        places, starts = a + u * (b - a) + v * (c - a), np.repeat(points, SAMPLES, axis=0)
        facing = np.repeat(normals, SAMPLES, axis=0)
        way = places - starts
        distance = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        rays = way / distance[:, None]
        light = np.cross(b - a, c - a)
        light /= np.maximum(np.linalg.norm(light, axis=1, keepdims=True), 1e-300)
        geometry = (rays * facing).sum(axis=1) * np.abs((rays * light).sum(axis=1)) / distance**2
        least = 1e-3 * (self.occluders.radius if self.occluders else 1.0)
        seen = self._free(starts, facing, rays, distance - least) & (distance > least)
        return np.where(seen, geometry, 0.0).reshape(-1, SAMPLES).mean(axis=1) * power[-1] / math.pi

    def from_lights(self, points: Float, normals: Float) -> Float:
        """Of the other lights."""
        found = np.zeros(len(points))
        for light in self.scene.lights:
            found += self._of(light, points, normals)
        return found

    def _of(self, light: Light, points: Float, normals: Float) -> Float:
        if isinstance(light, PointLight | SpotLight | ProjectorLight):
            way = np.asarray(light.position) - points
            distance = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
            rays = way / distance[:, None]
            if isinstance(light, ProjectorLight):
                brightness = intensity_towards(light, -rays) @ LUMINANCE / distance**2
            else:
                brightness = np.dot(light.intensity, LUMINANCE) / distance**2
            if isinstance(light, SpotLight):
                angle = np.degrees(np.arccos(np.clip(-rays @ np.asarray(light.axis), -1, 1)))
                brightness *= np.clip((light.cutoff - angle) / max(light.cutoff - light.beam, 1e-3), 0, 1)
        elif isinstance(light, DirectionalLight):
            rays = np.broadcast_to(-np.asarray(light.direction), points.shape)
            distance, brightness = (
                np.full(len(points), np.inf),
                np.full(len(points), np.dot(light.irradiance, LUMINANCE)),
            )
        else:
            many, facing = np.repeat(points, SAMPLES, axis=0), np.repeat(normals, SAMPLES, axis=0)
            mean = np.asarray(light.radiance if isinstance(light, ConstantEnvironment) else light.pixels.mean((0, 1)))
            free = self._free(many, facing, _cosine(facing, self.rng), np.inf)
            return free.reshape(-1, SAMPLES).mean(axis=1) * float(mean @ LUMINANCE)
        seen = self._free(points, normals, rays, distance * (1 - 1e-3))
        return np.where(seen, brightness * (rays * normals).sum(axis=1) / math.pi, 0.0)
