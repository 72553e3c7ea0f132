"""Materials and textures of glTF files."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pmviewer.errors import SceneError
from pmviewer.scene.description import BLACK, Material, Scene
from pmviewer.scene.formats.gltf.extensions import HONOURED
from pmviewer.scene.load import load_scene
from pmviewer.scene.texture import Bitmap
from tests.scene.gltf_files import Gltf, meshes

RED = ((188 / 255 + 0.055) / 1.055) ** 2.4
"""Linear value of 188 in sRGB."""


def opened(folder: Path, material: dict, pictures: dict | None = None, attributes=None, **parts) -> Scene:
    """A triangle of this material with texture coordinates; `pictures` are arrays (h, w, c) by name, texture i showing
    the i-th; `attributes` gives more attributes of its file."""
    f = Gltf(**parts)
    names = list(pictures or {})
    for name, pixels in (pictures or {}).items():
        Image.fromarray(np.array(pixels, np.uint8)).save(folder / name)
    more = {"TEXCOORD_0": f.array([[0, 0], [1, 0], [0, 1]]), **(attributes(f) if attributes else {})}
    f.triangle(attributes=more, material=0)
    rows = {"images": [{"uri": n} for n in names], "textures": [{"source": i} for i in range(len(names))]}
    return load_scene(f.write(folder, materials=[material], **{**rows, **parts}))


def first(scene: Scene) -> Material:
    return scene.materials[scene.shapes[0].material]


def pbr(colour=(1, 1, 1, 1), metallic: float = 0, roughness: float = 1, **more) -> dict:
    factors = {"baseColorFactor": list(colour), "metallicFactor": metallic, "roughnessFactor": roughness}
    textures = {k: more.pop(k) for k in ("baseColorTexture", "metallicRoughnessTexture") if k in more}
    return {"pbrMetallicRoughness": {**factors, **textures}, **more}


def ext(name: str, **fields) -> dict:
    return {"extensions": {f"KHR_materials_{name}": fields}}


@pytest.mark.parametrize(
    ("source", "kind", "expected"),
    [
        (pbr((0.123, 0.2, 0.3, 1)), "diffuse", {"reflectance": (0.123, 0.2, 0.3), "two_sided": True}),
        (pbr(roughness=0.5), "rough plastic", {"alpha": (0.25, 0.25), "eta": 1.5}),
        (pbr((0.5, 0.5, 0.5, 1), roughness=0.05), "plastic", {"eta": 1.5, "reflectance": (0.5, 0.5, 0.5)}),
        (pbr(metallic=1, roughness=0.5), "rough conductor", {"alpha": (0.25, 0.25)}),
        (pbr((0.9, 0.8, 0.7, 1), 1, 0.05), "conductor", {"reflectance": (0.9, 0.8, 0.7)}),
        (pbr(metallic=0.5, roughness=0.5), "principled", {"alpha": (0.25, 0.25), "eta": 1.5}),
        ({}, "rough conductor", {"alpha": (1, 1)}),  # glTF's defaults: white, metallic and rough
    ],
)
def test_metallic_roughness(tmp_path: Path, source: dict, kind: str, expected: dict) -> None:
    material = first(opened(tmp_path, source))
    assert material.kind == kind
    for name, value in expected.items():
        assert getattr(material, name) == pytest.approx(value), name
    if kind == "principled":
        assert material.principled.metallic == 0.5


def test_channels_of_the_metallic_roughness_texture(tmp_path: Path) -> None:
    pixels = [[[10, 255, 0], [20, 102, 255]]]
    material = first(opened(tmp_path, pbr(metallic=0.5, roughness=0.5, metallicRoughnessTexture={"index": 0}),
                            {"mr.png": pixels}))  # fmt: skip
    assert material.kind == "principled"
    assert material.textures["alpha"].pixels[0, :, 0] == pytest.approx([0.25, 0.04])  # squares of 0.5·(1, 0.4)
    assert material.textures["metallic"].pixels[0, :, 0] == pytest.approx([0, 0.5])
    assert material.principled.metallic == pytest.approx(0.25)
    plain = first(opened(tmp_path, pbr(metallic=0.5, metallicRoughnessTexture={"index": 0}),
                         {"mr.png": [[[0, 204, 0], [0, 51, 0]]]}))  # fmt: skip
    assert plain.kind == "rough plastic"  # no metal anywhere
    assert plain.textures["alpha"].pixels[0, :, 0] == pytest.approx([0.64, 0.04])


def test_index_and_specular(tmp_path: Path) -> None:
    def built(roughness: float = 0.5, metallic: float = 0, **extensions) -> Material:
        rows = {f"KHR_materials_{name}": fields for name, fields in extensions.items()}
        return first(opened(tmp_path, pbr(roughness=roughness, metallic=metallic, extensions=rows)))

    assert built(ior={"ior": 1.33}).eta == 1.33
    half = built(specular={"specularFactor": 0.5})  # reflects 2 % instead of 4 %
    assert ((half.eta - 1) / (half.eta + 1)) ** 2 == pytest.approx(0.02)
    tinted = built(specular={"specularColorFactor": [1, 0.5, 0]})
    assert tinted.specular == (1, 0.5, 0)
    assert tinted.eta == pytest.approx(1.5)
    assert built(specular={"specularFactor": 0}).kind == "diffuse"
    assert built(ior={"ior": 1}).kind == "diffuse"
    metal = built(metallic=0.5, specular={"specularFactor": 0.25}, ior={"ior": 2})
    assert metal.kind == "principled"
    assert ((metal.eta - 1) / (metal.eta + 1)) ** 2 == pytest.approx(0.25 / 9)


def test_coat_sheen_and_brushing(tmp_path: Path) -> None:
    coat = opened(tmp_path, pbr(roughness=0.5, **ext("clearcoat", clearcoatFactor=0.2, clearcoatRoughnessFactor=0.1)))
    details = first(coat).principled
    assert details.clearcoat == pytest.approx(0.8)  # a principled coat of 1 reflects a quarter of a real one
    assert details.clearcoat_gloss == pytest.approx(0.09 / 0.099)  # α = 0.01 between 0.1 and 0.001
    assert not any("coat" in w for w in coat.warnings)
    full = opened(tmp_path, pbr(**ext("clearcoat", clearcoatFactor=1)))
    assert first(full).principled.clearcoat == 1
    assert any("Clear coats reflect up to a quarter" in w for w in full.warnings)
    cloth = opened(tmp_path, pbr(**ext("sheen", sheenColorFactor=[0.8, 0.4, 0.2], sheenRoughnessFactor=0.5)))
    assert first(cloth).principled.sheen == pytest.approx(0.8)
    assert first(cloth).principled.sheen_tint == pytest.approx(0.75)
    assert any("sheen of cloth" in w for w in cloth.warnings)
    brushed = pbr(metallic=1, roughness=0.5, **ext("anisotropy", anisotropyStrength=0.5))
    assert first(opened(tmp_path, brushed)).alpha == pytest.approx((0.25 + 0.75 * 0.25, 0.25))
    brushed["extensions"]["KHR_materials_anisotropy"]["anisotropyRotation"] = math.pi / 2
    assert first(opened(tmp_path, brushed)).alpha == pytest.approx((0.25, 0.25 + 0.75 * 0.25))


def test_solid_glass(tmp_path: Path) -> None:
    source = pbr((0.9, 1, 1, 1), roughness=0)
    source["extensions"] = {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.25]},
    }
    glass = first(opened(tmp_path, source))
    assert (glass.kind, glass.eta, glass.reflectance, glass.transmittance) == (
        "dielectric",
        1.33,
        (1, 1, 1),
        (0.9, 1, 1),
    )
    assert glass.absorption == pytest.approx((0, math.log(2) / 2, math.log(4) / 2))
    source["pbrMetallicRoughness"]["roughnessFactor"] = 0.5
    rough = first(opened(tmp_path, source))
    assert (rough.kind, rough.alpha, rough.absorption) == ("rough dielectric", (0.25, 0.25), glass.absorption)


def test_thin_glass_and_blends(tmp_path: Path) -> None:
    thin = opened(tmp_path, pbr((0.5, 1, 1, 1), roughness=0, **ext("transmission", transmissionFactor=1)))
    assert (first(thin).kind, first(thin).transmittance) == ("thin dielectric", (0.5, 1, 1))
    rough = opened(tmp_path, pbr(roughness=0.5, **ext("transmission", transmissionFactor=1)))
    assert first(rough).kind == "thin dielectric"
    assert any("rough glass are shown smooth" in w for w in rough.warnings)
    blend = first(opened(tmp_path, pbr(roughness=1, **ext("transmission", transmissionFactor=0.25))))
    assert (blend.kind, blend.weight) == ("blend", 0.25)
    assert [part.kind for part in blend.parts] == ["diffuse", "thin dielectric"]
    metal = first(opened(tmp_path, pbr(metallic=1, **ext("transmission", transmissionFactor=1))))
    assert metal.kind == "rough conductor"  # nothing passes through metal
    mapped = ext("transmission", transmissionFactor=0.5, transmissionTexture={"index": 0})
    blend = first(opened(tmp_path, pbr(**mapped), {"t.png": [[[255, 0, 0], [0, 0, 0]]]}))
    assert blend.textures["weight"].pixels[0, :, 0] == pytest.approx([0.5, 0])
    assert blend.weight == pytest.approx(0.25)


def test_leaves_and_paper(tmp_path: Path) -> None:
    """KHR_materials_diffuse_transmission: its own colour, whatever the base colour is."""
    values = {"diffuseTransmissionFactor": 0.4, "diffuseTransmissionColorFactor": [0.9, 0.5, 0.1]}
    leaf = opened(tmp_path, pbr((0.2, 0.4, 0.1, 1), roughness=1, **ext("diffuse_transmission", **values)))
    front, through = first(leaf).parts
    assert (first(leaf).weight, front.kind, front.reflectance) == (0.4, "diffuse", (0.2, 0.4, 0.1))
    assert (through.kind, through.transmittance) == ("diffuse transmitter", (0.9, 0.5, 0.1))
    assert not [w for w in leaf.warnings if "extension" in w or "Highlights" in w]
    shiny = opened(tmp_path, pbr(roughness=0.5, **ext("diffuse_transmission", **values)))
    assert any("Highlights" in w for w in shiny.warnings)
    mapped = ext("diffuse_transmission", diffuseTransmissionFactor=0.5, diffuseTransmissionTexture={"index": 0})
    blend = first(opened(tmp_path, pbr(roughness=1, **mapped), {"t.png": [[[0, 0, 0, 255], [0, 0, 0, 0]]]}))
    assert blend.textures["weight"].pixels[0, :, 0] == pytest.approx([0.5, 0])


def test_alpha_mask_blend_and_opaque(tmp_path: Path) -> None:
    pixels = {"a.png": [[[255, 0, 0, 255], [255, 0, 0, 102], [255, 0, 0, 0]]]}

    def built(alpha: float, picture: bool = True, **more) -> Material:
        base = {"baseColorTexture": {"index": 0}} if picture else {}
        return first(opened(tmp_path, pbr((1, 1, 1, alpha), **base, **more), pixels))

    opaque = built(0.5)
    assert (opaque.opacity, "opacity" in opaque.textures) == (1, False)
    blend = built(0.5, alphaMode="BLEND")
    opacity = blend.textures["opacity"]
    assert (opacity.pixels[0, :, 0] * opacity.scale[0]).tolist() == pytest.approx([0.5, 0.2, 0])
    assert blend.opacity == pytest.approx(0.7 / 3)
    assert built(0.5, picture=False, alphaMode="BLEND").opacity == 0.5
    assert built(1, alphaMode="MASK").textures["opacity"].pixels[0, :, 0].tolist() == [1, 0, 0]
    assert built(1, alphaMode="MASK", alphaCutoff=0.4).textures["opacity"].pixels[0, :, 0].tolist() == [1, 1, 0]
    assert built(0.5, alphaMode="MASK", alphaCutoff=0.4).textures["opacity"].pixels[0, :, 0].tolist() == [1, 0, 0]
    assert built(0.3, picture=False, alphaMode="MASK").opacity == 0
    assert built(0.6, picture=False, alphaMode="MASK").opacity == 1


def test_colours_and_alpha_at_vertices(tmp_path: Path) -> None:
    def colours(rows):
        return lambda f: {"COLOR_0": f.array(rows)}

    scene = opened(tmp_path, pbr(alphaMode="BLEND"), None, colours([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5]]))
    assert first(scene).vertex_colours
    assert first(scene).opacity == 0.5
    assert meshes(scene)[0].colours.tolist() == np.eye(3).tolist()
    assert not any("Alpha" in w for w in scene.warnings)
    scene = opened(tmp_path, pbr(alphaMode="BLEND"), None, colours([[1, 0, 0, 1], [0, 1, 0, 0.5], [0, 0, 1, 0]]))
    assert first(scene).opacity == 0.5
    assert any("Alpha that differs" in w for w in scene.warnings)
    scene = opened(tmp_path, pbr(), None, colours([[1, 1, 1]] * 3))
    assert not first(scene).vertex_colours
    assert meshes(scene)[0].colours is None


def test_one_material_with_and_without_colours_at_vertices(tmp_path: Path) -> None:
    f = Gltf(materials=[pbr((0.2, 0.2, 0.2, 1))])
    f.triangle(material=0)
    f.triangle(material=0, attributes={"COLOR_0": f.array(np.eye(3))})
    f.triangle(material=0)
    scene = load_scene(f.write(tmp_path, nodes=[{"mesh": i, "translation": [i, 0, 0]} for i in range(3)]))
    assert [scene.materials[s.material].vertex_colours for s in scene.shapes[:3]] == [False, True, False]
    assert scene.shapes[0].material == scene.shapes[2].material


def test_unlit_surfaces_radiate_their_colour(tmp_path: Path) -> None:
    source = pbr((0.5, 1, 1, 1), baseColorTexture={"index": 0}, **ext("unlit"))
    scene = opened(tmp_path, source, {"a.png": [[[188, 255, 0]]]})
    assert (first(scene).kind, first(scene).reflectance) == ("diffuse", BLACK)
    assert scene.shapes[0].radiance == pytest.approx((RED / 2, 1, 0))
    assert isinstance(scene.shapes[0].emission, Bitmap)
    tinted = opened(
        tmp_path, pbr(**ext("unlit")), None, lambda f: {"COLOR_0": f.array([[1, 0, 0], [0.5, 0, 0], [0, 0, 0]])}
    )
    assert tinted.shapes[0].radiance == pytest.approx((0.5, 0, 0))


def test_emission_and_its_strength(tmp_path: Path) -> None:
    source = {"emissiveFactor": [1, 0.5, 0.25], **ext("emissive_strength", emissiveStrength=4)}
    assert opened(tmp_path, source).shapes[0].radiance == (4, 2, 1)
    source["emissiveTexture"] = {"index": 0}
    shape = opened(tmp_path, source, {"e.png": [[[188, 255, 0]]]}).shapes[0]
    assert shape.radiance == pytest.approx((4 * RED, 2, 0))
    assert shape.emission.scale == (4, 2, 1)
    both = opened(tmp_path, {"emissiveFactor": [1, 1, 1], "doubleSided": True})
    assert any("from their front only" in w for w in both.warnings)


def test_specular_glossiness(tmp_path: Path) -> None:
    def built(images=None, **fields) -> Material:
        return first(opened(tmp_path, ext("pbrSpecularGlossiness", **fields), images))

    plastic = built(diffuseFactor=[0.5, 0.4, 0.3, 1], specularFactor=[0.04, 0.04, 0.04], glossinessFactor=0.6)
    assert plastic.kind == "rough plastic"
    assert plastic.reflectance == pytest.approx((0.5, 0.4, 0.3))
    assert plastic.alpha == pytest.approx((0.16, 0.16))
    metal = built(diffuseFactor=[0, 0, 0, 1], specularFactor=[0.9, 0.9, 0.9], glossinessFactor=0.5)
    assert metal.kind == "rough conductor"
    assert metal.reflectance == pytest.approx((0.9, 0.9, 0.9), abs=1e-5)
    mixed = built(
        {"d.png": [[[0, 0, 0]]], "s.png": [[[255, 255, 255, 255], [0, 0, 0, 51]]]},
        diffuseTexture={"index": 0}, specularGlossinessTexture={"index": 1},
    )  # fmt: skip
    assert mixed.kind == "principled"
    assert mixed.textures["metallic"].pixels[0, :, 0] == pytest.approx([1, 0])
    assert mixed.textures["reflectance"].pixels[0] == pytest.approx(np.array([[1, 1, 1], [0, 0, 0]]))
    assert mixed.textures["alpha"].pixels[0, :, 0] == pytest.approx([0.001, 0.64])  # of roughness 0 (floored), 0.8


def test_all_textures_with_sampler_and_transformation(tmp_path: Path) -> None:
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 4]}}}
    source = {
        **pbr(baseColorTexture=info),
        "normalTexture": {"index": 0, "scale": 0.5},
        "emissiveTexture": {"index": 0},
        "emissiveFactor": [1, 1, 1],
        "occlusionTexture": {"index": 0, "texCoord": 1},
    }
    sampler = {"wrapS": 33648, "wrapT": 33648, "magFilter": 9728}
    scene = opened(
        tmp_path, source, {"a.png": [[[188, 0, 255]]]}, samplers=[sampler], textures=[{"source": 0, "sampler": 0}]
    )
    found = first(scene).textures
    assert found.keys() == {"reflectance", "normal"}
    base, normal = found["reflectance"], found["normal"]
    assert (base.wrap, base.filter) == ("mirror", "nearest")
    assert base.to_uv == pytest.approx((2, 0, 0.5, 0, 4, 0.25))
    assert base.pixels[0, 0] == pytest.approx([RED, 0, 1])
    assert normal.pixels[0, 0] == pytest.approx([0.5 + 0.5 * (188 / 255 - 0.5), 0.25, 1])
    assert isinstance(scene.shapes[0].emission, Bitmap)
    assert any("Occlusion" in w for w in scene.warnings)
    assert not any("sets of texture coordinates" in w for w in scene.warnings)


def test_a_quarter_turn_of_a_texture(tmp_path: Path) -> None:
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": math.pi / 2}}}
    scene = opened(tmp_path, pbr(baseColorTexture=info), {"a.png": [[[0, 0, 0], [255, 255, 255]]]})
    a, b, c, d, e, f = first(scene).textures["reflectance"].to_uv
    # The matrix of the extension's specification for (u, v): (cos, sin; −sin, cos).
    assert (a, b, c, d, e, f) == pytest.approx((0, 1, 0, -1, 0, 0), abs=1e-12)


def test_second_set_of_texture_coordinates(tmp_path: Path) -> None:
    def second(f: Gltf) -> dict:
        return {"TEXCOORD_1": f.array([[0.5, 0.5], [0.25, 0], [0, 0.75]])}

    images = {"a.png": [[[188, 0, 0]]]}
    scene = opened(tmp_path, pbr(baseColorTexture={"index": 0, "texCoord": 1}), images, second)
    assert meshes(scene)[0].uv.tolist() == [[0.5, 0.5], [0.25, 0], [0, 0.75]]
    transform = {"extensions": {"KHR_texture_transform": {"texCoord": 1}}, "index": 0}
    assert meshes(opened(tmp_path, pbr(baseColorTexture=transform), images, second))[0].uv[0].tolist() == [0.5, 0.5]
    source = {**pbr(baseColorTexture={"index": 0}), "normalTexture": {"index": 0, "texCoord": 1}}
    mixed = opened(tmp_path, source, images, second)
    assert first(mixed).textures.keys() == {"reflectance"}
    assert any("different sets of texture coordinates" in w for w in mixed.warnings)


def test_pictures_that_cannot_be_read(tmp_path: Path) -> None:
    source = {**pbr((1, 0.5, 1, 1), baseColorTexture={"index": 0}), "normalTexture": {"index": 0}}
    missing = opened(tmp_path, source, textures=[{"source": 0}], images=[{"uri": "gone.png"}])
    assert first(missing).reflectance == pytest.approx((0.5, 0.25, 0.5))
    assert "normal" not in first(missing).textures
    assert any("'gone.png' does not exist" in w and "Grey replaces it." in w for w in missing.warnings)
    nowhere = opened(tmp_path, source, textures=[{"source": 7}])
    assert any("refers to image 7" in w for w in nowhere.warnings)
    unknown = opened(tmp_path, source)
    assert any("not in the file" in w for w in unknown.warnings)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (pbr(roughness="much"), "'much' is not a number: 1 replaces it"),
        (pbr(roughness=7), "7 is outside of 0 to 1: 1 replaces it"),
        (pbr(colour=[2, -1, 0.5, 1]), "was cut"),
        (pbr(colour=[1, 1]), "is not 4 numbers"),
        (pbr(metallic=math.nan), "nan is not a number"),
        (pbr(roughness=10**400), "is not a number"),
        ({"emissiveFactor": [math.inf, 0, 0]}, "is not 3 numbers"),
    ],
)
def test_numbers_that_are_none_count_as_their_defaults(tmp_path: Path, source: dict, words: str) -> None:
    assert any(words in w for w in opened(tmp_path, source).warnings)


def test_variants(tmp_path: Path) -> None:
    f = Gltf(materials=[pbr((c, 0, 0, 1)) for c in (0.25, 0.5, 0.75)])
    mappings = [{"material": 1, "variants": [0]}, {"material": 2, "variants": [1]}]
    f.triangle(material=0, extensions={"KHR_materials_variants": {"mappings": mappings}})
    f.header["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}}
    path = f.write(tmp_path)
    scene = load_scene(path)
    assert first(scene).reflectance[0] == 0.25
    assert any("(-D variant=…): day, night" in w for w in scene.warnings)
    assert first(load_scene(path, {"variant": "night"})).reflectance[0] == 0.75
    assert first(load_scene(path, {"variant": "0"})).reflectance[0] == 0.5
    with pytest.raises(SceneError, match=r"no variant 'dawn'. It has day, night"):
        load_scene(path, {"variant": "dawn"})


def test_extensions_that_are_not_honoured_are_named_once(tmp_path: Path) -> None:
    used = ["KHR_materials_iridescence", "ACME_thing", "KHR_materials_ior", "EXT_structural_metadata", "KHR_xmp"]
    scene = opened(tmp_path, pbr(), extensionsUsed=used, extensionsRequired=["ACME_thing", "KHR_mesh_quantization"])
    named = [w for w in scene.warnings if "extension" in w]
    assert len(named) == 2
    assert "KHR_materials_iridescence is not supported: thin films" in named[0]
    assert "ACME_thing" in named[1]


def test_the_documentation_names_the_extensions_that_are_honoured() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs/scenes.md").read_text("utf-8")
    section = text.partition("\n## glTF\n")[2].partition("\n## ")[0]
    named = set(re.findall(r"`((?:EXT|KHR|MSFT)_\w+)`", section))
    assert named - {"KHR_animation_pointer"} == HONOURED
