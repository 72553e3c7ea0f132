"""The tree that is built while a file's camera and light are looked for: used where it fits, dropped where not."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from pmviewer.bench.measures.load import bumpy_ball, write_stl
from pmviewer.engine.opened import Arrangement, OpenScene, open_scene
from pmviewer.errors import SceneError
from pmviewer.kernels.accel import bvh
from pmviewer.progress import Cancelled, beside, check, watched
from pmviewer.scene.arrays import tree_ahead
from pmviewer.scene.description import Mesh


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ahead") / "ball.stl"
    write_stl(path, *bumpy_ball(3000))
    return path


@pytest.fixture
def used(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Whether each tree that is built from now on was begun before. Few triangles are many."""
    found: list[bool] = []

    def build(*given: object, started: bvh.Begun | None = None) -> bvh.Bvh:
        found.append(started is not None)
        return bvh.build(*given, started=started)  # type: ignore[arg-type]

    monkeypatch.setattr("pmviewer.scene.arrays.flatten.build", build)
    monkeypatch.setattr(tree_ahead, "FEWEST", 1000)
    return found


def triangles_met(opened: OpenScene) -> list[int]:
    ids = opened.flat.bvh.blocks.view(np.int32)[:, 9]
    return sorted(ids[ids >= 0].tolist())


def test_a_file_without_a_camera_is_the_same_with_it(ball: Path, used: list[bool], monkeypatch) -> None:
    opened = open_scene(ball)
    assert used == [True]
    monkeypatch.setattr(tree_ahead, "FEWEST", 10**6)
    plain = open_scene(ball)
    assert used == [True, False]
    assert opened.scene.camera == plain.scene.camera
    assert opened.content is not None
    assert isinstance(mesh := opened.content.shapes[0].geometry, Mesh)
    assert opened.flat.n_triangles > len(mesh.faces)  # the studio's are there, too
    assert np.array_equal(opened.flat.arrays["vertices"], plain.flat.arrays["vertices"])
    assert triangles_met(opened) == triangles_met(plain)


def test_where_the_scene_becomes_another_its_tree_is_built_anew(ball: Path, tmp_path: Path, used: list[bool]) -> None:
    vertices, faces = bumpy_ball(3000)
    write_stl(tmp_path / "far.stl", vertices + np.float32(1000), faces)
    far = open_scene(tmp_path / "far.stl")
    assert used == [False]
    assert any("from the origin" in w for w in far.scene.warnings)
    open_scene(ball, arrangement=Arrangement(edits={"object.1.move": (0.0, 0.0, 0.5)}))
    assert used == [False, False]


def test_what_is_beside_stops_with_the_context(ball: Path, used: list[bool], monkeypatch) -> None:
    """An error of the completion is the user's, and the tree is given up before it comes."""
    running = threading.Event()

    def endless(*given: object) -> None:
        running.set()
        while True:
            check()

    def failing(*given: object) -> None:
        assert running.wait(10)
        raise SceneError("no camera")

    monkeypatch.setattr(tree_ahead, "begun", endless)
    monkeypatch.setattr("pmviewer.engine.opened.completed", failing)
    with pytest.raises(SceneError, match="no camera"):
        open_scene(ball)
    assert used == []


def test_beside_gives_the_result_or_the_error() -> None:
    with beside(lambda: threading.current_thread().name) as name:
        assert name() != threading.current_thread().name
    with beside(lambda: 1 // 0) as broken, pytest.raises(ZeroDivisionError):
        broken()


def test_beside_stops_when_the_work_around_it_is_unwanted() -> None:
    unwanted = threading.Event()

    def endless() -> None:
        while True:
            check()

    with watched(unwanted=unwanted.is_set), beside(endless) as never:
        unwanted.set()
        with pytest.raises(Cancelled):
            never()
