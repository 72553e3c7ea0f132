"""Pictures that are compared, whatever they come from: frames, snapshots, the reference."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame
from pmviewer.settings.access import Settings
from pmviewer.viewer.gl.textures import Same

if TYPE_CHECKING:  # brings OpenEXR and scipy along, which the window doesn't wait for
    from pmviewer.output.compare import Reference
    from pmviewer.output.snapshot import CurvePoint, Snapshot

_SAME = 1e-5
"""Relative difference up to which two cameras' numbers are alike."""


@dataclass(frozen=True, eq=False)
class Side:
    """One of the pictures. `key` tells it from all others, `image` gives a layer, `about` what EXR files tell of a
    picture (empty where nobody knows), `views` the layers that it has, None for all; `encoded` that it comes from
    display values."""

    key: Hashable
    name: str
    image: Callable[[str], NDArray[np.float32]]
    size: tuple[int, int]
    about: Mapping[str, Any] = field(default_factory=dict)
    settings: Settings | None = None
    frame: Frame | None = None
    views: frozenset[str] | None = None
    curve: tuple[CurvePoint, ...] = ()
    encoded: bool = False

    def layer(self, view: str) -> str:
        """That layer's name, or the image's where it has none of it."""
        return view if self.views is None or view in self.views else "beauty"

    @property
    def camera(self) -> dict[str, Any]:
        """As it was resolved; empty where it isn't known."""
        return {n: v for n, v in self.about.items() if n.startswith("view.") and n != "view.exposure"}

    def fact(self, name: str) -> float | None:
        """A count or time of EXR files' attributes, None where it isn't known."""
        value = self.about.get(name)
        return float(value) if isinstance(value, int | float) else None


def frame_side(frame: Frame, name: str) -> Side:
    """Of a frame."""
    from pmviewer.output.frame_export import frame_metadata

    size = frame.camera.width, frame.camera.height  # of a coarse one, too
    return Side(Same(frame), name, frame.image, size, frame_metadata(frame), frame.settings, frame)


def snapshot_side(snapshot: Snapshot) -> Side:
    """Of a snapshot."""
    return Side(
        Same(snapshot.layers),
        snapshot.name,
        snapshot.image,
        snapshot.size,
        snapshot.about,
        snapshot.settings,
        views=frozenset(snapshot.layers),
        curve=snapshot.curve,
        encoded=snapshot.encoded,
    )


def reference_side(reference: Reference) -> Side:
    """Of the reference, which has its picture alone."""
    image = reference.image
    return Side(Same(image), "reference", lambda view: image, reference.size, views=frozenset(("beauty",)))


def same_camera(a: Side, b: Side) -> bool:
    """Whether both are seen by one camera, as far as that is known."""
    return same_view(a.camera, b.camera)


def same_view(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """The same of two cameras by their attributes; one that isn't known is any."""
    if not one or not other:
        return True
    if one.keys() != other.keys():
        return False
    return all(_alike(value, other[name]) for name, value in one.items())


def _alike(a: Any, b: Any) -> bool:
    """Of two attributes: numbers, texts of numbers, or texts."""
    try:
        x, y = (np.array([float(part) for part in str(value).split()]) for value in (a, b))
    except ValueError:
        return a == b
    return x.shape == y.shape and bool(np.allclose(x, y, rtol=_SAME, atol=_SAME))
