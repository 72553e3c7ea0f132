"""The dialog "Export at another size": width, passes, legend, file."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from pmviewer.errors import PmviewerError
from pmviewer.output.diagnostic_views import DIAGNOSTICS, HELD_WHILE_SHOWN
from pmviewer.viewer import theme
from pmviewer.viewer.dialogs.dialogs import FileDialogs
from pmviewer.viewer.dialogs.exports import default_path
from pmviewer.viewer.dialogs.modal import Modal
from pmviewer.viewer.state import LAYERS, ViewerState
from pmviewer.viewer.still import LARGEST

TITLE = "Export at another size"
_SIZES = (1280, 1920, 2560, 3840)


class StillDialog(Modal):
    """Asks how large and how well, then for the file."""

    title = TITLE

    def __init__(self, state: ViewerState, dialogs: FileDialogs) -> None:
        super().__init__()
        self._state = state
        self._dialogs = dialogs

    def _contents(self) -> None:
        em, still = imgui.get_font_size(), self._state.still.still
        camera = self._state.render_camera()
        aspect = camera.width / camera.height if camera is not None else 1.0
        imgui.set_next_item_width(6 * em)
        flags = imgui.SliderFlags_.always_clamp
        _, still.width = imgui.drag_int("##still.width", still.width, 4.0, 16, LARGEST, "%d", flags)
        imgui.same_line()
        imgui.text_unformatted(f"× {still.height(aspect)} pixels")
        for number, width in enumerate(_SIZES):
            if number:
                imgui.same_line()
            if imgui.small_button(f"{width}##still"):
                still.width = width
        imgui.set_next_item_width(6 * em)
        _, still.passes = imgui.drag_int("passes##still", still.passes, 0.5, 1, 100_000, "%d", flags)
        view = self._state.settings.display.view
        can = view in (*LAYERS, *HELD_WHILE_SHOWN, *DIAGNOSTICS)
        imgui.begin_disabled(view not in DIAGNOSTICS)
        _, still.legend = imgui.checkbox("with its legend##still", still.legend)
        imgui.end_disabled()
        imgui.push_text_wrap_pos(24 * em)
        what = f"The view '{view}'" if can else f"The view '{view}' is drawn by the window alone: the image"
        text = f"{what} is rendered beside the session, as the settings are now; without overlays."
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(text))
        imgui.pop_text_wrap_pos()
        for suffix, name in ((".png", "PNG …"), (".exr", "EXR, all layers …")):
            if imgui.button(f"{name}##still"):
                self._close()
                self._ask(suffix, aspect, view if can else "beauty")
            imgui.same_line()
        if imgui.button("Cancel##still") or imgui.is_key_pressed(imgui.Key.escape):
            self._close()

    def _ask(self, suffix: str, aspect: float, view: str) -> None:
        state = self._state

        def chosen(path: Path) -> None:
            try:
                state.still.export(path, aspect, view)
            except PmviewerError as error:
                state.say("error", str(error))

        name = f"{view.replace(' ', '_')}-{state.still.still.width}"
        path = default_path(state, suffix, name)
        self._dialogs.save(TITLE, path, chosen)
