"""A picture that was kept, with all that made it: of a frame, or of a file.

A snapshot's file is the EXR that `File > Export EXR` writes, with its name and its error's curve as two attributes
more, so that any exported EXR opens as a snapshot with its settings and figures. EXR files of other programs have their
picture alone, PNG files their picture, from which the sRGB curve is taken.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError, SettingError
from pmviewer.output.exr import BEAUTY, Value, read_exr, write_exr
from pmviewer.output.frame_export import EXR_NAMES, LAYERS, VOLUME_LAYERS, Exportable, frame_metadata, layers_of
from pmviewer.output.kept_layers import kept
from pmviewer.output.png import read_png
from pmviewer.settings.access import SETTINGS, Settings, parse_assignments, with_values

SUFFIXES = (".exr", ".png")
_VIEWS = {name: view for view, name in EXR_NAMES.items()}
_NAME, _CURVE, _TRUTH = "snapshot", "curve", "curve.reference"


@dataclass(frozen=True)
class CurvePoint:
    """relMSE after some passes; `seconds` of rendering, `cpu_seconds` summed over threads."""

    passes: int
    seconds: float
    cpu_seconds: float
    relmse: float


@dataclass(frozen=True, eq=False)
class Snapshot:
    """`number` tells it from others, `name` is the user's, `layers` are (h, w, c) float32 by view ("beauty" at least),
    on disk and read only, `about` what an EXR's attributes tell of it. `curve`: how its error fell, against the
    reference `truth`."""

    number: int
    name: str
    layers: Mapping[str, NDArray[np.float32]]
    about: Mapping[str, Value] = field(default_factory=dict)
    curve: tuple[CurvePoint, ...] = ()
    truth: str = ""
    encoded: bool = False
    """Whether it comes from display values, which are cut at 1."""

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        height, width = self.layers["beauty"].shape[:2]
        return width, height

    @cached_property
    def bytes(self) -> int:
        """Of its layers."""
        return sum(layer.nbytes for layer in self.layers.values())

    def image(self, view: str) -> NDArray[np.float32]:
        """That layer, or the beauty where there is none of that name."""
        return self.layers.get(view, self.layers["beauty"])

    @cached_property
    def settings(self) -> Settings | None:
        """Those that it was made with, None of other programs' files. What this program does not know is left out."""
        known = {path: str(value) for path, value in self.about.items() if path in SETTINGS}
        if not known:
            return None
        settings = Settings()
        try:
            return with_values(settings, parse_assignments(f"{path}={text}" for path, text in known.items()))
        except SettingError:
            for path, text in known.items():  # of another version of the program: what can be taken is
                try:
                    settings = with_values(settings, parse_assignments([f"{path}={text}"]))
                except SettingError:
                    continue
            return settings

    @property
    def camera(self) -> dict[str, Value]:
        """The camera as it was resolved, by the attributes' names; empty where it isn't known."""
        return {n: v for n, v in self.about.items() if n.startswith("view.") and n != "view.exposure"}

    def figure(self, name: str) -> float | None:
        """A count or time of `frame_metadata`, None where it isn't known."""
        value = self.about.get(name)
        return float(value) if isinstance(value, int | float) else None

    def renamed(self, name: str) -> Snapshot:
        """The same with another name."""
        return replace(self, name=name)


def snapshot_of(number: int, name: str, frame: Exportable) -> Snapshot:
    """Of a frame as it is now; its layers are copied, to the disk."""
    layers = {view: frame.image(view) for view in layers_of(frame)}
    return Snapshot(number, name, kept(layers), frame_metadata(frame))


def write_snapshot(path: str | Path, snapshot: Snapshot) -> None:
    """Write it as an EXR file. Raises OutputError."""
    about: dict[str, Value] = {**snapshot.about, _NAME: snapshot.name}
    if snapshot.curve:
        rows = (f"{p.passes} {p.seconds!r} {p.cpu_seconds!r} {p.relmse!r}" for p in snapshot.curve)
        about |= {_CURVE: "; ".join(rows), _TRUTH: snapshot.truth}
    if snapshot.encoded:
        about["encoded"] = "true"
    layers = {EXR_NAMES.get(view, view): layer for view, layer in snapshot.layers.items()}
    write_exr(path, layers, about)


def read_snapshot(path: str | Path, number: int = 0) -> Snapshot:
    """A file as a snapshot, named as it was or else after the file. Raises SceneError for what is no EXR or PNG file
    with a picture in colours or grey."""
    path = Path(path)
    if path.suffix.lower() == ".png":
        return Snapshot(number, path.stem, kept({"beauty": _decoded(path)}), encoded=True)
    if path.suffix.lower() != ".exr":
        raise SceneError("A snapshot is a picture.", path, hint=f"Give a file that ends in {' or '.join(SUFFIXES)}.")
    layers, about = read_exr(path)
    if BEAUTY not in layers or layers[BEAUTY].shape[2] == 2:
        others = ", ".join(name for name in layers if name)
        raise SceneError(f"The file has no channels R, G, B{f', only the layers {others}' if others else ''}.", path)
    named = {_VIEWS.get(name, name): layer for name, layer in layers.items()}
    views = {view: _colours(layer, view) for view, layer in named.items() if view in (*LAYERS, *VOLUME_LAYERS)}
    name, encoded = str(about.pop(_NAME, path.stem)), about.pop("encoded", "") == "true"
    curve, truth = _curve(str(about.pop(_CURVE, ""))), str(about.pop(_TRUTH, ""))
    return Snapshot(number, name, kept(views), about, curve, truth, encoded)


def _colours(layer: NDArray[np.float32], view: str) -> NDArray[np.float32]:
    """Three channels of a layer, one of depth; grey is repeated."""
    if view == "depth":
        return np.ascontiguousarray(layer[..., :1])
    return np.ascontiguousarray(np.repeat(layer, 3, axis=2) if layer.shape[2] == 1 else layer[..., :3])


def _decoded(path: Path) -> NDArray[np.float32]:
    """(h, w, 3) in 0 … 1 of a PNG file, by the inverse of the sRGB curve (IEC 61966-2-1)."""
    pixels, _ = read_png(path)
    values = np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels[..., :3]
    x = values.astype(np.float64) / 255
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _curve(text: str) -> tuple[CurvePoint, ...]:
    """The inverse of what `write_snapshot` writes; none where a text is something else."""
    points = []
    for row in filter(None, re.split(r";\s*", text)):
        try:
            passes, seconds, cpu, error = row.split()
            points.append(CurvePoint(int(passes), float(seconds), float(cpu), float(error)))
        except ValueError:
            return ()
    return tuple(points)
