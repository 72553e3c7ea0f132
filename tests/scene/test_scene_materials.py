"""BSDFs, emitters and colours of the Mitsuba subset."""

from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.arrays.material_lobes import glossy_roughness
from pmviewer.scene.description import ConstantEnvironment, Material, PointLight
from pmviewer.scene.optics import METALS, metal
from pmviewer.scene.texture import Checkerboard
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
    assert (mirror.reflectance, mirror.metal, warnings) == ((1, 1, 1), None, ())


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
    assert warnings == ()


def test_energy_is_not_created(tmp_path: Path) -> None:
    bright, warnings = material(tmp_path, '<bsdf type="diffuse"><rgb name="reflectance" value="2 0.5 0.5"/></bsdf>')
    assert bright.reflectance == (1, 0.5, 0.5)
    assert "above 1 was cut" in warnings[0]
    dark, warnings = material(tmp_path, '<bsdf type="diffuse"><rgb name="reflectance" value="-1 0 0.25"/></bsdf>')
    assert dark.reflectance == (0, 0, 0.25)
    assert "negative numbers count as 0" in warnings[0]


def test_indices_of_refraction_by_name_and_number(tmp_path: Path) -> None:
    by_name = '<string name="int_ior" value="Water"/><string name="ext_ior" value="vacuum"/>'
    assert material(tmp_path, f'<bsdf type="dielectric">{by_name}</bsdf>')[0].eta == pytest.approx(1.333)
    number = '<float name="intIOR" value="1.5"/><float name="extIOR" value="1"/>'
    assert material(tmp_path, f'<bsdf type="dielectric">{number}</bsdf>')[0].eta == 1.5
    unknown = '<bsdf type="dielectric"><string name="int_ior" value="unobtainium"/></bsdf>'
    found, warnings = material(tmp_path, unknown)
    assert found.eta == pytest.approx(1.5046 / 1.000277)
    assert "'unobtainium' is not known, 'bk7' replaces it" in warnings[0]
    found, warnings = material(tmp_path, '<bsdf type="dielectric"><float name="int_ior" value="0"/></bsdf>')
    assert found.eta == pytest.approx(0.001 / 1.000277)
    assert "outside 0.001 to 1000" in warnings[0]
    ratio = '<float name="eta" value="1.4"/>'
    assert material(tmp_path, f'<bsdf type="roughplastic">{ratio}</bsdf>')[0].eta == 1.4


def test_metals(tmp_path: Path) -> None:
    half = '<rgb name="specular_reflectance" value="0.5"/>'
    gold, warnings = material(tmp_path, f'<bsdf type="conductor"><string name="material" value="Au"/>{half}</bsdf>')
    assert (gold.kind, gold.reflectance, gold.metal, warnings) == ("conductor", (0.5, 0.5, 0.5), METALS["Au"], ())
    unknown, warnings = material(tmp_path, '<bsdf type="conductor"><string name="material" value="Xx"/></bsdf>')
    assert (unknown.reflectance, unknown.metal) == ((1, 1, 1), None)
    assert "'Xx'" in warnings[0]
    index = '<float name="eta" value="1.5"/><rgb name="k" value="1 2 3"/>'
    assert material(tmp_path, f'<bsdf type="conductor">{index}</bsdf>')[0].metal == ((1.5, 1.5, 1.5), (1, 2, 3))


def test_metals_are_the_known_ones() -> None:
    """Reflectance head-on against the colours that metals are known for, and names with and without their source."""

    def head_on(name: str) -> list[float]:
        index = metal(name)
        assert index is not None
        return [((e - 1) ** 2 + k * k) / ((e + 1) ** 2 + k * k) for e, k in zip(*index)]

    assert head_on("Au") == pytest.approx([1.0, 0.77, 0.34], abs=0.05)
    assert head_on("Ag") == pytest.approx([0.97, 0.96, 0.92], abs=0.03)
    assert head_on("Cu") == pytest.approx([0.95, 0.64, 0.54], abs=0.06)
    assert head_on("Al") == pytest.approx([0.92, 0.92, 0.92], abs=0.02)
    assert metal("Ni") == metal("Ni_palik")
    assert metal("Be_palik") == metal("Be")
    assert metal("unobtainium") is None


def test_roughness_and_distribution(tmp_path: Path) -> None:
    plain, warnings = material(tmp_path, '<bsdf type="roughconductor"/>')
    assert (plain.kind, plain.alpha, plain.distribution) == ("rough conductor", (0.1, 0.1), "beckmann")
    assert warnings == ()
    both = '<float name="alpha_u" value="0.2"/><float name="alphaV" value="0.3"/>'
    ggx = '<string name="distribution" value="GGX"/><boolean name="sample_visible" value="true"/>'
    found, warnings = material(tmp_path, f'<bsdf type="roughdielectric">{both}{ggx}</bsdf>')
    assert (found.kind, found.alpha, found.distribution, warnings) == ("rough dielectric", (0.2, 0.3), "ggx", ())
    for odd, taken, message in (
        ('<float name="alpha_u" value="0.2"/>', (0.2, 0.2), "'alpha_u' without 'alpha_v'"),
        ('<float name="alpha" value="-1"/>', (0, 0), "outside 0 to 10: -1 was taken as 0"),
        ('<string name="distribution" value="phong"/>', (0.1, 0.1), "'phong' is not supported, Beckmann's"),
        (f'<float name="alpha" value="0.9"/>{both}', (0.2, 0.3), "'alpha' beside 'alpha_u'"),
    ):
        found, warnings = material(tmp_path, f'<bsdf type="roughconductor">{odd}</bsdf>')
        assert (found.alpha, found.distribution) == (taken, "beckmann")
        assert len(warnings) == 1
        assert message in warnings[0]


def test_roughness_along_and_across(tmp_path: Path) -> None:
    """Each a texture or a number; the picture of one is not used for the other."""
    picture = '<texture name="{}" type="checkerboard"><float name="color0" value="{}"/></texture>'
    for odd, alpha, along, across in (
        (picture.format("alpha_u", 0.6) + '<float name="alpha_v" value="0.3"/>', (0.4, 0.3), (0.6, 0.2), (0.3, 0.3)),
        ('<float name="alpha_u" value="0.3"/>' + picture.format("alpha_v", 0.6), (0.3, 0.4), (0.3, 0.3), (0.6, 0.2)),
        (picture.format("alpha_u", 0.8) + picture.format("alpha_v", 0.6), (0.5, 0.4), (0.8, 0.2), (0.6, 0.2)),
    ):
        found, warnings = material(tmp_path, f'<bsdf type="roughconductor">{odd}</bsdf>')
        assert (found.alpha, warnings) == (pytest.approx(alpha), ())
        for slot, fields in (("alpha", along), ("alpha_across", across)):
            texture = found.textures[slot]
            assert isinstance(texture, Checkerboard)
            assert (texture.color0[0], texture.color1[0]) == pytest.approx(fields)
        assert glossy_roughness(found) == pytest.approx((min(*along, *across), min(max(along), max(across))))
    found, _ = material(tmp_path, f'<bsdf type="roughconductor">{picture.format("alpha_u", 0.6)}</bsdf>')
    assert found.textures.keys() == {"alpha"}


def test_a_metal_in_another_medium(tmp_path: Path) -> None:
    index = '<rgb name="eta" value="1.5 2 3"/><rgb name="k" value="-1 2 3"/><float name="ext_eta" value="1.5"/>'
    found, warnings = material(tmp_path, f'<bsdf type="roughconductor">{index}</bsdf>')
    assert found.metal is not None
    assert np.array(found.metal) == pytest.approx(np.array([[1, 4 / 3, 2], [0, 4 / 3, 2]]))
    assert len(warnings) == 1


def test_glass_that_absorbs(tmp_path: Path) -> None:
    sigma = '<rgb name="absorption" value="0.1 0.2 0.3"/>'
    for kind in ("dielectric", "roughdielectric"):
        found, warnings = material(tmp_path, f'<bsdf type="{kind}">{sigma}</bsdf>')
        assert (found.absorption, warnings) == ((0.1, 0.2, 0.3), ())
    thin, warnings = material(tmp_path, f'<bsdf type="thindielectric">{sigma}</bsdf>')
    assert (thin.kind, thin.absorption) == ("thin dielectric", (0, 0, 0))
    assert "'absorption'" in warnings[0]


def test_plastic(tmp_path: Path) -> None:
    smooth, warnings = material(tmp_path, '<bsdf type="plastic"/>')
    assert (smooth.kind, smooth.reflectance, smooth.specular) == ("plastic", (0.5,) * 3, (1.0,) * 3)
    assert smooth.eta == pytest.approx(1.49 / 1.000277)
    assert (smooth.nonlinear, warnings) == (False, ())
    values = (
        '<float name="alpha" value="0.3"/><boolean name="nonlinear" value="true"/><float name="int_ior" value="1.9"/>'
    )
    found, _ = material(tmp_path, f'<bsdf type="roughplastic">{values}</bsdf>')
    assert (found.kind, found.alpha, found.nonlinear, found.distribution) == (
        "rough plastic",
        (0.3, 0.3),
        True,
        "beckmann",
    )


def test_schlick_and_ward(tmp_path: Path) -> None:
    colour = '<rgb name="reflectance" value="0.8 0.7 0.6"/>'
    found, warnings = material(tmp_path, f'<bsdf type="schlick"><float name="alpha" value="0.25"/>{colour}</bsdf>')
    assert (found.kind, found.alpha, found.specular) == ("schlick", (0.5, 0.5), (0.8, 0.7, 0.6))
    assert warnings == ()
    found, warnings = material(tmp_path, '<bsdf type="schlick"><float name="alpha" value="2"/></bsdf>')
    assert found.alpha == (1, 1)
    assert "2 was taken as 1" in warnings[0]
    bright = '<float name="diffuse_reflectance" value="0.9"/><float name="specular_reflectance" value="0.25"/>'
    ward, warnings = material(tmp_path, f'<bsdf type="ward">{bright}</bsdf>')
    assert (ward.reflectance, ward.specular) == ((0.75,) * 3, (0.25,) * 3)
    assert "more than 1" in warnings[0]


@pytest.mark.parametrize(
    ("bsdf", "kind"),
    [
        ('<bsdf type="hair"/>', "diffuse"),
    ],
)
def test_approximations_are_named_once(tmp_path: Path, bsdf: str, kind: str) -> None:
    found, warnings = material(tmp_path, bsdf)
    assert found.kind == kind
    assert len(warnings) == 1


def test_twosided(tmp_path: Path) -> None:
    assert material(tmp_path, '<bsdf type="twosided"><bsdf type="conductor"/></bsdf>')[0].two_sided
    metal_inside, _ = material(tmp_path, '<bsdf type="twosided"><bsdf type="roughconductor"/></bsdf>')
    assert (metal_inside.kind, metal_inside.two_sided) == ("rough conductor", True)
    found, warnings = material(tmp_path, '<bsdf type="twosided"><bsdf type="dielectric"/></bsdf>')
    assert not found.two_sided
    assert "no effect" in warnings[0]
    empty, warnings = material(tmp_path, '<bsdf type="twosided"/>')
    assert (empty.kind, empty.two_sided) == ("diffuse", True)
    assert "no BSDF inside" in warnings[0]


def test_emitters(tmp_path: Path) -> None:
    scene = load(
        tmp_path,
        '<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="3 2 1"/></emitter></shape>',
        '<emitter type="point"><point name="position" value="1 2 3"/><rgb name="intensity" value="5"/></emitter>',
        '<emitter type="point"><transform name="to_world"><translate y="4"/></transform></emitter>',
        '<emitter type="volume"/>',
    )
    assert scene.shapes[0].radiance == (3, 2, 1)
    near, above, sky = scene.lights
    assert isinstance(near, PointLight)
    assert isinstance(above, PointLight)
    assert isinstance(sky, ConstantEnvironment)
    assert (near.position, near.intensity) == ((1, 2, 3), (5, 5, 5))
    assert (above.position, above.intensity) == ((0, 4, 0), (1, 1, 1))
    assert sky.radiance == (1, 1, 1)
    assert scene.warnings == ('line 5: <emitter type="volume"> is not supported and was ignored.',)


def test_lights_without_power_are_dropped_and_counted(tmp_path: Path) -> None:
    dark = '<shape type="sphere"><emitter type="area"><rgb name="radiance" value="0"/></emitter></shape>'
    flat = '<shape type="rectangle"><transform name="to_world"><scale y="0"/></transform><emitter type="area"/></shape>'
    scene = load(tmp_path, dark, flat)
    assert [s.radiance for s in scene.shapes] == [None]
    assert scene.dropped == {"light of no power": 1, "zero-area light": 1}


def test_thin_glass_says_how_light_passes_it(tmp_path: Path) -> None:
    """Not Mitsuba's: a property of smooth glass of either kind."""

    def of(kind: str, value: str = "") -> tuple[Material, tuple[str, ...]]:
        rule = f'<string name="thin_glass" value="{value}"/>' if value else ""
        return material(tmp_path, f'<bsdf type="{kind}">{rule}</bsdf>')

    assert (of("thindielectric")[0].thin_rule, of("dielectric")[0].thin_rule) == ("by setting", "exact")
    for kind in ("thindielectric", "dielectric"):
        for rule in ("exact", "ignored", "tinted", "tinted and reflecting", "by setting"):
            found, warnings = of(kind, rule)
            assert (found.thin_rule, warnings) == (rule, ())
        found, warnings = of(kind, "clear")
        assert found.thin_rule == of(kind)[0].thin_rule
        assert len(warnings) == 1
        assert "'thin_glass'" in warnings[0]
        assert "'clear'" in warnings[0]
    found, warnings = of("roughdielectric", "tinted")
    assert found.thin_rule == "exact"
    assert len(warnings) == 1
