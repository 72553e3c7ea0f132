"""Spots, directional lights and image environments in files, and pictures of the sky that are broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pmviewer.errors import SceneError
from pmviewer.output.exr import write_exr
from pmviewer.scene.analysis import analyse
from pmviewer.scene.describe import describe
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, SpotLight
from pmviewer.scene.formats.hdr import read_hdr
from pmviewer.scene.sky_image import read_sky
from tests.scene.helpers import load

SHAPE = '<shape type="sphere"/>'


def envmap(*inside: str, name: str = "sky.exr") -> str:
    return f'<emitter type="envmap"><string name="filename" value="{name}"/>{"".join(inside)}</emitter>'


def sky_file(folder: Path, pixels: np.ndarray | None = None) -> np.ndarray:
    if pixels is None:
        pixels = np.random.default_rng(1).uniform(0, 2, (5, 8, 3)).astype(np.float32)
    write_exr(folder / "sky.exr", {"": pixels})
    return pixels


def hdr(rows: bytes, width: int, height: int) -> bytes:
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + rows


def test_spot_and_directional_light(tmp_path: Path) -> None:
    turn = '<transform name="to_world"><rotate x="1" angle="90"/><translate y="3"/></transform>'
    scene = load(
        tmp_path,
        SHAPE,
        f'<emitter type="spot">{turn}<rgb name="intensity" value="3 2 1"/>'
        '<float name="cutoff_angle" value="40"/></emitter>',
        f'<emitter type="directional">{turn}</emitter>',
        '<emitter type="directional"><vector name="direction" value="0 -2 0"/>'
        '<rgb name="irradiance" value="7"/></emitter>',
        sky="",
    )
    spot, turned, down = scene.lights
    assert isinstance(spot, SpotLight)
    assert spot.position == (0, 3, 0)
    assert spot.axis == pytest.approx((0, -1, 0), abs=1e-12)
    assert (spot.intensity, spot.cutoff, spot.beam) == ((3, 2, 1), 40, 30)
    assert isinstance(turned, DirectionalLight)
    assert isinstance(down, DirectionalLight)
    assert turned.direction == pytest.approx((0, -1, 0), abs=1e-12)
    assert (down.direction, down.irradiance) == ((0, -1, 0), (7, 7, 7))
    assert scene.warnings == ()
    assert any("spot light" in value for _, value in describe(scene))


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ('<emitter type="spot"><float name="cutoff_angle" value="0"/></emitter>', "above 0 and at most 180"),
        ('<emitter type="spot"><float name="beam_width" value="30"/></emitter>', "between 0 and 'cutoff_angle'"),
        ('<emitter type="spot"><rgb name="intensity" value="-1"/></emitter>', "must not be negative"),
        ('<emitter type="spot"><transform name="to_world"><scale value="0"/></transform></emitter>', "no length"),
        ('<emitter type="directional"><vector name="direction" value="0 0 0"/></emitter>', "no length"),
        ('<emitter type="envmap"/>', "needs a 'filename'"),
        (envmap(name="gone.exr"), "does not exist"),
        (envmap('<transform name="to_world"><scale x="2"/></transform>'), "must be a rotation"),
        (envmap('<float name="scale" value="-1"/>'), "must not be negative"),
        (envmap('<float name="scale" value="1e30"/>', '<float name="other" value="1"/>'), None),
    ],
)
def test_wrong_lights_are_named(tmp_path: Path, light: str, words: str | None) -> None:
    sky_file(tmp_path)
    if words is None:
        assert any("'other'" in w for w in load(tmp_path, SHAPE, light, sky="").warnings)
        return
    with pytest.raises(SceneError, match=words) as caught:
        load(tmp_path, SHAPE, light, sky="")
    assert caught.value.line == 3


def test_image_environment(tmp_path: Path) -> None:
    pixels = sky_file(tmp_path)
    turn = '<transform name="to_world"><rotate y="1" angle="90"/><scale value="3"/></transform>'
    scene = load(tmp_path, SHAPE, envmap('<float name="scale" value="2"/>', turn), '<emitter type="constant"/>', sky="")
    (light,) = scene.lights
    assert isinstance(light, ImageEnvironment)
    assert light.pixels == pytest.approx(2 * pixels, rel=1e-3)
    assert light.to_world == pytest.approx(np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), abs=1e-12)
    assert analyse(scene).has_environment
    assert any("beside another environment" in w for w in scene.warnings)


def test_numbers_that_are_no_radiance_count_as_black(tmp_path: Path) -> None:
    pixels = np.ones((4, 4, 3), np.float32)
    pixels[1, 1], pixels[2, 2, 0], pixels[3, 3, 1] = np.nan, -1.0, np.inf
    sky_file(tmp_path, pixels)
    scene = load(tmp_path, SHAPE, envmap(), sky="")
    assert any("5 numbers that are negative or not finite" in w for w in scene.warnings)
    light = scene.lights[0]
    assert isinstance(light, ImageEnvironment)
    assert light.pixels.min() == 0
    assert np.isfinite(light.pixels).all()
    sky_file(tmp_path, np.zeros((4, 4, 3), np.float32))
    with pytest.raises(SceneError, match="no light"):
        load(tmp_path, SHAPE, envmap(), sky="")


def test_encoded_pictures_are_linear_radiance(tmp_path: Path) -> None:
    Image.new("RGB", (4, 3), (255, 188, 0)).save(tmp_path / "sky.png")
    pixels, unusable = read_sky(tmp_path / "sky.png")
    assert pixels.shape == (3, 4, 3)
    assert pixels[0, 0] == pytest.approx((1, 0.503, 0), abs=2e-3)
    assert unusable == 0


def test_hdr_pictures(tmp_path: Path) -> None:
    """Plain and run-length coded: mantissa · 2^(exponent − 136)."""
    path = tmp_path / "sky.hdr"
    path.write_bytes(hdr(bytes((128, 64, 0, 129)) * 12, 4, 3))
    assert read_hdr(path) == pytest.approx(np.broadcast_to([1.0, 0.5, 0.0], (3, 4, 3)))
    row = bytes((2, 2, 0, 8, 136, 128, 4, 1, 2, 3, 4, 132, 64, 136, 0, 136, 129))
    path.write_bytes(hdr(row * 3, 8, 3))
    pixels = read_hdr(path)
    assert pixels.shape == (3, 8, 3)
    assert pixels[1, :, 0] == pytest.approx(1.0)
    assert pixels[1, :, 1] == pytest.approx(np.array([1, 2, 3, 4, 64, 64, 64, 64]) / 128)
    assert pixels[1, :, 2] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("sky.hdr", b"garbage", "not a Radiance HDR"),
        ("sky.hdr", b"#?RADIANCE\n\n", "no size"),
        ("sky.hdr", hdr(b"", 4, 3), "cut off"),
        ("sky.hdr", hdr(bytes((2, 2, 0, 8, 136, 128)), 8, 3), "cut off"),
        ("sky.hdr", hdr(bytes((2, 2, 0, 8)) + bytes(40), 8, 3), "cut off"),
        ("sky.hdr", hdr(b"", 999999, 999999), "claims 999999"),
        ("sky.exr", b"garbage", "not a whole OpenEXR"),
        ("sky.png", b"garbage", "can't be read"),
        ("tiny.exr", None, "at least 2 × 3"),
    ],
)
def test_broken_pictures_are_one_error(tmp_path: Path, name: str, data: bytes | None, words: str) -> None:
    if data is None:
        write_exr(tmp_path / name, {"": np.ones((1, 1, 3), np.float32)})
    else:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(SceneError, match=words) as caught:
        load(tmp_path, SHAPE, envmap(name=name), sky="")
    assert name in str(caught.value)
    assert caught.value.line == 3
