"""Mitsuba's `projector` in files: where its picture is, how wide and how bright, by points whose light is known."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmviewer.output.exr import write_exr
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.defaults.light_reach import _Reach
from pmviewer.scene.describe import describe
from pmviewer.scene.description import ProjectorLight, Scene
from pmviewer.scene.editing.apply import edited
from pmviewer.scene.editing.own import own_numbers
from pmviewer.scene.emission import emitted_power
from pmviewer.scene.formats.mitsuba import projector as projector_file
from pmviewer.scene.light_places import light_places
from pmviewer.scene.meshes.recentre import recentred
from pmviewer.scene.miniature import miniature
from pmviewer.scene.projector import intensity_towards
from pmviewer.settings.access import parse_edits
from tests.scene.helpers import load

SHAPE = '<shape type="sphere"/>'
RED, GREEN, BLUE, WHITE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
CORNERS = np.array([[RED, RED, GREEN, GREEN], [BLUE, BLUE, WHITE, WHITE]], np.float32)
"""4 × 2 pixels: red at the top left, green at the top right, blue and white below."""
FOV = '<float name="fov" value="90"/>'


def to_world(*inside: str) -> str:
    return f'<transform name="to_world">{"".join(inside)}</transform>'


def bitmap(*inside: str) -> str:
    return (
        '<texture type="bitmap" name="irradiance"><string name="filename" value="picture.exr"/>'
        f'<boolean name="raw" value="true"/>{"".join(inside)}</texture>'
    )


def projector(folder: Path, *inside: str, pixels: np.ndarray = CORNERS) -> tuple[Scene, ProjectorLight]:
    write_exr(folder / "picture.exr", {"": pixels})
    scene = load(folder, SHAPE, f'<emitter type="projector">{"".join(inside)}</emitter>', sky="")
    (light,) = scene.lights
    assert isinstance(light, ProjectorLight)
    return scene, light


def towards(light: ProjectorLight, *points: tuple[float, float, float]) -> np.ndarray:
    """Intensity towards points as seen from the light; irradiance on the plane at distance 1 facing the axis, where
    that is what the points lie on."""
    d = np.array(points, float)
    distance = np.linalg.norm(d, axis=1, keepdims=True)
    return intensity_towards(light, d / distance)


def test_which_corner_goes_where(tmp_path: Path) -> None:
    """A projector at the origin that looks along z, as Mitsuba 3.9.1 shows it: the top of the picture is at +y, its
    left at +x. On the plane at distance 1 it has π times its irradiance."""
    scene, light = projector(tmp_path, bitmap(), FOV)
    assert scene.warnings == ()
    assert light.half == pytest.approx((1.0, 0.5))
    # Texel centres: a quarter of the height and three eighths of the width off the middle.
    places = [(x, y, 1.0) for y in (0.25, -0.25) for x in (0.75, -0.75)]
    cos3 = np.array([(1 + x * x + y * y) ** -1.5 for x, y, _ in places])
    found = towards(light, *places) * cos3[:, None]
    assert found == pytest.approx(math.pi * np.array([RED, GREEN, BLUE, WHITE]), abs=1e-5)
    between = towards(light, (0.0, 0.25, 1.0))[0] * (1 + 0.25**2) ** -1.5
    assert between == pytest.approx(math.pi * np.array([0.5, 0.5, 0.0]), abs=1e-5)
    # At its rim the picture goes on with the other side, as repeated textures do.
    rim = towards(light, (0.999999, 0.25, 1.0))[0] * (2 + 0.25**2) ** -1.5
    assert rim == pytest.approx(math.pi * np.array([0.5, 0.5, 0.0]), abs=1e-3)
    assert not towards(light, (1.01, 0, 1), (0, 0.51, 1), (0, -0.51, 1), (-1.01, 0, 1), (0, 0, -1)).any()


def test_its_power_is_the_integral_of_the_picture(tmp_path: Path) -> None:
    _, light = projector(tmp_path, bitmap(), FOV, '<float name="scale" value="3"/>')
    assert emitted_power(light, 1.0) == pytest.approx(3 * math.pi * 2 * 1 * CORNERS.mean(axis=(0, 1)), rel=1e-6)


@pytest.mark.parametrize(
    ("axis", "half"),
    [
        ("x", (1.0, 0.5)),
        ("y", (2.0, 1.0)),
        ("smaller", (2.0, 1.0)),
        ("larger", (1.0, 0.5)),
        ("diagonal", (2 / math.sqrt(5), 1 / math.sqrt(5))),
    ],
)
def test_the_field_of_view_is_measured_along_its_axis(tmp_path: Path, axis: str, half: tuple[float, float]) -> None:
    name = f'<string name="fov_axis" value="{axis}"/>'
    assert projector(tmp_path, bitmap(), FOV, name)[1].half == pytest.approx(half)
    tall = np.ascontiguousarray(CORNERS.transpose(1, 0, 2))
    turned = {"x": (1.0, 2.0), "y": (0.5, 1.0), "smaller": (1.0, 2.0), "larger": (0.5, 1.0)}
    if axis in turned:
        assert projector(tmp_path, bitmap(), FOV, name, pixels=tall)[1].half == pytest.approx(turned[axis])


def test_it_stands_where_its_matrix_says(tmp_path: Path) -> None:
    look = '<lookat origin="1, 2, 3" target="1, 2, 1" up="1, 0, 0"/>'
    _, light = projector(tmp_path, bitmap(), FOV, to_world(look))
    assert light.position == (1, 2, 3)
    # It looks along −z, its top is at +x and so, up × ahead, its left at +y.
    assert light.to_world == pytest.approx(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), abs=1e-12)
    (red,) = towards(light, (0.25, 0.75, -1.0))
    assert red[0] > 0
    assert red[1:] == pytest.approx(0, abs=1e-6)
    _, mirrored = projector(tmp_path, bitmap(), FOV, to_world('<scale x="-1"/>', look))
    assert np.linalg.det(mirrored.to_world) == pytest.approx(-1)
    assert towards(mirrored, (0.25, -0.75, -1.0))[0] == pytest.approx(red, abs=1e-5)


def test_scales_in_its_matrix(tmp_path: Path) -> None:
    """As Mitsuba 3.9.1's direct light has them: along z they brighten and narrow, across they widen."""
    _, plain = projector(tmp_path, bitmap(), FOV)
    _, scaled = projector(tmp_path, bitmap(), FOV, to_world('<scale x="3" y="1" z="2"/>'))
    assert scaled.half == pytest.approx((1.5 * plain.half[0], 0.5 * plain.half[1]))
    assert scaled.pixels == pytest.approx(2 * plain.pixels)
    sheared = to_world('<matrix value="1 0.5 0 0  0 1 0 0  0 0 1 0  0 0 0 1"/>')
    scene, light = projector(tmp_path, bitmap(), FOV, sheared)
    assert "shears: only its rotation" in scene.warnings[0]
    assert light.to_world.T @ light.to_world == pytest.approx(np.eye(3), abs=1e-12)


def test_fields_with_edges_are_exact(tmp_path: Path) -> None:
    """A checkerboard, repeated 1½ times across, and nearest texels."""
    again = '<transform name="to_uv"><scale x="1.5" y="1"/></transform>'
    colours = '<rgb name="color0" value="1 0 0"/><rgb name="color1" value="0 0 2"/>'
    board = f'<texture type="checkerboard" name="irradiance">{colours}{again}</texture>'
    _, light = projector(tmp_path, board, FOV)
    assert light.half == pytest.approx((1.0, 1.0))
    # Three fields across, two down: red blue red, blue red blue.
    assert emitted_power(light, 1.0) == pytest.approx(math.pi * 4 * np.array([0.5, 0, 1.0]))
    edge = 1 / 3
    seen = towards(light, (edge + 1e-6, 0.5, 1), (edge - 1e-6, 0.5, 1), (-edge - 1e-6, 0.5, 1), (0.5, -0.5, 1))
    assert [int(np.argmax(colour)) for colour in seen] == [0, 2, 0, 2]
    assert np.count_nonzero(seen) == 4
    _, near = projector(tmp_path, bitmap('<string name="filter_type" value="nearest"/>'), FOV)
    assert np.count_nonzero(towards(near, (0.01, 0.01, 1))) == 1
    assert emitted_power(near, 1.0) == pytest.approx(math.pi * 2 * CORNERS.mean(axis=(0, 1)))


def test_a_picture_that_is_turned_is_sampled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(projector_file, "REPLACED", 256)
    turned = bitmap('<transform name="to_uv"><rotate z="1" angle="90"/></transform>')
    scene, light = projector(tmp_path, turned, FOV)
    assert "256 × 256" in scene.warnings[0]
    assert light.pixels.shape == (257, 257, 3)
    assert emitted_power(light, 1.0) == pytest.approx(math.pi * 2 * CORNERS.mean(axis=(0, 1)), rel=1e-2)


def test_a_colour_alone(tmp_path: Path) -> None:
    """Without a picture it is square and, without a colour, of irradiance 1."""
    _, light = projector(tmp_path, FOV)
    assert light.half == pytest.approx((1.0, 1.0))
    assert emitted_power(light, 1.0) == pytest.approx([4 * math.pi] * 3)
    _, light = projector(tmp_path, FOV, '<rgb name="irradiance" value="2 1 0"/>')
    assert emitted_power(light, 1.0) == pytest.approx(4 * math.pi * np.array([2, 1, 0]))


def test_it_is_known_as_a_light_without_size(tmp_path: Path) -> None:
    scene, _ = projector(tmp_path, bitmap(), FOV, to_world('<translate x="4"/>'))
    assert analyse(scene).has_delta_lights
    assert not analyse(scene).has_findable_lights
    assert any(text.startswith("projector '") for _, text in describe(scene))
    flat = flatten(scene)
    assert light_places(flat)[0] == pytest.approx((4, 0, 0))
    small = miniature(scene)
    assert flatten(small).record.dtype == flat.record.dtype
    assert analyse(small) == analyse(scene)
    far = replace(scene, shapes=tuple(
        replace(s, geometry=replace(s.geometry, center=(1e7, 0.0, 0.0))) for s in scene.shapes
    ))  # fmt: skip
    (moved,) = recentred(far).lights
    assert moved.position == pytest.approx((4 - 1e7, 0, 0))


def test_it_can_be_edited(tmp_path: Path) -> None:
    scene, light = projector(tmp_path, bitmap(), FOV)
    power = emitted_power(light, 1.0)

    def after(*texts: str) -> ProjectorLight:
        (found,) = edited(scene, parse_edits(texts)).lights
        assert isinstance(found, ProjectorLight)
        return found

    assert emitted_power(after("light.1.power=2"), 1.0) == pytest.approx(2 * power)
    blue = emitted_power(after("light.1.colour=0,0,1"), 1.0)
    assert blue[:2] == pytest.approx([0, 0])
    assert blue[2] > 0
    assert own_numbers(scene, "light.1.colour") == pytest.approx(power / power.max())
    moved = after("light.1.move=1,2,3", "light.1.turn=0,90,0")
    assert moved.position == pytest.approx((1, 2, 3))
    assert moved.to_world[:, 1] == pytest.approx([0, 1, 0], abs=1e-6)
    assert abs(moved.to_world[:, 2] @ [0, 0, 1]) < 1e-6


def test_whether_its_light_reaches_a_place_is_known_without_tracing(tmp_path: Path) -> None:
    """What decides whether a scene needs more lights: the luminance of white places that face it, at distance 2."""
    scene, _ = projector(tmp_path, bitmap(), FOV)
    reach = _Reach(scene, None, np.random.default_rng(1))
    at = np.array([[1.5, 0.5, 2.0], [-1.5, -0.5, 2.0], [3.0, 0.0, 2.0]])
    found = reach.from_lights(at, np.tile([0.0, 0.0, -1.0], (3, 1)))
    # π E on the plane at distance 1, a quarter of it at 2, over π; of red, of white, and beside the picture.
    assert found == pytest.approx([0.2126 / 4, 1 / 4, 0.0], rel=1e-4)
