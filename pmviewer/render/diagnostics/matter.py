"""Views of media: what the camera ray through a pixel's middle meets of them up to the first surface, behind invisible
boundaries, and a slice through them. Nothing is looked at through mirrors and glass."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.media.column import WORDS, column_of
from pmviewer.kernels.media.lattice import line_of, walk
from pmviewer.kernels.media.medium import extinction, phase_numbers, scatters, way_seen
from pmviewer.kernels.media.varying import OF_EXTINCTION, grid_of, has_grids, sigma_at
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.vector import along
from pmviewer.maps.estimate.beam import beam_radiance
from pmviewer.render.cast import cast
from pmviewer.render.media.beams import beam_of
from pmviewer.render.media.through import next_boundary, next_stretch
from pmviewer.render.media.volume import radius_in
from pmviewer.render.pixel import camera_ray

_f4 = np.float32
_f8 = np.float64
_NONE = _f4(-1.0)
_THIRD = 1.0 / 3.0
MOST = 1e30
"""Lengths and depths without end are shown as this."""


@specialised
def _depth(scene, medium, o, d, length):
    """Optical depth of a stretch, the mean of its channels."""
    if not has_grids(scene):

        def evenly(scene, medium, o, d, length):
            sigma = extinction(scene, medium)
            total = (_f8(sigma[0]) + _f8(sigma[1]) + _f8(sigma[2])) * _THIRD
            return total * min(_f8(length), MOST) if total > 0.0 else 0.0

        return evenly

    def varying(scene, medium, o, d, length):
        sigma, grid = extinction(scene, medium), grid_of(scene, medium, OF_EXTINCTION)
        if grid < 0:
            total = (_f8(sigma[0]) + _f8(sigma[1]) + _f8(sigma[2])) * _THIRD
            return total * min(_f8(length), MOST) if total > 0.0 else 0.0
        part = walk(scene, grid, line_of(scene, grid, o, d), 0.0, _f8(length), 0, np.inf).depth
        return (sigma[0] * part[0] + sigma[1] * part[1] + sigma[2] * part[2]) * _THIRD

    return varying


@kernel
def depth_view(scenes, eyes, out, first, last):
    """Optical depth of the media up to the first surface, and how far light gets there in the mean: the way in media
    over its depth, in scene units. −1 in both where the ray meets no medium, in the latter where it is clear.

    scenes, eyes: records (1,); out: float32 (pixels, 2); pixels first … last−1 are drawn.
    """
    scene, eye = scenes[0], eyes[0]
    for pixel in range(first, last):
        ray = camera_ray(eye, pixel, _f4(0.5), _f4(0.5))
        hit = cast(scene, ray)
        o, medium, left = ray.o, ray.medium, hit.t
        depth, way, met = 0.0, 0.0, False
        for k in range(hit.crossed + 1):
            length, beyond, next_medium = next_stretch(scene, hit.crossed - k, o, ray.d, medium, left)
            if medium >= 0:
                met = True
                way += min(_f8(length), MOST)
                depth += _depth(scene, medium, o, ray.d, length)
            o, medium = beyond, next_medium
            left -= length
        out[pixel, 0] = _f4(min(depth, MOST)) if met else _NONE
        out[pixel, 1] = _f4(min(way / depth, MOST)) if depth > 0.0 else _NONE


@specialised
def _counted(scene, photons, medium, o, d, length, radius, paths, marks):
    """Photons of the volume map within the radius of a stretch."""
    if absent(photons):
        return lambda scene, photons, medium, o, d, length, radius, paths, marks: 0

    def by_beam(scene, photons, medium, o, d, length, radius, paths, marks):
        column = column_of(scene, medium, o, d, length, marks)
        length = min(length, way_seen(scene, medium))
        beam, lobes = beam_of(scene, o, d, length, radius), phase_numbers(scene, medium)
        _, count = beam_radiance(scene, photons, beam, radius, paths, column, lobes)
        return count

    return by_beam


@kernel
def beam_view(scenes, eyes, photon_maps, out, first, last):
    """Radius of the beam estimate, the smallest of the media met, and the photons that it counts along the ray up to
    the first surface; −1 in both where the ray meets no medium that scatters.

    photon_maps: record (1,) of the volume map; out: float32 (pixels, 2); the rest as for `depth_view`.
    """
    scene, eye = scenes[0], eyes[0]
    marks = stack_i4(WORDS)
    for pixel in range(first, last):
        ray = camera_ray(eye, pixel, _f4(0.5), _f4(0.5))
        hit = cast(scene, ray)
        o, medium, left = ray.o, ray.medium, hit.t
        count, met, narrowest = 0, False, eye.volume_radius
        for k in range(hit.crossed + 1):
            length, beyond, next_medium = next_stretch(scene, hit.crossed - k, o, ray.d, medium, left)
            if scatters(scene, medium):
                met = True
                radius = radius_in(scene, eye, medium)
                narrowest = min(narrowest, radius)
                count += _counted(scene, photon_maps[0], medium, o, ray.d, length, radius, eye.free_paths, marks)
            o, medium = beyond, next_medium
            left -= length
        out[pixel, 0] = narrowest if met else _NONE
        out[pixel, 1] = _f4(count) if met else _NONE


@device
def _on_plane(scene, ray, hit, axis, place):
    """The medium where the ray crosses the plane (−1: none, or a surface is before it), and the point."""
    t = (_f8(place) - _f8(ray.o[axis])) / _f8(ray.d[axis]) if ray.d[axis] != _f4(0.0) else -1.0
    nowhere = np.int64(-1)
    if not (t > 0.0 and (t < _f8(hit.t) or hit.prim < 0)):
        return nowhere, ray.o
    o, medium, left = ray.o, ray.medium, t
    for _ in range(hit.crossed):
        length, beyond, next_medium = next_boundary(scene, o, ray.d, medium)
        if left < _f8(length):
            break
        o, medium = beyond, next_medium
        left -= _f8(length)
    return medium, along(ray.o, ray.d, _f4(t))


@kernel
def slice_view(scenes, eyes, photon_maps, axis, place, out, first, last):
    """Where camera rays cross the plane on which coordinate `axis` (0 … 2) is `place`: the extinction there, the mean
    of its channels per scene unit, and the density of the volume map's photons in a cylinder around as high as wide,
    per cubic unit. −1 where there is no medium, or a surface hides the plane.

    Arguments as for `beam_view`.
    """
    scene, eye = scenes[0], eyes[0]
    marks = stack_i4(WORDS)
    for pixel in range(first, last):
        ray = camera_ray(eye, pixel, _f4(0.5), _f4(0.5))
        hit = cast(scene, ray)
        medium, p = _on_plane(scene, ray, hit, axis, place)
        out[pixel, 0] = out[pixel, 1] = _NONE
        if medium >= 0:
            sigma = sigma_at(scene, medium, p)
            out[pixel, 0] = (sigma[0] + sigma[1] + sigma[2]) * _f4(_THIRD)
            r = radius_in(scene, eye, medium)
            if scatters(scene, medium) and r > _f4(0.0):
                o = along(p, ray.d, -r)
                count = _counted(scene, photon_maps[0], medium, o, ray.d, _f4(2.0) * r, r, _f4(np.inf), marks)
                out[pixel, 1] = _f4(count / (2.0 * np.pi * _f8(r) ** 3))
