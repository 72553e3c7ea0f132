"""The table of material kinds: what kernels and the scene's analysis rely on."""

from __future__ import annotations

from dataclasses import fields

import pytest

from pmviewer.kernels.bsdf.kinds import GLOSSY, KINDS
from pmviewer.scene.arrays.material_lobes import glossy_roughness, has_diffuse_lobe
from pmviewer.scene.description import Material


def test_numbers_are_distinct_and_colours_are_fields_of_materials():
    numbers = [kind.number for kind in KINDS.values()]
    assert sorted(numbers) == list(range(len(numbers)))
    assert {kind.glossy for kind in KINDS.values()} - {""} <= {field.name for field in fields(Material)}
    assert {name for name, kind in KINDS.items() if kind.number in GLOSSY} == {
        "rough conductor", "rough plastic", "schlick", "ward"}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "diffuse", "glossy"),
    [
        ("diffuse", True, False),
        ("conductor", False, False),
        ("rough conductor", False, True),
        ("rough dielectric", False, False),
        ("plastic", True, False),
        ("rough plastic", True, True),
        ("schlick", True, True),
        ("ward", True, True),
    ],
)
def test_lobes_of_a_kind(kind, diffuse, glossy):
    material = Material("m", kind)
    assert has_diffuse_lobe(material) == diffuse
    assert bool(glossy_roughness(material)) == glossy
    assert glossy_roughness(Material("m", kind, (0.0,) * 3, specular=(0.0,) * 3)) == ()


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="unknown kind of material: velvet"):
        Material("m", "velvet")
