"""The bundled scenes, held against their reference images pixel by pixel."""

from pathlib import Path

import numpy as np
import pytest

from pmviewer import resources
from pmviewer.errors import PmviewerError
from pmviewer.output.exr import read_exr
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.describe import describe, description_text
from pmviewer.scene.description import Cylinder, Mesh, Parallelogram, Sphere
from pmviewer.scene.load import bundled_scenes, load_scene, reference_of
from pmviewer.settings.access import CameraSettings

NAMES = ("cornell_caustic", "cornell_diffuse", "ring_caustic", "rooms_10x10")


def reference(name: str) -> np.ndarray:
    import OpenEXR

    path = next(s.path for s in bundled_scenes() if s.name == name) / "reference.exr"
    with OpenEXR.File(str(path)) as file:
        return np.array(file.channels()["RGB"].pixels, np.float64)


def pixels(name: str, points: list) -> np.ndarray:
    pose = resolve_camera(load_scene(name), CameraSettings())
    return pose.project(np.array(points, float))


def test_the_four_scenes_are_bundled_with_texts_and_previews() -> None:
    scenes = {s.name: s for s in bundled_scenes()}
    assert set(NAMES) <= scenes.keys()
    for scene in scenes.values():
        assert scene.title != scene.name
        assert scene.description
        assert scene.shows
        size = sum(f.stat().st_size for f in scene.path.rglob("*") if f.is_file())
        assert size < 2 << 20


@pytest.mark.parametrize("name", [s.name for s in bundled_scenes()])
def test_bundled_scene_opens_without_a_word(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert scene.warnings == ()
    assert scene.dropped == {}


@pytest.mark.parametrize("name", [s.name for s in bundled_scenes()])
def test_every_bundled_scene_has_a_reference_that_tells_how_it_was_made(name: str) -> None:
    scene = load_scene(name)
    path = reference_of(scene)
    assert path is not None
    layers, attributes = read_exr(path)
    assert layers[""].shape[:2] == (scene.height, scene.width)
    assert np.isfinite(layers[""]).all()
    assert layers[""].mean() > 0
    assert all(str(attributes[key]) for key in ("made", "command", "seeds", "samples"))
    assert 0 < float(attributes["noise"]) < 0.02


def test_contents() -> None:
    kinds = {name: [type(s.geometry) for s in load_scene(name).shapes] for name in NAMES}
    assert kinds["cornell_diffuse"] == [Mesh, Mesh, Mesh, Parallelogram]
    assert kinds["cornell_caustic"] == [Mesh, Mesh, Mesh, Sphere, Sphere, Parallelogram]
    assert kinds["ring_caustic"] == [Mesh, Cylinder, Parallelogram]
    assert kinds["rooms_10x10"] == [Mesh] * 3 + [Parallelogram] * 100
    glass = load_scene("cornell_caustic").materials[4]
    assert (glass.name, glass.kind, glass.eta) == ("glass", "dielectric", 1.5)


@pytest.mark.parametrize("name", ["cornell_caustic", "cornell_diffuse"])
def test_light_stands_where_the_reference_shows_it(name: str) -> None:
    scene, image = load_scene(name), reference(name)
    light = scene.shapes[-1]
    assert light.radiance is not None
    lit = np.abs(image - light.radiance).max(axis=2) < 0.3
    corner, u, v = (np.array(x) for x in (light.geometry.corner, light.geometry.edge_u, light.geometry.edge_v))
    xy = pixels(name, [corner, corner + u, corner + u + v, corner + v])[:, :2]
    rows, columns = np.nonzero(lit)
    # Whole pixels of the light end within a pixel of its projected corners.
    assert columns.min() == pytest.approx(xy[:, 0].min(), abs=1.5)
    assert columns.max() + 1 == pytest.approx(xy[:, 0].max(), abs=1.5)
    assert rows.min() == pytest.approx(xy[:, 1].min(), abs=1.5)
    assert rows.max() + 1 == pytest.approx(xy[:, 1].max(), abs=1.5)


def test_light_of_the_box_faces_down() -> None:
    light = load_scene("cornell_caustic").shapes[-1].geometry
    assert np.cross(light.edge_u, light.edge_v)[1] < 0


def test_red_wall_is_on_the_left_as_in_the_reference() -> None:
    scene, image = load_scene("cornell_diffuse"), reference("cornell_diffuse")
    for name, channel in (("red", 0), ("green", 1)):
        mesh = next(s.geometry for s in scene.shapes if scene.materials[s.material].name == name)
        x, y, _ = pixels("cornell_diffuse", [mesh.vertices.mean(axis=0)])[0]
        colour = image[int(y), int(x)]
        assert colour[channel] > 2 * np.delete(colour, channel).max()


def test_ring_stands_where_the_reference_shows_it() -> None:
    # The caustic's cusp lies inside the ring: the brightest pixels project into its foot circle.
    scene, image = load_scene("ring_caustic"), reference("ring_caustic")
    ring = scene.shapes[1].geometry
    angle = np.linspace(0, 2 * np.pi, 64)
    foot = np.stack([ring.radius * np.cos(angle), 0 * angle, ring.radius * np.sin(angle)], axis=1)
    xy = pixels("ring_caustic", foot)[:, :2]
    rows, columns = np.nonzero(image[..., 0] > 0.9 * image[..., 0].max())
    assert len(rows) > 0
    assert columns.min() >= xy[:, 0].min() - 1
    assert columns.max() <= xy[:, 0].max() + 1
    assert rows.max() <= xy[:, 1].max() + 1


def test_parameters_of_a_bundled_scene() -> None:
    scene = load_scene("cornell_caustic", {"res": "64"})
    assert (scene.width, scene.height) == (64, 64)


def test_description_of_a_bundled_scene() -> None:
    rows = describe(load_scene("cornell_caustic"))
    texts = dict(rows)
    assert texts["surfaces"] == "10 triangles in 3 meshes, 1 parallelogram, 2 spheres"
    assert texts["materials"] == "4 diffuse (white, green, red, black), 1 conductor (chrome), 1 dielectric (glass)"
    # π · 0.35² m² · (8, 6.5, 4) W/(m² sr)
    assert texts["light"] == "area light 'rectangle (line 25)', (3.079, 2.501, 1.539) W"
    assert texts["image"] == "256 × 256 pixels"
    assert "… 100 lights in all" in description_text(load_scene("rooms_10x10"))


def test_data_folder_prefers_the_installed_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "pmviewer"
    (tmp_path / "scenes").mkdir()
    (package / "_data").mkdir(parents=True)
    monkeypatch.setattr(resources, "PACKAGE", package)
    with pytest.raises(PmviewerError, match="install it again"):
        resources.data_folder("scenes")
    (tmp_path / "pyproject.toml").touch()
    assert resources.data_folder("scenes") == tmp_path / "scenes"
    (package / "_data" / "scenes").mkdir()
    assert resources.data_folder("scenes") == package / "_data" / "scenes"
