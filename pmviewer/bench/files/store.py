"""Results of a run in a file, a line of JSON each, so that a run that was ended goes on where it was.

What Mitsuba said about a file holds as long as the file is the same; what we said, as long as our sources are too.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pmviewer.bench.collected import sources_stamp
from pmviewer.bench.files.judge import Row

THEIRS = ("theirs", "refused", "adapted", "media")


def file_stamp(path: Path) -> str:
    """Changes when the file does."""
    about = path.stat()
    return f"{about.st_size}-{about.st_mtime_ns}"


class Store:
    """Kept results by file. Without a path nothing is kept."""

    def __init__(self, path: Path | None, effort: str) -> None:
        self._path, self._effort, self._sources = path, effort, sources_stamp()
        self._kept: dict[str, dict[str, Any]] = {}
        if path is not None and path.is_file():
            for line in path.read_text("utf-8").splitlines():
                try:
                    entry = json.loads(line)
                    self._kept[entry["row"]["file"]] = entry
                except (ValueError, KeyError, TypeError):
                    continue  # a line that an ended run did not finish

    def row(self, name: str, path: Path) -> Row | None:
        """What we know of an unchanged file by these very sources and this effort."""
        entry = self._same(name, path)
        return Row(**entry["row"]) if entry is not None and entry["sources"] == self._sources else None

    def theirs(self, name: str, path: Path) -> dict[str, Any] | None:
        """Mitsuba's part of what we know of an unchanged file, and the size that it rendered."""
        entry = self._same(name, path)
        if entry is None or not (entry["row"]["theirs"] or entry["row"]["refused"]):
            return None
        return {key: entry["row"][key] for key in (*THEIRS, "sizes")}

    def _same(self, name: str, path: Path) -> dict[str, Any] | None:
        entry = self._kept.get(name)
        if entry is None or entry["effort"] != self._effort or entry["stamp"] != file_stamp(path):
            return None
        return entry

    def keep(self, row: Row, path: Path) -> None:
        """Add a line to the file."""
        if self._path is None:
            return
        entry = {"row": row.as_dict(), "stamp": file_stamp(path), "sources": self._sources, "effort": self._effort}
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(entry) + "\n")
