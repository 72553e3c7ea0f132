"""Hostile cases by number: case i of a seed is the same on every machine, and can be made alone."""

from __future__ import annotations

import os
import random
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from pmviewer.bench.hostile.mutate import BYTE_MUTATIONS, TEXT_MUTATIONS
from pmviewer.bench.hostile.seeds import Seed, seeds
from pmviewer.bench.hostile.specials import specials
from pmviewer.bench.hostile.structure import mutate_deflated, mutate_glb, mutate_json, mutate_xml

TEXTS = (".xml", ".gltf", ".obj", ".mtl")


@dataclass(frozen=True)
class Case:
    """`main` is to be opened. `seed`: the honest case that it was made from, for comparison."""

    name: str
    format: str
    main: str
    files: dict[str, bytes]
    fifos: tuple[str, ...] = ()
    links: dict[str, str] = field(default_factory=dict)
    seed: str = ""

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(map(len, self.files.values()))

    def write(self, folder: Path) -> Path:
        """Write all files; the one to be opened."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in self.files.items():
            (folder / name).write_bytes(content)
        for name in self.fifos:
            if hasattr(os, "mkfifo") and not os.path.lexists(folder / name):
                os.mkfifo(folder / name)
        for name, target in self.links.items():
            if not os.path.lexists(folder / name):
                (folder / name).symlink_to(target)
        return folder / self.main


@cache
def honest() -> tuple[Case, ...]:
    """The seeds themselves."""
    return tuple(Case(s.name, s.format, s.main, dict(s.files), seed=s.name) for s in seeds())


@cache
def _seeds() -> tuple[Seed, ...]:
    return tuple(seeds())


def case(seed: int, index: int, every_special: bool = True) -> Case:
    """Case `index` of `seed`: the specials come first, mutations of each honest file in turn then.

    With `every_special` false only one in four of the specials comes, spread evenly.
    """
    listed = specials() if every_special else specials()[::4]
    if index < len(listed):
        made = listed[index][1]()
        return Case(listed[index][0], made.format, made.main, made.files, made.fifos, dict(made.links))
    of = _seeds()[(index - len(listed)) % len(_seeds())]
    chance = random.Random(f"{seed} {index - len(listed)} {of.name}")
    victim = chance.choice(of.victims)
    content, mutation = mutated(of.files[victim], victim, chance)
    files = {**of.files, victim: content}
    return Case(f"{of.name}: {victim} {mutation}", of.format, of.main, files, seed=of.name)


def mutated(data: bytes, name: str, chance: random.Random) -> tuple[bytes, str]:
    """The file changed, and how."""
    ending = Path(name).suffix
    kinds = ["bytes"]
    if ending in TEXTS or data[:5] == b"solid" or b"format ascii" in data[:60]:
        kinds = ["text"]
    if ending == ".ply":
        kinds.append("text")
    structure = {".xml": mutate_xml, ".gltf": mutate_json, ".glb": mutate_glb}.get(ending)
    if structure is not None:
        kinds += ["structure"] * 3
    if ending == ".serialized":
        kinds += ["deflated"] * 2
    kind = chance.choice(kinds)
    if kind == "structure" and structure is not None:
        return structure(data, chance), "restructured"
    if kind == "deflated":
        return mutate_deflated(data, chance, BYTE_MUTATIONS), "changed inside"
    change = chance.choice(TEXT_MUTATIONS if kind == "text" else BYTE_MUTATIONS)
    return change(data, chance), change.__name__.replace("_", " ")
