"""A user who does anything: real keys, clicks, drags and wheels in the window, and every setting, at random.

`python -m pmviewer.viewer.random_user SCENE SEED ACTIONS` opens the window, lets the user loose and prints one JSON
object. Every `ROUND` actions everything is undone: settings and picture must then be those of the beginning, bit for
bit, and memory what it was.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from imgui_bundle import ImVec2, hello_imgui, imgui
from imgui_bundle.immapp import testing

from pmviewer.heap import give_back, one_heap
from pmviewer.kernels.compile.jit import loaded
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, get, with_values
from pmviewer.settings.edits import PROPERTIES
from pmviewer.settings.presets import PRESETS
from pmviewer.viewer.shortcuts import BINDINGS

if TYPE_CHECKING:
    from pmviewer.viewer.app import ViewerApp

ROUND = 100
PATIENCE = 300.0
"""Seconds for a picture to be finished, compiling included."""
START: dict[str, Any] = {"camera.width": 96, "camera.height": 72, "photons.N": 5000, "render.passes": 2}
MOST: Mapping[str, float] = {
    "photons.N": 30_000, "camera.width": 200, "camera.height": 150, "render.passes": 6, "importance.N": 5000,
    "importance.tests": 2000, "estimate.k": 200, "gather.rays": 8, "gather.cache_samples": 32, "direct.samples": 8,
    "direct.con_samples": 8, "direct.noncon_samples": 8, "direct.shadow_N": 5000, "render.outline_rays": 16,
    "render.max_depth": 60, "virtual.number": 500, "virtual.per_pixel": 100, "virtual.photons": 5000,
    "virtual.walks": 8, "virtual.gather_rays": 16, "compare.passes": 4,
}  # fmt: skip
"""Upper ends where higher ones take only time, and memory that is asked for."""
LEFT_ALONE = (
    "quit",
    "save_session",
    "export_exr",
    "export_png",
    "screenshot",
    "screenshot_picture",
    "choose_automatically",
)
"""Actions that end the program, write files without end, or compile ways of rendering that nobody looks at."""
_WEIGHTS = {
    "setting": 30, "key": 20, "orbit": 12, "click": 12, "wheel": 6, "edit": 6, "undo": 8, "preset": 2, "shift click": 4,
}  # fmt: skip


@dataclass
class Report:
    """What became of it. `resident` is memory in MiB after each round, at rest, without what the session keeps for a
    return to settings of before, which has its own limit; `kernels` how many are loaded; `wrong` has
    sentences."""

    actions: int = 0
    rounds: int = 0
    resident: list[float] = field(default_factory=list)
    kernels: list[int] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    frames: int = 0
    seconds: float = 0.0


class RandomUser:
    """At the window `app`, by the numbers of `seed`."""

    def __init__(self, app: ViewerApp, seed: int) -> None:
        self.app, self.report = app, Report()
        self._rng = random.Random(seed)
        self._start: tuple[Settings, Any] | None = None
        self._acts: dict[str, Callable[[Any], None]] = {
            "setting": self._setting,
            "key": self._key,
            "orbit": self._drag,
            "click": self._click,
            "wheel": self._wheel,
            "edit": self._edit,
            "undo": self._undo,
            "preset": self._preset,
            "shift click": self._shift_click,
        }

    def run(self, context: Any, actions: int) -> None:
        """Do so many things; look after each round whether all is well."""
        engine = imgui.test_engine.get_io(hello_imgui.get_imgui_test_engine())
        engine.config_watchdog_warning = engine.config_watchdog_kill_test = 1e6
        began = time.monotonic()
        self._settle(context)
        self._start = self.app.state.settings, self._picture()
        for number in range(1, actions + 1):
            name = self._rng.choices(list(_WEIGHTS), list(_WEIGHTS.values()))[0]
            self.report.counts[name] = self.report.counts.get(name, 0) + 1
            self._acts[name](context)
            context.yield_(self._rng.choice((1, 1, 1, 2, 4, 10)))
            self.report.actions += 1
            self._look(name)
            if number % ROUND == 0 or number == actions:
                self._round(context)
        self.report.seconds = time.monotonic() - began

    # what a user does -------------------------------------------------------------------------------------------

    def _setting(self, context: Any) -> None:
        paths = self._rng.sample(sorted(SETTINGS), self._rng.choice((1, 1, 1, 2)))
        values = {p: random_value(SETTINGS[p], self._rng) for p in paths if SETTINGS[p].scale != "edits"}
        self.app.state.history.gesture += 1
        self.app.state.change(values)

    def _key(self, context: Any) -> None:
        bindings = [b for b in BINDINGS if b.key is not None and b.action not in LEFT_ALONE]
        binding = self._rng.choice(bindings)
        chord = int(binding.key)  # type: ignore[arg-type]
        chord |= int(imgui.Key.mod_ctrl) if binding.ctrl else 0
        chord |= int(imgui.Key.mod_shift) if binding.shift else 0
        context.key_press(chord)
        context.yield_(2)
        self._close_dialogs(context)

    def _drag(self, context: Any) -> None:
        context.mouse_move_to_pos(self._place_in_picture())
        button = self._rng.choice((0, 0, 1, 2))
        context.mouse_down(button)
        for _ in range(self._rng.randint(1, 4)):
            context.mouse_move_to_pos(self._place_in_picture())
            context.yield_(self._rng.randint(1, 3))
        context.mouse_up(button)

    def _click(self, context: Any) -> None:
        """Anywhere below the menus: panels, toolbar, picture."""
        area, em = imgui.get_main_viewport(), imgui.get_font_size()
        x, y = self._rng.uniform(0, area.size.x), self._rng.uniform(5.5 * em, area.size.y - 2.5 * em)
        context.mouse_move_to_pos(ImVec2(area.pos.x + x, area.pos.y + y))
        context.mouse_click(self._rng.choice((0, 0, 0, 1)))
        context.yield_(2)
        self._close_dialogs(context)

    def _shift_click(self, context: Any) -> None:
        context.mouse_move_to_pos(self._place_in_picture())
        context.key_down(imgui.Key.mod_shift)
        context.yield_(1)
        context.mouse_click(0)
        context.key_up(imgui.Key.mod_shift)

    def _wheel(self, context: Any) -> None:
        context.mouse_move_to_pos(self._place_in_picture())
        context.mouse_wheel_y(self._rng.choice((-2.0, -1.0, 1.0, 2.0)))

    def _edit(self, context: Any) -> None:
        editing = self.app.state.editing
        if editing.catalogue is None:
            return
        targets = [t for kind in editing.catalogue.targets.values() for t in kind]
        target = self._rng.choice(targets)
        prop = self._rng.choice(list(PROPERTIES[target.kind]))
        if editing.refusal(target, prop) is not None:
            return
        what = PROPERTIES[target.kind][prop]
        low, high = max(what.low, -0.2), min(what.high, 2.0)
        self.app.state.history.gesture += 1
        editing.set(target, {prop: tuple(self._rng.uniform(low, high) for _ in range(what.count))})

    def _undo(self, context: Any) -> None:
        for _ in range(self._rng.randint(1, 4)):
            self._rng.choice((self.app.state.undo, self.app.state.undo, self.app.state.redo))()

    def _preset(self, context: Any) -> None:
        self.app.state.history.gesture += 1
        values = {path: _bounded(path, value) for path, value in self._rng.choice(PRESETS).assignments().items()}
        self.app.state.change(values)

    # whether all is well ----------------------------------------------------------------------------------------

    def _look(self, did: str) -> None:
        """Errors that the log has got."""
        for message in list(self.app.state.log):
            if message.level == "error":
                self.report.wrong.append(f"after {did}, action {self.report.actions}: {message.text}")
        self.app.state.log.clear()

    def _round(self, context: Any) -> None:
        """Undo everything; settings, picture and memory are what they were."""
        state = self.app.state
        assert self._start is not None
        self._close_dialogs(context)
        state.flying = state.help_open = False
        if state.panels_hidden:
            self.app.commands.table["toggle_panels"]()
        state.film.stop()
        state.inspector.unpin()
        state.editing.choose(None)
        while state.history.done:
            state.undo()
        self._settle(context)
        settings, picture = self._start
        if state.frame is not None and state.frame.statistics.passes > settings.render.passes:
            state.session.restart()  # fewer passes asked for leave the finer picture as it is
            context.yield_(2)
            self._settle(context)
        self._look("undoing all")
        where = f"after {self.report.actions} actions"
        if state.settings != settings:
            differing = [p for p in SETTINGS if get(state.settings, p) != get(settings, p)]
            self.report.wrong.append(f"{where} and undoing all, settings differ: {', '.join(differing)}")
        elif not np.array_equal(self._picture(), picture):
            self.report.wrong.append(f"{where} and undoing all, the picture is another one")
        self.report.rounds += 1
        give_back()
        kept: int = self.app.state.session.kept_bytes  # type: ignore[attr-defined]
        self.report.resident.append(resident() - kept / 2**20)
        self.report.kernels.append(loaded())

    def _settle(self, context: Any) -> None:
        """Wait until the picture of the newest settings is finished and shown."""
        state, end = self.app.state, time.monotonic() + PATIENCE
        if state.session.paused:
            state.session.resume()
        still = 0
        while still < 5:
            frame = state.frame
            done = state.session.status.state == "finished" and state.session.is_newest
            done = done and frame is not None and not frame.coarse
            still = still + 1 if done else 0
            if time.monotonic() > end:
                what = state.session.status
                self.report.wrong.append(f"after {self.report.actions} actions nothing is finished: {what}")
                return
            context.yield_(1)
            time.sleep(0.01)

    def _picture(self) -> Any:
        frame = self.app.state.frame
        return None if frame is None else frame.image().copy()

    def _close_dialogs(self, context: Any) -> None:
        """Leave file dialogs and pop-ups by Escape."""
        for _ in range(5):
            popup = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
            if not (self.app.dialogs.is_open or self.app.commands.palette.is_open or popup):
                return
            context.key_press(imgui.Key.escape)
            context.yield_(2)

    def _place_in_picture(self) -> ImVec2:
        (x, y), (width, height) = self.app.viewport.origin, self.app.viewport.size
        return ImVec2(x + self._rng.uniform(0.02, 0.98) * width, y + self._rng.uniform(0.02, 0.98) * height)


def random_value(info: SettingInfo, rng: random.Random) -> Any:
    """Anything that the setting accepts, up to MOST."""
    if info.auto and rng.random() < 0.3:
        return "auto"
    if info.scale == "switch":
        return rng.random() < 0.5
    if info.choices:
        return rng.choice(info.choices)
    if info.scale == "vector":
        return tuple(rng.uniform(-1, 1) for _ in range(3))
    if info.scale == "name":
        return "auto"
    assert info.lower is not None
    assert info.upper is not None
    low, high = float(info.lower), min(float(info.upper), MOST.get(info.path, np.inf))
    value = low * (high / low) ** rng.random() if info.scale == "log" and low > 0 else rng.uniform(low, high)
    return min(max(info.kind(round(value) if info.kind is int else value), info.kind(low)), info.kind(high))


def _bounded(path: str, value: Any) -> Any:
    return min(value, type(value)(MOST[path])) if path in MOST and not isinstance(value, str) else value


def resident() -> float:
    """Memory of this process in MiB."""
    with open("/proc/self/statm", encoding="ascii") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def ignore_broken_pipes() -> None:
    """As Python does. The test engine takes the signal for a crash, and itself crashes in telling of it once the window
    is closed. On the main thread, while a window with a test engine is open."""
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


@contextmanager
def window(scene: str, folder: Path) -> Iterator[ViewerApp]:
    """A window on the engine with that scene, small, which leaves the user's configuration alone."""
    from pmviewer.engine.effects import inactive_reason
    from pmviewer.engine.session import Session
    from pmviewer.kernels.compile import elsewhere, placed
    from pmviewer.viewer.app import ViewerApp
    from pmviewer.viewer.dialogs.recent import RecentFiles

    one_heap()  # as the window has all three
    elsewhere.install()
    placed.install()
    session = Session(settings=with_values(Settings(), START))
    recent = RecentFiles(folder / "recent.txt")
    app = ViewerApp(session, recent=recent, remember=False, inactive_reason=inactive_reason)
    before = app.params.callbacks.pre_new_frame

    def pre_new_frame() -> None:
        ignore_broken_pipes()
        before()

    app.params.callbacks.pre_new_frame = pre_new_frame
    app.state.open(scene, keep_camera=True)
    try:
        yield app
    finally:
        session.close()
        elsewhere.uninstall()


def let_loose(scene: str, seed: int, actions: int, folder: Path) -> Report:
    """Open the window, do so many things, close it."""
    with window(scene, folder) as app:
        user = RandomUser(app, seed)

        def script(context: Any) -> None:
            context.yield_(4)
            user.run(context, actions)
            user.report.frames = app.state.frame.serial if app.state.frame is not None else 0

        testing.run(test_function=script, runner_params=app.params, add_ons_params=app.add_ons)
    return user.report


def main(arguments: list[str]) -> int:
    """`SCENE SEED ACTIONS`"""
    scene, seed, actions = arguments[0], int(arguments[1]), int(arguments[2])
    with tempfile.TemporaryDirectory(prefix="pmviewer-user-") as folder:
        os.chdir(folder)
        report = let_loose(scene, seed, actions, Path(folder))
        os.chdir("/")
    print(json.dumps(report.__dict__))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
