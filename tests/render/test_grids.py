"""Media on lattices against formulas, against Mitsuba's numbers, and all methods against each other."""

from __future__ import annotations

import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from pmviewer.scene.description import ConstantEnvironment, Medium
from pmviewer.scene.grid import Grid
from pmviewer.scene.load import read_scene
from pmviewer.scene.medium import Phase
from tests.render.test_media import BARELY, CAMERA, METHODS, SKY, cube_of, picture

pytestmark = pytest.mark.usefixtures("any_light_in_media")

TO_CUBE = np.array([[2.0, 0, 0, -1], [0, 2, 0, -1], [0, 0, 2, -1], [0, 0, 0, 1]])
"""The unit cube to [−1, 1]³."""


def ramp(n=64):
    """(z + 1)/2 in the cube, but for the outermost half of a number, where it is constant."""
    return Grid(((np.arange(n, dtype=np.float32) + 0.5) / n).reshape(n, 1, 1, 1), TO_CUBE)


@pytest.mark.parametrize("method", METHODS)
def test_absorption_in_a_ramp_is_beer_and_lambert(method):
    """exp(−σ ∫ρ) within 0.1 %: through all of the ramp, 1, and from within at z = 0.5, 9/16."""
    sigma = (0.5, 1.0, 3.0)
    medium = Medium("ramp", sigma, (0, 0, 0) if method == "path" else BARELY, density=ramp())
    for z, inside, depth in ((4.0, -1, 1.0), (0.5, 0, 0.5625)):
        camera = replace(CAMERA, origin=(0.0, 0.0, z), target=(0.0, 0.0, z - 1), fov=1.0, medium=inside)
        center = picture(cube_of(medium, SKY, camera=camera, size=4), method, 2).mean(axis=(0, 1))
        np.testing.assert_allclose(center, np.exp(-depth * np.array(sigma)), rtol=1e-3)


def cloud(channels=1, n=12, seed=3):
    """A third of it empty, the rest uneven."""
    values = np.random.default_rng(seed).random((n, n + 3, n - 2, channels)) ** 3
    values[: n // 3] = 0
    return Grid(values.astype(np.float32), TO_CUBE)


def closed(grid):
    """With nothing at its border, where Mitsuba lets turned lattices go on to the corners of the box around them."""
    return Grid(np.pad(grid.values, ((1, 1), (1, 1), (1, 1), (0, 0))), grid.to_world)


@pytest.mark.parametrize("method", ["path", "progressive"])
def test_white_cloud_under_a_white_sky_vanishes(method):
    medium = Medium("cloud", (3.0,) * 3, (1,) * 3, phase=Phase(0.4), density=cloud(3 if method == "path" else 1))
    settings = {} if method == "path" else {"estimate": {"radius": 0.03}, "photons": {"N": 100_000}}
    image = picture(cube_of(medium, SKY), method, 48 if method == "path" else 16, **settings)
    np.testing.assert_allclose(image[2:14, 2:14].mean(axis=(0, 1)), 1, rtol=5e-3)


@pytest.mark.parametrize("method", ["path", "progressive"])
def test_a_flame_on_a_lattice_emits_what_gets_out(method):
    """∫ ε ρ exp(−σ ∫ρ) along the ramp, against numerical integration, within 0.2 %."""
    sigma, emission = np.array([0.5, 4.0, 1e-6]), np.array([2.0, 1.0, 0.5])
    flame = Medium("flame", tuple(sigma), BARELY, tuple(emission), density=ramp(), emission_grid=ramp(40))
    camera = replace(CAMERA, origin=(0.0, 0.0, 4.0), fov=4.0)
    scene = cube_of(flame, (ConstantEnvironment("sky", (1e-6,) * 3),), camera=camera, size=4)
    found = picture(scene, method, 2).mean(axis=(0, 1))
    for k in range(3):  # from z = 1 down, u = (z + 1)/2 from 1 to 0
        way = lambda u, s=sigma[k]: 2 * u * math.exp(-s * (1 - u * u))  # noqa: E731
        assert found[k] == pytest.approx(emission[k] * quad(way, 0, 1)[0], rel=2e-3)


SCENE = """<scene version="3.0.0">
  <integrator type="volpath"><integer name="max_depth" value="64"/></integrator>
  <medium type="heterogeneous" id="cloud">
    <volume name="sigma_t" type="gridvolume"><string name="filename" value="sigma.vol"/>{place}</volume>
    <volume name="albedo" type="gridvolume"><string name="filename" value="albedo.vol"/>{place}</volume>
    <float name="scale" value="6"/><phase type="hg"><float name="g" value="0.5"/></phase></medium>
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="1, 1, 4.2" target="0, 0, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"/><film type="hdrfilm"><integer name="width" value="16"/>
      <integer name="height" value="16"/><rfilter type="box"/></film></sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/>
    <translate y="-1.2"/></transform><bsdf type="diffuse"/></shape>
  <shape type="cube"><bsdf type="null"/><ref name="interior" id="cloud"/></shape>
  <emitter type="constant"><rgb name="radiance" value="0.3 0.4 0.6"/></emitter>
  <shape type="rectangle"><transform name="to_world"><scale value="0.8"/><rotate x="1" angle="90"/>
    <translate x="0.6" y="2.5"/></transform><bsdf type="diffuse"/>
    <emitter type="area"><rgb name="radiance" value="12 10 7"/></emitter></shape>
</scene>
"""
PLACE = (
    '<transform name="to_world"><scale value="1.7, 1.8, 1.6"/><translate value="-0.9, -0.8, -0.8"/>'
    '<rotate y="1" angle="20"/></transform>'
)
MITSUBA = (
    (0.25296, 0.33439, 0.48986),
    (0.26164, 0.33963, 0.49835),
    (0.20646, 0.24037, 0.30739),
    (0.28295, 0.29973, 0.36992),
)
"""Means by quarter (top left, top right, bottom left, bottom right) and channel of Mitsuba 3.9.1's volpath, 16,384
samples a pixel."""


def write_scene(folder):
    """Extinction and albedo of three channels each on lattices of their own, in a turned box."""
    for name, grid in (("sigma", closed(cloud(3))), ("albedo", cloud(3, 7, 4))):
        nz, ny, nx, channels = grid.values.shape
        head = struct.pack("<3sB5i6f", b"VOL", 3, 1, nx, ny, nz, channels, 0, 0, 0, 1, 1, 1)
        (folder / f"{name}.vol").write_bytes(head + grid.values.tobytes())
    path = folder / "scene.xml"
    path.write_text(SCENE.format(place=PLACE), "utf-8")
    return path


def test_dense_smoke_is_not_blurred_outwards():
    """Photons of a dense cloud lie within a depth that their radius at the start is many times of."""
    scene = cube_of(Medium("smoke", (150.0,) * 3, (0.95,) * 3, density=cloud()), SKY)
    truth = picture(scene, "path", 128)[2:14, 2:14].mean()
    found = picture(scene, "progressive", 16, photons={"N": 50_000})[2:14, 2:14].mean()
    assert found == pytest.approx(truth, rel=0.04)  # 1.13 of it with one radius for all photons


@pytest.mark.parametrize("method", METHODS)
def test_methods_agree_with_mitsuba(tmp_path, method):
    """Means of quarters, within 2.5 %, and of all of them within 1 %."""
    scene = read_scene(write_scene(tmp_path))
    assert not scene.warnings
    settings = {"estimate": {"radius": 0.01}, "photons": {"N": 40_000}, "gather": {"rays": 8}}
    image = picture(scene, method, 400 if method == "path" else 40, **({} if method == "path" else settings))
    found = image.reshape(2, 8, 2, 8, 3).mean(axis=(1, 3)).reshape(4, 3)
    np.testing.assert_allclose(found, MITSUBA, rtol=0.025)
    assert found.mean() == pytest.approx(np.mean(MITSUBA), rel=0.01)
