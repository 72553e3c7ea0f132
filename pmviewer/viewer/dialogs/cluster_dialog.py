"""The dialog "Borrow a cluster": whose workers render the passes from now on."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.engine.cluster.address import MOST_LOCAL
from pmviewer.errors import PmviewerError
from pmviewer.viewer import theme
from pmviewer.viewer.dialogs.modal import Modal
from pmviewer.viewer.state import ViewerState

TITLE = "Borrow a cluster"
_WHAT = (
    "The passes are rendered by the workers of a Dask cluster and added here: the picture is the same, bit for bit. "
    "Clusters of other machines run already; docs/cluster.md says how they are started."
)
_WIDE = 26


class ClusterDialog(Modal):
    """What was typed stays until the program ends."""

    title = TITLE

    def __init__(self, state: ViewerState) -> None:
        super().__init__()
        self._state = state
        self._local, self._count, self._address = True, 2, ""
        self._problem = ""

    def open(self) -> None:
        """With the next window frame."""
        super().open()
        self._problem = ""

    @property
    def where(self) -> str:
        """The cluster that is chosen, as `--cluster` has it."""
        return f"local:{self._count}" if self._local else self._address.strip()

    def _contents(self) -> None:
        em, workers = imgui.get_font_size(), self._state.session.workers
        _wrapped(_WHAT, theme.DIM)
        if imgui.radio_button("processes of this machine##cluster", self._local):
            self._local = True
        imgui.same_line()
        imgui.set_next_item_width(5 * em)
        flags = imgui.SliderFlags_.always_clamp
        changed, self._count = imgui.drag_int("##cluster.count", self._count, 0.1, 1, MOST_LOCAL, "%d", flags)
        self._local = self._local or changed
        if imgui.radio_button("scheduler##cluster", not self._local):
            self._local = False
        imgui.same_line()
        imgui.set_next_item_width(-1)
        hint = "tcp://host:8786, or its file (.json)"
        changed, self._address = imgui.input_text_with_hint("##cluster.address", hint, self._address)
        self._local = self._local and not changed
        where = workers.where if workers is not None else None
        _wrapped(f"Borrowed now: {where}." if where is not None else "None is borrowed now.", theme.TEXT)
        if self._problem:
            _wrapped(self._problem, theme.ERROR)
        imgui.begin_disabled(workers is None or not self.where)
        if imgui.button("Borrow##cluster"):
            self._borrow(self.where)
        imgui.end_disabled()
        imgui.same_line()
        imgui.begin_disabled(where is None)
        if imgui.button("Give it back##cluster"):
            self._borrow(None)
        imgui.end_disabled()
        imgui.same_line()
        if imgui.button("Cancel##cluster") or imgui.is_key_pressed(imgui.Key.escape):
            self._close()

    def _borrow(self, where: str | None) -> None:
        """The log tells what becomes of it; what can't be an address stays in the dialog with a sentence."""
        try:
            self._state.session.workers.borrow(where)
        except PmviewerError as error:
            self._problem = str(error)
        else:
            self._close()


def _wrapped(text: str, colour: theme.Colour) -> None:
    imgui.push_text_wrap_pos(_WIDE * imgui.get_font_size())
    imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(text))
    imgui.pop_text_wrap_pos()
