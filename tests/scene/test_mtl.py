"""What MTL statements become."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.description import Material, Scene
from pmviewer.scene.load import read_scene

TRIANGLE = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"


def opened(folder: Path, statements: str) -> Scene:
    (folder / "a.mtl").write_text("newmtl m\n" + statements)
    (folder / "a.obj").write_text(TRIANGLE)
    return read_scene(folder / "a.obj")


def material(folder: Path, statements: str) -> Material:
    scene = opened(folder, statements)
    return scene.materials[scene.shapes[0].material]


@pytest.mark.parametrize(
    ("statements", "kind", "opacity"),
    [
        ("illum 4\nKd 0.5 0.5 0.5\nTf 1 1 1\nNi 1\n", "diffuse", 1.0),  # Maya's for everything
        ("illum 4\nKd 0.5 0.5 0.5\nTf 1 1 1\nNi 1.5\nd 1\n", "diffuse", 1.0),
        ("illum 4\nKd 0 0 0\nTf 1 1 1\nNi 1.5\n", "dielectric", 1.0),
        ("illum 4\nKd 0.5 0.5 0.5\nTf 0.2 0.3 0.4\nNi 1.5\n", "dielectric", 1.0),
        ("illum 9\nKd 0.5 0.5 0.5\nd 0.1\nNi 1.33\n", "dielectric", 1.0),
        ("illum 7\nNi 1.5\n", "dielectric", 1.0),
        ("illum 7\nNi 1\nd 0.3\n", "diffuse", 0.3),
        ("illum 2\nNi 1.45\nd 0.25\n", "diffuse", 0.25),
        ("illum 2\nd -halo 0.25\n", "diffuse", 0.25),
        ("Tr 0.25\n", "diffuse", 0.75),
        ("Tr 0.25\nd 0.5\n", "diffuse", 0.5),
        ("Tr 1\n", "diffuse", 1.0),
        ("illum 3\nKd 0 0 0\nKs 0.9 0.9 0.9\n", "conductor", 1.0),
        ("illum 5\nNi 1.5\nd 1\nKd 0.9 0.9 0.9\nKs 0.1 0.1 0.1\n", "diffuse", 1.0),
    ],
)
def test_transparency_by_what_the_material_says(tmp_path: Path, statements: str, kind: str, opacity: float) -> None:
    found = material(tmp_path, statements)
    assert (found.kind, found.opacity) == (kind, pytest.approx(opacity))


def test_glossy_coats_and_metals(tmp_path: Path) -> None:
    coat = material(tmp_path, "illum 2\nKd 0.4 0.4 0.4\nKs 0.5 0.5 0.5\nNs 198\n")
    # Ks 0.5 reflects 4 %, as glass of index 1.5 does; α = √(2 / (198 + 2)).
    assert coat.kind == "rough plastic"
    assert coat.eta == pytest.approx(1.5)
    assert coat.alpha == pytest.approx((0.1, 0.1))
    metal = material(tmp_path, "illum 2\nKd 0 0 0\nKs 0.8 0.7 0.6\nNs 798\n")
    assert (metal.kind, metal.reflectance) == ("rough conductor", (0.8, 0.7, 0.6))
    assert metal.alpha == pytest.approx((0.05, 0.05))
    assert material(tmp_path, "illum 1\nKs 0.5 0.5 0.5\nNs 198\n").kind == "diffuse"
    assert material(tmp_path, "illum 2\nKs 0.5 0.5 0.5\nNs 2\n").kind == "diffuse"


def test_physically_based_extension(tmp_path: Path) -> None:
    found = material(tmp_path, "Kd 0.1 0.2 0.3\nPr 0.5\nPm 0.25\nPs 0.3\nPc 0.7\nPcr 0.1\nNi 1.4\n")
    assert (found.kind, found.reflectance, found.eta) == ("principled", (0.1, 0.2, 0.3), 1.4)
    assert found.alpha == pytest.approx((0.25, 0.25))
    assert found.principled is not None
    p = found.principled
    assert (p.metallic, p.sheen, p.clearcoat, p.clearcoat_gloss) == pytest.approx((0.25, 0.3, 0.7, 0.9))


def test_lights_by_ke_or_by_an_ambient_above_one(tmp_path: Path) -> None:
    assert opened(tmp_path, "Ke 3 2 1\n").shapes[0].radiance == (3, 2, 1)
    assert opened(tmp_path, "Ka 20 20 20\n").shapes[0].radiance is None
    (tmp_path / "a.mtl").write_text("newmtl light\nKa 20 20 20\nnewmtl m\n")
    (tmp_path / "a.obj").write_text(TRIANGLE.replace("usemtl m", "usemtl light"))
    scene = read_scene(tmp_path / "a.obj")
    assert scene.shapes[0].radiance == (20, 20, 20)
    assert any("'light' has no Ke" in w for w in scene.warnings)


def test_lights_by_name_where_nothing_emits(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(TRIANGLE + "usemtl AreaLight\nf 1 2 3\nusemtl light wood\nf 1 2 3\n")
    mtl = "newmtl m\n{}newmtl AreaLight\nKd 1 0.5 0\nnewmtl light wood\n"
    (tmp_path / "a.mtl").write_text(mtl.format(""))
    scene = read_scene(tmp_path / "a.obj")
    assert [s.radiance for s in scene.shapes] == [None, (10, 5, 0), None]
    assert any("'AreaLight' does, for its name" in w for w in scene.warnings)
    (tmp_path / "a.mtl").write_text(mtl.format("Ke 1 1 1\n"))
    assert [s.radiance for s in read_scene(tmp_path / "a.obj").shapes] == [(1, 1, 1), None, None]


def picture(path: Path, mode: str, *colours: object) -> None:
    from PIL import Image

    image = Image.new(mode, (len(colours), 1))
    image.putdata(list(colours))
    image.save(path)


def test_cut_outs(tmp_path: Path) -> None:
    picture(tmp_path / "grey.png", "L", 0, 255)
    found = material(tmp_path, "d 0.5\nmap_d grey.png\n")
    assert found.opacity == pytest.approx(0.25)
    assert found.textures["opacity"].scale == (0.5, 0.5, 0.5)
    picture(tmp_path / "alpha.png", "RGBA", (255, 255, 255, 0), (0, 0, 0, 255))
    cut = material(tmp_path, "map_d alpha.png\n").textures["opacity"]
    assert cut.pixels[0, :, 0].tolist() == [0, 1]


def test_map_options(tmp_path: Path) -> None:
    picture(tmp_path / "rough map.png", "RGB", (255, 0, 0), (0, 255, 0))
    texture = material(
        tmp_path, 'map_Pr -s 2 3 1 -o 0.5 0.25 -clamp on -imfchan g -mm 0.25 0.5 -texres 64 "rough map.png"\n'
    ).textures["alpha"]
    # Base 0.25, gain 0.5, squared; green is 0 and 1.
    assert texture.pixels[0, :, 0] == pytest.approx([0.25**2, 0.75**2])
    assert texture.wrap == "clamp"
    assert texture.to_uv == (2, 0, 0.5, 0, 3, 1 - 3 - 0.25)


def test_pictures_are_found_as_other_machines_named_them(tmp_path: Path) -> None:
    (tmp_path / "Maps").mkdir()
    picture(tmp_path / "Maps" / "Wood.PNG", "RGB", (255, 255, 255))
    for name in ("maps\\wood.png", "./maps/Wood.png"):
        assert "reflectance" in material(tmp_path, f"map_Kd {name}\n").textures
    picture(tmp_path / "stone.png", "RGB", (255, 255, 255))
    assert "reflectance" in material(tmp_path, "map_Kd C:\\Users\\me\\stone.png\n").textures
    missing = opened(tmp_path, "map_Kd a.png\nbump b.png\nmap_Ks c.png\n")
    assert len([w for w in missing.warnings if "do not exist" in w]) == 1


@pytest.mark.timeout(20)
def test_a_pipe_in_a_picture_s_place_does_not_hang(tmp_path: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    os.mkfifo(tmp_path / "t.png")
    scene = opened(tmp_path, "map_Kd t.png\nKd 0.5 0.5 0.5\n")
    assert any("is not a regular file" in w for w in scene.warnings)
    (tmp_path / "a.mtl").unlink()
    os.mkfifo(tmp_path / "a.mtl")
    assert any("is not a regular file" in w for w in read_scene(tmp_path / "a.obj").warnings)


def test_missing_and_odd_libraries(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(TRIANGLE.replace("a.mtl", "renamed.mtl"))
    (tmp_path / "a.mtl").write_text("\tnewmtl m\n  Kd 0.1\n")
    scene = read_scene(tmp_path / "a.obj")
    assert scene.materials[0].reflectance == (0.1, 0.1, 0.1)
    assert "'a.mtl' is taken for it" in scene.warnings[0]
    (tmp_path / "a.obj").write_text(TRIANGLE.replace("a.mtl", "gone.mtl a.mtl"))
    scene = read_scene(tmp_path / "a.obj")
    assert scene.materials[0].reflectance == (0.1, 0.1, 0.1)
    assert "'gone.mtl' does not exist" in scene.warnings[0]
    (tmp_path / "a.mtl").write_text("newmtl m\nKd nan 1 1\nKs\nNs 1e999\nillum x\nd\n")
    assert math.isclose(np.max(read_scene(tmp_path / "a.obj").materials[0].reflectance), 0.7)


def test_a_file_that_would_be_invisible_is_opaque(tmp_path: Path) -> None:
    """Opacity 0 on everything is a mistake; beside something that shows, it is meant."""
    scene = opened(tmp_path, "d 0\nKd 0.2 0.4 0.6\n")
    found = scene.materials[scene.shapes[0].material]
    assert (found.opacity, found.reflectance) == (1.0, (0.2, 0.4, 0.6))
    assert any("shown opaque" in w for w in scene.warnings)
    (tmp_path / "a.mtl").write_text("newmtl m\nd 0\nnewmtl n\nKd 1 0 0\n")
    (tmp_path / "a.obj").write_text(TRIANGLE + "usemtl n\nf 1 3 2\n")
    both = read_scene(tmp_path / "a.obj")
    assert sorted(both.materials[s.material].opacity for s in both.shapes) == [0.0, 1.0]
