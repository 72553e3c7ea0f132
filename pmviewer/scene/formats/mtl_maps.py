"""The texture statements of Wavefront MTL files: `map_Kd -s 2 2 wood.png` and their like."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.open_file import found_beside
from pmviewer.scene.formats.texture_file import read_opacity, read_picture
from pmviewer.scene.texture import Affine, Bitmap

_USES = {
    "map_kd": "kd", "map_ks": "ks", "map_ke": "ke", "map_d": "opacity", "map_tr": "transparency", "bump": "bump",
    "map_bump": "bump", "norm": "normal", "map_pr": "alpha", "map_pm": "metallic",
}  # fmt: skip
_COLOURS = ("kd", "ks", "ke")
_OPTION_WORDS = {"-blendu": 1, "-blendv": 1, "-cc": 1, "-texres": 1, "-type": 1, "-boost": 1}


@dataclass(frozen=True)
class Map:
    """One statement: what it is for, the file, how it is laid on, the factor of a bump map, the channel that counts
    ("" for all), and what the values are multiplied by and added to."""

    use: str
    file: str
    line: int
    to_uv: Affine
    clamp: bool
    factor: float
    channel: str
    gain: float
    base: float


def map_of(key: str, rest: str, line: int) -> Map | None:
    """The statement `key rest`; None if it is none that is read."""
    if key not in _USES or not rest:
        return None
    scale, offset, clamp, factor, channel, base, gain = [1.0, 1.0], [0.0, 0.0], False, 1.0, "", 0.0, 1.0
    words = rest.split()
    while len(words) > 1 and words[0].startswith("-"):
        option = words.pop(0).lower()
        if option in ("-s", "-o", "-t"):
            numbers = _leading(words, 3)
            target = {"-s": scale, "-o": offset}.get(option)
            if target is not None:
                target[: len(numbers[:2])] = numbers[:2]
        elif option == "-clamp":
            clamp = words.pop(0).lower() == "on"
        elif option == "-bm":
            factor = (_leading(words, 1) or [1.0])[0]
        elif option == "-mm":
            base, gain = (*_leading(words, 2), 0.0, 1.0)[:2] if len(words) > 2 else (0.0, 1.0)
        elif option == "-imfchan":
            channel = words.pop(0).lower()
        else:
            del words[: min(_OPTION_WORDS.get(option, 1), len(words) - 1)]
    # Vertical coordinates are counted from above here, from below in the file.
    to_uv = (scale[0], 0.0, offset[0], 0.0, scale[1], 1.0 - scale[1] - offset[1])
    return Map(_USES[key], " ".join(words), line, to_uv, clamp, factor, channel, gain, base)


def _leading(words: list[str], most: int) -> list[float]:
    """Take up to `most` finite numbers off the front, but never the last word, which is the file."""
    numbers: list[float] = []
    while len(words) > 1 and len(numbers) < most:
        try:
            value = float(words[0])
        except ValueError:
            break
        if not np.isfinite(value):
            break
        numbers.append(value)
        words.pop(0)
    return numbers


class Pictures:
    """The pictures that statements name, each file read once; what can't be read is left out with a warning, for a mesh
    is worth seeing without."""

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._missing: dict[str, str] = {}
        self._pixels: dict[tuple[Path, str], NDArray[np.float32] | None] = {}

    def read(self, m: Map, library: Path) -> Bitmap | None:
        """The statement's picture, None if it can't be read."""
        path = found_beside(library.parent, m.file)
        if not path.exists():  # a path of another machine
            path = found_beside(library.parent, m.file.replace("\\", "/").rsplit("/", 1)[-1])
        kind = "colour" if m.use in _COLOURS else "opacity" if m.use in ("opacity", "transparency") else "raw"
        if (path, kind) not in self._pixels:
            self._pixels[path, kind] = self._load(path, kind, m, library)
        pixels = self._pixels[path, kind]
        if pixels is None:
            return None
        channel = "rgb".find(m.channel) if len(m.channel) == 1 else -1
        if channel >= 0 and pixels.shape[2] == 3 and m.use not in _COLOURS:
            pixels = pixels[:, :, channel : channel + 1]
        if (m.base, m.gain) != (0.0, 1.0):
            pixels = pixels * np.float32(m.gain) + np.float32(m.base)
        if m.use == "transparency":
            pixels = np.float32(1) - pixels
        return Bitmap(np.ascontiguousarray(pixels), "clamp" if m.clamp else "repeat", to_uv=m.to_uv, name=path.name)

    def tell_missing(self) -> None:
        """Warn of the files that are not there, once for all of them."""
        if not self._missing:
            return
        names, where = list(self._missing), next(iter(self._missing.values()))
        if len(names) == 1:
            self._diagnostics.warn(f"The texture {names[0]!r} does not exist. It is left out ({where}).")
            return
        listed = ", ".join(repr(name) for name in names[:5]) + (", …" if len(names) > 5 else "")
        self._diagnostics.warn(f"{len(names)} textures do not exist and are left out: {listed} (the first in {where}).")

    def _load(self, path: Path, kind: str, m: Map, library: Path) -> NDArray[np.float32] | None:
        try:
            if not path.exists():
                self._missing.setdefault(m.file[:100], f"{library.name}, line {m.line}")
                return None
            if kind == "opacity":
                pixels, sentence = read_opacity(path, path.name)
            else:
                pixels, sentence = read_picture(path, path.name, raw=kind == "raw")
        except (SceneError, OSError, ValueError) as error:
            what = error.what if isinstance(error, SceneError) else f"The texture {m.file[:200]!r} can't be read."
            self._diagnostics.warn(f"{what} It is left out ({library.name}, line {m.line}).")
            return None
        if sentence:
            self._diagnostics.warn(sentence)
        return pixels
