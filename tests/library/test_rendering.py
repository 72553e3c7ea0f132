"""The renderer as a library: what is kept, what begins anew, what comes out."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest

import pmviewer
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import OutputError, PictureWarning, PmviewerError, SceneError, SettingError, WindowError
from pmviewer.output.exr import read_exr
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import cornell_box, diffuse_box

SMALL = {"N": 3000, "radius": 0.05}


@pytest.fixture
def box():
    with pmviewer.open(diffuse_box(size=16), SMALL, threads=2) as s:
        yield s


def test_importing_pmviewer_loads_nothing():
    code = (
        "import sys, pmviewer; print([m for m in sys.modules if m.startswith('pmviewer.') or m in ('numba', 'numpy')])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found == "['pmviewer.version']\n"


def test_the_picture_is_that_of_the_engine(box):
    pool = WorkPool(1)
    settings = with_values(Settings(), {"photons.N": 3000, "estimate.radius": 0.05})
    renderer = Renderer(open_scene(diffuse_box(size=16)), settings, pool, StageStore(0))
    for _ in range(2):
        renderer.step()
    pool.close()
    frame = box.render(passes=2)
    assert np.array_equal(frame.beauty, renderer.frame(0).beauty)
    assert frame.statistics.emitted == 6000
    assert (frame.passes, box.passes) == (2, 2)


def test_rendering_goes_on_where_it_was(box):
    first = box.render(passes=2)
    kept = first.beauty.copy()
    second = box.render(passes=1)
    assert second.passes == 3
    assert np.array_equal(first.beauty, kept)
    with pmviewer.open(diffuse_box(size=16), SMALL, threads=1) as other:
        assert np.array_equal(other.render(passes=3).beauty, second.beauty)


def test_only_what_changed_begins_anew(box):
    before = box.render(passes=1)
    box.set(tone="linear", N=3000)
    assert box.passes == 1
    assert box.frame().settings.display.tone == "linear"
    box.set(fov=60)
    assert box.passes == 0
    after = box.render(passes=1)
    assert not np.array_equal(before.beauty, after.beauty)
    clouds = [frame.frame.clouds["global"].photons for frame in (before, after)]
    assert np.shares_memory(*clouds), "another camera keeps the photons"
    box.set(N=4000)
    assert box.passes == 0
    assert box.render(passes=1).statistics.emitted == 4000


def test_rendering_stops_by_time_and_by_the_settings(box):
    assert box.render(seconds=1e-6).passes == 1
    box.set(passes=3)
    assert box.render().passes == 3
    assert box.render().passes == 3
    assert box.render(passes=5, seconds=1e-6).passes == 4
    box.set(time_limit=1e-6)
    assert box.render().passes == 4


@pytest.mark.parametrize(
    "asked", [{"passes": 0}, {"passes": 1.5}, {"passes": True}, {"passes": "2"}, {"seconds": 0}, {"seconds": "1"}]
)
def test_impossible_numbers_of_passes_are_refused(box, asked):
    with pytest.raises(SettingError, match="expected a"):
        box.render(**asked)


def test_progress_is_told_and_may_end_the_rendering(box):
    heard = []

    def tell(text, share):
        heard.append((text, share))
        if text == "pass 2":
            raise KeyError("enough")

    with pytest.raises(KeyError):
        box.render(passes=4, progress=tell)
    assert heard[-2:] == [("pass 1", 0.0), ("pass 2", 0.25)]
    assert box.frame().passes == 1
    with pytest.raises(PmviewerError, match="at work"):
        box.render(passes=1, progress=lambda text, share: box.set(N=10))


@pytest.fixture
def interruptible():
    """Background processes of a shell ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_waits_for_the_pass_and_loses_nothing(box):
    def press(text, share):
        if text == "pass 2":
            signal.raise_signal(signal.SIGINT)

    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        box.render(passes=4, progress=press)
    assert signal.getsignal(signal.SIGINT) is handler
    assert box.frame().passes == 2
    with pmviewer.open(diffuse_box(size=16), SMALL, threads=1) as other:
        assert np.array_equal(other.render(passes=3).beauty, box.render(passes=1).beauty)


@pytest.mark.usefixtures("interruptible")
def test_a_second_interrupt_does_not_wait_and_the_film_begins_anew(box, monkeypatch):
    eye_pass = Renderer._eye_pass

    def twice(self, given, film):
        if film.passes:
            film.sums += 1e9
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
        eye_pass(self, given, film)

    with monkeypatch.context() as patch:
        patch.setattr(Renderer, "_eye_pass", twice)
        with pytest.raises(KeyboardInterrupt):
            box.render(passes=3)
    assert box.passes == 0
    with pytest.raises(SettingError, match="Nothing has been rendered"):
        box.frame()
    with pmviewer.open(diffuse_box(size=16), SMALL, threads=1) as other:
        assert np.array_equal(other.render(passes=1).beauty, box.render(passes=1).beauty)


def test_too_little_memory_is_one_sentence(box, monkeypatch):
    def full(self):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(Renderer, "step", full)
        with pytest.raises(SettingError, match="Not enough memory"):
            box.render(passes=1)
    assert box.render(passes=1).passes == 1


def test_closing_ends_the_threads_and_frames_stay():
    def threads():
        return [t for t in threading.enumerate() if t.name.startswith("pmviewer_")]

    before = len(threads())
    with pmviewer.open(diffuse_box(size=16), SMALL, threads=3) as s:
        frame = s.render(passes=1)
        assert len(threads()) > before
    assert len(threads()) == before
    s.close()
    assert frame.beauty.mean() > 0
    for use in (lambda: s.render(passes=1), lambda: s.set(N=1), lambda: frame.view("photon count")):
        with pytest.raises(PmviewerError, match="was closed"):
            use()


def test_what_the_picture_does_not_show_is_a_warning_once(tmp_path):
    file = tmp_path / "box.xml"
    file.write_text(
        '<scene version="3.0.0"><shape type="sphere"/><shape type="unheard"/><emitter type="constant"/></scene>'
    )
    with pytest.warns(PictureWarning) as said:
        pmviewer.open(file, threads=1).close()  # one thread compiles nothing beside
    assert sum("unheard" in str(warning.message) for warning in said) == 1
    assert {warning.filename for warning in said} == {__file__}


def test_bad_scenes_and_folders_are_one_error(tmp_path):
    with pytest.raises(SceneError, match="no such file"):
        pmviewer.open(tmp_path / "nothing.xml")
    with pytest.raises(SceneError, match="search path"):
        pmviewer.open("cornell_diffuse", search_paths=[tmp_path / "nowhere"])
    with pytest.raises(SettingError, match="threads = 0"):
        pmviewer.open("cornell_diffuse", threads=0)


@pytest.mark.filterwarnings("ignore::pmviewer.errors.PictureWarning")
def test_parameters_and_search_paths_reach_the_scene(tmp_path):
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    (meshes / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    file = tmp_path / "scene.xml"
    file.write_text(
        '<scene version="3.0.0"><default name="res" value="32"/><sensor type="perspective"><film type="hdrfilm">'
        '<integer name="width" value="$res"/><integer name="height" value="$res"/></film></sensor>'
        '<shape type="obj"><string name="filename" value="t.obj"/></shape><emitter type="constant"/></scene>'
    )
    with pmviewer.open(file, parameters={"res": 12}, search_paths=[str(meshes)], threads=1) as s:
        assert (s.scene.width, s.scene.height) == (12, 12)
        assert len(s.scene.shapes) == 1


def test_another_light_rig_lights_the_same_scene_anew():
    with pmviewer.open("cornell_diffuse", {"width": 8, "height": 8, "N": 1000}, threads=2) as s:
        lit = s.render(passes=1)
        lamp = [shape for shape in s.scene.shapes if shape.radiance is not None]
        s.set(rig="headlight")
        assert s.passes == 0
        assert lamp
        assert len(s.scene.lights) == 1
        assert s.scene.lights[0].position == pytest.approx(s.scene.camera.origin, abs=1)
        assert not np.array_equal(lit.beauty, s.render(passes=1).beauty)


def test_a_saved_session_opens_to_the_same_picture(tmp_path):
    size = {"width": 24, "height": 24}
    with pmviewer.open("cornell_diffuse", {"N": 2000, "display.exposure": 1.5, **size}) as s:
        frame = s.render(passes=2)
    frame.save(tmp_path / "box.toml")
    with pmviewer.open(tmp_path / "box.toml") as s:
        assert s.changed == {
            "photons.N": 2000, "display.exposure": 1.5, "render.passes": 2, "camera.width": 24, "camera.height": 24
        }  # fmt: skip
        again = s.render()
    assert again.passes == 2
    assert np.array_equal(again.beauty, frame.beauty)
    with pmviewer.open(diffuse_box(size=8), SMALL) as s, pytest.raises(OutputError, match="made in Python"):
        s.render(passes=1).save(tmp_path / "other.toml")


@pytest.mark.usefixtures("every_path_may_split")
def test_frames_are_written_with_all_layers(box, tmp_path):
    frame = box.render(passes=1)
    frame.save(tmp_path / "box.exr")
    layers, about = read_exr(tmp_path / "box.exr")
    assert np.array_equal(layers["indirect"], frame.indirect)
    assert about["photons.N"] == 3000
    frame.save(tmp_path / "box.png", view="photon count")
    assert (tmp_path / "box.png").read_bytes()[1:4] == b"PNG"
    with pytest.raises(OutputError, match="unknown format"):
        frame.save(tmp_path / "box.jpg")
    box.set({"display.view": "geometry"})
    with pytest.raises(OutputError, match="drawn by the window alone"):
        box.frame().save(tmp_path / "box.png")
    for name, asked in (("a.exr", {"view": "geometry"}), ("a.toml", {"view": "beauty"}), ("a.png", {"half": True})):
        with pytest.raises(SettingError):
            frame.save(tmp_path / name, **asked)
        assert not (tmp_path / name).exists()


def test_the_window_opens_on_the_same_scene_and_settings(monkeypatch):
    given = {}

    def start(make, source, settings, threads, parameters):
        make("session")
        changed = with_values(settings, {"photons.N": 9})  # by the user, in the window
        window.state.settings = changed
        given.update(source=source, N=settings.photons.N, threads=threads, parameters=dict(parameters))
        return 0

    with pmviewer.open("cornell_diffuse", parameters={"res": 32}, threads=2) as s:
        s.set(N=7)
        # the viewer's modules need its libraries, which this test does not
        window = SimpleNamespace(state=SimpleNamespace(settings=None))
        monkeypatch.setitem(sys.modules, "pmviewer.viewer.app", SimpleNamespace(ViewerApp=lambda session: window))
        monkeypatch.setitem(sys.modules, "pmviewer.viewer.start", SimpleNamespace(start_viewer=start))
        assert s.show() == {"photons.N": 9}
        assert s.get("N") == 7, "what was changed in the window is returned, and not changed here"
        assert given == {"source": "cornell_diffuse", "N": 7, "threads": 2, "parameters": {"res": "32"}}

        def no_display(*arguments):
            raise WindowError("No window can be opened.")

        monkeypatch.setattr(sys.modules["pmviewer.viewer.start"], "start_viewer", no_display)
        with pytest.raises(WindowError):
            s.show()
        assert s.get("N") == 7
    with pmviewer.open(cornell_box(size=8)) as s, pytest.raises(SceneError, match="made in Python"):
        s.show()


def test_choosing_sets_what_it_says_and_refuses_what_is_no_time():
    with pmviewer.open(diffuse_box(), {"camera.width": 16, "camera.height": 16}) as s:
        said = s.choose(seconds=0.01)
        assert s.get("gather.cache") == "on"
        assert "too few for a trial" in said[0]
        with pytest.raises(SettingError, match="above 0"):
            s.choose(error=-1)


def test_a_checkpoint_goes_on_elsewhere(box, tmp_path):
    """A scene that was made in Python is known by its content, too."""
    file = tmp_path / "box.checkpoint"
    with pytest.raises(SettingError, match="Nothing has been rendered"):
        box.save(file)
    box.render(passes=2)
    box.save(file)
    whole = box.render(passes=2)
    with pmviewer.open(diffuse_box(size=16), SMALL, threads=1) as other:
        other.resume(file)
        assert other.passes == 2
        assert np.array_equal(other.render(passes=2).beauty, whole.beauty)
        assert other.frame().statistics.emitted == whole.statistics.emitted
        other.set(radius=0.06)
        other.render(passes=1)
        with pytest.raises(SceneError, match=r"estimate\.radius was 0\.05 and is 0\.06"):
            other.resume(file)
        assert other.passes == 1
    with pmviewer.open(cornell_box(size=16), SMALL) as stranger, pytest.raises(SceneError, match="other shapes"):
        stranger.resume(file)
