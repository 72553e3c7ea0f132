"""What a series has finished, so that it goes on where it was stopped (`--resume`).

Beside the outputs stands a folder with a file for each picture: what made it (program, scene, settings, exposure), the
digests of the files that were written for it, and its row of a table; and, where a film or sheet is made of pictures,
its pixels. That file is written last, when all others are on the disk. A picture counts as finished while all of that
still holds; anything else is rendered again, and said.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.checkpoint.identity import (
    as_json,
    differences,
    other_program,
    other_scene,
    other_settings,
    scene_hashes,
)
from pmviewer.engine.program import program
from pmviewer.engine.series.render import Picture
from pmviewer.errors import OutputError
from pmviewer.output.files import write_file
from pmviewer.output.png import read_png, write_png
from pmviewer.render.camera import resolve_camera
from pmviewer.settings.access import flat

Pixels = NDArray[np.uint8]
Row = Mapping[str, Any]


class KeptPictures:
    """The finished pictures of a series, in a folder that is made if need be."""

    def __init__(self, folder: Path, with_pixels: bool, measured: Mapping[str, str]) -> None:
        """with_pixels: whether a picture's pixels will be asked for; measured: what rows depend on besides the picture.
        Raises OutputError."""
        self.folder, self.with_pixels, self.measured = folder, with_pixels, dict(measured)
        self.again: list[str] = []
        """Why pictures that had been finished are rendered again, in sentences."""
        self._scene: tuple[int, Mapping[str, str]] = (0, {})
        try:
            folder.mkdir(exist_ok=True)
            for left in folder.glob(".pmviewer-*.tmp"):  # of a write that was killed
                left.unlink()
        except OSError as error:
            raise OutputError(f"{folder}: finished pictures can't be kept there ({error.strerror}).") from None

    def has(self, picture: Picture, files: Sequence[Path]) -> bool:
        """Whether that very picture and these files of it are there."""
        told = self._told(picture.number)
        if told is None:
            return False
        why = self._differences(told, self.made_of(picture), self._all(picture.number, files))
        if why:
            self.again.append(f"Picture {picture.number} is rendered again: {why}.")
        return not why

    def keep(self, picture: Picture, files: Sequence[Path], pixels: Pixels | None, row: Row) -> None:
        """Remember a picture whose files are written. Raises OutputError."""
        if pixels is not None:
            write_png(self._file(picture.number, ".png"), pixels)
        digests = {file.name: _digest(file) for file in self._all(picture.number, files)}
        told = {"made_of": self.made_of(picture), "files": digests, "row": dict(row)}
        write_file(self._file(picture.number, ".json"), json.dumps(told, indent=1).encode(), (".json",))

    def pixels(self, number: int) -> Pixels:
        """Of a picture that is there. Raises SceneError."""
        return read_png(self._file(number, ".png"))[0]

    def row(self, number: int) -> Row:
        """Of a picture that is there."""
        told = self._told(number)
        assert told is not None
        row: Row = told["row"]
        return row

    def made_of(self, picture: Picture) -> dict[str, Any]:
        """All that decides about a picture, as JSON holds it."""
        opened, settings = picture.opened, picture.settings
        pose = resolve_camera(opened.scene, settings.camera)
        if self._scene[0] != opened.uid:
            self._scene = opened.uid, scene_hashes(opened, pose, pose)
        camera = hashlib.sha256(repr(sorted(asdict(pose).items())).encode()).hexdigest()[:32]
        return {
            "program": {name: program()[name] for name in ("version", "sources")},
            "scene": {**self._scene[1], "camera": camera},
            "settings": {path: as_json(value) for path, value in flat(settings).items()},
            "exposure": picture.exposure,
            "measured": self.measured,
        }

    def _file(self, number: int, suffix: str) -> Path:
        return self.folder / f"{number:06d}{suffix}"

    def _all(self, number: int, files: Sequence[Path]) -> list[Path]:
        return [*files, self._file(number, ".png")] if self.with_pixels else list(files)

    def _told(self, number: int) -> dict[str, Any] | None:
        """What is kept of a picture; None where there is nothing, or nothing that can be read."""
        with suppress(OSError, ValueError):
            told = json.loads(self._file(number, ".json").read_bytes())
            if isinstance(told, dict) and all(isinstance(told.get(key), dict) for key in ("made_of", "files", "row")):
                return told
        return None

    def _differences(self, told: Mapping[str, Any], now: Mapping[str, Any], files: Sequence[Path]) -> str:
        """Why a kept picture is none any more, "" if it still is."""
        before, exposure, measured = told["made_of"], "", ""
        if before.get("measured") != now["measured"]:
            measured = "it was not measured against this reference"
        if before.get("exposure") != now["exposure"]:
            exposure = f"its exposure was {before.get('exposure')} and is {now['exposure']}"
        try:
            of_program = other_program(before["program"], now["program"])
            of_scene = other_scene(before["scene"], now["scene"])
            of_settings = other_settings(before["settings"], now["settings"])
        except (KeyError, TypeError, AttributeError):
            return "what was kept of it can't be read"
        return differences([of_program, of_scene, of_settings, exposure, measured]) or _changed(told["files"], files)


def _changed(digests: Mapping[str, str], files: Sequence[Path]) -> str:
    """Which file is not what was written, "" for none."""
    for file in files:
        if not file.is_file():
            return f"{file} is not there"
        if digests.get(file.name) != _digest(file):
            return f"{file} is another one"
    return ""


def _digest(file: Path) -> str:
    with file.open("rb") as data:
        return hashlib.file_digest(data, "sha256").hexdigest()
