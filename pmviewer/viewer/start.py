"""From the command line to an open window: check the screen, open the window, start the engine behind it."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import glfw
import platformdirs

from pmviewer.errors import WindowError
from pmviewer.heap import importing, one_heap
from pmviewer.settings.access import Settings
from pmviewer.viewer.background import PATIENCE
from pmviewer.viewer.session_link import SessionLike, SessionLink

if TYPE_CHECKING:
    from pmviewer.viewer.app import ViewerApp

DEFAULT_SCENE = "cornell_caustic"


def check_screen() -> None:
    """Raises WindowError, saying what to do, when no window with OpenGL 3.3 can be opened."""
    failures: list[str] = []

    def note(code: int, text: str | bytes) -> None:
        failures.append(text if isinstance(text, str) else text.decode(errors="replace"))

    reporting: Any = glfw.set_error_callback(note)
    try:
        if not glfw.init():
            raise WindowError(
                "No window can be opened: there is no display"
                + (" (DISPLAY is not set)" if sys.platform.startswith("linux") else "")
                + ". Render to a file instead: pmviewer render SCENE -o picture.exr."
            )
        glfw.default_window_hints()
        glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, glfw.TRUE)
        window = glfw.create_window(64, 64, "pmviewer", None, None)
        if not window:
            reason = f" ({failures[-1]})" if failures else ""
            raise WindowError(
                f"This screen has no OpenGL 3.3{reason}. On Debian or Ubuntu install it with: apt-get install libgl1 "
                "libegl1. Without it, render to a file: pmviewer render SCENE -o picture.exr."
            )
        glfw.destroy_window(window)
    finally:
        glfw.default_window_hints()
        glfw.set_error_callback(reporting)


def _make_session(
    threads: int | None, settings: Settings | None, cluster: str | None, clicks: bool
) -> Callable[[], SessionLike]:
    def make() -> SessionLike:
        with importing(for_long=True):
            from pmviewer.engine.ahead.early import early_helper
            from pmviewer.kernels.compile import elsewhere

            helper = early_helper(threads)  # imports while this process does
            compiler = elsewhere.install()
            if helper is not None:  # a first start: there will be much to compile
                compiler.begin()
            from pmviewer.engine.session import Session
            from pmviewer.kernels.compile import placed

        placed.install()
        return Session(threads, settings, compiles_ahead=True, clicks=clicks, helper=helper, cluster=cluster)

    return make


def _inactive_reason(path: str, settings: Settings, traits: Any) -> str | None:
    """Asked of the engine once it is there; before, every setting looks active."""
    if traits is None:
        return None
    from pmviewer.engine.effects import inactive_reason

    return inactive_reason(path, settings, traits)


def autosaves() -> Path:
    """Where windows keep what a crash shall not lose."""
    return Path(platformdirs.user_state_dir("pmviewer")) / "autosave"


def start_viewer(
    make_app: Callable[..., ViewerApp],
    source: str | Path | None,
    settings: Settings | None,
    threads: int | None,
    parameters: Mapping[str, str] | None,
    *,
    snapshots: Sequence[tuple[int, Path]] = (),
    cluster: str | None = None,
    leave: bool = False,
    clicks: bool = True,
    chosen: bool = False,
) -> int:
    """See `pmviewer.viewer.app.run_viewer`. With `leave` the process ends here when the window has closed while the
    engine is busy: a kernel that is being compiled can't be interrupted, and there is nothing of it to keep. Such a
    window, the user's own, also keeps session and film on disk for the case of a crash. Without `clicks` nobody will
    click, and nothing is compiled for it."""
    one_heap()
    check_screen()
    link = SessionLink(_make_session(threads, settings, cluster, clicks), settings)
    app = make_app(link, inactive_reason=_inactive_reason, autosaves=autosaves() if leave else None)
    background = app.state.background
    app.state.automatic.at_start = leave
    app.state.open(
        source if source is not None else DEFAULT_SCENE, keep_camera=True, parameters=parameters, chosen=chosen
    )
    if snapshots:
        app.state.snapshots.open([path for _, path in snapshots], [number for number, _ in snapshots])
    app.params.callbacks.enqueue_post_init(lambda: link.connect(background))
    try:
        app.run()
    except BaseException:
        link.close()
        raise
    for text in app.state.unread_errors():
        print(f"pmviewer: {text}", file=sys.stderr)
    if not leave:
        link.close()
    elif not _closed_soon(link) or background.running():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)
    return 0


def _closed_soon(link: SessionLink) -> bool:
    """Close the session, and tell whether that was a matter of moments."""
    closing = threading.Thread(target=link.close, name="pmviewer closing", daemon=True)
    closing.start()
    closing.join(PATIENCE)
    return not closing.is_alive()
