"""The two pictures that the viewport compares: which they are, what they differ by, and why they can't be compared."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame
from pmviewer.settings.access import Display, Settings
from pmviewer.settings.schema.compare import LAST, LIVE, REFERENCE
from pmviewer.viewer.background import DIFFERENCES, Background
from pmviewer.viewer.comparison import NO_REFERENCE, Comparison
from pmviewer.viewer.importance_gain import GainRun
from pmviewer.viewer.linked import Linked
from pmviewer.viewer.sides import Side, frame_side, reference_side, same_camera, snapshot_side
from pmviewer.viewer.snapshots import Snapshots

if TYPE_CHECKING:  # brings OpenEXR along, which the window doesn't wait for
    from pmviewer.output.snapshot import Snapshot

OFF, WIPE, FLIP, BESIDE, DIFFERENCE = MODES = ("off", "wipe", "flip", "side by side", "difference")
NO_SNAPSHOT = "There is no snapshot yet: S takes one, and EXR or PNG files open as snapshots."
OTHER_CAMERA = "The pictures are seen by different cameras: Shift+S links them."
DISPLAY_VALUES = "One picture is of display values (PNG), which are cut at 1."


@dataclass(frozen=True, eq=False)
class ShownPair:
    """What the viewport compares: by `mode`, and by `display`, whose view is a layer. `split` is of a wipe, `second`
    tells that flipping shows B, `kind` is of the difference. `caution` is what to know, `refusal` why there is no
    difference."""

    a: Side
    b: Side
    mode: str
    display: Display
    split: float
    second: bool
    kind: str
    caution: str = ""
    refusal: str = ""

    @property
    def sides(self) -> tuple[Side, Side]:
        """A and B."""
        return self.a, self.b

    @property
    def keys(self) -> tuple[Hashable, Hashable]:
        """Of the layers that are shown."""
        return tuple((side.key, side.layer(self.display.view)) for side in self.sides)  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Difference:
    """What two pictures differ by: `values` (h, w) and their `mean`, of the `kind` and the layers that `key` names."""

    key: Hashable
    kind: str
    values: NDArray[np.float32]
    mean: float


class Pair:
    """Lives as long as the window, whose thread calls everything. `second` is whether flipping shows B."""

    def __init__(
        self, background: Background, comparison: Comparison, gain: GainRun, snapshots: Snapshots, linked: Linked
    ) -> None:
        self.second = False
        self.difference: Difference | None = None
        """The newest that was worked out."""
        self._background = background
        self._comparison = comparison
        self._gain = gain
        self._snapshots = snapshots
        self._linked = linked
        self._failed: tuple[Hashable, str] = None, ""
        self._of_frames: list[Side] = []

    # which pictures ---------------------------------------------------------------------------------------------

    def side(self, name: str, frame: Frame | None, linked: bool = False) -> Side | str:
        """The picture of that name in the settings, or why there is none; with `linked` of a snapshot what the live
        camera sees, as far as that is there."""
        if name == LIVE:
            return self._of(frame, LIVE) if frame is not None else "Nothing is rendered yet."
        if name == REFERENCE:
            reference = self._comparison.reference
            return reference_side(reference) if reference is not None else NO_REFERENCE
        snapshot = self._snapshots.get(name)
        if snapshot is not None:
            again = self._linked.frame(snapshot, frame) if linked else None
            return snapshot_side(snapshot) if again is None else self._of(again, f"{snapshot.name} · linked")
        return NO_SNAPSHOT if name == LAST else f"There is no snapshot '{name}': choose another picture to compare."

    def _of(self, frame: Frame, name: str) -> Side:
        """Of a frame; the same one as long as it is the same frame."""
        for side in self._of_frames:
            if side.frame is frame and side.name == name:
                return side
        made = frame_side(frame, name)
        self._of_frames = [*self._of_frames, made][-3:]
        return made

    def sides(self, settings: Settings, frame: Frame | None) -> tuple[Side, Side] | str:
        """A and B, or why there is nothing to compare. While the pictures with and without importance are shown, it is
        these."""
        gain = self._gain.frames()
        if gain is not None:
            return self._of(gain[0], "with importance"), self._of(gain[1], "without importance")
        compare = settings.compare
        a, b = (self.side(name, frame, compare.linked) for name in (compare.a, compare.b))
        if isinstance(a, str):
            return a
        return b if isinstance(b, str) else (a, b)

    def problem(self, settings: Settings, frame: Frame | None) -> str:
        """Why nothing is compared although it should be, or nothing."""
        if settings.compare.mode == OFF:
            return ""
        found = self.sides(settings, frame)
        return found if isinstance(found, str) else ""

    def shown(self, settings: Settings, display: Display, frame: Frame | None) -> ShownPair | None:
        """What the viewport compares now, by display settings with an exposure and a layer as view; None when nothing
        is compared."""
        compare, gain = settings.compare, self._gain.frames()
        if gain is None and compare.mode == OFF:
            return None
        found = self.sides(settings, frame)
        if isinstance(found, str):
            return None
        mode = WIPE if compare.mode == OFF else compare.mode
        a, b = found
        refusal = refusal_of(a, b, compare.difference) if mode == DIFFERENCE else ""
        caution = "" if same_camera(a, b) else OTHER_CAMERA
        if gain is None and compare.linked:
            caution = next(filter(None, (self._linked.note(one, frame) for one in self._compared(settings))), caution)
        caution = caution or (DISPLAY_VALUES if a.encoded or b.encoded else "")
        return ShownPair(a, b, mode, display, compare.split, self.second, compare.difference, caution, refusal)

    def _compared(self, settings: Settings) -> list[Snapshot]:
        """The snapshots among A and B."""
        found = (self._snapshots.get(name) for name in dict.fromkeys((settings.compare.a, settings.compare.b)))
        return [one for one in found if one is not None]

    def link(self, settings: Settings, frame: Frame | None) -> None:
        """Once per window frame: have the compared snapshots follow the live camera, if they are to."""
        follows = settings.compare.linked and settings.compare.mode != OFF
        self._linked.poll(self._compared(settings) if follows else [], frame)

    def flip(self) -> None:
        """The other picture."""
        self.second = not self.second

    # the difference ---------------------------------------------------------------------------------------------

    def poll(self, shown: ShownPair | None) -> None:
        """Once per window frame: have the difference worked out when it is shown and another one."""
        if shown is None:
            self._of_frames = []  # frames of a scene that is gone
        if shown is None or shown.mode != DIFFERENCE or shown.refusal:
            self.difference = None
            return
        kind, view, key = shown.kind, shown.display.view, (shown.kind, *shown.keys)
        known = self.difference is not None and self.difference.key == key
        coarse = any(side.frame is not None and side.frame.coarse for side in shown.sides)
        if known or coarse or self._failed[0] == key or self._background.running(DIFFERENCES):
            return

        def work() -> str:
            from pmviewer.output.difference import difference, mean_difference

            try:
                values = difference(kind, shown.a.image(view), shown.b.image(view))
            except Exception as error:
                self._failed = key, str(error)
                raise
            self.difference = Difference(key, kind, values, mean_difference(kind, values))
            return ""

        self._background.start(DIFFERENCES, "working out the difference", work)

    def current(self, shown: ShownPair) -> Difference | None:
        """The difference of the kind that is shown; of an earlier pass of the live picture until the next is there."""
        found = self.difference
        if found is None or shown.mode != DIFFERENCE or shown.refusal or found.kind != shown.kind:
            return None
        return found if found.values.shape == shown.a.size[::-1] else None


def refusal_of(a: Side, b: Side, kind: str) -> str:
    """Why two pictures have no difference of that kind, or nothing."""
    if a.size != b.size:
        sizes = " and ".join(f"{width}×{height}" for width, height in (a.size, b.size))
        return f"A and B have {sizes} pixels: only pictures of one size have a difference."
    return _flip_missing() if kind == "FLIP" else ""


@cache
def _flip_missing() -> str:
    from pmviewer.output.flip import MISSING, is_installed

    return "" if is_installed() else f"FLIP: {MISSING}"
