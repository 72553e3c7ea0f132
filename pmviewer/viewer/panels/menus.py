"""The menu bar."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import hello_imgui, imgui

from pmviewer.settings.access import SETTINGS, get
from pmviewer.viewer import theme
from pmviewer.viewer.appearance import SCALES
from pmviewer.viewer.overlays.registry import SWITCHED
from pmviewer.viewer.panels.bundled_menu import BundledMenu
from pmviewer.viewer.panels.edit_menu import EditMenu
from pmviewer.viewer.panels.toolbar import Actions
from pmviewer.viewer.shortcuts import follow_mouse, keys_of
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.view_actions import forget_view, go_to_view


class Menus:
    """Menus name actions; `actions` maps these to what they do, `panels` are the windows that "View" lists."""

    def __init__(self, state: ViewerState, actions: Actions, panels: tuple[str, ...]) -> None:
        self._state = state
        self._actions = actions
        self._panels = panels
        self._bundled = BundledMenu(state)
        self._edit = EditMenu(state, self._item)

    def gui(self) -> None:
        """Draw the bar's menus, between imgui's begin and end of a menu bar."""
        follow_mouse(self._state.history)
        if imgui.begin_menu("File"):
            self._file()
            imgui.end_menu()
        if imgui.begin_menu("Edit"):
            self._edit.gui()
            imgui.end_menu()
        if imgui.begin_menu("View"):
            self._view()
            imgui.end_menu()
        if imgui.begin_menu("Render"):
            self._render()
            imgui.end_menu()
        if imgui.begin_menu("Compare"):
            self._compare()
            imgui.end_menu()
        if imgui.begin_menu("Overlays"):
            for overlay in SWITCHED:
                title = SETTINGS[f"overlays.{overlay.name}.show"].group.capitalize()
                self._item(title, f"toggle_{overlay.name}", overlay.is_shown(self._state.settings))
            imgui.end_menu()
        if imgui.begin_menu("Help"):
            self._item("The tour", "begin_tour")
            self._item("Keys and mouse", "toggle_help", self._state.help_open)
            imgui.end_menu()

    def _item(self, text: str, action: str, selected: bool = False, enabled: bool = True) -> None:
        if imgui.menu_item(text, keys_of(action), selected, enabled)[0]:
            self._actions[action]()

    def _file(self) -> None:
        self._item("Open …", "open")
        self._item("Load reference …", "load_reference")
        self._item("Photons of a PLY file …", "open_photons")
        if imgui.begin_menu("Bundled scenes"):
            self._bundled.gui()
            imgui.end_menu()
        if imgui.begin_menu("Open recent", bool(self._state.recent.entries)):
            for entry in list(self._state.recent.entries):
                self._recent(entry)
            imgui.separator()
            if imgui.menu_item_simple("Clear the list"):
                self._state.recent.clear()
            imgui.end_menu()
        imgui.separator()
        self._item("Save session …", "save_session")
        imgui.separator()
        self._item("Export PNG …", "export_png")
        self._item("Export PNG with overlays …", "export_png_overlays")
        self._item("Export at another size …", "export_still")
        self._item("Export EXR, 32-bit float …", "export_exr")
        self._item("Export EXR, 16-bit half …", "export_exr_half")
        self._item("Export the film …", "export_film", enabled=len(self._state.film.keys) > 1)
        self._item("Screenshot of the picture", "screenshot_picture")
        self._item("Screenshot of the window", "screenshot")
        imgui.separator()
        if self._state.is_attachable is not None:
            self._item("Let Python programs attach", "listen", self._state.is_attachable())
            imgui.set_item_tooltip(
                "pmviewer.attach() in Python changes this window, reads it and shows pictures in it."
            )
            imgui.separator()
        self._item("Quit", "quit")

    def _recent(self, entry: str) -> None:
        missing = self._state.recent.is_missing(entry)
        name = f"{Path(entry).parent.name}/{Path(entry).name}" if Path(entry).is_absolute() else entry
        if imgui.menu_item(f"{name}{'  (missing)' if missing else ''}##{entry}", "", False)[0]:
            if missing:
                self._state.recent.remove(entry)
                self._state.say("error", f"{entry}: the file is gone; it was taken off the list.")
            else:
                self._state.open(entry)
        imgui.set_item_tooltip(entry)

    def _view(self) -> None:
        view = self._state.named_view
        for number, name in enumerate(SETTINGS["display.view"].choices):
            refusal = self._state.refused_view(name)
            key = str((number + 1) % 10) if number < 10 else ""
            if imgui.menu_item(name.capitalize(), key, name == view, refusal is None)[0]:
                self._state.change({"display.view": name})
            if refusal is not None and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
                imgui.set_tooltip(theme.drawable(refusal))
        imgui.separator()
        self._item("Frame the whole scene", "frame_all")
        self._item("Reset the camera", "reset_camera")
        self._item("Fly", "toggle_fly", self._state.flying)
        through = self._state.settings.display.through_surfaces
        if imgui.menu_item("Move through surfaces", "", through)[0]:
            self._state.change({"display.through_surfaces": not through})
        self._item("Fit the picture", "fit_picture")
        if imgui.begin_menu("Saved views"):
            self._views()
            imgui.end_menu()
        if imgui.begin_menu("Free camera"):
            free = self._state.settings.free_camera
            self._item("Free camera", "toggle_free", free.on)
            if imgui.menu_item("Frustum of the render camera", "", free.frustum, free.on)[0]:
                self._state.change({"free_camera.frustum": not free.frustum})
            imgui.separator()
            self._item("From above", "free_from_above")
            self._item("Go to the render camera", "free_to_render")
            self._item("Take this view as render camera", "free_becomes_render", enabled=free.on)
            imgui.end_menu()
        imgui.separator()
        params = hello_imgui.get_runner_params()
        for label in self._panels:
            window = params.docking_params.dockable_window_of_name(label)
            _, window.is_visible = imgui.menu_item(label, "", window.is_visible)
        imgui.separator()
        appearance = self._state.appearance
        self._item("Light interface", "toggle_look", appearance.look == "light")
        if imgui.begin_menu("Size of the interface"):
            for scale in SCALES:
                if imgui.menu_item(f"{scale:.0%}", "", scale == appearance.scale)[0]:
                    appearance.choose(scale=scale)
            imgui.separator()
            self._item("Larger", "larger")
            self._item("Smaller", "smaller")
            imgui.end_menu()
        self._item("Hide the panels", "toggle_panels", self._state.panels_hidden)
        if imgui.menu_item_simple("Reset the layout"):
            params.docking_params.layout_reset = True

    def _views(self) -> None:
        """Of the open scene: a click goes there."""
        self._item("Save this view", "save_view")
        names = list(self._state.views.of(self._state.session.scene_path))
        if names:
            imgui.separator()
        for name in names:
            if imgui.menu_item(name, "", False)[0]:
                go_to_view(self._state, name)
        if imgui.begin_menu("Forget", bool(names)):
            for name in names:
                if imgui.menu_item(f"{name}##forget", "", False)[0]:
                    forget_view(self._state, name)
            imgui.end_menu()

    def _compare(self) -> None:
        state = self._state
        self._item("Take a snapshot", "take_snapshot")
        self._item("Open a picture as a snapshot …", "open_snapshot")
        imgui.separator()
        for mode in SETTINGS["compare.mode"].choices:
            if imgui.menu_item(mode.capitalize(), "", mode == state.settings.compare.mode)[0]:
                state.change({"compare.mode": mode})
        self._item("Next of these", "next_comparison")
        imgui.separator()
        if imgui.begin_menu("Difference"):
            for kind in SETTINGS["compare.difference"].choices:
                why = state.inactive_reason(f"compare.difference={kind}", state.settings, state.session.traits)
                usable = why is None or state.settings.compare.mode != "difference"
                if imgui.menu_item(kind, "", kind == state.settings.compare.difference, usable)[0]:
                    state.change({"compare.mode": "difference", "compare.difference": kind})
                if why is not None and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
                    imgui.set_tooltip(theme.drawable(why))
            imgui.end_menu()
        self._item("Flip to the other picture", "flip_pictures")
        self._item("Swap A and B", "swap_pictures")
        self._item("Link cameras", "link_cameras", state.settings.compare.linked)
        imgui.separator()
        self._item("With and without importance", "compare_importance", state.gain.running)
        self._item("Mark odd pixels", "toggle_marks", state.settings.display.marks)

    def _render(self) -> None:
        self._item("Resume" if self._state.session.paused else "Pause", "toggle_pause")
        self._item("Restart", "restart")
        self._item("Refine a region: drag it", "choose_region")
        self._item("Region", "toggle_region", self._state.settings.region.on)
        ahead = self._state.settings.display.compile_ahead
        if imgui.menu_item("Compile ahead", "", ahead)[0]:
            self._state.change({"display.compile_ahead": not ahead})
        self._item("Compare with and without importance", "compare_importance", self._state.gain.running)
        workers = self._state.session.workers
        self._item("Borrow a cluster …", "borrow_cluster", workers is not None and workers.where is not None)
        if imgui.begin_menu("Light rig"):
            rig = self._state.settings.light.rig
            for choice in SETTINGS["light.rig"].choices:
                if imgui.menu_item(choice.capitalize(), "", choice == rig)[0]:
                    self._state.change({"light.rig": choice})
            imgui.end_menu()
        imgui.separator()
        info = SETTINGS["render.method"]
        method = get(self._state.settings, info.path)
        for choice in info.choices:
            if imgui.menu_item(choice.capitalize(), "", choice == method)[0]:
                self._state.change({info.path: choice})
