"""Virtual lights in scenes with media: on surfaces weakened on the way, in media by the phase function."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.maps.virtual_lights import COLUMNS, OF_MEDIUM, UNWEIGHTED, V_P, V_PHI, V_PRIM, V_U
from pmviewer.photons.virtual.flight import C_STORED, N_COUNTS
from pmviewer.photons.virtual.trace import TRACE_DTYPE, trace_virtual_lights
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera, Medium, Parallelogram, PointLight, Shape
from pmviewer.scene.medium import Phase
from tests.render.test_media import cube_of, picture
from tests.support import kinds
from tests.support.scenes import diffuse

pytestmark = pytest.mark.usefixtures("any_light_in_media")

LAMP = (PointLight("lamp", (0.3, 0.6, 0.2), (3.0, 3.0, 3.0)),)
CORNERS = (
    ((-1, -1, -1), (2, 0, 0), (0, 2, 0)),
    ((-1, -1, 1), (0, 2, 0), (2, 0, 0)),
    ((-1, -1, -1), (0, 2, 0), (0, 0, 2)),
    ((1, -1, -1), (0, 0, 2), (0, 2, 0)),
    ((-1, -1, -1), (0, 0, 2), (2, 0, 0)),
    ((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
)


def foggy_room(size=8):
    """A closed room full of coloured fog, the camera within."""
    walls = [Shape(f"wall {i}", Parallelogram(*corner), 1) for i, corner in enumerate(CORNERS)]
    camera = Camera((0, 0, 0.9), (0, 0, -1), (0, 1, 0), 60.0, medium=0)
    fog = Medium("fog", (0.7,) * 3, (0.8, 0.9, 0.6), phase=Phase(0.5))
    return cube_of(fog, LAMP, walls, (diffuse(albedo=(0.6, 0.4, 0.5)),), half=1.01, camera=camera, size=size)


def test_every_collision_is_a_light_of_what_it_scatters():
    """In endless fog around a lamp all of its light collides once: the first collisions scatter albedo of it."""
    albedo, N = np.array([0.5, 0.7, 0.9]), 4000
    flat = flatten(
        cube_of(Medium("fog", (2.0,) * 3, tuple(albedo)), (PointLight("lamp", (0, 0, 0), (1, 1, 1)),), half=12)
    )
    record = np.zeros(1, TRACE_DTYPE)
    record[0] = (1, 0, 0, 1, 0.2, UNWEIGHTED)  # one scattering
    photons, rows, counts = (
        np.zeros((2 * N, 6), np.float32),
        np.zeros((2 * N, COLUMNS), np.float32),
        np.zeros(N_COUNTS, int),
    )
    assert trace_virtual_lights(flat.record, record, 0, N, photons, rows, counts) == N
    rows = rows[: counts[C_STORED]]
    assert len(rows) == N
    assert (rows[:, V_PRIM].copy().view(np.uint32) == OF_MEDIUM).all()
    assert (rows[:, V_U] == 0).all()
    np.testing.assert_allclose(rows[:, V_PHI : V_PHI + 3].mean(axis=0), albedo, rtol=1e-4)
    way = np.linalg.norm(rows[:, V_P : V_P + 3], axis=1)
    assert way.mean() == pytest.approx(1 / 2.0, rel=0.05)


@pytest.fixture(scope="module")
def indirect_of_paths():
    """Half a million paths: few passes of many pixels, for every pass has its fixed cost."""
    with pytest.MonkeyPatch.context() as patch:
        kinds.any_light_in_media(patch)
        return picture(foggy_room(96), "path", 56, view="indirect").mean(axis=(0, 1))


@pytest.mark.parametrize("estimator", ["unweighted", "single step"])
def test_light_on_walls_in_fog_is_that_of_paths(estimator, indirect_of_paths):
    """Within 6 %, noise: a collision near a wall is a spot. Over six seeds single steps had 1.04 ± 0.03 of it."""
    virtual = {"estimator": estimator, "number": 200, "photons": 4000}
    found = picture(foggy_room(), "virtual lights", 60, view="indirect", photons={"N": 1000}, virtual=virtual)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), indirect_of_paths, rtol=0.06)
