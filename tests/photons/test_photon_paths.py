"""The paths that are shown are those of the light pass's own photons."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.maps.record import BOUNCES, decode_directions, unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.paths import MOST_VERTICES, empty_paths
from pmviewer.settings.access import Settings
from pmviewer.viewer.overlays.photon_paths import flights
from tests.support.scenes import cornell_box, light_scene

N, M = 3000, 200


def in_order(tasks):
    return [task() for task in tasks]


@pytest.fixture(scope="module")
def box():
    return open_scene(cornell_box()).flat


def trace(scene, first=0, N=N, **options):
    return trace_pass(scene, Settings().photons, 1, first, N, True, in_order, **options)


def used(paths):
    """Vertices (n, 6) that are used, path by path, and whether each is a surface."""
    number = np.arange(MOST_VERTICES)
    inside = number < paths.counts[:, None]
    return paths.vertices[inside], (number > 0) & inside


def plain(row):
    """A photon's bytes without its direction and normal."""
    words = row.view(np.uint32).copy()
    words[3] &= 0xFF
    return words.tobytes()


@pytest.mark.parametrize("first", [0, 2 * N])
def test_stored_photons_lie_on_the_paths_with_their_power(box, first):
    """The global photons of the first M trajectories are vertices of the paths, word for word but for the normal that
    the direction's word tells, in the same order."""
    paths = empty_paths(M, box.radius)
    few = trace(box, first, watch=paths)
    everything = trace(box, first)
    stored = everything.global_[: len(few.global_)]
    np.testing.assert_array_equal(few.global_.view(np.uint32), stored.view(np.uint32))
    assert len(stored) > M
    vertices = {plain(row): row for row in used(paths)[0]}
    kept = {plain(row) for row in stored}
    assert kept <= set(vertices)
    ways = decode_directions(stored.view(np.uint32)[:, 3])
    drawn = decode_directions(np.array([vertices[plain(row)].view(np.uint32)[3] for row in stored]))
    np.testing.assert_allclose(ways, drawn, atol=0.016)
    mirrors = sum(plain(row) not in kept for row in paths.vertices[:, 1][paths.counts > 1])
    assert mirrors > 0, "mirror and glass, where nothing is stored, are on the paths too"


def test_paths_start_on_the_light_and_count_bounces(box):
    paths = empty_paths(M, box.radius)
    trace(box, watch=paths)
    assert np.all(paths.counts >= 2), "the box is closed"
    starts = paths.vertices[:, 0, :3]
    assert np.ptp(starts[:, 1]) < 1e-6, "all on the lamp"
    for path, count in zip(paths.vertices[:20], paths.counts, strict=False):
        seen = unpack(np.ascontiguousarray(path[:count]), 1.0)
        np.testing.assert_array_equal(seen["bounces"][1:], np.arange(count - 1) & BOUNCES)
        way = np.diff(path[:count, :3], axis=0)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        np.testing.assert_allclose(-way, seen["wi"][1:], atol=8e-3)


def test_a_photon_that_leaves_ends_a_little_way_out():
    flat = open_scene(light_scene("point")).flat
    paths = empty_paths(M, flat.radius)
    trace(flat, watch=paths)
    ends = paths.vertices[np.arange(M), paths.counts - 1, :3]
    before = paths.vertices[np.arange(M), paths.counts - 2, :3]
    last = np.linalg.norm(ends - before, axis=1)
    assert np.isclose(last, paths.reach, rtol=1e-3).mean() > 0.9, "the floor is small"


def test_flights_are_cut_out_of_the_paths(box):
    paths = empty_paths(M, box.radius)
    trace(box, watch=paths)
    everything = flights(paths, 1, MOST_VERTICES)
    assert len(everything) == 2 * int((paths.counts - 1).sum())
    second = flights(paths, 2, 1)
    assert len(second) == 2 * int((paths.counts > 2).sum())
    long = paths.vertices[paths.counts > 2]
    np.testing.assert_array_equal(second[::2, :3], long[:, 1, :3])
    np.testing.assert_array_equal(second[1::2].view(np.uint32), long[:, 2].view(np.uint32))
