"""What of the open scene is being edited: the chosen light, material or object, and the values that edits give it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.settings.edits import PROPERTIES, Edits
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:
    from pmviewer.scene.description import Scene
    from pmviewer.scene.editing.catalogue import Catalogue, Target

Change = Callable[[dict[str, Any]], None]
Operation = str
OPERATIONS: tuple[Operation, ...] = ("move", "turn", "size")


class Editing:
    """Lives as long as the window. `chosen` is what the handles in the picture belong to, `operation` what they do;
    `raised` is True until the panel has come to the front. Nothing of it is known before a scene is open."""

    def __init__(self, session: SessionLike, change: Change) -> None:
        self._session, self._change = session, change
        self.chosen: Target | None = None
        self.operation: Operation = "move"
        self.raised = False
        self._known: tuple[Any, Catalogue] | None = None
        self._middles: dict[Target, NDArray[np.float64]] = {}

    @property
    def whole(self) -> Scene | None:
        """The scene before it was edited, None while there is none."""
        opened = self._session.opened_scene
        return opened.whole if opened is not None else None

    @property
    def catalogue(self) -> Catalogue | None:
        """What can be edited."""
        whole = self.whole
        if whole is None:
            return None
        if self._known is None or self._known[0] is not whole:
            from pmviewer.scene.editing.catalogue import catalogue_of

            self._known, self.chosen = (whole, catalogue_of(whole)), None
            self._middles.clear()
        return self._known[1]

    @property
    def edits(self) -> Edits:
        """Those that are asked for."""
        return self._session.settings.edit.changes

    def choose(self, target: Target | None) -> None:
        """Show the handles of that one, or of none."""
        self.raised = self.raised or (target is not None and self.chosen is None)
        self.chosen = target

    def choose_object(self, number: int) -> None:
        """The object of that number, shapes before instances."""
        catalogue = self.catalogue
        if catalogue is not None and 0 <= number < len(catalogue.targets["object"]):
            self.choose(catalogue.targets["object"][number])

    def name_of(self, target: Target, prop: str) -> str:
        """The edit that changes the property, by its full name as it stands in the settings; other spellings of it are
        found."""
        for what in (target.key, target.name, str(self.number(target))):
            if f"{target.kind}.{what}.{prop}" in self.edits:
                return f"{target.kind}.{what}.{prop}"
        return f"{target.kind}.{target.key}.{prop}"

    def value(self, target: Target, prop: str) -> tuple[float, ...]:
        """The numbers of the property now: edited, or the scene's own."""
        edited = self.edits.get(self.name_of(target, prop))
        return edited if edited is not None else self.own(target, prop)

    def own(self, target: Target, prop: str) -> tuple[float, ...]:
        """What the file says."""
        from pmviewer.scene.editing.own import own_of

        whole = self.whole
        assert whole is not None
        return own_of(whole, target, prop)

    def is_edited(self, target: Target, prop: str | None = None) -> bool:
        """Whether the property, or any of it, is edited."""
        props = PROPERTIES[target.kind] if prop is None else (prop,)
        return any(self.name_of(target, p) in self.edits for p in props)

    def refusal(self, target: Target, prop: str) -> str | None:
        """Why the property can't be edited, None if it can."""
        from pmviewer.scene.editing.catalogue import refusal

        whole = self.whole
        return refusal(whole, target, prop) if whole is not None else None

    def set(self, target: Target, values: dict[str, tuple[float, ...]]) -> None:
        """Edit properties; what the file says is no edit."""
        edits = dict(self.edits)
        for prop, numbers in values.items():
            name = self.name_of(target, prop)
            edits[name] = tuple(float(f"{number:.7g}") for number in numbers)
            if np.allclose(edits[name], self.own(target, prop), rtol=1e-6, atol=1e-12):
                del edits[name]
        self._change({"edit.changes": edits})

    def reset(self, target: Target | None = None, prop: str | None = None) -> None:
        """Take edits back: of one property, of one target, or all."""
        edits = dict(self.edits)
        if target is None:
            edits.clear()
        else:
            for p in PROPERTIES[target.kind] if prop is None else (prop,):
                edits.pop(self.name_of(target, p), None)
        self._change({"edit.changes": edits})

    def middle(self, target: Target) -> NDArray[np.float64]:
        """What it turns and grows around, (3,), where the file has it, in the coordinates of the picture."""
        if target not in self._middles:
            from pmviewer.scene.editing.apply import middle_of

            whole = self.whole
            assert whole is not None
            self._middles[target] = middle_of(whole, target)
        return self._middles[target] + self._offset()

    def _offset(self) -> NDArray[np.float64]:
        """How far the scene was moved when it was opened, (3,): all of it, its camera too."""
        opened = self._session.opened_scene
        return np.subtract(opened.scene.camera.origin, opened.whole.camera.origin)

    def material_of(self, target: Target) -> Target | None:
        """The material of a shape; None for what has several or none."""
        whole, catalogue = self.whole, self.catalogue
        if whole is None or catalogue is None or target.of != "shape":
            return None
        return catalogue.targets["material"][whole.shapes[target.place].material]

    def object_number(self, target: Target) -> int:
        """Of the object that it is, shapes before instances; −1 for lights without a surface."""
        whole = self.whole
        if whole is None or target.of not in ("shape", "instance"):
            return -1
        return target.place + (len(whole.shapes) if target.of == "instance" else 0)

    def number(self, target: Target) -> int:
        """Its number from 1 among those of its kind."""
        catalogue = self.catalogue
        return catalogue.targets[target.kind].index(target) + 1 if catalogue is not None else 0
