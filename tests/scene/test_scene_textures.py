"""Textures in scene files of every kind, and what happens to broken ones."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pmviewer.errors import SceneError
from pmviewer.output.exr import write_exr
from pmviewer.scene.description import Mesh, Scene
from pmviewer.scene.formats import texture_file
from pmviewer.scene.formats.texture_file import linear, read_picture
from pmviewer.scene.load import load_scene
from pmviewer.scene.texture import Bitmap, Checkerboard, evaluate
from tests.scene.helpers import load
from tests.support.marks import warnings_are_errors

RED = ((188 / 255 + 0.055) / 1.055) ** 2.4


def picture(folder: Path, name: str = "a.png", size: tuple[int, int] = (4, 2)) -> None:
    Image.new("RGB", size, (188, 0, 255)).save(folder / name)


def bitmap(name: str, file: str = "a.png", more: str = "") -> str:
    return f'<texture name="{name}" type="bitmap"><string name="filename" value="{file}"/>{more}</texture>'


def sphere(folder: Path, bsdf: str, *lines: str) -> Scene:
    return load(folder, f'<shape type="sphere">{bsdf}</shape>', *lines)


def test_bitmap_with_all_its_options(tmp_path: Path) -> None:
    picture(tmp_path)
    more = (
        '<boolean name="raw" value="true"/><string name="wrap_mode" value="mirror"/>'
        '<string name="filter_type" value="nearest"/>'
        '<transform name="to_uv"><scale x="2" y="3"/><translate x="0.5" y="0.25"/></transform>'
    )
    scene = sphere(tmp_path, f'<bsdf type="diffuse">{bitmap("reflectance", more=more)}</bsdf>')
    (texture,) = scene.materials[scene.shapes[0].material].textures.values()
    assert isinstance(texture, Bitmap)
    assert (texture.wrap, texture.filter, texture.to_uv) == ("mirror", "nearest", (2, 0, 0.5, 0, 3, 0.25))
    assert texture.pixels.shape == (2, 4, 3)
    assert texture.mean == pytest.approx((188 / 255, 0, 1))
    assert scene.warnings == ()


def test_texture_used_twice_is_read_once(tmp_path: Path) -> None:
    picture(tmp_path)
    shape = '<shape type="sphere"><bsdf type="diffuse"><ref name="reflectance" id="t"/></bsdf></shape>'
    named = bitmap("x").replace('name="x" ', 'id="t" ')
    scene = load(tmp_path, named, shape, shape)
    first, second = (scene.materials[s.material].textures["reflectance"] for s in scene.shapes)
    assert isinstance(first, Bitmap)
    assert isinstance(second, Bitmap)
    assert first.pixels is second.pixels


def test_checkerboard_bump_and_normal_map(tmp_path: Path) -> None:
    picture(tmp_path)
    board = '<texture name="reflectance" type="checkerboard"><rgb name="color0" value="0.1 0.2 0.3"/></texture>'
    inner = f'<bsdf type="normalmap">{bitmap("normalmap")}<bsdf type="diffuse">{board}</bsdf></bsdf>'
    bsdf = (
        f'<bsdf type="twosided"><bsdf type="bumpmap">{bitmap("x")}<float name="scale" value="3"/>{inner}</bsdf></bsdf>'
    )
    scene = sphere(tmp_path, bsdf)
    material = scene.materials[scene.shapes[0].material]
    assert material.textures.keys() == {"reflectance", "normal", "bump"}
    assert (material.two_sided, material.bump_scale) == (True, 3)
    checks = material.textures["reflectance"]
    assert isinstance(checks, Checkerboard)
    assert (checks.color0, checks.color1) == ((0.1, 0.2, 0.3), (0.2, 0.2, 0.2))
    assert scene.warnings == ()


def test_textured_area_light(tmp_path: Path) -> None:
    picture(tmp_path)
    scene = load(
        tmp_path, f'<shape type="rectangle"><emitter type="area">{bitmap("radiance")}</emitter></shape>', sky=""
    )
    assert scene.shapes[0].radiance == pytest.approx((RED, 0, 1), rel=1e-5)
    assert isinstance(scene.shapes[0].emission, Bitmap)


@pytest.mark.parametrize("kind", ["a.png", "a.jpg", "a.exr", "grey.png", "deep.png", "palette.png", "alpha.png"])
def test_kinds_of_pictures(tmp_path: Path, kind: str) -> None:
    path = tmp_path / kind
    rgb = np.zeros((3, 5, 3), np.uint8) + np.uint8([188, 0, 255])
    whole = Image.fromarray(rgb)
    if kind == "a.exr":
        write_exr(path, {"": linear(np.float32(rgb / 255))})
    elif kind == "grey.png":
        whole.convert("L").save(path)
    elif kind == "deep.png":
        Image.fromarray(np.full((3, 5), 40000, np.uint16)).save(path)
    elif kind == "palette.png":
        whole.quantize(4).save(path)
    elif kind == "alpha.png":
        whole.convert("RGBA").save(path)
    else:
        whole.save(path, quality=100) if kind == "a.jpg" else whole.save(path)
    pixels, sentence = read_picture(path, kind, raw=False)
    assert sentence == ""
    assert pixels.dtype == np.float32
    assert pixels.shape[:2] == (3, 5)
    if kind == "deep.png":
        assert pixels.shape[2] == 1
        assert pixels == pytest.approx(((40000 / 65535 + 0.055) / 1.055) ** 2.4, rel=1e-4)
    elif kind == "grey.png":
        assert pixels.shape[2] == 1
    else:
        assert pixels[1, 2] == pytest.approx([RED, 0, 1], abs=0.03 if kind in ("a.jpg", "palette.png") else 1e-5)


BROKEN = {
    "empty.png": (b"", "is empty"),
    "text.png": (b"this is no picture", "can't be read"),
    "cut.exr": (b"\x76\x2f\x31\x01" + b"\0" * 20, "can't be read"),
    "huge.png": (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBBI", 13, b"IHDR", 2**31 - 1, 2**31 - 1, 8, 2, 0, 0, 0, 0),
        "can't be read",
    ),
}


def test_broken_textures_are_left_out_and_listed_once(tmp_path: Path) -> None:
    for name, (content, _) in BROKEN.items():
        (tmp_path / name).write_bytes(content)
    picture(tmp_path, "cut.png")
    names = [*BROKEN, "gone.png"]
    shapes = [
        f'<shape type="sphere"><bsdf type="diffuse">{bitmap("reflectance", name)}</bsdf></shape>' for name in names
    ]
    nameless = '<texture name="reflectance" type="bitmap"/>'
    scene = load(tmp_path, *shapes, f'<shape type="cube"><bsdf type="diffuse">{nameless}</bsdf></shape>')
    assert [m.reflectance for m in scene.materials] == [(0.5, 0.5, 0.5)] * 6
    assert not any(m.textures for m in scene.materials)
    (warning,) = scene.warnings
    assert warning.startswith("lines 2, 3, 4, 5, 6 and 1 more: Pictures that can't be used are left out")
    for name, (_, words) in (BROKEN | {"gone.png": (b"", "does not exist")}).items():
        assert f"{name} (" in warning
        assert words in warning


@warnings_are_errors
def test_every_cut_of_a_picture_opens_or_raises(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    Image.fromarray(rng.integers(0, 255, (6, 6, 3), dtype=np.uint8)).save(tmp_path / "whole.png")
    Image.fromarray(rng.integers(0, 255, (6, 6, 3), dtype=np.uint8)).save(tmp_path / "whole.jpg")
    write_exr(tmp_path / "whole.exr", {"": rng.random((6, 6, 3), dtype=np.float32)})
    for whole in ("whole.png", "whole.jpg", "whole.exr"):
        data = (tmp_path / whole).read_bytes()
        for length in [*range(80), *range(80, len(data), 13)]:
            try:
                pixels, _ = read_picture(data[:length], whole, raw=False)
            except SceneError:
                continue
            assert np.isfinite(pixels).all()
        for _ in range(150):
            noisy = bytearray(data)
            for _ in range(4):
                noisy[rng.integers(len(data))] = rng.integers(256)
            try:
                pixels, _ = read_picture(bytes(noisy), whole, raw=False)
            except SceneError:
                continue
            assert np.isfinite(pixels).all()


@pytest.mark.parametrize(
    ("more", "wrap", "filter", "words"),
    [
        ('<string name="wrap_mode" value="bounce"/>', "repeat", "bilinear", "'bounce' is not supported"),
        ('<string name="wrapMode" value="zero"/>', "clamp", "bilinear", "taken as clamp"),
        ('<string name="wrapModeU" value="mirror"/>', "mirror", "bilinear", "along v as it does along u"),
        ('<string name="filter_type" value="cubic"/>', "repeat", "bilinear", "looked up bilinearly"),
        ('<string name="filterType" value="ewa"/>', "repeat", "bilinear", "looked up bilinearly"),
        ('<float name="maxAnisotropy" value="20"/>', "repeat", "bilinear", ""),
    ],
)
def test_odd_options_are_replaced(tmp_path: Path, more: str, wrap: str, filter: str, words: str) -> None:
    picture(tmp_path)
    scene = sphere(tmp_path, f'<bsdf type="diffuse">{bitmap("reflectance", more=more)}</bsdf>')
    texture = scene.materials[scene.shapes[0].material].textures["reflectance"]
    assert isinstance(texture, Bitmap)
    assert (texture.wrap, texture.filter) == (wrap, filter)
    assert [words in w for w in scene.warnings] == [True] * bool(words)


def test_wrong_values_take_their_default(tmp_path: Path) -> None:
    picture(tmp_path)
    wrong = '<boolean name="raw" value="maybe"/>'
    scene = sphere(tmp_path, f'<bsdf type="diffuse">{bitmap("reflectance", more=wrong)}</bsdf>')
    assert (
        "'raw' of <texture type=\"bitmap\">: expected true or false, found 'maybe'; false is used." in scene.warnings[0]
    )


def test_maps_without_a_texture_are_flat(tmp_path: Path) -> None:
    scene = sphere(tmp_path, '<bsdf type="bumpmap"><bsdf type="diffuse"/></bsdf>')
    assert not scene.materials[scene.shapes[0].material].textures
    assert "shown flat" in scene.warnings[0]


def test_large_pictures_are_reduced_and_full_memory_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pixels = np.arange(40 * 30 * 3, dtype=np.uint8).reshape(30, 40, 3)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    monkeypatch.setattr(texture_file, "MOST_PIXELS", 300)
    small, sentence = read_picture(tmp_path / "a.png", "a.png", raw=True)
    assert small.shape == (15, 20, 3)
    assert small == pytest.approx(pixels.reshape(15, 2, 20, 2, 3).mean(axis=(1, 3)) / 255, abs=1e-5)
    assert sentence == "The texture 'a.png' of 40 × 30 pixels was reduced to 20 × 15."
    monkeypatch.setattr(texture_file, "available_memory", lambda: 1000)
    with pytest.raises(SceneError, match=r"needs about .* GB of memory"):
        read_picture(tmp_path / "a.png", "a.png", raw=True)


def test_colours_above_one_are_cut(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"": np.full((2, 2, 3), [3.0, 0.5, -1.0], np.float32)})
    scene = sphere(tmp_path, f'<bsdf type="diffuse">{bitmap("reflectance", "a.exr")}</bsdf>')
    texture = scene.materials[scene.shapes[0].material].textures["reflectance"]
    assert isinstance(texture, Bitmap)
    assert texture.pixels[0, 0] == pytest.approx([1, 0.5, 0])
    assert any("above 1 were cut" in w for w in scene.warnings)


def test_obj_with_texture_coordinates_and_maps(tmp_path: Path) -> None:
    picture(tmp_path)
    (tmp_path / "a.mtl").write_text(
        "newmtl wood\nKd 0.5 0.5 0.5\nmap_Kd -s 2 3 1 -o 0.1 0.2 0 a.png\nbump -bm 0.3 a.png\n"
        "newmtl lamp\nKd 0 0 0\nKe 2 2 2\nmap_Ke a.png\nmap_Kd gone.png\n"
    )
    text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 0.75\nusemtl wood\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(text + "usemtl lamp\nf 3/3 2/2 1/1\n")
    scene = load_scene(tmp_path / "a.obj")
    by_name = {scene.materials[s.material].name: (scene.materials[s.material], s) for s in scene.shapes}
    wood, shape = by_name["wood"]
    texture = wood.textures["reflectance"]
    assert isinstance(texture, Bitmap)
    assert (texture.scale, wood.bump_scale) == ((0.5, 0.5, 0.5), 0.3)
    assert texture.to_uv == pytest.approx((2, 0, 0.1, 0, 3, -2.2))
    assert isinstance(shape.geometry, Mesh)
    assert shape.geometry.uv is not None
    order = np.argsort(shape.geometry.vertices @ [1, 2, 0])
    assert shape.geometry.uv[order] == pytest.approx(np.array([[0, 1], [1, 1], [1, 0.25]]))
    _, lamp = by_name["lamp"]
    assert isinstance(lamp.emission, Bitmap)
    assert lamp.radiance == pytest.approx((2 * RED, 0, 2), rel=1e-5)
    assert any("'gone.png' does not exist" in w and "line 9" in w for w in scene.warnings)


def test_a_map_takes_a_texture_without_a_name(tmp_path: Path) -> None:
    picture(tmp_path)
    unnamed = bitmap("x").replace('name="x" ', "", 1)
    assert 'name="x"' not in unnamed
    scene = sphere(tmp_path, f'<bsdf type="bumpmap">{unnamed}<bsdf type="diffuse"/></bsdf>')
    assert scene.materials[scene.shapes[0].material].textures.keys() == {"bump"}
    assert scene.warnings == ()


def reflectance(folder: Path, texture: str) -> tuple[object, tuple[str, ...]]:
    scene = sphere(folder, f'<bsdf type="diffuse">{texture}</bsdf>')
    material = scene.materials[scene.shapes[0].material]
    return material.textures.get("reflectance", material.reflectance), scene.warnings


def test_a_scaled_texture(tmp_path: Path) -> None:
    """`scale` of version 0.6: a nested texture, named or not, times a number or a colour."""
    picture(tmp_path)
    for words in ('<float name="scale" value="0.5"/>', '<rgb name="scale" value="0.5 0.5 0.25"/>'):
        found, warnings = reflectance(
            tmp_path, f'<texture name="reflectance" type="scale">{words}{bitmap("x")}</texture>'
        )
        assert isinstance(found, Bitmap)
        assert found.mean == pytest.approx((0.5 * RED, 0, 0.5 if "float" in words else 0.25), rel=1e-5)
        assert warnings == ()
    colour = '<texture name="reflectance" type="scale"><rgb name="value" value="0.2 0.4 0.6"/>{}</texture>'
    assert reflectance(tmp_path, colour.format('<float name="scale" value="0.5"/>')) == ((0.1, 0.2, 0.3), ())
    empty, warnings = reflectance(tmp_path, '<texture name="reflectance" type="scale"/>')
    assert empty == (0.5, 0.5, 0.5)
    assert "no texture inside" in warnings[0]


@pytest.mark.parametrize("width", [0.01, 0.125, 0.3])
def test_a_grid(tmp_path: Path, width: float) -> None:
    """Version 0.6: `color1` within `lineWidth` of the edges of cells of 1 × 1, `color0` elsewhere."""
    words = f'<float name="lineWidth" value="{width}"/><float name="uscale" value="3"/>'
    found, warnings = reflectance(tmp_path, f'<texture name="reflectance" type="gridtexture">{words}</texture>')
    assert isinstance(found, Bitmap)
    assert (found.to_uv, found.filter, found.wrap, warnings) == ((3, 0, 0, 0, 1, 0), "nearest", "repeat", ())
    uv = np.array([[0.5, 0.5], [0.5, 0.5 * width], [1 - 0.5 * width, 0.5], [0.5, 1.2 * width], [0.5, 1 - 1.2 * width]])
    values = evaluate(Bitmap(found.pixels, "repeat", "nearest"), uv)[:, 0]
    assert values == pytest.approx([0.2, 0.4, 0.4, 0.2, 0.2])


def test_scales_and_offsets_of_version_0(tmp_path: Path) -> None:
    """As Mitsuba 3 upgrades them: the offset first, then the scale."""
    words = "".join(
        f'<float name="{n}" value="{v}"/>' for n, v in [("uscale", 2), ("vscale", 3), ("uoffset", 0.5), ("voffset", 1)]
    )
    found, _ = reflectance(tmp_path, f'<texture name="reflectance" type="checkerboard">{words}</texture>')
    assert isinstance(found, Checkerboard)
    assert found.to_uv == (2, 0, 1, 0, 3, 3)


def test_gamma_and_channel_of_version_0(tmp_path: Path) -> None:
    picture(tmp_path)
    linear_blue, _ = reflectance(tmp_path, bitmap("reflectance", more='<string name="channel" value="b"/>'))
    assert isinstance(linear_blue, Bitmap)
    assert linear_blue.pixels.shape == (2, 4, 1)
    assert linear_blue.mean == pytest.approx((1, 1, 1))
    square, _ = reflectance(tmp_path, bitmap("reflectance", more='<float name="gamma" value="2"/>'))
    assert isinstance(square, Bitmap)
    assert square.mean[0] == pytest.approx((188 / 255) ** 2, rel=1e-5)
    plain, _ = reflectance(tmp_path, bitmap("reflectance", more='<float name="gamma" value="1"/>'))
    assert isinstance(plain, Bitmap)
    assert plain.mean[0] == pytest.approx(188 / 255, rel=1e-5)


@pytest.mark.parametrize(
    ("texture", "colour", "words"),
    [
        ('<texture name="reflectance" type="wireframe"/>', 0.5, "between its lines"),
        ('<texture name="reflectance" type="curvature"/>', 0.5, "keeps its default"),
        ('<texture name="reflectance" type="volume"/>', 0.5, "keeps its default"),
        ('<texture name="reflectance" type="uniform"><float name="value" value="0.25"/></texture>', 0.25, ""),
    ],
)  # fmt: skip
def test_textures_that_are_one_colour(tmp_path: Path, texture: str, colour: float, words: str) -> None:
    found, warnings = reflectance(tmp_path, texture)
    assert found == (colour,) * 3
    assert [words in w for w in warnings] == [True] * bool(words)


@pytest.mark.timeout(20)
def test_textures_of_textures_end(tmp_path: Path) -> None:
    """Each has the one before twice: 2²⁵ if they were written out."""
    lines = ['<texture type="checkerboard" id="t0"/>']
    for i in range(25):
        twice = f'<ref name="color0" id="t{i}"/><ref name="color1" id="t{i}"/>'
        lines.append(f'<texture type="checkerboard" id="t{i + 1}">{twice}</texture>')
    scene = sphere(tmp_path, '<bsdf type="diffuse"><ref name="reflectance" id="t25"/></bsdf>', *lines)
    assert scene.materials[0].reflectance == pytest.approx((0.3,) * 3)
    circle = '<texture type="scale" id="s"><ref id="s"/><ref id="s"/></texture>'
    scene = sphere(tmp_path, '<bsdf type="diffuse"><ref name="reflectance" id="s"/></bsdf>', circle)
    assert any("contains itself" in w for w in scene.warnings)
