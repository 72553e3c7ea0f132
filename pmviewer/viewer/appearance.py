"""How large the interface is and whether it is dark or light: the user's own, whatever the scene and session."""

from __future__ import annotations

from imgui_bundle import hello_imgui, imgui

from pmviewer.viewer import theme

SCALES = (0.75, 0.9, 1.0, 1.25, 1.5, 2.0, 2.5)
_PREFERENCE = "appearance"
_SIZES = (
    "window_padding",
    "frame_padding",
    "cell_padding",
    "item_spacing",
    "item_inner_spacing",
    "scrollbar_size",
    "grab_min_size",
    "indent_spacing",
)


class Appearance:
    """`look` of `pmviewer.viewer.theme` and `scale` of text and spacing, beside that of the screen."""

    def __init__(self, *, remember: bool) -> None:
        self.look = "dark"
        self.scale = 1.0
        self._remember = remember
        self._shown = ("dark", 1.0)
        self._sizes: dict[str, tuple[float, ...]] = {}

    def load(self) -> None:
        """What was chosen last time, once the window is there. Nonsense in the file is nothing chosen."""
        if not self._remember:
            return
        look, _, scale = hello_imgui.load_user_pref(_PREFERENCE).partition(" ")
        if look in theme.LOOKS:
            self.look = look
        if scale in {str(known) for known in SCALES}:
            self.scale = float(scale)

    def choose(self, *, look: str | None = None, scale: float | None = None) -> None:
        """From the next window frame on, and next time."""
        self.look, self.scale = look or self.look, scale or self.scale

    def keep(self) -> None:
        """For next time; before the window closes."""
        if self._remember:
            hello_imgui.save_user_pref(_PREFERENCE, f"{self.look} {self.scale}")

    def larger(self, steps: int) -> None:
        """The next scale of SCALES, up or down."""
        number = SCALES.index(self.scale) + steps
        self.choose(scale=SCALES[min(max(number, 0), len(SCALES) - 1)])

    def show(self) -> None:
        """Between window frames: make it so."""
        if (self.look, self.scale) == self._shown:
            return
        self._shown = self.look, self.scale
        theme.use(self.look)
        theme.colours()
        style = imgui.get_style()
        style.font_scale_main = self.scale
        for name in _SIZES:
            size = getattr(style, name)
            self._sizes.setdefault(name, (size,) if isinstance(size, float) else (size.x, size.y))
        for name, size in self._sizes.items():
            scaled = [self.scale * part for part in size]
            setattr(style, name, scaled[0] if len(scaled) == 1 else imgui.ImVec2(*scaled))
        params = hello_imgui.get_runner_params()
        params.imgui_window_params.background_color = theme.ground("background")
        for toolbar in params.callbacks.edges_toolbars.values():
            toolbar.options.window_bg = theme.ground("toolbar")
