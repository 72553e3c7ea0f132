"""BSDFs, emitters and colours of the Mitsuba subset."""

from pathlib import Path

import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.description import ConstantEnvironment, Material, PointLight
from tests.scene.helpers import load


def material(folder: Path, bsdf: str, *lines: str) -> tuple[Material, tuple[str, ...]]:
    scene = load(folder, f'<shape type="sphere">{bsdf}</shape>', *lines)
    return scene.materials[scene.shapes[0].material], scene.warnings


def test_defaults_are_mitsubas(tmp_path: Path) -> None:
    grey, _ = material(tmp_path, '<bsdf type="diffuse"/>')
    assert (grey.kind, grey.reflectance, grey.two_sided) == ("diffuse", (0.5, 0.5, 0.5), False)
    bare, _ = material(tmp_path, "")
    assert (bare.kind, bare.reflectance) == ("diffuse", (0.5, 0.5, 0.5))
    light, _ = material(tmp_path, '<emitter type="area"/>')
    assert light.reflectance == (0, 0, 0)
    glass, _ = material(tmp_path, '<bsdf type="dielectric"/>')
    assert glass.eta == pytest.approx(1.5046 / 1.000277)
    mirror, warnings = material(tmp_path, '<bsdf type="conductor"/>')
    assert (mirror.reflectance, warnings) == ((1, 1, 1), ())


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ('<rgb name="reflectance" value="0.1 0.2 0.3"/>', (0.1, 0.2, 0.3)),
        ('<float name="reflectance" value="0.25"/>', (0.25, 0.25, 0.25)),
        ('<spectrum name="reflectance" value="0.25"/>', (0.25, 0.25, 0.25)),
        ('<srgb name="reflectance" value="#ff0000"/>', (1, 0, 0)),
        ('<spectrum name="reflectance" type="uniform"><float name="value" value="0.75"/></spectrum>', (0.75,) * 3),
        (
            '<spectrum name="reflectance" type="srgb"><rgb name="color" value="0.1 0.2 0.3"/></spectrum>',
            (0.1, 0.2, 0.3),
        ),
        ('<texture name="reflectance" type="checkerboard"/>', (0.3, 0.3, 0.3)),
        ('<rgb name="diffuseReflectance" value="0.1 0.2 0.3"/>', (0.1, 0.2, 0.3)),
    ],
)
def test_colours_in_all_their_ways(tmp_path: Path, value: str, expected: tuple[float, ...]) -> None:
    assert material(tmp_path, f'<bsdf type="diffuse">{value}</bsdf>')[0].reflectance == pytest.approx(expected)


def test_bitmap_gives_its_mean(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (8, 8), (255, 0, 188)).save(tmp_path / "a.png")
    bitmap = '<texture name="reflectance" type="bitmap"><string name="filename" value="a.png"/></texture>'
    found, warnings = material(tmp_path, f'<bsdf type="diffuse">{bitmap}</bsdf>')
    assert found.reflectance == pytest.approx((1, 0, ((188 / 255 + 0.055) / 1.055) ** 2.4))
    assert "mean colour" in warnings[0]


def test_energy_is_not_created(tmp_path: Path) -> None:
    bright, warnings = material(tmp_path, '<bsdf type="diffuse"><rgb name="reflectance" value="2 0.5 0.5"/></bsdf>')
    assert bright.reflectance == (1, 0.5, 0.5)
    assert "above 1 was cut" in warnings[0]
    with pytest.raises(SceneError, match="must not be negative"):
        material(tmp_path, '<bsdf type="diffuse"><rgb name="reflectance" value="-1 0 0"/></bsdf>')


def test_indices_of_refraction_by_name_and_number(tmp_path: Path) -> None:
    by_name = '<string name="int_ior" value="Water"/><string name="ext_ior" value="vacuum"/>'
    assert material(tmp_path, f'<bsdf type="dielectric">{by_name}</bsdf>')[0].eta == pytest.approx(1.333)
    number = '<float name="intIOR" value="1.5"/><float name="extIOR" value="1"/>'
    assert material(tmp_path, f'<bsdf type="dielectric">{number}</bsdf>')[0].eta == 1.5
    with pytest.raises(SceneError, match="'unobtainium' is not known"):
        material(tmp_path, '<bsdf type="dielectric"><string name="int_ior" value="unobtainium"/></bsdf>')
    with pytest.raises(SceneError, match=r"expected 0\.001 to 1000"):
        material(tmp_path, '<bsdf type="dielectric"><float name="int_ior" value="0"/></bsdf>')


def test_metals(tmp_path: Path) -> None:
    half = '<rgb name="specular_reflectance" value="0.5"/>'
    gold, warnings = material(tmp_path, f'<bsdf type="conductor"><string name="material" value="Au"/>{half}</bsdf>')
    assert gold.reflectance == pytest.approx((0.5, 0.383, 0.168))
    assert len(warnings) == 1
    unknown, warnings = material(tmp_path, '<bsdf type="conductor"><string name="material" value="Xx"/></bsdf>')
    assert unknown.reflectance == (1, 1, 1)
    assert "'Xx'" in warnings[0]
    index = '<float name="eta" value="1.5"/><float name="k" value="0"/>'
    assert material(tmp_path, f'<bsdf type="conductor">{index}</bsdf>')[0].reflectance == pytest.approx((0.04,) * 3)


@pytest.mark.parametrize(
    ("bsdf", "kind"),
    [
        ('<bsdf type="thindielectric"/>', "dielectric"),
        ('<bsdf type="roughdielectric"><float name="alpha" value="0.1"/></bsdf>', "dielectric"),
        ('<bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf>', "conductor"),
        ('<bsdf type="plastic"/>', "diffuse"),
        (
            '<bsdf type="bumpmap"><texture name="arbitrary" type="bitmap"/><bsdf type="dielectric"/></bsdf>',
            "dielectric",
        ),
        ('<bsdf type="hair"/>', "diffuse"),
    ],
)
def test_approximations_are_named_once(tmp_path: Path, bsdf: str, kind: str) -> None:
    found, warnings = material(tmp_path, bsdf)
    assert found.kind == kind
    assert len(warnings) == 1


def test_twosided(tmp_path: Path) -> None:
    assert material(tmp_path, '<bsdf type="twosided"><bsdf type="conductor"/></bsdf>')[0].two_sided
    found, warnings = material(tmp_path, '<bsdf type="twosided"><bsdf type="dielectric"/></bsdf>')
    assert not found.two_sided
    assert "no effect" in warnings[0]
    with pytest.raises(SceneError, match="needs a BSDF inside"):
        material(tmp_path, '<bsdf type="twosided"/>')


def test_emitters(tmp_path: Path) -> None:
    scene = load(
        tmp_path,
        '<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="3 2 1"/></emitter></shape>',
        '<emitter type="point"><point name="position" value="1 2 3"/><rgb name="intensity" value="5"/></emitter>',
        '<emitter type="point"><transform name="to_world"><translate y="4"/></transform></emitter>',
        '<emitter type="spot"/>',
    )
    assert scene.shapes[0].radiance == (3, 2, 1)
    near, above, sky = scene.lights
    assert isinstance(near, PointLight)
    assert isinstance(above, PointLight)
    assert isinstance(sky, ConstantEnvironment)
    assert (near.position, near.intensity) == ((1, 2, 3), (5, 5, 5))
    assert (above.position, above.intensity) == ((0, 4, 0), (1, 1, 1))
    assert sky.radiance == (1, 1, 1)
    assert scene.warnings == ('line 5: <emitter type="spot"> is not supported and was ignored.',)


def test_lights_without_power_are_dropped_and_counted(tmp_path: Path) -> None:
    dark = '<shape type="sphere"><emitter type="area"><rgb name="radiance" value="0"/></emitter></shape>'
    flat = '<shape type="rectangle"><transform name="to_world"><scale y="0"/></transform><emitter type="area"/></shape>'
    scene = load(tmp_path, dark, flat)
    assert [s.radiance for s in scene.shapes] == [None]
    assert scene.dropped == {"light of no power": 1, "zero-area light": 1}
