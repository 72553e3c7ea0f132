"""The panel of the comparison with and without importance: what is equal, how far it is, and its table."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS
from pmviewer.viewer import theme
from pmviewer.viewer.panels.settings_panel import SettingsPanel
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.state import ViewerState


class GainPanel:
    """Rows are those of the settings panel; it lends its widgets."""

    def __init__(self, state: ViewerState, actions: Mapping[str, Callable[[], None]], rows: SettingsPanel) -> None:
        self._state = state
        self._actions = actions
        self._rows = rows

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        run = self._state.gain
        if imgui.begin_child("##how", (min(20 * imgui.get_font_size(), 0.42 * imgui.get_content_region_avail().x), 0)):
            self._button()
            if self._rows.begin_rows("compare", name_em=7.5):
                for name in ("equal", "passes", "limit"):
                    self._rows.row(SETTINGS[f"compare.{name}"])
                imgui.end_table()
            if run.gain is not None:
                self._show()
        imgui.end_child()
        imgui.same_line()
        if imgui.begin_child("##result", (0, 0)):
            self._result()
        imgui.end_child()

    def _button(self) -> None:
        run = self._state.gain
        if run.running:
            text, share = run.progress
            if imgui.button(f"{fa.ICON_FA_STOP}  Cancel"):
                run.cancel()
            imgui.same_line()
            fraction = share if share is not None else -0.4 * imgui.get_time()
            imgui.push_style_color(imgui.Col_.plot_histogram, theme.with_alpha(theme.ACCENT, 0.55))
            imgui.progress_bar(fraction, (-1, imgui.get_frame_height()), f"{share:.0%}" if share is not None else "")
            imgui.pop_style_color()
            _wrapped(text, theme.DIM)
            return
        why = run.refusal()
        imgui.begin_disabled(why is not None)
        label = f"{fa.ICON_FA_SCALE_BALANCED}  With and without importance"
        if imgui.calc_text_size(label).x + imgui.get_font_size() > imgui.get_content_region_avail().x:
            label = f"{fa.ICON_FA_SCALE_BALANCED}  Compare"
        if imgui.button(f"{label}###gain.start"):
            self._actions["compare_importance"]()
        imgui.end_disabled()
        if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
            imgui.set_tooltip(theme.drawable(f"Render both and compare them  ({keys_of('compare_importance')})"))
        if why is not None:
            _wrapped(why, theme.WARNING)

    def _show(self) -> None:
        """Bring the split picture to the viewport, or leave it."""
        run = self._state.gain
        fits = run.fits(self._state.live_camera())
        imgui.begin_disabled(not fits)
        changed, shown = imgui.checkbox("show in the viewport", run.shown)
        imgui.end_disabled()
        if changed:
            run.shown = shown
        if not fits:
            _wrapped("The camera is another one than that of the result.", theme.WARNING)

    def _result(self) -> None:
        run = self._state.gain
        if run.gain is None:
            imgui.push_text_wrap_pos(0)
            imgui.text_disabled(
                "Renders the picture twice beside the session, with importance as it is set and with all photons "
                "stored, and tells what each took."
            )
            imgui.pop_text_wrap_pos()
            return
        changed = run.changed_since()
        if changed:
            names = ", ".join(changed[:3]) + (" …" if len(changed) > 3 else "")
            _wrapped(f"Of settings before the last change ({names}).", theme.WARNING)
        rows = run.gain.rows()
        heading = run.gain.heading, "with", "without", "ratio"
        for note in run.gain.notes:
            _wrapped(note, theme.WARNING)
        flags = imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.sizing_stretch_prop
        imgui.push_style_var(imgui.StyleVar_.cell_padding, (imgui.get_style().cell_padding.x, 1))
        if imgui.begin_table("##gain", 4, flags):
            for number, row in enumerate([heading, *rows]):
                imgui.table_next_row()
                for column, text in enumerate(row):
                    imgui.table_next_column()
                    _cell(text, right=column > 0, dim=number == 0 or column == 0)
            imgui.end_table()
        imgui.pop_style_var()
        _wrapped(run.gain.sentences()[0], theme.DIM)


def _cell(text: str, *, right: bool, dim: bool) -> None:
    if right:
        offset = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(offset, 0))
    imgui.text_colored(imgui.ImVec4(*(theme.DIM if dim else theme.TEXT)), theme.drawable(text))


def _wrapped(text: str, colour: theme.Colour) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(text))
    imgui.pop_text_wrap_pos()
