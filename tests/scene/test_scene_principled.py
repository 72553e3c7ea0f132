"""`principled` and `principledthin` as materials; defaults and formulas are those of Mitsuba 3's documentation."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pmviewer.scene.description import Material, Mesh, Principled
from pmviewer.scene.texture import Bitmap, Checkerboard
from tests.scene.helpers import load


def material(folder: Path, inside: str, kind: str = "principled") -> tuple[Material, tuple[str, ...]]:
    scene = load(folder, f'<shape type="sphere"><bsdf type="{kind}">{inside}</bsdf></shape>')
    return scene.materials[scene.shapes[0].material], scene.warnings


def number(name: str, value: float) -> str:
    return f'<float name="{name}" value="{value}"/>'


def test_defaults(tmp_path: Path) -> None:
    found, warnings = material(tmp_path, "")
    assert (found.kind, found.reflectance, found.principled) == ("principled", (0.5, 0.5, 0.5), Principled())
    # specular 0.5 is a reflection of 4 % head-on, that of an index of 1.5; roughness 0.5 is α = ¼.
    assert found.eta == pytest.approx(1.5)
    assert (found.alpha, found.two_sided, warnings) == ((0.25, 0.25), False, ())


def test_all_its_numbers(tmp_path: Path) -> None:
    shares = {"metallic": 0.7, "spec_trans": 0.4, "spec_tint": 0.35, "sheen": 0.3, "sheen_tint": 0.2, "flatness": 0.1,
              "clearcoat": 0.6, "clearcoat_gloss": 0.25}  # fmt: skip
    words = "".join(number(name, value) for name, value in shares.items())
    words += '<rgb name="base_color" value="0.9 0.5 0.1"/>' + number("roughness", 0.2) + number("anisotropic", 0.5)
    found, warnings = material(tmp_path, words + number("eta", 1.4) + number("clearcoat_sampling_rate", 2))
    assert found.principled == Principled(**shares)
    assert (found.reflectance, found.eta, warnings) == ((0.9, 0.5, 0.1), 1.4, ())
    aspect = math.sqrt(1 - 0.9 * 0.5)
    assert found.alpha == pytest.approx((0.04 / aspect, 0.04 * aspect))


@pytest.mark.parametrize(("specular", "eta"), [(0.0, 1.0), (1.0, 1.7887), (0.25, 1.3294)])
def test_specular_gives_the_index(tmp_path: Path, specular: float, eta: float) -> None:
    """((η − 1)/(η + 1))² = 0.08·specular."""
    found, _ = material(tmp_path, number("specular", specular))
    assert found.eta == pytest.approx(eta, abs=1e-4)
    assert ((found.eta - 1) / (found.eta + 1)) ** 2 == pytest.approx(0.08 * specular, abs=1e-9)


def test_odd_numbers_are_cut(tmp_path: Path) -> None:
    found, warnings = material(tmp_path, number("metallic", 2) + number("sheen", -1) + number("roughness", 0))
    assert found.principled == Principled(metallic=1.0)
    assert found.alpha == (0.001, 0.001)
    assert len(warnings) == 2
    both, warnings = material(tmp_path, number("eta", 1.3) + number("specular", 0.5))
    assert both.eta == 1.3
    assert "both 'eta' and 'specular'" in warnings[0]
    glass, _ = material(tmp_path, number("eta", 1.0) + number("spec_trans", 1))
    assert glass.eta == 1.001


def test_a_colour_in_a_numbers_place_counts_by_its_luminance(tmp_path: Path) -> None:
    """As Blender's exporter once wrote tints."""
    tint = '<rgb name="{}" value="{}"/>'
    found, warnings = material(tmp_path, tint.format("spec_tint", "1 1 1") + tint.format("sheen_tint", "1 0 0"))
    assert found.principled == Principled(spec_tint=pytest.approx(1.0), sheen_tint=pytest.approx(0.2126))
    assert warnings == ()


def test_its_textures(tmp_path: Path) -> None:
    rough = np.uint8([[[51, 51, 51], [255, 0, 0]]])
    Image.fromarray(rough).save(tmp_path / "rough.png")

    def bitmap(name: str) -> str:
        raw = '<boolean name="raw" value="true"/>'
        return f'<texture name="{name}" type="bitmap"><string name="filename" value="rough.png"/>{raw}</texture>'

    board = '<texture name="base_color" type="checkerboard"/>'
    words = board + bitmap("roughness") + bitmap("metallic") + bitmap("clearcoat")
    found, warnings = material(tmp_path, words)
    assert found.textures.keys() == {"reflectance", "alpha", "metallic"}
    alpha, metal = found.textures["alpha"], found.textures["metallic"]
    assert isinstance(found.textures["reflectance"], Checkerboard)
    assert isinstance(alpha, Bitmap)
    assert isinstance(metal, Bitmap)
    # Grey 51 is a roughness of 0.2; red has the luminance 0.2126.
    assert alpha.pixels[0, :, 0] == pytest.approx([0.04, 0.2126**2], rel=1e-5)
    assert metal.pixels.shape == (1, 2, 3)
    assert found.principled is not None
    assert found.principled.metallic == pytest.approx((0.2 + 0.2126) / 2)
    assert found.principled.clearcoat == pytest.approx((0.2 + 0.2126) / 2)
    (warning,) = warnings
    assert "'clearcoat'" in warning
    assert "its mean is used everywhere" in warning


COS = np.linspace(0.001, 1, 1000)


def of_all_light(eta: float) -> np.ndarray:
    """What one face reflects under the cosines COS, by the angles of Fresnel's equations."""
    refracted = np.arcsin(np.sqrt(1 - COS**2) / eta)
    angle = np.arccos(COS)
    with np.errstate(invalid="ignore"):
        s = np.sin(angle - refracted) / np.sin(angle + refracted)
        p = np.tan(angle - refracted) / np.tan(angle + refracted)
    return np.where(COS == 1, ((eta - 1) / (eta + 1)) ** 2, (s**2 + p**2) / 2)


def test_a_thin_sheet(tmp_path: Path) -> None:
    colour = '<rgb name="base_color" value="0.64 0.36 0.16"/>'
    sheet, warnings = material(tmp_path, colour + number("sheen", 0.5), "principledthin")
    assert (sheet.kind, sheet.two_sided, sheet.eta, warnings) == ("principled", True, 1.0, ())
    assert sheet.principled == Principled(sheen=0.5)
    mixed, warnings = material(
        tmp_path, colour + number("spec_trans", 0.3) + number("diff_trans", 0.5) + number("eta", 1.4), "principledthin"
    )
    assert (mixed.kind, mixed.weight, len(warnings)) == ("blend", 0.3, 1)
    diffuse, glass = mixed.parts
    # A quarter of the diffuse light goes through.
    front, through = diffuse.parts
    assert (diffuse.weight, front.reflectance) == (0.25, pytest.approx((0.64, 0.36, 0.16)))
    assert (through.kind, through.transmittance) == ("diffuse transmitter", pytest.approx((0.64, 0.36, 0.16)))
    assert (glass.kind, glass.transmittance) == ("thin dielectric", pytest.approx((0.64, 0.36, 0.16)))
    face, pane_of_it = of_all_light(1.4), of_all_light(glass.eta)
    assert (2 * pane_of_it / (1 + pane_of_it) * COS).sum() == pytest.approx((face * COS).sum(), rel=1e-3)
    picture = '<texture type="checkerboard" name="base_color"><float name="color0" value="0.2"/></texture>'
    mixed, _ = material(tmp_path, picture + number("spec_trans", 0.3), "principledthin")
    assert mixed.parts[1].textures["transmittance"] == mixed.parts[0].textures["reflectance"]
    pane, _ = material(tmp_path, number("spec_trans", 1), "principledthin")
    assert pane.kind == "thin dielectric"


def test_colours_at_vertices(tmp_path: Path) -> None:
    """In a mesh attribute, or scaled, as version 0.6 has them."""
    attribute = '<texture name="base_color" type="mesh_attribute"><string name="name" value="vertex_color"/></texture>'
    found, warnings = material(tmp_path, attribute)
    assert (found.vertex_colours, found.reflectance, warnings) == (True, (1, 1, 1), ())
    old = '<texture name="reflectance" type="scale"><float name="scale" value="0.5"/><texture type="vertexcolors"/>'
    found, warnings = material(tmp_path, f"{old}</texture>", "diffuse")
    assert (found.vertex_colours, found.reflectance, warnings) == (True, (0.5, 0.5, 0.5), ())
    other = attribute.replace("vertex_color", "corner_weight").replace("base_color", "reflectance")
    found, warnings = material(tmp_path, other, "diffuse")
    assert (found.vertex_colours, found.reflectance) == (False, (0.5, 0.5, 0.5))
    assert "'corner_weight'" in warnings[0]
    coat = attribute.replace("base_color", "specular_reflectance")
    found, warnings = material(tmp_path, coat, "plastic")
    assert (found.vertex_colours, found.specular) == (False, (1, 1, 1))
    assert "no effect here" in warnings[0]


def test_colours_of_a_ply_file_as_mitsuba_writes_it(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\n"
    columns = "".join(f"property float {n}\n" for n in ("x", "y", "z", "color_0", "color_1", "color_2"))
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    rows = "0 0 0 1 0 0\n1 0 0 0 0.5 0\n0 1 0 0 0 0.25\n3 0 1 2\n"
    (tmp_path / "a.ply").write_text(header + columns + faces + rows)
    scene = load(tmp_path, '<shape type="ply"><string name="filename" value="a.ply"/></shape>')
    mesh = scene.shapes[0].geometry
    assert isinstance(mesh, Mesh)
    assert mesh.colours is not None
    assert mesh.colours[np.argsort(mesh.vertices @ [1, 2, 0])] == pytest.approx(np.diag([1, 0.5, 0.25]))


@pytest.mark.parametrize(("attribute", "green"), [("vertex_color", 0.5), ("face_color", 0.25)])
def test_colours_of_faces_where_vertices_have_some_too(tmp_path: Path, attribute: str, green: float) -> None:
    """The attribute that the BSDF names counts, through a reference and inside another BSDF as well."""
    vertex = "".join(f"property float {n}\n" for n in ("x", "y", "z", "color_0", "color_1", "color_2"))
    face = "property list uchar int vertex_indices\n" + "".join(f"property float color_{k}\n" for k in range(3))
    rows = "0 0 0 1 0.5 0\n1 0 0 1 0.5 0\n0 1 0 1 0.5 0\n3 0 1 2 0 0.25 1\n"
    header = f"ply\nformat ascii 1.0\nelement vertex 3\n{vertex}element face 1\n{face}end_header\n"
    (tmp_path / "a.ply").write_text(header + rows)
    texture = f'<texture type="mesh_attribute" name="reflectance"><string name="name" value="{attribute}"/></texture>'
    scene = load(
        tmp_path,
        f'<bsdf type="twosided" id="b"><bsdf type="diffuse">{texture}</bsdf></bsdf>'
        '<shape type="ply"><string name="filename" value="a.ply"/><ref id="b"/></shape>',
    )
    mesh = scene.shapes[0].geometry
    assert isinstance(mesh, Mesh)
    assert mesh.colours is not None
    assert mesh.colours[:, 1].tolist() == [green] * 3
    assert scene.materials[scene.shapes[0].material].vertex_colours


ATTRIBUTES = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property float heat_r\nproperty float heat_g\nproperty float heat_b\nproperty uchar bits_0\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty float color_0\nproperty float color_1\nproperty float color_2\n"
    "property float weight_0\nproperty float tint_x\nproperty float tint_y\nproperty float tint_z\n"
    "property float odd_0\nproperty float odd_1\nend_header\n"
    "0 0 0 0.1 0.2 0.3 1\n1 0 0 0.1 0.2 0.3 1\n1 1 0 0.1 0.2 0.3 1\n"
    "0 1 0 0.4 0.5 0.6 0\n"
    "3 0 1 2 1 0 0 0.25 0.5 0.6 0.7 0 0\n3 0 2 3 0 1 0 0.75 0.8 0.9 1 0 0\n"
)
"""Columns as `Mesh.write_ply` of Mitsuba 3.9.1 names them, and with the other endings that its reader knows."""


@pytest.mark.parametrize(
    ("attribute", "first", "last"),
    [
        ("face_color", [1, 0, 0], [0, 1, 0]),
        ("face_weight", [0.25] * 3, [0.75] * 3),
        ("face_tint", [0.5, 0.6, 0.7], [0.8, 0.9, 1]),
        ("vertex_heat_color", [0.1, 0.2, 0.3], [0.4, 0.5, 0.6]),
        ("vertex_bits", [1] * 3, [0] * 3),
        ("face_odd", None, None),
        ("vertex_weight", None, None),
        ("face_heat_color", None, None),
    ],
)
def test_attributes_of_vertices_and_faces(
    tmp_path: Path, attribute: str, first: list | None, last: list | None
) -> None:
    """At the first corner of the first face and the last of the last, one number or three; those that are not there,
    or of two numbers, which Mitsuba refuses too, are said."""
    (tmp_path / "a.ply").write_text(ATTRIBUTES)
    texture = f'<texture type="mesh_attribute" name="reflectance"><string name="name" value="{attribute}"/></texture>'
    shape = f'<string name="filename" value="a.ply"/><bsdf type="diffuse">{texture}</bsdf>'
    scene = load(tmp_path, f'<shape type="ply">{shape}</shape>')
    mesh = scene.shapes[0].geometry
    assert isinstance(mesh, Mesh)
    if first is None:
        assert mesh.colours is None
        assert any(f"no attribute '{attribute}'" in w for w in scene.warnings)
        return
    assert mesh.colours is not None
    assert mesh.colours[mesh.faces[0, 0]] == pytest.approx(first)
    assert mesh.colours[mesh.faces[-1, -1]] == pytest.approx(last)
    assert not any("attribute" in w for w in scene.warnings)


def test_several_attributes_of_one_mesh(tmp_path: Path) -> None:
    """The first is read, which is said; two shapes may read one each."""
    (tmp_path / "a.ply").write_text(ATTRIBUTES)
    name = '<string name="filename" value="a.ply"/>'
    halves = [
        '<bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">'
        f'<string name="name" value="{attribute}"/></texture></bsdf>'
        for attribute in ("face_weight", "face_tint")
    ]
    both = f'<shape type="ply">{name}<bsdf type="blendbsdf"><float name="weight" value="0.5"/>{"".join(halves)}</bsdf>'
    scene = load(tmp_path, f"{both}</shape>")
    assert any("several attributes" in w and "'face_weight'" in w for w in scene.warnings)
    scene = load(tmp_path, "".join(f'<shape type="ply">{name}{half}</shape>' for half in halves))
    colours = [shape.geometry.colours[0, 0] for shape in scene.shapes]
    assert colours == pytest.approx([0.25, 0.5])
    assert not any("attribute" in w for w in scene.warnings)


def test_the_colour_comes_before_other_attributes(tmp_path: Path) -> None:
    """As programs write them that give each property of `principled` an attribute."""
    (tmp_path / "a.ply").write_text(ATTRIBUTES)
    textures = "".join(
        f'<texture type="mesh_attribute" name="{name}"><string name="name" value="{attribute}"/></texture>'
        for name, attribute in (("roughness", "face_weight"), ("base_color", "face_tint"))
    )
    shape = f'<string name="filename" value="a.ply"/><bsdf type="principled">{textures}</bsdf>'
    scene = load(tmp_path, f'<shape type="ply">{shape}</shape>')
    assert scene.shapes[0].geometry.colours[0] == pytest.approx([0.5, 0.6, 0.7])
    material = scene.materials[scene.shapes[0].material]
    assert material.vertex_colours
    assert any("several attributes" in w and "'face_tint'" in w for w in scene.warnings)
    assert material.alpha == (0.25, 0.25)  # of Mitsuba's default, 0.5
    assert any("'roughness' can't vary" in w for w in scene.warnings)
