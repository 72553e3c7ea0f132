"""Sun and sky against Mitsuba 3.9.1's `sunsky`, whose answers are recorded here: `mi.load_dict({"type": "sunsky", …})`
in `scalar_rgb`, its `eval` towards the directions named, with `sun_scale` or `sky_scale` 0; of the sun, times the solid
angle of 0.5358°."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.arrays.sky_table import sky_integral
from pmviewer.scene.daylight import models
from pmviewer.scene.daylight.image import sky_image
from pmviewer.scene.daylight.models import SUN_HALF_APERTURE, sky_model
from pmviewer.scene.daylight.position import Moment, sun_angles
from pmviewer.scene.daylight.preetham import Preetham
from pmviewer.scene.defaults.sky_sum import looked_up
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, Light
from tests.scene.helpers import load

installed = pytest.mark.skipif(models._mitsuba_tables() is None, reason="its tables come with Mitsuba")
HIGH = '<vector name="sun_direction" x="0.6" y="0" z="0.8"/>'
HIGH_SUN = (1.48969, 1.23866, 0.938430)
SKIES = {
    # Turbidity, albedo, sun: direction and the sky's radiance there.
    (3.0, 0.3, (0.6, 0.0, 0.8)): [
        ((0, 0, 1), (0.0290801, 0.0482356, 0.0955867)),
        ((0.5, 0.1, 0.3), (0.105112, 0.146346, 0.215088)),
        ((-1, 0, 0.05), (0.15429, 0.214191, 0.274033)),
    ],
    (6.5, 0.8, (0.98, 0.0, 0.198997487)): [
        ((0, 0, 1), (0.0157285, 0.0247203, 0.0378594)),
        ((0.5, 0.1, 0.3), (0.210688, 0.1845, 0.135955)),
        ((-1, 0, 0.05), (0.108198, 0.111973, 0.0956862)),
    ],
}


def lights(
    folder: Path, kind: str, inside: str = "", version: str = "3.0.0"
) -> tuple[tuple[Light, ...], tuple[str, ...]]:
    emitter = f'<emitter type="{kind}">{inside}</emitter>'
    scene = load(folder, '<shape type="sphere"/>', '<emitter type="point"/>', emitter, sky="", version=version)
    return scene.lights[1:], scene.warnings


def towards(light: Light, *direction: float) -> np.ndarray:
    assert isinstance(light, ImageEnvironment)
    d = np.array([direction]) / np.linalg.norm(direction)
    return looked_up(light, d)[0]


@installed
@pytest.mark.parametrize("sky", SKIES)
def test_the_sky_is_mitsubas(sky: tuple[float, float, tuple[float, float, float]]) -> None:
    turbidity, albedo, sun = sky
    model, exact = sky_model(turbidity, (albedo,) * 3, math.acos(sun[2]))
    assert exact
    for direction, expected in SKIES[sky]:
        d = np.array(direction) / np.linalg.norm(direction)
        assert model.radiance(d[2], np.arccos(d @ sun)) == pytest.approx(expected, rel=1e-4)


@installed
def test_a_sky_in_a_file(tmp_path: Path) -> None:
    (sky,), warnings = lights(tmp_path, "sunsky", f'{HIGH}<float name="sun_scale" value="0"/>')
    assert warnings == ()
    for direction, expected in SKIES[3.0, 0.3, (0.6, 0.0, 0.8)]:
        assert towards(sky, *direction) == pytest.approx(expected, rel=0.01)
    assert towards(sky, 0, 0, -1) == pytest.approx(0)
    turn = '<transform name="to_world"><rotate x="1" angle="-90"/></transform>'
    sun = '<vector name="sun_direction" x="0" y="0.6" z="0.8"/>'
    (sky,), _ = lights(tmp_path, "sunsky", f'{turn}{sun}<float name="sun_scale" value="0"/>')
    assert towards(sky, 0, 1, 0) == pytest.approx((0.0196621, 0.0359278, 0.0726145), rel=0.01)
    assert towards(sky, 0.3, 0.5, -0.4) == pytest.approx((0.0239171, 0.0461211, 0.0906368), rel=0.01)


@installed
@pytest.mark.parametrize("aperture", [0.5358, 5.0, 0.01])
def test_the_sun_is_a_disc_of_mitsubas_irradiance(tmp_path: Path, aperture: float) -> None:
    size = f'<float name="sun_aperture" value="{aperture}"/>'
    (light,), warnings = lights(tmp_path, "sunsky", f'{HIGH}{size}<float name="sky_scale" value="0"/>')
    assert isinstance(light, ImageEnvironment)
    assert warnings == ()
    assert sky_integral(light.pixels) == pytest.approx(HIGH_SUN, rel=5e-3)
    assert towards(light, 0.6, 0, 0.8).min() > 0
    if aperture == 5.0:
        inside, outside = math.radians(2.3), math.radians(2.8)
        lean = math.atan2(0.6, 0.8)
        assert towards(light, math.sin(lean + inside), 0, math.cos(lean + inside)).min() > 0
        assert towards(light, math.sin(lean + outside), 0, math.cos(lean + outside)).max() == 0


@pytest.mark.parametrize(
    ("at", "direction"),
    [
        (Moment(), (0.0513854, 0.691748, 0.720308)),
        (Moment(2015, 3, 21, 9.5, 48.0, 11.0, 1.0), (0.539138, -0.686269, 0.488226)),
        (Moment(2010, 12, 10, 6.5, -33.0, 18.0, 2.0), (0.349629, -0.920197, 0.17606)),
    ],
)
def test_where_the_sun_stands(at: Moment, direction: tuple[float, float, float]) -> None:
    """`mi.traverse(emitter)["sun_direction"]`, which counts days in 32 bits; x is north, y east turned round."""
    zenith, azimuth = sun_angles(at)
    found = (-math.cos(azimuth) * math.sin(zenith), -math.sin(azimuth) * math.sin(zenith), math.cos(zenith))
    assert found == pytest.approx(direction, abs=1e-3)


def test_version_0_has_y_up_and_three_kinds(tmp_path: Path) -> None:
    """Mitsuba 0.6's documentation: `sky` without a sun, `sun` without a sky, of no size with sunRadiusScale 0."""
    sun = '<vector name="sunDirection" x="0.6" y="0.8" z="0"/>'
    (sky,), _ = lights(tmp_path, "sky", sun, "0.6.0")
    assert towards(sky, 0, -1, 0) == pytest.approx(0)
    near, far = towards(sky, 0.7, 0.7, 0.1), towards(sky, -0.7, 0.7, 0.1)
    assert (near > far).all()
    (disc,), _ = lights(tmp_path, "sun", sun, "0.6.0")
    assert towards(disc, 0.6, 0.8, 0).min() > 100
    assert towards(disc, -0.6, 0.8, 0).max() == 0
    both, _ = lights(tmp_path, "sunsky", f'{sun}<float name="sunRadiusScale" value="0"/>', "0.6.0")
    ray, dome = both
    assert isinstance(ray, DirectionalLight)
    assert ray.direction == pytest.approx((-0.6, -0.8, 0))
    assert isinstance(dome, ImageEnvironment)
    assert isinstance(disc, ImageEnvironment)
    assert sky_integral(disc.pixels) == pytest.approx(ray.irradiance, rel=1e-4)


def test_a_sky_drawn_below_the_horizon(tmp_path: Path) -> None:
    sun = '<vector name="sunDirection" x="0.6" y="0.8" z="0"/>'
    (plain,), _ = lights(tmp_path, "sky", sun, "0.6.0")
    (drawn,), _ = lights(tmp_path, "sky", f'{sun}<float name="stretch" value="1.5"/>', "0.6.0")
    (faded,), _ = lights(tmp_path, "sky", f'{sun}<boolean name="extend" value="true"/>', "0.6.0")
    assert towards(plain, 1, -0.3, 0).max() == 0
    assert towards(drawn, 1, -0.3, 0).min() > 0
    assert 0 < towards(faded, 1, -0.3, 0)[2] < towards(faded, 1, 0.001, 0)[2]


def test_no_sun_at_night(tmp_path: Path) -> None:
    found, warnings = lights(tmp_path, "sunsky", '<float name="hour" value="1"/>')
    assert found == ()
    assert "below the horizon" in warnings[0]


def test_without_mitsuba_another_model_is_used_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "_mitsuba_tables", lambda: None)
    _, warnings = lights(tmp_path, "sunsky", HIGH)
    assert "Preetham" in warnings[0]


def test_preethams_sky_and_sun() -> None:
    """Zenith luminance of the paper's appendix at turbidity 4 and a sun 30° off the zenith, by hand:
    χ = (4/9 − 1/30)·(π − π/3) = 0.8610, Y = (4.0453·4 − 4.9710)·tan χ − 0.2155·4 + 2.4192 = 14.61 kcd/m². Clear sky
    is blue, about 8000 K or more; sunlight is about 100 klx, warmer when it is low."""
    model = Preetham(4.0, math.radians(30))
    red, green, blue = model.radiance(np.array(1.0), np.array(math.radians(30)))
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    assert luminance * 683 * 106.75026 / 1000 == pytest.approx(14.61, rel=0.01)
    assert red < green < blue
    high, low = model.sun(), Preetham(4.0, math.radians(80)).sun()
    assert 60 < high @ [0.2126, 0.7152, 0.0722] * 683 * 106.75026 / 1000 < 110
    assert low[2] / low[0] < 0.5 * high[2] / high[0]


def test_the_image_has_what_the_model_brings() -> None:
    """A model of the same radiance everywhere lights a plane that looks up with π, and a half sphere has 2π."""

    class Even:
        def radiance(self, cos_zenith: np.ndarray, gamma: np.ndarray) -> np.ndarray:
            return np.ones((*gamma.shape, 3))

        def sun(self) -> np.ndarray:
            return np.array([3.0, 2.0, 1.0])

    up = np.array([0.0, 1.0, 0.0])
    assert sky_integral(sky_image(Even(), up, 1.0, 0.0, SUN_HALF_APERTURE)) == pytest.approx(2 * math.pi, rel=1e-4)
    both = sky_integral(sky_image(Even(), np.array([0.0, 0.6, 0.8]), 1.0, 2.0, SUN_HALF_APERTURE))
    assert both == pytest.approx(2 * math.pi + np.array([6, 4, 2]), rel=1e-4)
