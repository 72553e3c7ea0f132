"""The texture statements of Wavefront MTL files: `map_Kd -s 2 2 wood.png` and their like."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.texture_file import read_picture
from pmviewer.scene.texture import Affine, Bitmap

_KEYS = {"map_kd": "kd", "map_ks": "ks", "map_ke": "ke", "bump": "bump", "map_bump": "bump", "norm": "norm"}
_COLOURS = ("kd", "ks", "ke")
_OPTION_WORDS = {"-blendu": 1, "-blendv": 1, "-cc": 1, "-mm": 2, "-texres": 1, "-imfchan": 1, "-type": 1, "-boost": 1}


@dataclass(frozen=True)
class Map:
    """One statement: the file, how it is laid on, and the factor of a bump map."""

    file: str
    line: int
    to_uv: Affine
    clamp: bool
    factor: float


def read_maps(text: str) -> tuple[dict[str, dict[str, Map]], set[str]]:
    """Maps by material and use (kd, ks, ke, bump, norm), and the statements that are not read."""
    found: dict[str, dict[str, Map]] = {}
    ignored: set[str] = set()
    current: dict[str, Map] = {}
    for number, line in enumerate(text.splitlines(), 1):
        key, _, rest = line.strip().partition(" ")
        key, rest = key.lower(), rest.strip()
        if key == "newmtl":
            current = found.setdefault(" ".join(rest.split()), {})
        elif key in _KEYS and rest:
            current[_KEYS[key]] = _statement(rest, number)
        elif key.startswith(("map_", "disp", "refl", "decal")):
            ignored.add(key)
    return found, ignored


def _statement(rest: str, line: int) -> Map:
    scale, offset, clamp, factor = [1.0, 1.0], [0.0, 0.0], False, 1.0
    words = rest.split()
    while words and words[0].startswith("-"):
        option = words.pop(0).lower()
        if option in ("-s", "-o", "-t"):
            numbers: list[float] = []
            while len(words) > 1 and len(numbers) < 3 and _is_number(words[0]):
                numbers.append(float(words.pop(0)))
            target = {"-s": scale, "-o": offset}.get(option)
            if target is not None:
                target[: len(numbers[:2])] = numbers[:2]
        elif option == "-clamp" and words:
            clamp = words.pop(0).lower() == "on"
        elif option == "-bm" and words and _is_number(words[0]):
            factor = float(words.pop(0))
        else:
            del words[: _OPTION_WORDS.get(option, 1)]
    # Vertical coordinates are counted from above here, from below in the file.
    to_uv = (scale[0], 0.0, offset[0], 0.0, scale[1], 1.0 - scale[1] - offset[1])
    return Map(" ".join(words), line, to_uv, clamp, factor)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def load_maps(maps: Mapping[str, Map], library: Path, diagnostics: Diagnostics) -> dict[str, Bitmap]:
    """The statements' pictures; what can't be read is left out with a warning, for a mesh is worth seeing without."""
    textures = {}
    for use, m in maps.items():
        path = library.parent / m.file.replace("\\", "/")
        try:
            if not path.is_file():
                raise SceneError(f"The texture {m.file[:200]!r} does not exist.")
            pixels, sentence = read_picture(path, path.name, raw=use not in _COLOURS)
        except (SceneError, OSError, ValueError) as error:
            what = error.what if isinstance(error, SceneError) else f"The texture {m.file[:200]!r} can't be read."
            diagnostics.warn(f"{what} It is left out ({library.name}, line {m.line}).")
            continue
        if sentence:
            diagnostics.warn(sentence)
        textures[use] = Bitmap(pixels, "clamp" if m.clamp else "repeat", to_uv=m.to_uv, name=path.name)
    return textures
