"""Wavefront MTL: materials by what their numbers say. The illumination model alone decides little, for programs write
it at will (Maya writes 4, "glass", for everything)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB, Material, Principled
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mtl_maps import Map, Pictures, map_of
from pmviewer.scene.formats.obj_text import decoded
from pmviewer.scene.formats.open_file import found_beside, read_regular
from pmviewer.scene.texture import Bitmap, Texture, limited, scaled

_RAY_TRACED = range(3, 10)
_REFRACTING = (6, 7)
_MIRRORING = (3, 5, 8)
_ROUGHEST = 0.5
"""α beyond which a coat of varnish can't be told from the diffuse base."""
_FAINTEST = 0.004
"""Reflectance at normal incidence below which nobody sees a coat."""
_SPECULAR = 0.08
"""Reflectance at normal incidence that Ks 1 stands for beside a diffuse colour, as Blender and others write it."""
_LIGHT_NAME = re.compile(r"light|lamp|emit|luminaire|bulb", re.IGNORECASE)
_ALL_LIGHT = re.compile(r"(area|ceiling|top|room|sun|sky|key|fill)?[ _.-]*(light|emitter)(s|source)?[ _.-]*\d*", re.I)
_BRIGHT = 10.0
"""Radiance of a white light whose file doesn't say."""
_KNOWN = ("ka", "kd", "ks", "ke", "tf", "ns", "ni", "d", "tr", "illum", "pr", "pm", "ps", "pc", "pcr")


@dataclass(frozen=True)
class MtlMaterial:
    """A material, the radiance it emits and its texture."""

    material: Material
    radiance: RGB | None = None
    emission: Texture | None = None

    @property
    def textured(self) -> bool:
        """Are texture coordinates of use?"""
        return bool(self.material.textures) or self.emission is not None

    def with_vertex_colours(self) -> Material:
        """The material multiplied by the colours of vertices."""
        return replace(self.material, vertex_colours=True)


@dataclass
class _Statements:
    """Of one material: numbers by key, maps by key, and the file they stand in."""

    library: Path
    line: int
    numbers: dict[str, list[float]] = field(default_factory=dict)
    maps: dict[str, Map] = field(default_factory=dict)

    def colour(self, key: str, default: float) -> RGB:
        """Three numbers that are not negative; one counts for all channels."""
        numbers = self.numbers.get(key) or [default]
        r, g, b = numbers[:3] if len(numbers) >= 3 else numbers[:1] * 3
        return (max(0.0, r), max(0.0, g), max(0.0, b))

    def one(self, key: str, default: float) -> float:
        """A number that is not negative."""
        return max(0.0, self.numbers[key][0]) if self.numbers.get(key) else default


class Materials:
    """All materials that an OBJ file's libraries define; each is made, and its pictures are read, when it is asked
    for."""

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._statements: dict[str, _Statements] = {}
        self._made: dict[str, MtlMaterial] = {}
        self._diagnostics = diagnostics
        self._pictures = Pictures(diagnostics)

    def __bool__(self) -> bool:
        return bool(self._statements)

    def __contains__(self, name: str | None) -> bool:
        return name is not None and _name(name) in self._statements

    def __getitem__(self, name: str | None) -> MtlMaterial:
        key = _name(name or "")
        if key not in self._made:
            self._made[key] = _material(key, self._statements[key], self._pictures, self._diagnostics)
        return self._made[key]

    def light_up(self, names: Iterable[str]) -> None:
        """Where none of these materials emits, those named like a light do, in their own colour: many programs leave
        lights out of the file."""
        found = {name: self[name] for name in dict.fromkeys(names) if name in self}
        if any(m.radiance is not None for m in found.values()):
            return
        for name, m in found.items():
            if not _ALL_LIGHT.fullmatch(_name(name)) or m.material.transparent:
                continue
            r, g, b = m.material.reflectance if max(m.material.reflectance) > 0 else (1.0, 1.0, 1.0)
            self._made[_name(name)] = replace(m, radiance=(_BRIGHT * r, _BRIGHT * g, _BRIGHT * b))
            what = f"No material emits light (Ke). That of '{name[:60]}' does, for its name, with a guessed radiance."
            self._diagnostics.warn(what)

    def tell_missing(self) -> None:
        """Warn of the pictures that were asked for and are not there."""
        self._pictures.tell_missing()

    def read(self, library: Path, text: str) -> None:
        """Add the materials of a file; the first definition of a name counts."""
        current = _Statements(library, 0)
        strange: dict[str, int] = {}
        for number, line in enumerate(text.splitlines(), 1):
            words = line.split(None, 1)
            if not words or words[0].startswith("#"):
                continue
            key, rest = words[0].lower(), words[1].strip() if len(words) > 1 else ""
            if key == "newmtl":
                current = _Statements(library, number)
                self._statements.setdefault(_name(rest), current)
            elif (found := map_of(key, rest, number)) is not None:
                current.maps.setdefault(found.use, found)
            elif key in _KNOWN:
                numbers = _numbers(rest)
                if numbers:
                    current.numbers.setdefault(key, numbers)
                elif rest.split()[:1] in (["spectral"], ["xyz"]):
                    self._diagnostics.warn(
                        f"Colours given as '{rest.split()[0]}' are ignored ({library.name}).", number
                    )
            elif key.startswith(("map_", "disp", "refl", "decal")):
                strange.setdefault(key, number)
        if strange:
            names = ", ".join(sorted(strange))
            self._diagnostics.warn(f"The textures {names} of {library.name} are ignored: surfaces look plainer there.")


def read_libraries(path: Path, named: Sequence[tuple[str, int]], diagnostics: Diagnostics) -> Materials:
    """The materials of all MTL files that an OBJ file names, each with the line that names it."""
    materials = Materials(diagnostics)
    done: set[Path] = set()
    for argument, line in named:
        whole = found_beside(path.parent, argument)
        named_files = [argument] if whole.exists() else argument.split()
        libraries = [found_beside(path.parent, name) for name in named_files]
        missing = [name for name, library in zip(named_files, libraries) if not library.exists()]
        own = found_beside(path.parent, f"{path.stem}.mtl")
        if len(missing) == len(libraries) and own.exists():
            diagnostics.warn(f"The material file {argument!r} does not exist: '{own.name}' is taken for it.", line)
            libraries = [own]
        elif missing:
            gone = argument if len(missing) == len(libraries) else " ".join(missing)
            diagnostics.warn(f"The material file {gone[:200]!r} does not exist: grey replaces its materials.", line)
        for library in libraries:
            if library in done or not library.exists():
                continue
            done.add(library)
            try:
                materials.read(library, decoded(read_regular(library, "The material file")))
            except SceneError as error:
                diagnostics.warn(f"{error.what} Grey replaces the materials of '{library.name}'.", line)
    return materials


def _name(name: str) -> str:
    return " ".join(name.split())


def _numbers(text: str) -> list[float]:
    """The finite numbers that a statement begins with, behind options such as -halo."""
    numbers: list[float] = []
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            if word.startswith("-") and not numbers:
                continue
            break
        if not math.isfinite(value):
            break
        numbers.append(value)
    return numbers


def _material(name: str, s: _Statements, pictures: Pictures, diagnostics: Diagnostics) -> MtlMaterial:
    """What the statements say, see docs/scenes.md."""
    maps = {use: picture for use, m in s.maps.items() if (picture := pictures.read(m, s.library)) is not None}
    opacity = _opacity(name, s, diagnostics)
    tf, index, model = s.colour("tf", 1.0), s.one("ni", 1.0), int(s.one("illum", 2.0))
    if "opacity" not in maps and _is_glass(s, opacity, tf, index, model):
        tint = tf if max(tf) > 0 else (1.0, 1.0, 1.0)
        material = Material(name, "dielectric", (1.0, 1.0, 1.0), _capped(tint), eta=index)
    else:
        material = _opaque(name, s, maps, model)
        cut = maps.get("opacity")
        if cut is not None:
            textured, _ = limited(scaled(cut, (opacity,) * 3), 1.0)
            r, g, b = textured.mean
            material = replace(
                material,
                opacity=0.2126 * r + 0.7152 * g + 0.0722 * b,
                textures={**material.textures, "opacity": textured},
            )
        else:
            material = replace(material, opacity=opacity)
    surface: dict[str, Texture] = {slot: maps[slot] for slot in ("bump", "normal") if slot in maps}
    scale = s.maps["bump"].factor if "bump" in maps else 1.0
    material = replace(material, textures={**material.textures, **surface}, bump_scale=scale)
    ke = s.colour("ke", 0.0)
    ka = s.colour("ka", 0.0)
    if not max(ke) > 0 and "ke" not in maps and max(ka) > 1 and _LIGHT_NAME.search(name):
        what = f"The material '{name[:60]}' has no Ke, but a Ka above 1 and the name of a light: Ka is what it emits."
        diagnostics.warn(what)
        ke = ka
    ke, emission = _textured(ke, maps.get("ke"), None)
    return MtlMaterial(material, ke, emission) if max(ke) > 0 else MtlMaterial(material)


def _opacity(name: str, s: _Statements, diagnostics: Diagnostics) -> float:
    """Of d, or of Tr, which is 1 − d by most programs and d by some: a Tr of 1 hides nothing here."""
    if "d" in s.numbers:
        return min(1.0, s.one("d", 1.0))
    if "tr" not in s.numbers:
        return 1.0
    opacity = 1.0 - min(1.0, s.one("tr", 0.0))
    if opacity == 0.0:
        what = "Materials with Tr 1 and without d are shown opaque: some programs mean the opposite by Tr"
        diagnostics.warn(f"{what} ('{name[:60]}' in {s.library.name}).", kind="mtl Tr 1")
        return 1.0
    return opacity


def _is_glass(s: _Statements, opacity: float, tf: RGB, index: float, model: int) -> bool:
    """Does light pass with refraction? Asks for an index, a model that traces rays, and anything that says that light
    passes: the refracting models, d, a Tf other than white, or no colour of its own at all."""
    if not index > 1.0 or model not in _RAY_TRACED:
        return False
    if model in _REFRACTING:
        return True
    filters = "tf" in s.numbers and max(tf) > 0 and tf != (1.0, 1.0, 1.0) and model not in _MIRRORING
    black = "kd" in s.numbers and max(s.colour("kd", 0.7)) == 0 and "kd" not in s.maps and model not in _MIRRORING
    return opacity < 1.0 or filters or black


def _opaque(name: str, s: _Statements, maps: dict[str, Bitmap], model: int) -> Material:
    kd, base = _textured(s.colour("kd", 0.7), maps.get("kd"), 1.0)
    textures: dict[str, Texture] = {} if base is None else {"reflectance": base}
    if any(key in s.numbers for key in ("pr", "pm", "ps", "pc")) or {"alpha", "metallic"} & maps.keys():
        return _principled(name, s, maps, kd, textures)
    ks, shine = _textured(s.colour("ks", 0.0), maps.get("ks"), 1.0)
    metal = max(ks) > max(kd) and max(ks) >= 0.5
    metal_textures: dict[str, Texture] = {} if shine is None else {"reflectance": shine}
    if model in _MIRRORING and metal:
        return Material(name, "conductor", _capped(ks), two_sided=True, textures=metal_textures)
    # Phong's exponent as Beckmann's roughness (Walter et al. 2007, section 5.1)
    alpha = math.sqrt(2 / (s.one("ns", 0.0) + 2))
    if model >= 2 and "ns" in s.numbers and alpha <= _ROUGHEST:
        roughness = (max(alpha, 0.01),) * 2
        if metal and max(kd) <= 0.1 * max(ks):
            return Material(
                name, "rough conductor", _capped(ks), two_sided=True, alpha=roughness, textures=metal_textures
            )
        normal = _SPECULAR * min(1.0, float(np.mean(ks)))
        if normal >= _FAINTEST:
            root = math.sqrt(normal)
            return Material(
                name, "rough plastic", _capped(kd), eta=(1 + root) / (1 - root), two_sided=True, alpha=roughness,
                textures=textures,
            )  # fmt: skip
    return Material(name, "diffuse", _capped(kd), two_sided=True, textures=textures)


def _principled(name: str, s: _Statements, maps: dict[str, Bitmap], kd: RGB, textures: dict[str, Texture]) -> Material:
    """The physically based extension: Pr roughness, Pm metallic, Ps sheen, Pc and Pcr a clear coat and its
    roughness."""

    def share(key: str, default: float) -> float:
        return min(1.0, s.one(key, default))

    roughness, metallic = share("pr", 0.5), share("pm", 0.0)
    alpha = roughness**2
    if "alpha" in maps:
        # α is the square of what the picture holds times the number.
        factor = np.float32(share("pr", 1.0))
        rough = replace(maps["alpha"], pixels=np.clip(maps["alpha"].pixels * factor, 0, 1) ** 2)
        textures["alpha"], alpha = rough, float(np.mean(rough.mean))
    if "metallic" in maps:
        shining, _ = limited(scaled(maps["metallic"], (share("pm", 1.0),) * 3), 1.0)
        textures["metallic"], metallic = shining, float(np.mean(shining.mean))
    more = Principled(
        metallic=metallic, sheen=share("ps", 0.0), clearcoat=share("pc", 0.0), clearcoat_gloss=1.0 - share("pcr", 0.0)
    )
    index = s.one("ni", 1.5)
    return Material(
        name, "principled", _capped(kd), eta=index if index > 1.0 else 1.5, two_sided=True,
        alpha=(max(alpha, 1e-4),) * 2, textures=textures, principled=more,
    )  # fmt: skip


def _textured(colour: RGB, bitmap: Bitmap | None, most: float | None) -> tuple[RGB, Texture | None]:
    """The colour times a map's mean, and the map times the colour; a black colour leaves the map as it is."""
    if bitmap is None:
        return colour, None
    texture, _ = limited(scaled(bitmap, colour if any(colour) else (1.0, 1.0, 1.0)), most)
    return texture.mean, texture


def _capped(colour: RGB) -> RGB:
    r, g, b = (min(1.0, c) for c in colour)
    return (r, g, b)
