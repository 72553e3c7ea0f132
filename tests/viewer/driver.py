"""Runs a window on a session and drives it with the Dear ImGui test engine: real clicks, drags and keys."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import ImVec2, hello_imgui, imgui
from imgui_bundle import _patch_runners_add_save_screenshot_param as runners
from imgui_bundle.immapp import testing

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.session import Session
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer.app import ViewerApp
from pmviewer.viewer.dialogs.recent import RecentFiles
from pmviewer.viewer.random_user import ignore_broken_pipes

# Who opens a window is asked for the sake of imgui_bundle's tutorials: by all modules' sources, 25 ms a window.
runners._get_caller_filename = lambda depth: ""

Context = Any
Pixels = np.ndarray


def make_app(session: Any, folder: Path, **options: Any) -> ViewerApp:
    """A window that leaves the user's configuration alone."""
    app = ViewerApp(session, recent=RecentFiles(folder / "recent.txt"), remember=False, **options)
    app.params.app_window_params.window_geometry.size = (1120, 700)
    before = app.params.callbacks.pre_new_frame

    def pre_new_frame() -> None:
        ignore_broken_pipes()
        before()
        while _work:
            _work.pop(0)()
        if app.context is not None:
            app.context.screen.use()

    app.params.callbacks.pre_new_frame = pre_new_frame
    _draw_only_what_is_looked_at(app)
    return app


RASTERIZER_DISCARD = 0x8C89
"""OpenGL's number; moderngl has no name for it."""
_looking: list[Context] = []
"""Scripts that look at the whole window now."""


def _draw_only_what_is_looked_at(app: ViewerApp) -> None:
    """The interface is laid out and sent to OpenGL in each frame, but painted into the window only where somebody
    reads its pixels: on a software driver painting takes most of a frame. The picture in it is always painted."""
    callbacks = app.params.callbacks
    before_swap = callbacks.before_swap

    def begin() -> None:
        looked_at = _looking or app.commands.window_shot is not None
        if app.context is not None and not looked_at:
            app.context.enable_direct(RASTERIZER_DISCARD)

    def end() -> None:
        if app.context is not None:
            app.context.disable_direct(RASTERIZER_DISCARD)
        before_swap()

    callbacks.before_imgui_render, callbacks.before_swap = begin, end


@contextmanager
def app_on_engine(folder: Path, scene: str, values: Mapping[str, Any]) -> Iterator[ViewerApp]:
    """A window on the real engine, with a bundled scene opened by these settings. Nothing that no test clicks is
    compiled ahead."""
    session = Session(settings=with_values(Settings(), {"display.compile_ahead": False, **values}))
    app = make_app(session, folder, inactive_reason=inactive_reason)
    app.state.open(scene, keep_camera=True)
    yield app
    session.close()


def finished(app: ViewerApp) -> bool:
    """Whether the last pass that was asked for is shown."""
    return app.state.frame is not None and app.state.session.status.state == "finished"


_work: list[Callable[[], None]] = []


def on_window_thread(context: Context, function: Callable[[], Any]) -> Any:
    """The script runs on a thread of its own, without the OpenGL context: call this on the window's."""
    results: list[Any] = []
    _work.append(lambda: results.append(function()))
    while not results:
        context.yield_(1)
    return results[0]


def drive(app: ViewerApp, script: Callable[[Context], None]) -> None:
    """Open the window, run the script in it, close it. Errors of the script and of the test engine are raised."""

    def settled(context: Context) -> None:
        # Time goes by frames, or a busy machine makes two clicks of a double click.
        imgui.test_engine.get_io(hello_imgui.get_imgui_test_engine()).config_fixed_delta_time = 1 / 60
        context.yield_(4)
        script(context)

    testing.run(test_function=settled, runner_params=app.params, add_ons_params=app.add_ons)


def item(path: str) -> str:
    """The widget of a setting in the settings panel."""
    return f"//Settings/**/##{path}"


def overlay_item(name: str) -> str:
    return f"//Overlays/**/{name}"


def drag(context: Context, ref: str, start: float, end: float) -> None:
    """Press at a share of the item's width, move, release."""
    context.scroll_to_item_y(ref)
    box = context.item_info(ref).rect_full
    y = (box.min.y + box.max.y) / 2
    width = box.max.x - box.min.x
    context.mouse_move_to_pos(ImVec2(box.min.x + start * width, y))
    context.mouse_down(0)
    for step in np.linspace(start, end, 5)[1:]:
        context.mouse_move_to_pos(ImVec2(box.min.x + step * width, y))
        context.yield_(1)
    context.mouse_up(0)
    context.yield_(2)


def click_at_once(context: Context, position: ImVec2) -> None:
    """A click whose press comes in the frame in which the mouse gets there; the engine's own waits in between."""
    context.inputs.mouse_pos_value, context.inputs.mouse_buttons_value = position, 1
    context.yield_(1)
    context.inputs.mouse_buttons_value = 0
    context.yield_(3)


def drag_picture(context: Context, app: ViewerApp, dx: float, dy: float, button: int = 0) -> None:
    """Drag from the picture's middle by that many points."""
    x, y = app.viewport.origin
    w, h = app.viewport.size
    context.mouse_move_to_pos(ImVec2(x + w / 2, y + h / 2))
    context.mouse_down(button)
    context.mouse_move_to_pos(ImVec2(x + w / 2 + dx, y + h / 2 + dy))
    context.mouse_up(button)
    context.yield_(2)


def viewport_pixels(context: Context, app: ViewerApp) -> Pixels:
    """(h, w, 3) uint8 of what the viewport shows now, inside the picture's rectangle."""
    picture = app.viewport.picture
    assert picture is not None
    pixels = on_window_thread(context, lambda: picture.framebuffers.read("window"))
    left, top, width, height = app.viewport.target().picture
    return pixels[max(top, 0) : top + height, max(left, 0) : left + width]


def window_pixels(app: ViewerApp, context: Context, path: Path) -> Pixels:
    """(h, w, 3) uint8 of the whole window, through the test engine's screenshot."""
    from PIL import Image

    _looking.append(context)
    try:
        context.yield_(2)
        testing.capture(context, str(path))
    finally:
        _looking.pop()
    return np.asarray(Image.open(path).convert("RGB"))


def chord(key: int, modifier: int) -> int:
    """A key with a modifier, as a number: Python 3.11.2 (Debian 12) can't combine these enums."""
    return int(key) | int(modifier)


def wait_until(context, condition, seconds=480.0):
    """Let the window run until the condition holds. Kernels may have to be compiled first."""
    engine = imgui.test_engine.get_io(hello_imgui.get_imgui_test_engine())
    engine.config_watchdog_warning = engine.config_watchdog_kill_test = 1e6
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        context.yield_(1)
        time.sleep(0.05)  # leave the processor to the engine: each frame is drawn by software
