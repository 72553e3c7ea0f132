"""Shape groups, instances and displacement in scene files."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.arrays.flatten import bounding_sphere, flatten
from pmviewer.scene.arrays.tessellate import tessellate
from pmviewer.scene.describe import describe
from pmviewer.scene.formats.mitsuba import displacement
from pmviewer.scene.load import load_scene
from pmviewer.scene.meshes.displacement import Fractal
from tests.scene.helpers import CAMERA, load, xml_file

CUBE = '<shape type="shapegroup" id="one"><shape type="cube"/></shape>'
INSTANCE = '<shape type="instance"><ref id="{}"/><transform name="to_world">{}</transform></shape>'


def instance(group="one", transform='<translate value="1 2 3"/>'):
    return INSTANCE.format(group, transform)


def test_instances_are_placed(tmp_path):
    scene = load(tmp_path, CUBE, instance(), instance(transform='<scale value="-1 2 1"/>'))
    assert scene.warnings == ()
    assert scene.shapes == ()
    first, second = scene.instances
    assert first.group is second.group
    assert (first.name, first.group.name) == ("instance (line 3)", "one")
    np.testing.assert_array_equal(first.to_world[:3, 3], (1, 2, 3))
    np.testing.assert_array_equal(np.diag(second.to_world), (-1, 2, 1, 1))
    flat = flatten(scene)
    assert (flat.n_triangles, flat.n_instances, flat.n_elements) == (12, 2, 24)
    center, _ = bounding_sphere(scene)
    np.testing.assert_allclose(center, (0.5, 0.5, 1.5))
    texts = dict(describe(scene))
    assert texts["surfaces"] == "none"
    assert texts["instances"] == "2 copies of 1 group (one: 12 triangles in 1 mesh)"
    assert texts["elements"] == "24 to be hit, 12 stored"


def test_groups_within_groups_are_flattened(tmp_path):
    row = '<shape type="shapegroup" id="row">' + "".join(
        instance("one", f'<translate value="{3 * i} 0 0"/>') for i in range(3)
    ) + '<shape type="sphere"><float name="radius" value="0.1"/></shape></shape>'  # fmt: skip
    scene = load(
        tmp_path, CUBE, row, instance("row", '<translate value="0 5 0"/>'), instance("row", '<scale value="2"/>')
    )
    assert len(scene.instances) == 8
    assert [group.name for group in scene.groups] == ["row", "one"]
    offsets = [tuple(i.to_world[:3, 3]) for i in scene.instances if i.group.name == "one"]
    assert offsets == [(0, 5, 0), (3, 5, 0), (6, 5, 0), (0, 0, 0), (6, 0, 0), (12, 0, 0)]
    assert flatten(scene).n_elements == 6 * 12 + 2


def test_camera_without_sensor_sees_the_instances(tmp_path):
    scene = load(tmp_path, CUBE, instance(transform='<translate value="100 0 0"/>'), camera="")
    np.testing.assert_allclose(scene.camera.target, (100, 0, 0), atol=0.5)  # the cube is 2 wide


@pytest.mark.parametrize(
    ("lines", "line", "words"),
    [
        ((instance(),), 2, "refers to the id 'one', which is not defined"),
        (('<shape type="instance"/>',), 2, "needs exactly one shapegroup"),
        ((f'<shape type="shapegroup" id="one">{instance()}</shape>', instance()), 2, "contains an instance of itself"),
        ((f'<shape type="shapegroup" id="one">{CUBE.replace("one", "two")}</shape>', instance()), 2, "stands inside"),
    ],
)  # fmt: skip
def test_broken_groups(tmp_path, lines, line, words):
    with pytest.raises(SceneError, match=words) as caught:
        load(tmp_path, *lines)
    assert caught.value.line == line


def test_instances_that_are_squeezed_flat_are_left_out(tmp_path):
    scene = load(tmp_path, CUBE, instance(), instance(transform='<scale value="1 0 1"/>'))
    assert len(scene.instances) == 1
    assert scene.warnings == (
        "line 4: 'to_world' of <shape type=\"instance\"> squeezes the group flat: the instance is left out.",
    )


def test_instance_of_a_plain_shape_is_left_out(tmp_path):
    scene = load(tmp_path, '<shape type="cube" id="one"/>', instance())
    assert (len(scene.shapes), len(scene.instances)) == (1, 0)
    assert scene.warnings == (
        'line 3: <shape type="instance"> needs exactly one shapegroup. The instance is left out.',
    )


def test_lights_in_groups_are_left_out(tmp_path):
    lamp = '<shape type="cube"><emitter type="area"/></shape>'
    scene = load(tmp_path, CUBE.replace('<shape type="cube"/>', lamp + '<emitter type="point"/>'), instance())
    assert [shape.radiance for shape in scene.groups[0].shapes] == [None]
    assert [w for w in scene.warnings if "lights can't be instanced" in w] == list(scene.warnings)
    assert len(scene.warnings) == 2


@pytest.mark.timeout(10)
def test_deeply_nested_groups_are_one_error(tmp_path):
    """3 000 groups within each other once ended in a RecursionError."""
    groups = [CUBE.replace("one", "g0")]
    groups += [f'<shape type="shapegroup" id="g{i}">{instance(f"g{i - 1}")}</shape>' for i in range(1, 3000)]
    with pytest.raises(SceneError, match="lies within more than 64 other groups"):
        load(tmp_path, *groups, instance("g2999"))


@pytest.mark.timeout(10)
def test_too_many_nested_instances(tmp_path):
    nested = [CUBE]
    for level in range(7):
        inner = "one" if level == 0 else f"g{level - 1}"
        nested.append(f'<shape type="shapegroup" id="g{level}">{instance(inner) * 10}</shape>')
    with pytest.raises(SceneError, match="more than 1,048,576 instances"):
        load(tmp_path, *nested, instance("g6"))


def test_an_empty_group_is_left_out_with_a_warning(tmp_path):
    empty = '<shape type="shapegroup" id="one"><shape type="sphere"><float name="radius" value="0"/></shape></shape>'
    scene = load(tmp_path, empty, '<shape type="cube"/>', instance())
    assert scene.instances == ()
    assert any("The group 'one' has no surface" in warning for warning in scene.warnings)


def test_a_scene_of_an_unused_group_has_no_surface(tmp_path):
    with pytest.raises(SceneError, match="no surface"):
        load_scene(xml_file(tmp_path, CUBE, CAMERA))


def test_window_draws_instances_where_they_are(tmp_path):
    scene = load(tmp_path, CUBE, instance(), instance(transform='<scale value="-1 2 1"/>'))
    drawn = tessellate(scene)
    assert drawn.note == ""
    assert drawn.vertices.shape == (3 * 24, 3)
    np.testing.assert_allclose(drawn.vertices[:36].mean(axis=0), (1, 2, 3), atol=1e-6)
    corners, normals = drawn.vertices[36:].reshape(-1, 3, 3), drawn.normals[36:].reshape(-1, 3, 3)
    assert (np.einsum("ij,ij->i", corners.mean(axis=1), normals[:, 0]) > 0).all()


def test_window_simplifies_what_is_too_much(tmp_path, monkeypatch):
    monkeypatch.setattr("pmviewer.scene.arrays.tessellate.INSTANCE_BUDGET", 3000)
    ball = '<shape type="shapegroup" id="one"><shape type="sphere"/></shape>'
    scene = load(tmp_path, ball, *[instance(transform=f'<translate value="{3 * i} 0 0"/>') for i in range(4)])
    drawn = tessellate(scene)
    count = len(drawn.vertices) // 3
    assert 500 < count <= 3000
    assert drawn.note == f"the geometry view draws {count:,} of 36,864 instanced triangles"
    ball = drawn.vertices[np.abs(drawn.vertices[:, 0]) < 1.4]
    assert np.linalg.norm(ball, axis=1) == pytest.approx(1.0, abs=0.2)


def rectangle(*inside):
    return f'<shape type="rectangle">{"".join(inside)}</shape>'


FRACTAL = '<texture name="displacement" type="fractal"><integer name="frequency" value="3"/></texture>'
FINE = '<integer name="subdivision" value="24"/>'


def test_displaced_rectangle(tmp_path):
    scene = load(tmp_path, rectangle(FRACTAL, FINE, '<float name="displacement_scale" value="0.2"/>'))
    assert scene.warnings == ()
    mesh = scene.shapes[0].geometry
    assert mesh.faces.shape == (2 * 24 * 24, 3)
    heights = mesh.vertices[:, 2]
    assert 0.05 < np.ptp(heights) < 0.5
    np.testing.assert_allclose(np.unique(mesh.vertices[:, 0]), np.linspace(-1, 1, 25), atol=1e-12)
    corners = mesh.vertices[mesh.faces]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()
    # Neighbouring tiles join: both ends of a row have the same height.
    grid = heights.reshape(25, 25)
    np.testing.assert_allclose(grid[0], grid[-1], atol=1e-12)
    np.testing.assert_allclose(grid[:, 0], grid[:, -1], atol=1e-12)
    offset = '<float name="displacement_offset" value="0.5"/>'
    scene = load(tmp_path, rectangle(FRACTAL, FINE, '<float name="displacement_scale" value="0.2"/>', offset))
    np.testing.assert_allclose(scene.shapes[0].geometry.vertices[:, 2], heights + 0.1, atol=1e-12)


@pytest.mark.parametrize("kind", ["cube", "sphere"])
def test_displacement_opens_no_cracks(tmp_path, kind):
    shape = rectangle(
        FRACTAL, '<integer name="subdivision" value="9"/>', '<float name="displacement_scale" value="0.3"/>'
    )
    scene = load(tmp_path, shape.replace("rectangle", kind))
    assert scene.dropped == {}
    mesh = scene.shapes[0].geometry
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(e) for e in edges} == {(b, a) for a, b in edges}  # every edge has its other side: closed
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(8.0 if kind == "cube" else 4 / 3 * np.pi, rel=0.2)


def test_displaced_triangles_are_limited_in_all(tmp_path, monkeypatch):
    """The third of these would be the one too many: 2 · 60² triangles each."""
    monkeypatch.setattr(displacement, "MOST_TRIANGLES", 20_000)
    scene = load(tmp_path, *[rectangle(FRACTAL, '<integer name="subdivision" value="60"/>')] * 3)
    assert len(scene.shapes) == 2
    assert "would make 7,200 triangles, at most 20,000 in all are made. The shape is left out." in scene.warnings[0]


def test_noise_has_the_heights_it_always_had(tmp_path):
    # Computed with numpy before the noise was compiled; bundled scenes have reference pictures of these surfaces.
    places = np.array([[0.1, 0.2, 0.3], [0.9, 0.45, 0.0], [-1.3, 2.7, 0.5]])
    np.testing.assert_allclose(Fractal()(places), [-0.04643203328996, 0.38874746569184, -0.02926797409994], atol=1e-12)
    np.testing.assert_allclose(
        Fractal(7, 0.55, 2, 3)(places), [-0.28453210262248, -0.20300974946964, 0.07968025825826], atol=1e-12
    )


def test_seeds_octaves_and_roughness_matter(tmp_path):
    def heights(**values):
        numbers = "".join(
            f'<{"float" if isinstance(v, float) else "integer"} name="{k}" value="{v}"/>' for k, v in values.items()
        )
        texture = f'<texture name="displacement" type="fractal">{numbers}</texture>'
        return load(tmp_path, rectangle(texture, FINE)).shapes[0].geometry.vertices[:, 2]

    base = heights()
    for change in ({"seed": 1}, {"octaves": 2}, {"roughness": 0.8}, {"frequency": 7}):
        assert np.abs(heights(**change) - base).max() > 0.01
    np.testing.assert_array_equal(heights(seed=0), base)


def test_waves_repeat_and_have_the_asked_size(tmp_path):
    texture = '<texture name="displacement" type="waves"><float name="frequency" value="5"/></texture>'
    mesh = load(tmp_path, rectangle(texture, '<integer name="subdivision" value="64"/>')).shapes[0].geometry
    grid = mesh.vertices[:, 2].reshape(65, 65)
    np.testing.assert_allclose(grid[0], grid[-1], atol=1e-9)
    np.testing.assert_allclose(grid[:, 0], grid[:, -1], atol=1e-9)
    assert abs(grid[:-1, :-1].mean()) < 1e-3
    assert grid.std() == pytest.approx(0.5, rel=0.2)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (rectangle('<texture name="displacement" type="bitmap"/>'), "can't be a displacement"),
        (rectangle('<float name="displacement" value="1"/>'), "must be <texture>"),
        (rectangle(FRACTAL, '<integer name="subdivision" value="0"/>'), "between 1 and 4096"),
        (
            rectangle(FRACTAL, '<integer name="subdivision" value="4096"/>'),
            "33,554,432 triangles, at most 2,000,000 in all are made",
        ),
        (rectangle(FRACTAL).replace("rectangle", "disk"), "only rectangles, cubes, spheres and meshes"),
        (rectangle(FRACTAL.replace("frequency", "octaves").replace("3", "99")), "between 1 and 16"),
    ],
)
def test_broken_displacement(tmp_path, shape, words):
    with pytest.raises(SceneError, match=words) as caught:
        load(tmp_path, shape)
    assert caught.value.line == 2
