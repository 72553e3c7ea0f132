"""Lights of glTF files."""

import math
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pmviewer.scene.description import DirectionalLight, ImageEnvironment, PointLight, Scene, SpotLight
from pmviewer.scene.load import read_scene
from tests.scene.gltf_files import Gltf

DOWN = [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)]


def lit(folder: Path, lights: list, nodes: list) -> Scene:
    f = Gltf(extensions={"KHR_lights_punctual": {"lights": lights}})
    f.triangle()
    rows = [{**node, "extensions": {"KHR_lights_punctual": {"light": node["light"]}}} for node in nodes]
    return read_scene(f.write(folder, nodes=[{"mesh": 0}, *rows]))


def test_points_spots_and_suns(tmp_path: Path) -> None:
    cone = {"innerConeAngle": math.radians(10), "outerConeAngle": math.radians(30)}
    lights = [
        {"type": "spot", "intensity": 683, "spot": cone},
        {"type": "directional", "intensity": 1366},
        {"type": "point", "intensity": 683, "color": [1, 0.5, 0], "range": 10},
        {"type": "tube"},
    ]
    nodes = [
        {"light": 0, "translation": [0, 4, 0], "rotation": DOWN},
        {"light": 1},
        {"light": 1, "scale": [0, 0, 0]},
        {"light": 2, "translation": [0, 4, 0]},
        {"light": 3},
        {"light": 4},
    ]
    scene = lit(tmp_path, lights, nodes)
    spot, sun, point = scene.lights
    assert isinstance(spot, SpotLight)
    assert spot.position == (0, 4, 0)
    assert spot.axis == pytest.approx((0, -1, 0), abs=1e-12)
    assert spot.intensity == pytest.approx((1, 1, 1))
    assert (spot.beam, spot.cutoff) == pytest.approx((10, 30))
    assert isinstance(sun, DirectionalLight)
    assert sun.direction == (0, 0, -1)
    assert sun.irradiance == pytest.approx((2, 2, 2))
    assert isinstance(point, PointLight)
    assert point.position == (0, 4, 0)
    assert point.intensity == pytest.approx((1, 0.5, 0))
    for words in ("linearly", "no direction", "'tube'", "ranges of lights", "not in the file"):
        assert any(words in w for w in scene.warnings), words


def test_a_spot_whose_angles_are_the_wrong_way_round_opens(tmp_path: Path) -> None:
    lights = [{"type": "spot", "intensity": 1, "spot": {"innerConeAngle": 2.0, "outerConeAngle": 1.0}}]
    (spot,) = lit(tmp_path, lights, [{"light": 0}]).lights
    assert spot.beam == spot.cutoff == pytest.approx(math.degrees(1))


def surroundings(folder: Path, faces: list[np.ndarray], **light) -> Scene:
    f = Gltf()
    f.triangle()
    f.header["images"] = []
    for pixels in faces:
        stream = BytesIO()
        Image.fromarray(pixels.astype(np.uint8)).save(stream, "PNG")
        f.header["images"].append({"bufferView": f.view(stream.getvalue())})
    row = {"specularImages": [list(range(6))], **light}
    name = "EXT_lights_image_based"
    return read_scene(
        f.write(
            folder, extensions={name: {"lights": [row]}}, scenes=[{"nodes": [0], "extensions": {name: {"light": 0}}}]
        )
    )


def radiance(sky: ImageEnvironment, direction: tuple) -> np.ndarray:
    """What the picture shows in a direction of the world: (0, 0, 1) is its middle, (1, 0, 0) that of its left half."""
    x, y, z = sky.to_world.T @ np.array(direction, float)
    height, width = sky.pixels.shape[:2]
    column = int((0.5 - math.atan2(x, z) / (2 * math.pi)) * width) % width
    return sky.pixels[min(height - 1, int(math.acos(y / math.hypot(x, y, z)) / math.pi * height)), column]


def test_image_based_surroundings_lie_the_right_way_round(tmp_path: Path) -> None:
    faces = [np.full((4, 4, 3), 40 * (i + 1)) for i in range(6)]
    scene = surroundings(tmp_path, faces, intensity=2)
    (sky,) = scene.lights
    linear = [((v / 255 + 0.055) / 1.055) ** 2.4 if v / 255 > 0.04045 else v / 255 / 12.92 for v in range(0, 256, 40)]
    axes = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    for i, axis in enumerate(axes):
        nudged = tuple(a + 0.01 for a in axis)
        assert radiance(sky, nudged) == pytest.approx([2 * linear[i + 1]] * 3, rel=1e-5)
    # The first row of a side face lies below, its first column on the face's left as OpenGL has it: +z for +x.
    faces[0][0] = 255
    (sky,) = surroundings(tmp_path, faces).lights
    assert radiance(sky, (1, -0.9, 0))[0] == pytest.approx(1)
    assert radiance(sky, (1, 0.9, 0))[0] < 0.1
    faces[0][:] = 0
    faces[0][:, 0] = 255
    (sky,) = surroundings(tmp_path, faces).lights
    assert radiance(sky, (1, 0, 0.9))[0] == pytest.approx(1)
    # Turned by 90° about y, +x becomes −z.
    (sky,) = surroundings(tmp_path, faces, rotation=[0, math.sqrt(0.5), 0, math.sqrt(0.5)]).lights
    assert radiance(sky, (0.9, 0, -1))[0] == pytest.approx(1)


def test_surroundings_divide_by_alpha_and_damaged_ones_are_left_out(tmp_path: Path) -> None:
    face = np.dstack([np.full((4, 4, 3), 255), np.full((4, 4), 51)])
    (sky,) = surroundings(tmp_path, [face] * 6).lights
    assert sky.pixels == pytest.approx(5)
    scene = surroundings(tmp_path, [face] * 5)
    assert any("EXT_lights_image_based) can't be read" in w for w in scene.warnings)


@pytest.mark.parametrize("lights", [1e308, "lamps", {"0": {}}, None, [3.0]])
def test_lights_that_are_no_list_are_missing_lights(tmp_path: Path, lights: object) -> None:
    """Found by files that were changed at random: it was "object of type 'float' has no len()"."""
    scene = lit(tmp_path, lights, [{"light": 0}])
    assert any("refers to a light that is not in the file" in text for text in scene.warnings)
