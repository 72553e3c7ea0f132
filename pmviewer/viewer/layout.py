"""The window's frame: docked panels, bars and pace, as hello_imgui wants them described."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from imgui_bundle import hello_imgui, imgui

from pmviewer.viewer import theme
from pmviewer.viewer.viewport.viewport import VIEWPORT

Draw = Callable[[], None]
PANELS = (
    "Settings",
    "Scene",
    "Overlays",
    "Inspector",
    "Statistics",
    "Importance",
    "Error",
    "Snapshots",
    "Comparison",
    "Film",
    "Log",
)
_PLACE = {"Settings": "Left", "Scene": "Left", "Overlays": "Right", "Inspector": "Right"}
"""Where panels are docked; the others at the bottom."""
WINDOW_SIZE = (1440, 900)
SMALLEST_WINDOW = (800, 600)
FPS_MAX = 60
FPS_IDLE = 2


@dataclass(frozen=True)
class Callbacks:
    """What the window calls: `panels` by label, and the bars."""

    panels: Mapping[str, Draw]
    viewport: Draw
    menus: Draw
    toolbar: Draw
    status: Draw
    over_everything: Draw
    post_init: Draw
    add_platform_callbacks: Draw
    pre_new_frame: Draw
    before_swap: Draw
    before_exit: Draw


def runner_params(
    callbacks: Callbacks, *, remember: bool, alone: tuple[int, int] | None = None
) -> hello_imgui.RunnerParams:
    """`remember` keeps window and panel positions in the user's configuration folder; `alone`: a window of that size
    with the picture and nothing else."""
    params = hello_imgui.RunnerParams()
    window = params.app_window_params
    window.window_title = "pmviewer"
    window.window_geometry.size = alone or WINDOW_SIZE
    window.restore_previous_geometry = remember
    params.ini_disable = not remember
    params.ini_folder_type = hello_imgui.IniFolderType.app_user_config_folder
    params.ini_filename = "pmviewer/window.ini"
    params.renderer_backend_options.open_gl_options = _opengl()
    _pace(params.fps_idling)
    params.imgui_window_params.background_color = theme.ground("background")
    if alone is None:
        _bars(params, callbacks)
        _dock(params.docking_params, callbacks)
    else:
        params.imgui_window_params.default_imgui_window_type = hello_imgui.DefaultImGuiWindowType.no_default_window
    c = params.callbacks
    c.load_additional_fonts = theme.load_fonts
    c.setup_imgui_style = theme.apply
    c.show_menus = callbacks.menus
    c.show_status = callbacks.status
    c.show_gui = callbacks.over_everything if alone is None else callbacks.viewport
    c.post_init = callbacks.post_init
    c.post_init_add_platform_backend_callbacks = callbacks.add_platform_callbacks
    c.pre_new_frame = callbacks.pre_new_frame
    c.before_swap = callbacks.before_swap
    c.before_exit = callbacks.before_exit
    return params


def _opengl() -> hello_imgui.OpenGlOptions:
    """The interface is drawn without multisampling: it costs much on a software driver and shows little elsewhere."""
    options = hello_imgui.OpenGlOptions()
    options.anti_aliasing_samples = 0
    return options


def _pace(idling: hello_imgui.FpsIdling) -> None:
    """Fast while the user acts, nearly still otherwise; each new frame of the session wakes the window."""
    idling.fps_max = FPS_MAX
    idling.fps_idle = FPS_IDLE
    idling.time_active_after_last_event = 0.5
    idling.vsync_to_monitor = True


def _bars(params: hello_imgui.RunnerParams, callbacks: Callbacks) -> None:
    frame = params.imgui_window_params
    frame.default_imgui_window_type = hello_imgui.DefaultImGuiWindowType.provide_full_screen_dock_space
    frame.show_menu_bar = True
    frame.show_menu_app = False
    frame.show_menu_view = False
    frame.show_status_bar = True
    frame.show_status_fps = False
    frame.remember_theme = False
    frame.remember_status_bar_settings = False
    options = hello_imgui.EdgeToolbarOptions()
    options.size_em = 2.4
    options.window_padding_em = imgui.ImVec2(0.5, 0.3)
    options.window_bg = theme.ground("toolbar")
    params.callbacks.add_edge_toolbar(hello_imgui.EdgeToolbarType.top, callbacks.toolbar, options)


def _dock(docking: hello_imgui.DockingParams, callbacks: Callbacks) -> None:
    docking.docking_splits = [
        hello_imgui.DockingSplit("MainDockSpace", "Left", imgui.Dir.left, 0.24),
        hello_imgui.DockingSplit("MainDockSpace", "Right", imgui.Dir.right, 0.235),
        hello_imgui.DockingSplit("MainDockSpace", "Bottom", imgui.Dir.down, 0.24),
    ]
    picture = hello_imgui.DockableWindow(VIEWPORT, "MainDockSpace", callbacks.viewport, True, False)
    picture.call_begin_end = False  # the viewport opens its window itself, without padding
    places = {label: _PLACE.get(label, "Bottom") for label in PANELS}
    panels = [hello_imgui.DockableWindow(label, place, callbacks.panels[label]) for label, place in places.items()]
    docking.dockable_windows = [picture, *panels]


class Shares:
    """Panels keep their share of the window when it changes its size; by itself the picture alone would give way."""

    def __init__(self) -> None:
        self._size: tuple[float, float] | None = None

    def keep(self) -> None:
        """Between window frames."""
        nodes = _dock_nodes()
        root = next((node for node in nodes.values() if node.parent_node is None), None)
        if root is None:
            return
        before, self._size = self._size, (root.size.x, root.size.y)
        if before is None or before == self._size or min(before) < 1:
            return
        across, down = self._size[0] / before[0], self._size[1] / before[1]
        for number, node in nodes.items():
            if node is not root:
                size = node.size.x * across, node.size.y * down
                if min(size) > 0:  # a node whose panels are all hidden has none
                    imgui.internal.dock_builder_set_node_size(number, size)


class Layout:
    """Where panels are docked, in which order of tabs and which is in front: windows that are hidden and shown again
    would line up anew."""

    FRAMES = 4
    """That shown panels take to be there again, and then to be docked."""

    def __init__(self) -> None:
        self._saved = ""
        self._in_front: list[str] = []
        self._waits = -1

    def remember(self) -> None:
        """As it is now."""
        self._saved = imgui.save_ini_settings_to_memory()
        windows = {label: imgui.internal.find_window_by_name(label) for label in PANELS}
        self._in_front = [
            label
            for label, window in windows.items()
            if window is not None and window.dock_node is not None and window.dock_node.selected_tab_id == window.tab_id
        ]

    def restore_soon(self) -> None:
        """Once the panels are back."""
        self._waits = self.FRAMES

    def restore_now(self) -> None:
        """Between window frames: when it is time."""
        self._waits -= self._waits >= 0
        if self._waits == self.FRAMES // 2 and self._saved:
            imgui.load_ini_settings_from_memory(self._saved)
        if self._waits == 0:
            for label in self._in_front:
                docking = hello_imgui.get_runner_params().docking_params
                docking.dockable_window_of_name(label).focus_window_at_next_frame = True


def _dock_nodes() -> dict[int, Any]:
    """The nodes in which the docked windows lie, and those that these are parts of, by number."""
    nodes: dict[int, Any] = {}
    for label in (VIEWPORT, *PANELS):
        window = imgui.internal.find_window_by_name(label)
        node = window.dock_node if window is not None else None
        while node is not None:
            nodes[node.id_] = node
            node = node.parent_node
    return nodes
