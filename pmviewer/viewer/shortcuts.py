"""Keys and mouse buttons in one table: what runs on a key press, and what the overview (`H`) lists."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from imgui_bundle import imgui

from pmviewer.viewer.history import History
from pmviewer.viewer.overlays.overlay import Switch
from pmviewer.viewer.overlays.registry import OVERLAYS

K = imgui.Key


@dataclass(frozen=True)
class Binding:
    """`action` names what happens; `key` is None for what the mouse does and the viewport handles itself."""

    group: str
    keys: str
    text: str
    action: str = ""
    key: imgui.Key | None = None
    ctrl: bool = False
    shift: bool = False
    repeat: bool = False
    alternative: imgui.Key | None = None


def _switching(overlay: str, switch: Switch) -> Binding:
    """The key that switches an overlay."""
    return Binding("Picture", switch.keys, switch.text, f"toggle_{overlay}", switch.key, shift=switch.shift)


BINDINGS: tuple[Binding, ...] = (
    Binding("File", "Ctrl+O", "Open a scene or session", "open", K.o, ctrl=True),
    Binding("File", "Ctrl+R", "Load a reference to compare with", "load_reference", K.r, ctrl=True),
    Binding("File", "Ctrl+S", "Save the session", "save_session", K.s, ctrl=True),
    Binding("File", "Ctrl+E", "Export the layers as EXR", "export_exr", K.e, ctrl=True),
    Binding("File", "Ctrl+Shift+E", "Export the picture as PNG", "export_png", K.e, ctrl=True, shift=True),
    Binding("File", "F12", "Screenshot of the window", "screenshot", K.f12),
    Binding("File", "Ctrl+F12", "Screenshot of the picture with overlays", "screenshot_picture", K.f12, ctrl=True),
    Binding("File", "Ctrl+Q", "Quit", "quit", K.q, ctrl=True),
    Binding("Edit", "Ctrl+Z", "Undo the last change of a setting or the camera", "undo", K.z, ctrl=True),
    Binding("Edit", "Ctrl+Shift+Z", "Redo it", "redo", K.z, ctrl=True, shift=True),
    Binding("Edit", "Ctrl+Y", "Redo it, too", "redo", K.y, ctrl=True),
    Binding("Edit", "Ctrl+P", "Find a command or setting by name", "open_palette", K.p, ctrl=True),
    Binding("Edit", "Ctrl+L", "List the changed settings, or all again", "list_changed", K.l, ctrl=True),
    Binding("Render", "Space", "Pause or resume", "toggle_pause", K.space),
    Binding("Render", "R", "Restart", "restart", K.r),
    Binding("Render", "B", "Refine a region alone: drag it; a click: the whole picture", "choose_region", K.b),
    Binding("Render", "Shift+B", "The region on or off", "toggle_region", K.b, shift=True),
    Binding(
        "Render",
        "Shift+R",
        "Automatic: let a short trial choose method and numbers, or stop it",
        "choose_automatically",
        K.r,
        shift=True,
    ),
    Binding("Render", "N", "Compare with and without importance", "compare_importance", K.n),
    Binding("Compare", "S", "Keep the picture as a snapshot", "take_snapshot", K.s),
    Binding("Compare", "X", "Compare A and B: wipe, flip, side by side, difference, off", "next_comparison", K.x),
    Binding("Compare", "Y", "Flip to the other of the two pictures", "flip_pictures", K.y),
    Binding("Compare", "Shift+X", "Next kind of difference", "next_difference", K.x, shift=True),
    Binding("Compare", "Shift+Y", "Swap A and B", "swap_pictures", K.y, shift=True),
    Binding(
        "Compare", "Shift+S", "Link cameras: snapshots follow the live one, or not", "link_cameras", K.s, shift=True
    ),
    Binding("Picture", "1 … 9, 0", "View: beauty, one of its terms, a property, geometry"),
    Binding("Picture", "E", "Exposure up by half a stop", "exposure_up", K.e, repeat=True),
    Binding("Picture", "Shift+E", "Exposure down by half a stop", "exposure_down", K.e, shift=True, repeat=True),
    Binding("Picture", "T", "Next tone curve", "next_tone", K.t),
    Binding("Picture", "D", "Denoised picture, or as it is", "toggle_denoised", K.d),
    Binding(
        "Picture", "Shift+N", "Mark and count pixels not finite, negative, clipped", "toggle_marks", K.n, shift=True
    ),
    Binding("Picture", "V held", "The reference instead of the picture"),
    *(_switching(overlay.name, overlay.switch) for overlay in OVERLAYS if overlay.switch is not None),
    Binding("Picture", "Click", "Pin a pixel to the inspector; again or Esc: let it go"),
    Binding("Picture", "Alt+click", "The life of the photon under the mouse, of those that are shown"),
    Binding("Picture", "I held", "Gather rays of the pixel under the mouse"),
    Binding("Picture", "Ctrl+wheel, Ctrl+drag", "Magnify the picture's pixels and move it"),
    Binding("Picture", "Z", "Fit the picture again", "fit_picture", K.z),
    Binding("Camera", "Left drag", "Orbit around what is under the mouse"),
    Binding("Camera", "Middle or Shift+left drag", "Pan"),
    Binding("Camera", "Wheel or right drag", "Zoom"),
    Binding("Edit", "Shift+click", "Take hold of the object there: handles, and its row in the tab Scene"),
    Binding("Camera", "Ctrl+click", "Focus the lens on what is there"),
    Binding("Camera", "F", "Fly: W A S D, Q down, E up, drag to look; Shift is faster", "toggle_fly", K.f),
    Binding("Camera", "Right button + W A S D Q E", "Fly while the button is held"),
    Binding("Camera", "Home or A", "Frame the whole scene", "frame_all", K.home, alternative=K.a),
    Binding("Camera", "Backspace", "The scene file's camera; the free one's overview", "reset_camera", K.backspace),
    Binding("Camera", "Ctrl+B", "Save the view (View > Saved views)", "save_view", K.b, ctrl=True),
    Binding("Film", "Ctrl+K", "Add a key to the film", "add_key", K.k, ctrl=True),
    Binding("Film", "Ctrl+Shift+K", "Play the film, or stop", "play_film", K.k, ctrl=True, shift=True),
    Binding("Free camera", "O", "The render camera's importance from elsewhere", "toggle_free", K.o),
    Binding("Free camera", "Shift+Home", "From above", "free_from_above", K.home, shift=True),
    Binding("Free camera", "Shift+Backspace", "To the render camera", "free_to_render", K.backspace, shift=True),
    Binding("Free camera", "Shift+O", "Becomes the render camera", "free_becomes_render", K.o, shift=True),
    Binding("Window", "Tab", "Hide or show the panels", "toggle_panels", K.tab),
    Binding("Window", "Ctrl++", "Larger interface", "larger", K.equal, ctrl=True, alternative=K.keypad_add),
    Binding("Window", "Ctrl+-", "Smaller interface", "smaller", K.minus, ctrl=True, alternative=K.keypad_subtract),
    Binding("Window", "Ctrl+Shift+L", "Light or dark interface", "toggle_look", K.l, ctrl=True, shift=True),
    Binding("Window", "H or F1", "This overview", "toggle_help", K.h, alternative=K.f1),
    Binding("Settings", "Double click or Ctrl+click", "Type an exact value"),
    Binding("Settings", "Right click", "Reset to the default, copy the setting's name"),
    Binding("Settings", "Esc", "Leave fly mode, close this overview, let the pinned pixel go", "escape", K.escape),
)

_DIGITS = (K._1, K._2, K._3, K._4, K._5, K._6, K._7, K._8, K._9, K._0)
FLIP_KEY = K.v
INSPECT_KEY = K.i
FLY_KEYS = (K.w, K.a, K.s, K.d, K.q, K.e)


def keys_of(action: str) -> str:
    """What to show beside a menu entry."""
    return next((b.keys for b in BINDINGS if b.action == action), "")


def is_held(key: imgui.Key) -> bool:
    """Whether the key is down by itself, and not for typing."""
    io = imgui.get_io()
    return imgui.is_key_down(key) and not (io.want_text_input or io.key_ctrl or io.key_shift or io.key_alt)


def run_shortcuts(
    actions: Mapping[str, Callable[[], None]], choose_view: Callable[[int], None], flying: bool, history: History
) -> None:
    """Run the actions of the keys pressed in this frame, each press a step of its own to undo. Typing into a field and
    flying keep their letters."""
    io = imgui.get_io()
    if io.want_text_input:
        return
    for binding in BINDINGS:
        for key in (binding.key, binding.alternative):
            if key is None or (flying and key in FLY_KEYS and not io.key_ctrl):
                continue
            if io.key_ctrl == binding.ctrl and io.key_shift == binding.shift and not io.key_alt:
                if imgui.is_key_pressed(key, binding.repeat):
                    history.gesture += imgui.is_key_pressed(key, False)
                    actions[binding.action]()
    if not (io.key_ctrl or io.key_shift or io.key_alt):
        for number, key in enumerate(_DIGITS):
            if imgui.is_key_pressed(key, False):
                history.gesture += 1
                choose_view(number)


def follow_mouse(history: History) -> None:
    """Once per window frame: what is changed while a button is down is one step to undo."""
    buttons = (imgui.MouseButton_.left, imgui.MouseButton_.right, imgui.MouseButton_.middle)
    history.gesture += any(imgui.is_mouse_clicked(b) or imgui.is_mouse_released(b) for b in buttons)
    history.held = any(imgui.is_mouse_down(button) for button in buttons)
