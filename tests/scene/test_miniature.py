"""The stand-in of a scene is small, and kernels are compiled for it as for the scene."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import ImageEnvironment, Instance, Mesh, Scene, Shape
from pmviewer.scene.load import bundled_scenes, load_scene
from pmviewer.scene.miniature import ALIKE, FACES, miniature
from pmviewer.scene.texture import Bitmap
from tests.support.scenes import ball_mesh, box_camera, box_walls, cube_mesh, diffuse, panel


def same_kernels(scene: Scene) -> Scene:
    """The stand-in, once it is shown that it compiles the same."""
    small = miniature(scene)
    assert open_scene(small).flat.record.dtype == open_scene(scene).flat.record.dtype
    few, all_ = analyse(small), analyse(scene)
    assert few.many_lights == all_.many_lights
    assert replace(few, n_lights=0) == replace(all_, n_lights=0)
    return small


@pytest.mark.parametrize("name", [scene.name for scene in bundled_scenes()])
def test_the_stand_in_of_a_bundled_scene_compiles_the_same(name):
    small = same_kernels(load_scene(name))
    assert len(pickle.dumps(small)) < 100_000


def test_a_large_scene_becomes_a_small_one():
    ball = replace(ball_mesh(), normals=np.tile([0.0, 0.0, 1.0], (len(ball_mesh().vertices), 1)))
    picture = np.random.default_rng(1).random((300, 200, 3)).astype(np.float32)
    material = replace(diffuse("pictured"), textures={"reflectance": Bitmap(picture)})
    shapes = (
        *box_walls(),
        *(Shape(f"ball {i}", ball, 1) for i in range(20)),
        *(Shape(f"cube {i}", cube_mesh(half=0.1 + 0.01 * i), 1) for i in range(20)),
        panel(),
        panel(y=0.8),
        panel(y=0.7),
    )
    sky = ImageEnvironment("sky", picture, np.eye(3))
    scene = Scene("many", None, shapes, (diffuse(), material), (sky,), box_camera(), 64, 64)
    small = same_kernels(scene)
    meshes = [s.geometry for s in small.shapes if isinstance(s.geometry, Mesh)]
    assert len(meshes) == 2 * ALIKE
    assert all(len(mesh.faces) <= FACES for mesh in meshes)
    assert small.shapes[-1].radiance == scene.shapes[-1].radiance
    assert len(pickle.dumps(small)) < 20_000


def test_instances_keep_their_groups():
    from pmviewer.scene.description import Group

    group = Group("balls", (Shape("ball", ball_mesh(0.1), 0),))
    places = [np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]) for x in np.linspace(-0.5, 0.5, 9)]
    instances = tuple(Instance(f"copy {i}", group, place) for i, place in enumerate(places))
    scene = Scene("copies", None, (*box_walls(), panel()), (diffuse(),), (), box_camera(), 64, 64, instances=instances)
    small = same_kernels(scene)
    assert len(small.instances) == ALIKE
    assert len(small.groups) == 1
