"""Spectra of scene files as linear sRGB, against what Mitsuba 3.9.1 makes of the same elements (variant scalar_rgb,
read with mi.traverse; black bodies: variant scalar_spectral, mean of a rendered picture)."""

from pathlib import Path

import pytest

from pmviewer.scene.cie import EQUAL_ENERGY, rgb_of_blackbody
from pmviewer.scene.description import PointLight
from tests.scene.helpers import load

CLOSE = 3e-3
SPD = "# measured\n400 0.2\n450.5 0.9\n\n520 0.1\n700 0.4\n"

# Attributes of <spectrum>; its colour as a reflectance, as an intensity, and as the index of a conductor.
CASES = {
    'value="400:0.2, 500:0.5, 600:0.1, 700:0.9"': (
        (0.162584, 0.336032, 0.368713),
        (0.228687, 0.313302, 0.331706),
        (0.162584, 0.336032, 0.368713),
    ),
    'value="360:1, 830:1"': ((1, 1, 1), (1.204884, 0.948228, 0.909267), (1, 1, 1)),
    'value="600:1, 650:1"': ((0.748683, 0, 0), (0.853868, 0, 0), (0.748683, 0, 0)),
    'value="0.5"': ((0.5, 0.5, 0.5), (0.602397, 0.474146, 0.454458), (0.5, 0.5, 0.5)),
    'filename="measured.spd"': (
        (0.278427, 0.138316, 0.748332),
        (0.332937, 0.129505, 0.677072),
        (0.278427, 0.138316, 0.748332),
    ),
    'value="300:0 900:2"': (
        (1, 0.809086, 0.468867),
        (1.346326, 0.770339, 0.416602),
        (1.140259, 0.809086, 0.468867),
    ),
}


def reflectance(folder: Path, inside: str):
    scene = load(folder, f'<shape type="cube"><bsdf type="diffuse">{inside}</bsdf></shape>')
    return scene.materials[scene.shapes[0].material].reflectance, scene.warnings


def intensity(folder: Path, inside: str):
    scene = load(folder, '<shape type="cube"/>', f'<emitter type="point">{inside}</emitter>')
    light = scene.lights[0]
    assert isinstance(light, PointLight)
    return light.intensity, scene.warnings


@pytest.mark.parametrize("attributes", CASES)
def test_spectra_have_mitsubas_colours(tmp_path: Path, attributes: str) -> None:
    (tmp_path / "measured.spd").write_text(SPD, "utf-8")
    surface, light, index = CASES[attributes]
    spectrum = '<spectrum name="{}" ' + attributes + "/>"
    assert reflectance(tmp_path, spectrum.format("reflectance"))[0] == pytest.approx(surface, abs=CLOSE, rel=CLOSE)
    assert intensity(tmp_path, spectrum.format("intensity"))[0] == pytest.approx(light, abs=CLOSE, rel=CLOSE)
    metal = f'<bsdf type="conductor">{spectrum.format("eta")}{spectrum.format("k")}</bsdf>'
    scene = load(tmp_path, f'<shape type="cube">{metal}</shape>')
    found = scene.materials[scene.shapes[0].material].metal
    assert found is not None
    assert found[0] == pytest.approx(index, abs=CLOSE, rel=CLOSE)
    assert found[1] == pytest.approx(index, abs=CLOSE, rel=CLOSE)


def test_walls_of_the_measured_box(tmp_path: Path) -> None:
    """The Cornell box' measured walls and light (every 40 nm), by mi.spectrum_list_to_srgb of Mitsuba 3.9.1."""
    green = "400:0.092, 440:0.096, 480:0.101, 520:0.284, 560:0.286, 600:0.14, 640:0.125, 680:0.124, 700:0.129"
    red = "400:0.04, 440:0.055, 480:0.061, 520:0.055, 560:0.061, 600:0.421, 640:0.639, 680:0.628, 700:0.65"
    lamp = "400:0, 500:8, 600:15.6, 700:18.4"
    for text, expected in ((green, (0.118547, 0.271462, 0.085811)), (red, (0.585858, 0.072411, 0.04311))):
        colour, warnings = reflectance(tmp_path, f'<spectrum name="reflectance" value="{text}"/>')
        assert colour == pytest.approx(expected, rel=CLOSE)
        assert warnings == ()
    light = f'<emitter type="area"><spectrum name="radiance" value="{lamp}"/></emitter>'
    scene = load(tmp_path, f'<shape type="rectangle">{light}</shape>')
    assert scene.shapes[0].radiance == pytest.approx((20.710821, 10.854642, 2.771151), rel=CLOSE)


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ('type="regular"><string name="values" value="0.2 0.5 0.1 0.9"/>', (0.228687, 0.313302, 0.331706)),
        (
            'type="irregular"><string name="wavelengths" value="400 500 600 700"/>'
            '<string name="values" value="0.2, 0.5, 0.1, 0.9"/>',
            (0.228687, 0.313302, 0.331706),
        ),
        ('type="uniform"><float name="value" value="0.5"/>', (0.5, 0.5, 0.5)),
        ('type="d65"><float name="scale" value="3"/>', (3, 3, 3)),
        (
            'type="d65"><float name="scale" value="2"/><spectrum type="irregular">'
            '<string name="wavelengths" value="400 500 600 700"/><string name="values" value="0.2, 0.5, 0.1, 0.9"/>'
            "</spectrum>",
            (0.325168, 0.672064, 0.737426),
        ),
        ('type="d65"><rgb name="color" value="1 2 3"/><float name="scale" value="2"/>', (2, 4, 6)),
    ],
)
def test_spectra_written_as_objects(tmp_path: Path, inside: str, expected: tuple[float, ...]) -> None:
    if "regular" in inside and "irregular" not in inside:
        inside += '<float name="wavelength_min" value="400"/><float name="wavelength_max" value="700"/>'
    colour, warnings = intensity(tmp_path, f'<spectrum name="intensity" {inside}</spectrum>')
    assert colour == pytest.approx(expected, rel=CLOSE)
    assert warnings == ()


@pytest.mark.parametrize(
    ("kelvin", "expected"),
    [(2800, (425.82, 185.76, 49.60)), (5000, (15281, 12095, 9603)), (12000, (243118, 292532, 460973))],
)
def test_black_bodies_glow_as_mitsubas(kelvin: float, expected: tuple[float, ...], tmp_path: Path) -> None:
    assert rgb_of_blackbody(kelvin) == pytest.approx(expected, rel=5e-3)
    inside = f'<spectrum type="blackbody" name="intensity"><float name="temperature" value="{kelvin}"/></spectrum>'
    assert intensity(tmp_path, inside)[0] == pytest.approx(expected, rel=5e-3)
    old = f'<blackbody name="intensity" temperature="{kelvin}K" scale="0.1"/>'
    assert intensity(tmp_path, old)[0] == pytest.approx([0.1 * c for c in expected], rel=5e-3)


def test_light_of_equal_energy_is_pink() -> None:
    # mi.xyz_to_srgb(1) of Mitsuba 3.9.1
    assert pytest.approx((1.20479, 0.948291, 0.908916), rel=1e-5) == EQUAL_ENERGY


def test_colours_beyond_rgb_are_said(tmp_path: Path) -> None:
    colour, warnings = intensity(tmp_path, '<spectrum name="intensity" value="500:0 510:1 520:0"/>')
    assert colour[0] == 0
    assert colour[1] > 0
    assert warnings == (
        "line 3: The colour of a spectrum lies outside of what RGB can show: its negative part is cut off.",
    )


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ('<spectrum name="reflectance" value="400:a"/>', "expected a number, found 'a'; 0.5 0.5 0.5 is used"),
        ('<spectrum name="reflectance" filename="text.spd"/>', "expected a wavelength and a value in each line"),
        ('<spectrum name="reflectance" type="irregular"/>', "two wavelengths or more; the default (0.5, 0.5, 0.5)"),
        (
            '<spectrum name="reflectance" type="blackbody"><float name="temperature" value="-4"/></spectrum>',
            "1 to 1000000 K",
        ),
        ('<transform name="reflectance"/>', "expected a colour, found <transform>; 0.5 0.5 0.5 is used"),
        ('<spectrum name="reflectance" filename="gone.spd"/>', "Files that do not exist"),
    ],
)
def test_what_is_no_spectrum_leaves_the_default(tmp_path: Path, inside: str, words: str) -> None:
    (tmp_path / "text.spd").write_text("400 1\n500 1 2\n", "utf-8")
    colour, warnings = reflectance(tmp_path, inside)
    assert colour == (0.5, 0.5, 0.5)
    assert len(warnings) == 1
    assert words in warnings[0]


def test_three_numbers_are_rgb_as_in_version_0_6(tmp_path: Path) -> None:
    assert reflectance(tmp_path, '<spectrum name="reflectance" value="0.1 0.2 0.3"/>')[0] == (0.1, 0.2, 0.3)
    assert intensity(tmp_path, '<spectrum name="intensity" value="1, 2, 3"/>')[0] == (1, 2, 3)
