"""Masks, blends, mixtures, coats, and what stands in for BSDFs that there are none of here."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from PIL import Image

from pmviewer.scene.description import Material
from pmviewer.scene.texture import Bitmap
from tests.scene.helpers import load


def material(folder: Path, bsdf: str) -> tuple[Material, tuple[str, ...]]:
    scene = load(folder, f'<shape type="sphere">{bsdf}</shape>')
    return scene.materials[scene.shapes[0].material], scene.warnings


def bitmap(folder: Path, name: str, more: str = "") -> str:
    Image.new("RGBA", (4, 2), (188, 0, 255, 51)).save(folder / "a.png")
    return f'<texture name="{name}" type="bitmap"><string name="filename" value="a.png"/>{more}</texture>'


BLUE = '<rgb name="{}" value="0.1 0.2 0.3"/>'
LAYER = '<rgb name="sigmaS" value="3 1 0"/><rgb name="sigmaA" value="1"/>'
METAL, GREY = '<bsdf type="conductor"/>', '<bsdf type="diffuse"/>'


def test_blends(tmp_path: Path) -> None:
    found, warnings = material(
        tmp_path, f'<bsdf type="blendbsdf">{METAL}{GREY}<float name="weight" value="0.25"/></bsdf>'
    )
    assert (found.kind, found.weight, [p.kind for p in found.parts]) == ("blend", 0.25, ["conductor", "diffuse"])
    assert warnings == ()
    found, _ = material(tmp_path, f'<bsdf type="blendbsdf">{bitmap(tmp_path, "weight")}{METAL}{GREY}</bsdf>')
    assert found.textures.keys() == {"weight"}
    end, _ = material(tmp_path, f'<bsdf type="blendbsdf">{METAL}{GREY}<float name="weight" value="0"/></bsdf>')
    assert end.kind == "conductor"
    one, warnings = material(tmp_path, f'<bsdf type="blendbsdf">{METAL}</bsdf>')
    assert one.kind == "conductor"
    assert "needs two BSDFs" in warnings[0]


def test_both_sides_and_maps_reach_the_parts(tmp_path: Path) -> None:
    blend = f'<bsdf type="blendbsdf">{METAL}<bsdf type="dielectric"/></bsdf>'
    bumpy = f'<bsdf type="twosided"><bsdf type="bumpmap">{bitmap(tmp_path, "x")}{blend}</bsdf></bsdf>'
    found, warnings = material(tmp_path, bumpy)
    assert found.kind == "blend"
    assert not found.textures
    assert [p.textures.keys() for p in found.parts] == [{"bump"}, {"bump"}]
    assert [p.two_sided for p in found.parts] == [True, False]
    assert "no effect on a transparent BSDF" in warnings[0]


def test_a_mixture_is_blends_in_blends(tmp_path: Path) -> None:
    plain = '<bsdf type="plastic"/>'
    weights = '<string name="weights" value="0.2, 0.5 0.1"/>'
    found, warnings = material(tmp_path, f'<bsdf type="mixturebsdf">{weights}{METAL}{GREY}{plain}</bsdf>')

    def shares(m: Material, share: float) -> list[tuple[str, float]]:
        if m.kind != "blend":
            return [(m.kind, share)]
        a, b = m.parts
        return shares(a, share * (1 - m.weight)) + shares(b, share * m.weight)

    kinds, amounts = zip(*shares(found, 1.0))
    assert kinds == ("conductor", "diffuse", "plastic", "diffuse")
    # What is missing to 1 is black.
    assert amounts == pytest.approx([0.2, 0.5, 0.1, 0.2])
    assert warnings == ()
    bright = '<string name="weights" value="3 1"/>'
    found, warnings = material(tmp_path, f'<bsdf type="mixturebsdf">{bright}{METAL}{GREY}</bsdf>')
    assert found.weight == pytest.approx(0.25)
    assert "scaled to 1" in warnings[0]


def test_blends_of_blends_end(tmp_path: Path) -> None:
    """Each a blend of the one before with itself: 2³⁰ parts if they were written out."""
    lines = ['<bsdf type="conductor" id="b0"/>']
    for i in range(30):
        lines.append(f'<bsdf type="blendbsdf" id="b{i + 1}"><ref id="b{i}"/><ref id="b{i}"/></bsdf>')
    scene = load(tmp_path, *lines, '<shape type="sphere"><ref id="b30"/></shape>')

    def depth(m: Material) -> int:
        return 1 + max(map(depth, m.parts)) if m.parts else 0

    assert depth(scene.materials[scene.shapes[0].material]) <= 5
    assert any("more than 5 deep" in w for w in scene.warnings)


def test_masks(tmp_path: Path) -> None:
    half, warnings = material(tmp_path, f'<bsdf type="mask">{GREY}</bsdf>')
    assert (half.kind, half.opacity, warnings) == ("diffuse", 0.5, ())
    colour = '<rgb name="opacity" value="1 0 0"/>'
    red, _ = material(tmp_path, f'<bsdf type="mask">{colour}<bsdf type="mask">{GREY}</bsdf></bsdf>')
    assert red.opacity == pytest.approx(0.2126 / 2)
    alpha = bitmap(tmp_path, "opacity", '<string name="channel" value="a"/>')
    leaf, warnings = material(tmp_path, f'<bsdf type="mask">{alpha}<bsdf type="twosided">{GREY}</bsdf></bsdf>')
    texture = leaf.textures["opacity"]
    assert isinstance(texture, Bitmap)
    assert texture.pixels.shape == (2, 4, 1)
    assert (texture.pixels[0, 0, 0], leaf.opacity) == (pytest.approx(0.2), pytest.approx(0.2))
    assert (leaf.two_sided, warnings) == (True, ())
    missing = '<texture name="opacity" type="bitmap"><string name="filename" value="gone.png"/></texture>'
    lost, warnings = material(tmp_path, f'<bsdf type="mask">{missing}{GREY}</bsdf>')
    assert (lost.opacity, lost.textures) == (0.5, {})
    assert "gone.png" in warnings[0]


def test_what_is_not_there(tmp_path: Path) -> None:
    gone, warnings = material(tmp_path, '<bsdf type="null"/>')
    assert (gone.opacity, gone.reflectance, warnings) == (0.0, (0, 0, 0), ())
    # Half of unpolarised light passes a polariser, all of it a retarder.
    assert material(tmp_path, '<bsdf type="polarizer"/>')[0].opacity == 0.5
    assert material(tmp_path, '<bsdf type="retarder"/>')[0].opacity == 0.0


def test_coats(tmp_path: Path) -> None:
    base = '<bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.5 0.8"/></bsdf>'
    words = '<float name="intIOR" value="1.6"/><float name="extIOR" value="1"/><float name="thickness" value="2"/>'
    absorbing = '<rgb name="sigmaA" value="0.25 0 0"/>'
    found, warnings = material(tmp_path, f'<bsdf type="coating">{words}{absorbing}{base}</bsdf>')
    assert (found.kind, found.eta, found.nonlinear) == ("plastic", 1.6, True)
    assert found.reflectance == pytest.approx((0.5 * math.exp(-1), 0.5, 0.8))
    assert len(warnings) == 1
    rough, _ = material(tmp_path, f'<bsdf type="roughcoating"><float name="alpha" value="0.3"/>{base}</bsdf>')
    assert (rough.kind, rough.alpha) == ("rough plastic", (0.3, 0.3))
    over_metal, warnings = material(tmp_path, f'<bsdf type="coating">{METAL}</bsdf>')
    assert over_metal.kind == "conductor"
    assert "without its coat" in warnings[0]


@pytest.mark.parametrize(
    ("bsdf", "kind", "colour"),
    [
        ('<bsdf type="phong"/>', "ward", (0.5,) * 3),
        (f'<bsdf type="roughdiffuse">{BLUE.format("diffuseReflectance")}</bsdf>', "diffuse", (0.1, 0.2, 0.3)),
        (f'<bsdf type="hk">{LAYER}</bsdf>', "diffuse", (0.75, 0.5, 0)),
        ('<bsdf type="pplastic"/>', "rough plastic", (0.5,) * 3),
        ('<bsdf type="irawan"/>', "diffuse", (0.5,) * 3),
        ('<bsdf type="measured"/>', "diffuse", (0.5,) * 3),
        (f'<bsdf type="brandnew">{METAL}</bsdf>', "conductor", (1,) * 3),
    ],
)  # fmt: skip
def test_nearest_materials_are_named_once(tmp_path: Path, bsdf: str, kind: str, colour: tuple[float, ...]) -> None:
    found, warnings = material(tmp_path, bsdf)
    assert (found.kind, found.reflectance) == (kind, pytest.approx(colour))
    assert len(warnings) == 1
    assert "is not supported" in warnings[0]


def test_paper_lets_light_through(tmp_path: Path) -> None:
    found, warnings = material(tmp_path, f'<bsdf type="difftrans">{bitmap(tmp_path, "transmittance")}</bsdf>')
    assert (found.kind, max(found.reflectance), warnings) == ("diffuse transmitter", 0, ())
    assert found.textures.keys() == {"transmittance"}
    older, _ = material(tmp_path, f'<bsdf type="difftrans">{BLUE.format("diffuseTransmittance")}</bsdf>')
    assert older.transmittance == pytest.approx((0.1, 0.2, 0.3))


def test_plugins_of_others_are_read_as_what_they_are_called_after(tmp_path: Path) -> None:
    """Of two public scenes; a name like no other stays grey."""
    alpha = '<float name="alpha" value="0.3"/>'
    found, warnings = material(tmp_path, f'<bsdf type="roughconductorGGX">{alpha}</bsdf>')
    assert (found.kind, found.alpha, found.distribution) == ("rough conductor", (0.3, 0.3), "ggx")
    assert "it is read as 'roughconductor'" in warnings[0]
    for name, kind in {"glass": "dielectric", "mirror": "conductor", "disneybsdf": "principled"}.items():
        found, warnings = material(tmp_path, f'<bsdf type="{name}"/>')
        assert found.kind == kind
        assert f"it is read as '{kind}'" in warnings[0]
    found, warnings = material(tmp_path, f'<bsdf type="TwoSided">{METAL}</bsdf>')
    assert (found.kind, found.two_sided, len(warnings)) == ("conductor", True, 1)


def test_disneys_bsdf_by_the_names_of_others(tmp_path: Path) -> None:
    """As in a renderer for teaching: lobes on their own, and `specular` as a share of what the index reflects."""
    number = '<float name="{}" value="{}"/>'.format
    colour = '<rgb name="baseColor" value="0.8 0.6 0.1"/>'
    diffuse, _ = material(tmp_path, f'<bsdf type="disneydiffuse">{colour}{number("subsurface", 0.5)}</bsdf>')
    assert (diffuse.reflectance, diffuse.eta) == (pytest.approx((0.8, 0.6, 0.1)), 1)
    assert diffuse.principled.flatness == 0.5
    for name, lobe in {"disneymetal": "metallic", "disneyglass": "spec_trans"}.items():
        found, warnings = material(tmp_path, f'<bsdf type="{name}">{colour}{number("anisotropic", 0.8)}</bsdf>')
        assert getattr(found.principled, lobe) == 1
        assert found.alpha[0] > found.alpha[1]
        assert len(warnings) == 1
    rest = number("specular", 0.5) + number("eta", 1.5) + number("specularTint", 0.25)
    whole, warnings = material(tmp_path, f'<bsdf type="disneybsdf">{rest}</bsdf>')
    assert ((whole.eta - 1) / (whole.eta + 1)) ** 2 == pytest.approx(0.5 * 0.04)
    assert whole.principled.spec_tint == 0.25
    assert len(warnings) == 1
    glass, _ = material(tmp_path, f'<bsdf type="disneybsdf">{rest}{number("specularTransmission", 0.5)}</bsdf>')
    assert (glass.eta, glass.principled.spec_trans) == (1.5, 0.5)


@pytest.mark.parametrize("exponent", [20.0, 300.0])
def test_phongs_lobe_has_wards_width(tmp_path: Path, exponent: float) -> None:
    """Where cosⁿ δ about the mirror direction is a half, exp(−tan²(δ/2)/α²) about the half vector is too."""
    found, _ = material(tmp_path, f'<bsdf type="phong"><float name="exponent" value="{exponent}"/></bsdf>')
    lean = math.acos(0.5 ** (1 / exponent))
    assert math.exp(-((math.tan(lean / 2) / found.alpha[0]) ** 2)) == pytest.approx(0.5, abs=0.02)


def test_a_bsdf_for_each_side(tmp_path: Path) -> None:
    found, warnings = material(tmp_path, f'<bsdf type="twosided">{METAL}{GREY}</bsdf>')
    assert (found.kind, found.by_side, [p.kind for p in found.parts]) == ("blend", True, ["conductor", "diffuse"])
    assert [p.two_sided for p in found.parts] == [True, True]
    assert warnings == ()
    holes = f'<bsdf type="mask">{GREY}<float name="opacity" value="0.25"/></bsdf>'
    assert material(tmp_path, f'<bsdf type="twosided">{holes}{METAL}</bsdf>')[0].opacity == 0.25
    clear, warnings = material(tmp_path, f'<bsdf type="twosided">{GREY}<bsdf type="dielectric"/></bsdf>')
    assert (clear.kind, clear.two_sided) == ("diffuse", True)
    assert "the first counts for both sides" in warnings[0]
    many, warnings = material(tmp_path, f'<bsdf type="twosided">{GREY}{METAL}{METAL}</bsdf>')
    assert [p.kind for p in many.parts] == ["diffuse", "conductor"]
    assert "more than two" in warnings[0]
