"""Random scenes: the same for the same numbers, everything occurs in them, and both sides can read them."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest

from pmviewer.bench.agree.features import features
from pmviewer.bench.agree.files import make_mesh
from pmviewer.bench.agree.generate import (
    DENSE_FROM,
    EVERY,
    GLOWING_FROM,
    MEDIA,
    PROFILES,
    PROJECTED_FROM,
    STAGED_FROM,
    needs_particles,
    scene_of,
)
from pmviewer.bench.agree.media import has_media
from pmviewer.bench.agree.tree import from_json, to_json, written_out
from pmviewer.bench.agree.trial import HARMLESS
from pmviewer.bench.agree.xml import number, scene_text, write_scene
from pmviewer.photons.projection.projection import projection_of
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import ProjectorLight
from pmviewer.scene.load import load_scene
from pmviewer.scene.projector import projector_power

EXPECTED = """
shape: rectangle disk sphere cylinder cube obj ply instance
shape: blob~mesh tetra~mesh sheet~mesh quad~mesh tilted~vertex~normals mesh~without~normals flipped~normals face~normals
transform: mirrored uneven sheared groups~in~groups axis~not~of~unit~length
bsdf: dispersion diffuse conductor roughconductor dielectric roughdielectric thindielectric plastic roughplastic
bsdf: twosided bumpmap normalmap anisotropic ggx beckmann null
texture: bitmap checkerboard nearest bilinear repeat mirror clamp roughness
light: point spot directional constant envmap several textured~area touches~or~crosses
light: area~on~rectangle area~on~disk area~on~sphere area~on~cylinder area~on~cube area~on~obj area~on~ply
light: caustics~that~paths~don't~find area~and~environment~alone
medium: homogeneous heterogeneous hg coloured~lattice lattice~of~albedo
scene: open closed metal~alone glass~alone nothing~diffuse nested~glass small~scale large~scale
camera: outside near~a~wall in~glass
"""


def expected() -> set[str]:
    """The names of `EXPECTED`, one by one."""
    found = set()
    for line in EXPECTED.strip().splitlines():
        group, _, names = line.partition(": ")
        found |= {f"{group}: {name.replace('~', ' ')}" for name in names.split()}
    return found


def test_every_feature_occurs_and_none_is_rare():
    count = Counter(name for i in range(500) for name in features(scene_of(1, i)))
    assert expected() - set(count) == set()
    assert set(count) - expected() == {f"profile: {profile.name}" for profile in (*PROFILES, MEDIA)}
    assert min(count.values()) >= 5, count.most_common()[-3:]


def test_a_scene_depends_on_seed_and_number_alone():
    script = (
        "import hashlib; from pmviewer.bench.agree.generate import scene_of;"
        "from pmviewer.bench.agree.tree import to_json;"
        "print(hashlib.sha256(''.join(to_json(scene_of(3, i)) for i in (40, 7, 8)).encode()).hexdigest())"
    )
    here = hashlib.sha256("".join(to_json(scene_of(3, i)) for i in (40, 7, 8)).encode()).hexdigest()
    for order in ("1", "2"):
        environment = os.environ | {"PYTHONHASHSEED": order, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
        assert done.stdout.strip() == here, done.stderr
    assert scene_of(3, 7) != scene_of(4, 7) != scene_of(4, 19)


@pytest.mark.extensive
def test_every_scene_is_read_without_a_warning_and_few_variants_of_kernels_are_needed(tmp_path):
    kinds = set()
    for i in range(72):
        path, _ = write_scene(scene_of(2, i), tmp_path, f"scene{i}")
        scene = load_scene(path)
        assert [w for w in scene.warnings if not any(h in w for h in HARMLESS)] == [], (i, scene_of(2, i)["profile"])
        kinds.add(flatten(scene).record.dtype)
    assert len(kinds) <= 8


def test_text_reads_back():
    scene = scene_of(1, 6)
    assert from_json(to_json(scene)) == scene
    assert json.loads(to_json(scene)) == scene


def test_files_are_the_same_every_time(tmp_path):
    scene = scene_of(1, 3)
    for folder in ("a", "b"):
        write_scene(scene, tmp_path / folder, "scene")
    names = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert names == sorted(p.name for p in (tmp_path / "b").iterdir())
    assert all((tmp_path / "a" / n).read_bytes() == (tmp_path / "b" / n).read_bytes() for n in names)


def test_groups_written_out_place_the_same_copies(tmp_path):
    nested = [s for i in range(300) if "transform: groups in groups" in features(s := scene_of(1, i))]
    assert nested
    for i, scene in enumerate(nested[:5]):
        ours, theirs = write_scene({**scene, "scale": 1.0}, tmp_path, f"nested{i}")
        assert ours != theirs
        both = [load_scene(path).instances for path in (ours, theirs)]
        assert len(both[0]) == len(both[1]) > 0
        for a, b in zip(*both, strict=True):
            assert len(a.group.shapes) == len(b.group.shapes)
            assert np.allclose(a.to_world, b.to_world, atol=1e-9)
        assert not any(s["type"] == "instance" for members in written_out(scene)["groups"].values() for s in members)


@pytest.mark.parametrize("kind", ["blob", "tetra", "sheet", "quad"])
def test_meshes_are_closed_or_face_up_and_normals_tilt_as_told(kind):
    spec = {"kind": kind, "seed": 5, "detail": 2, "tilt": 20.0}
    vertices, faces, normals, uv = make_mesh(spec)
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if kind in ("blob", "tetra"):
        assert np.abs(across.sum(axis=0)).max() < 1e-12  # closed
        assert (corners[:, 0] * across).sum() > 0  # its volume: faces look outwards
        assert np.abs(vertices).max() <= 1 + 1e-12
    else:
        assert (across[:, 2] > 0).all()
    straight = make_mesh(spec | {"tilt": 0.0})[2]
    assert np.degrees(np.arccos((normals * straight).sum(axis=1))) == pytest.approx(20)
    assert uv.shape == (len(vertices), 2)


def test_a_scaled_scene_has_all_its_lengths_scaled(tmp_path):
    scene = next(s for i in range(100) if (s := scene_of(1, i))["lights"] and s["lights"][0]["type"] == "point")
    one, ten = (load_scene(write_scene({**scene, "scale": s}, tmp_path, f"s{s:g}")[0]) for s in (1.0, 10.0))
    assert np.allclose(np.array(one.lights[0].position) * 10, ten.lights[0].position)
    assert np.allclose(np.array(one.lights[0].intensity) * 100, ten.lights[0].intensity)
    assert np.allclose(np.array(one.camera.origin) * 10, ten.camera.origin)
    small, for_mitsuba = write_scene({**scene, "scale": 0.001}, tmp_path, "small")
    assert load_scene(for_mitsuba).camera.origin == one.camera.origin != load_scene(small).camera.origin


def test_numbers_are_written_as_every_reader_takes_them(tmp_path):
    assert [number(x) for x in (1e-7, 0.5, 100.0)] == ["0.0000001", "0.5", "100.0"]
    with pytest.raises(ValueError, match="scale"):
        scene_text({**scene_of(1, 0), "scale": 0.0}, tmp_path)


def test_some_scenes_need_particles_and_most_do_not():
    share = sum(needs_particles(scene_of(1, i)) for i in range(300)) / 300
    assert 0.05 < share < 0.5


def test_media_emit_from_a_number_on_and_the_scenes_before_are_as_they_were(tmp_path):
    """The digest is that of the generator before media could emit."""
    before = hashlib.sha256("".join(to_json(scene_of(3, i)) for i in range(60)).encode()).hexdigest()
    assert before == "cbc71cdf210f6dbebd202251e23920951d5ee37dc3f085c719528b05a0b07876"
    count = Counter(name for i in range(GLOWING_FROM, GLOWING_FROM + 60) for name in features(scene_of(3, i)))
    assert count["medium: emission"] >= 5
    assert count["medium: emission in a lattice"] >= 5
    for i in range(GLOWING_FROM, GLOWING_FROM + 12):
        path, _ = write_scene(scene_of(3, i), tmp_path, f"scene{i}")
        scene = load_scene(path)
        assert [w for w in scene.warnings if not any(h in w for h in HARMLESS)] == [], i
        assert flatten(scene).record[0]["emits"] != 0


def test_media_are_dense_from_a_number_on(tmp_path):
    thick = 0
    for i in range(DENSE_FROM, DENSE_FROM + 40):
        made = scene_of(3, i)
        assert "medium: dense" in features(made), i
        for medium in (shape["medium"] for shape in made["shapes"] if "medium" in shape):
            assert medium["scale"] >= 10, i
            assert max(medium["albedo"]) <= 0.95, i
            assert "emission" not in medium, i
            thick += medium["type"] == "heterogeneous"
    assert thick >= 25
    path, _ = write_scene(scene_of(3, DENSE_FROM), tmp_path, "dense")
    assert [w for w in load_scene(path).warnings if not any(h in w for h in HARMLESS)] == []


def test_projectors_are_in_all_scenes_from_a_number_on_and_the_scenes_before_are_as_they_were(tmp_path):
    """The digests are those of the generator before there were any."""
    for first, digest in (
        (GLOWING_FROM, "91d43e61f9d22cb00b3c90a8341e059c7824f54325dd129285375598d6cb8566"),
        (DENSE_FROM, "d12fe6ac7ebf21460666c90e09b961cd208fb25a0c8bb20b4064d533b65c2fc9"),
        (PROJECTED_FROM - 20, "8986c1716827423e700e0360a47d45c378c89b2241faaf7ef3e9c9f2dfc9298b"),
    ):
        before = "".join(to_json(scene_of(3, i)) for i in range(first, first + 20))
        assert hashlib.sha256(before.encode()).hexdigest() == digest
    made = [scene_of(3, i) for i in range(PROJECTED_FROM, PROJECTED_FROM + 6 * EVERY)]
    assert all("light: projector" in features(scene) for scene in made)
    assert sum(has_media(scene) for scene in made) == 6
    assert not any(has_media(scene) and needs_particles(scene) for scene in made)
    count = Counter(scene["profile"] for scene in made)
    assert set(count) == {profile.name for profile in (*PROFILES, MEDIA)}
    alone = [s for s in made if not any("emitter" in shape for shape in s["shapes"]) and len(s["lights"]) == 1]
    assert len(alone) >= 10
    pictures = Counter(type(light["irradiance"]) for s in made for light in s["lights"] if light["type"] == "projector")
    assert min(pictures[dict], pictures[list]) >= 5


def test_photons_aim_at_what_stands_on_wide_stages(tmp_path):
    """Whatever is there, with media and without; files are read without a warning."""
    aims, stages = 0, Counter[str]()
    for i in range(STAGED_FROM, STAGED_FROM + 26):
        made = scene_of(3, i)
        stages.update(name for name in features(made) if "stage" in name)
        assert not needs_particles(made), i
        scene = load_scene(write_scene(made, tmp_path, f"scene{i}")[0])
        assert [w for w in scene.warnings if not any(h in w for h in HARMLESS)] == [], i
        aims += projection_of(flatten(scene), confined=not has_media(made)).gain > 1
    assert aims >= 20
    assert len(stages) == 2
    assert sum(stages.values()) == 26
    assert sum(has_media(scene_of(3, i)) for i in range(STAGED_FROM, STAGED_FROM + 26)) == 2


def test_scenes_with_projectors_are_read_without_a_warning_and_scale(tmp_path):
    for i in range(PROJECTED_FROM, PROJECTED_FROM + 14):
        made = scene_of(3, i)
        one, ten = (write_scene({**made, "scale": s}, tmp_path, f"scene{i}_{s:g}")[0] for s in (1.0, 10.0))
        scene, large = load_scene(one), load_scene(ten)
        assert [w for w in scene.warnings if not any(h in w for h in HARMLESS)] == [], i
        lights = [[light for light in loaded.lights if isinstance(light, ProjectorLight)] for loaded in (scene, large)]
        assert len(lights[0]) == len(lights[1]) >= 1
        for small, big in zip(*lights, strict=True):
            assert np.allclose(np.array(small.position) * 10, big.position)
            assert np.allclose(100 * projector_power(small), projector_power(big), rtol=1e-5)
