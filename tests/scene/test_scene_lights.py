"""Spots, directional lights and image environments in files, and pictures of the sky that are broken."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pmviewer.errors import SceneError
from pmviewer.output.exr import write_exr
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.describe import describe
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, ProjectorLight, SpotLight
from pmviewer.scene.emission import emitted_power
from pmviewer.scene.formats.hdr import read_hdr
from pmviewer.scene.formats.sky_image import read_sky
from pmviewer.scene.formats.texture_file import read_picture
from tests.scene.helpers import load

SHAPE = '<shape type="sphere"/>'
WIDE = '<float name="cutoff_angle" value="88"/>'


def envmap(*inside: str, name: str = "sky.exr") -> str:
    return f'<emitter type="envmap"><string name="filename" value="{name}"/>{"".join(inside)}</emitter>'


def sky_file(folder: Path, pixels: np.ndarray | None = None) -> np.ndarray:
    if pixels is None:
        pixels = np.random.default_rng(1).uniform(0, 2, (5, 8, 3)).astype(np.float32)
    write_exr(folder / "sky.exr", {"": pixels})
    return pixels


def hdr(rows: bytes, width: int, height: int) -> bytes:
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + rows


def test_a_light_whose_surface_lets_all_light_pass_shines(tmp_path: Path) -> None:
    """As Blender's exporter writes them."""
    lamp = '<shape type="rectangle"><emitter type="area"/><bsdf type="null"/></shape>'
    scene = load(tmp_path, lamp, '<shape type="sphere"><bsdf type="null"/></shape>', sky="")
    light, clear = (scene.materials[shape.material] for shape in scene.shapes)
    assert (light.reflectance, light.opacity, clear.opacity) == ((0, 0, 0), 1, 0)
    assert flatten(scene).light_power.min() > 0
    assert '<bsdf type="null"> on a light is black here' in scene.warnings[0]


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


TURN = '<transform name="to_world"><translate y="4"/></transform>'


@pytest.mark.parametrize(
    ("light", "words", "left"),
    [
        ('<emitter type="spot"><float name="cutoff_angle" value="0"/></emitter>', "0 was taken as 0.01", True),
        ('<emitter type="spot"><float name="beam_width" value="30"/></emitter>', "30 was taken as 20", True),
        ('<emitter type="spot"><rgb name="intensity" value="-1 2 2"/></emitter>', "negative numbers count as 0", True),
        ('<emitter type="spot"><transform name="to_world"><scale value="0"/></transform></emitter>', "no direction", 0),
        ('<emitter type="directional"><vector name="direction" value="0 0 0"/></emitter>', "no direction", False),
        (f'<emitter type="point"><point name="position" x="1"/>{TURN}</emitter>', "'position' is used", True),
        ('<emitter type="envmap"/>', "names no file", False),
        (envmap(name="gone.exr"), "left out, what they would light stays dark: gone.exr (does not exist)", False),
        (envmap('<transform name="to_world"><scale x="2"/></transform>'), "only its rotation", True),
        (envmap('<float name="scale" value="-1"/>'), "-1 was taken as 0", False),
        (envmap('<float name="other" value="1"/>'), "'other'", True),
        (f'<emitter type="spot">{WIDE}<texture name="texture" type="checkerboard"/></emitter>', "its texture", True),
        ('<emitter type="projector"><transform name="to_world"><scale value="0"/></transform></emitter>', "no dir", 0),
        ('<emitter type="projector"><float name="scale" value="-1"/></emitter>', "-1 was taken as 0", False),
        ('<emitter type="projector"><rgb name="irradiance" value="-1 2 2"/></emitter>', "numbers count as 0", True),
        ('<emitter type="projector"><float name="fov" value="180"/></emitter>', "was taken as 179", True),
        ('<emitter type="projector"><float name="other" value="1"/></emitter>', "'other'", True),
    ],
)
def test_odd_lights_are_cut_or_left_out(tmp_path: Path, light: str, words: str, left: bool) -> None:
    sky_file(tmp_path)
    lamp = '<emitter type="point"/>'
    scene = load(tmp_path, SHAPE, lamp, light.replace('x="1"/>', 'x="1" y="0" z="0"/>'), sky="")
    (warning,) = scene.warnings
    assert warning.startswith("line 4: ")
    assert words in warning
    assert len(scene.lights) == 1 + bool(left)


BOARD = '<texture name="texture" type="checkerboard"><rgb name="color0" value="1 0 0"/></texture>'


def test_the_texture_of_a_wide_spot_counts_by_its_mean(tmp_path: Path) -> None:
    words = f'<emitter type="spot">{WIDE}<rgb name="intensity" value="10"/>{BOARD}</emitter>'
    (spot,) = load(tmp_path, SHAPE, words, sky="").lights
    assert isinstance(spot, SpotLight)
    assert spot.intensity == pytest.approx((6, 1, 1))


def test_a_spot_throws_its_texture(tmp_path: Path) -> None:
    """In a direction (x, y, z) of its own it has the texture's colour at (1 + x/(z tan c))/2, (1 + y/(z tan c))/2 times
    the intensity, which falls with the angle from 30° to the cut-off c = 40°; on the plane z = 1 that is cos³ as much
    irradiance."""
    angles = '<float name="cutoff_angle" value="40"/><float name="beam_width" value="30"/>'
    words = f'<emitter type="spot">{angles}<rgb name="intensity" value="10"/>{BOARD}{TURN}</emitter>'
    (light,) = load(tmp_path, SHAPE, words, sky="").lights
    assert isinstance(light, ProjectorLight)
    assert light.position == (0, 4, 0)
    slope = math.tan(math.radians(40))
    assert light.half == pytest.approx((slope, slope))

    def thrown(degrees: float, around: float) -> NDArray[np.float32]:
        """At that angle off the axis, turned from the left to the top."""
        x, y = (math.tan(math.radians(degrees)) / slope * f(math.radians(around)) for f in (math.cos, math.sin))
        column = int(np.abs(light.columns - (1 - x) / 2).argmin())
        return light.pixels[int(np.abs(light.rows - (1 - y) / 2).argmin()), column]

    left_top, right_top = thrown(20, 45), thrown(20, 135)
    np.testing.assert_allclose(left_top, thrown(20, 225))
    np.testing.assert_allclose(right_top, thrown(20, 315))
    red, grey = np.array([10, 0, 0]), np.array([2, 2, 2])
    np.testing.assert_allclose(left_top, red * math.cos(math.radians(20)) ** 3, rtol=0.01)
    np.testing.assert_allclose(right_top, grey * math.cos(math.radians(20)) ** 3, rtol=0.01)
    np.testing.assert_allclose(thrown(36, 45), 0.4 * red * math.cos(math.radians(36)) ** 3, rtol=0.05)
    assert (thrown(41, 45) == 0).all()
    sums = emitted_power(light, 1.0)
    ring = 2 * math.pi * (1 - math.cos(math.radians(30)))
    assert sums[0] == pytest.approx(6 * (ring + falling(30, 40)), rel=0.01)


def falling(beam: float, cutoff: float) -> float:
    """∫ (c − θ)/(c − b) dω between the angles b and c."""
    theta = np.radians(np.linspace(beam, cutoff, 2001))
    share = (theta[-1] - theta) / (theta[-1] - theta[0])
    return float(np.trapezoid(share * np.sin(theta), theta)) * 2 * math.pi


@pytest.mark.parametrize("name", ["power", "intensity"])
def test_a_collimated_beam_is_the_narrowest_spot_of_its_power(tmp_path: Path, name: str) -> None:
    words = f'<rgb name="{name}" value="2 1 0"/>{TURN}'
    scene = load(tmp_path, SHAPE, f'<emitter type="collimated">{words}</emitter>', sky="", version="0.6.0")
    (spot,) = scene.lights
    assert isinstance(spot, SpotLight)
    assert (spot.position, spot.axis, spot.cutoff, spot.beam) == ((0, 4, 0), (0, 0, 1), 0.01, 0.01)
    assert emitted_power(spot, 1.0) == pytest.approx([2, 1, 0])
    assert "as a spot of 0.01°" in scene.warnings[0]


def test_image_environment(tmp_path: Path) -> None:
    pixels = sky_file(tmp_path)
    turn = '<transform name="to_world"><rotate y="1" angle="90"/><scale value="3"/></transform>'
    constant = '<emitter type="constant"><rgb name="radiance" value="1 2 3"/></emitter>'
    scene = load(tmp_path, SHAPE, envmap('<float name="scale" value="2"/>', turn), constant, sky="")
    (light,) = scene.lights
    assert isinstance(light, ImageEnvironment)
    assert light.pixels == pytest.approx(2 * pixels + [1, 2, 3], rel=1e-3)
    assert light.to_world == pytest.approx(np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), abs=1e-12)
    assert analyse(scene).has_environment
    assert any("light is added up" in w for w in scene.warnings)


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
    dark = load(tmp_path, SHAPE, envmap(), sky="")
    assert dark.dropped == {"light of no power": 1}
    assert any(w.startswith("The file has no light") for w in dark.warnings)


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
        ("sky.png", b"garbage", "no kind of picture"),
    ],
)
def test_broken_pictures_are_left_out_with_a_warning(tmp_path: Path, name: str, data: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(data)
    (warning,) = load(tmp_path, SHAPE, envmap(name=name)).warnings
    assert warning.startswith(
        f"line 3: Pictures that can't be used are left out, what they would light stays dark: {name} ("
    )
    assert words in warning


def test_a_small_picture_is_continued(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", {"": np.full((1, 1, 3), [1, 2, 3], np.float32)})
    (light,) = load(tmp_path, SHAPE, envmap(), sky="").lights
    assert isinstance(light, ImageEnvironment)
    assert light.pixels == pytest.approx(np.broadcast_to([1.0, 2.0, 3.0], (3, 2, 3)))


def test_two_images_are_added_where_they_are_turned(tmp_path: Path) -> None:
    """A bright hemisphere turned on its side over one that is not: their sum, seen along the axes."""
    pixels = np.zeros((33, 64, 3), np.float32)
    pixels[:17] = 1
    sky_file(tmp_path, pixels)
    turn = '<transform name="to_world"><rotate x="1" angle="90"/></transform>'
    (light,) = load(tmp_path, SHAPE, envmap(), envmap(turn), sky="").lights
    assert isinstance(light, ImageEnvironment)
    assert light.to_world == pytest.approx(np.eye(3))
    # The middle of the image is +z, where the second one's up has gone; its edge is −z.
    assert light.pixels[8, 32, 0] == pytest.approx(2)
    assert light.pixels[8, 0, 0] == pytest.approx(1)
    assert light.pixels[24, 32, 0] == pytest.approx(1)
    assert light.pixels[24, 0, 0] == pytest.approx(0)


def test_portable_float_maps(tmp_path: Path) -> None:
    """Rows from the bottom up; the sign of the scale is the byte order."""
    values = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    (tmp_path / "a.pfm").write_bytes(b"PF\n2 2\n-1.0\n" + values[::-1].astype("<f4").tobytes())
    assert read_sky(tmp_path / "a.pfm")[0][:2] == pytest.approx(values)
    assert read_picture(tmp_path / "a.pfm", "a.pfm", raw=False)[0] == pytest.approx(values)
    (tmp_path / "b.pfm").write_bytes(b"Pf\n2 2\n1\n" + values[::-1, :, 0].astype(">f4").tobytes())
    assert read_picture(tmp_path / "b.pfm", "b.pfm", raw=False)[0][..., 0] == pytest.approx(values[..., 0])
    (tmp_path / "c.pfm").write_bytes(b"PF\n900000 900000\n-1\n")
    with pytest.raises(SceneError, match="cut off"):
        read_picture(tmp_path / "c.pfm", "c.pfm", raw=False)


@pytest.mark.parametrize("kind", ["point", "spot", "directional"])
def test_lights_without_a_surface_inside_a_shape_are_lights_of_their_own(tmp_path: Path, kind: str) -> None:
    """As Mitsuba 3.9.1 renders them: where their own `to_world` says, and the shape is black without a BSDF."""
    light = f'<emitter type="{kind}"><transform name="to_world"><translate x="2" y="3" z="4"/></transform></emitter>'
    placed = f'>{light}<transform name="to_world"><scale value="9"/></transform></shape>'
    beside, inside = load(tmp_path, SHAPE + light), load(tmp_path, SHAPE.replace("/>", placed))
    assert len(inside.lights) == len(beside.lights) == 2  # and the sky
    assert inside.lights[0] == replace(beside.lights[0], name=inside.lights[0].name)
    assert inside.warnings == ()
    assert inside.shapes[0].radiance is None
    assert inside.materials[inside.shapes[0].material].reflectance == (0, 0, 0)
