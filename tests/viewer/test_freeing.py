"""OpenGL objects live as long as they are used: counted by OpenGL itself."""

from __future__ import annotations

import ctypes
import gc
import signal
import threading

import glfw
import moderngl
import pytest

from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer.gl import program
from tests.viewer.driver import drive, make_app, on_window_thread
from tests.viewer.fake_session import FakeSession

KINDS = ("Buffer", "Texture", "VertexArray", "Framebuffer", "Renderbuffer", "Program")
NAMES = range(1, 4096)
SCREEN = 0
"""The window's own framebuffer."""
CLASSES = (moderngl.Buffer, moderngl.Texture, moderngl.VertexArray, moderngl.Framebuffer, moderngl.Renderbuffer)


def is_there(kind: str):
    address = glfw.get_proc_address(f"glIs{kind}")
    return ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(ctypes.cast(address, ctypes.c_void_p).value)


def live() -> dict[str, int]:
    """How many objects of each kind there are. On the window's thread."""
    return {kind: sum(map(is_there(kind), NAMES)) for kind in KINDS}


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = {"overlays.caustic.show": True, "overlays.global.show": True, "free_camera.on": True}
    session = FakeSession(with_values(Settings(), shown))
    session.open("box")
    return make_app(session, tmp_path)


def test_scene_changes_leave_nothing_behind(app, tmp_path):
    """Ten scenes, pictures exported and screenshots taken between: as many objects after each."""
    counts, hidden = [], []

    def script(c):
        for number in range(10):
            app.state.session.open(f"scene{number}")
            app.state.change({"free_camera.on": True, "display.view": ("beauty", "depth")[number % 2]})
            c.yield_(4)
            on_window_thread(c, lambda: app.viewport.capture(overlays=True))
            app.commands.window_shot = tmp_path / "window.png"
            c.yield_(4)
            counts.append(on_window_thread(c, live))
        names = ("overlays.caustic.show", "overlays.global.show", "free_camera.on")
        app.state.change(dict.fromkeys(names, False))
        c.yield_(4)
        hidden.append(on_window_thread(c, live))

    drive(app, script)
    assert counts == [counts[0]] * 10
    assert counts[0]["VertexArray"] - hidden[0]["VertexArray"] == 3, "two clouds and the frustum are freed"
    assert counts[0]["Buffer"] - hidden[0]["Buffer"] == 3
    assert counts[0]["Program"] - hidden[0]["Program"] == 2, "the clouds' and the frustum's"


def test_programs_are_compiled_when_an_overlay_is_shown_and_not_for_its_frames(app, monkeypatch):
    compiled, rests = [], []
    load, rest = program.load_program, program._release_compiler
    monkeypatch.setattr(program, "load_program", lambda context, name: compiled.append(name) or load(context, name))
    monkeypatch.setattr(program, "_release_compiler", lambda: rests.append(len(compiled)) or rest())
    seen = {}

    def script(c):
        for _ in range(5):
            app.state.session.publish()
            c.yield_(2)
        seen["shown"] = list(compiled)
        app.state.change({"overlays.caustic.show": False})
        c.yield_(3)
        app.state.change({"overlays.global.show": False})  # the last one
        c.yield_(3)
        app.state.change({"overlays.caustic.show": True})
        c.yield_(3)
        seen["again"] = list(compiled)

    drive(app, script)
    assert sorted(seen["shown"]) == ["frustum", "geometry", "picture", "points"]
    assert seen["again"] == [*seen["shown"], "points"]
    assert rests[-1] == len(compiled), "what the compiler holds goes after the last one"
    assert len(rests) < len(compiled), "and not after each"


def test_what_the_collector_finds_on_another_thread_is_freed_on_the_windows(app):
    seen = {}

    def script(c):
        buffers = [on_window_thread(c, lambda: app.context.buffer(b"dropped without release"))]
        seen["before"] = on_window_thread(c, live)["Buffer"]

        def drop():
            buffers.clear()
            gc.collect()

        other = threading.Thread(target=drop)
        other.start()
        other.join()
        c.yield_(3)
        seen["after"] = on_window_thread(c, live)["Buffer"]

    drive(app, script)
    assert seen["after"] == seen["before"] - 1


def test_everything_is_freed_before_the_window_closes(app):
    alive, context = [], []  # windows of other tests may wait for the collector

    def script(c):
        context.append(app.context)
        alive.append(len(living()))

    def living():
        # By the type: isinstance asks a weak proxy for what it stood for, which may be gone.
        made = [o for o in gc.get_objects() if issubclass(type(o), CLASSES) and o.ctx is context[0] and o.glo != SCREEN]
        return [o for o in made if not isinstance(o.mglo, moderngl.InvalidObject)]

    before = app.params.callbacks.before_exit
    names = {}

    def before_exit():
        names["before"] = live()
        before()
        alive.append(len(living()))
        names["after"] = live()

    app.params.callbacks.before_exit = before_exit
    drive(app, script)
    assert alive[0] > 8
    assert alive[1] == 0
    assert names["before"]["VertexArray"] - names["after"]["VertexArray"] >= 4, "OpenGL agrees"


def test_a_broken_pipe_is_no_crash_after_the_test_engine(app):
    drive(app, lambda c: c.yield_(1))
    with open("/proc/self/status", encoding="ascii") as status:
        ignored = next(int(line.split()[1], 16) for line in status if line.startswith("SigIgn"))
    assert ignored & 1 << (signal.SIGPIPE - 1), "a closed connection would end the tests of this process"
