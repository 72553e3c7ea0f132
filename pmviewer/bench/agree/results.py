"""Verdicts in a file, a line of JSON each, so that a run may be done in pieces and says of each what it ran at.

A line holds for the same scene, asked with the same effort, as long as the reasons that it gives are known ones. The
revision does not have to be the same: a table of many hours may span some, and names them. On request, what other
sources found is run again.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.ours import METHODS
from pmviewer.bench.agree.shares import LOTS, MAIN, PANES, SCATTERING
from pmviewer.bench.agree.statistics import BLOCK, Outcome
from pmviewer.bench.agree.tree import to_json
from pmviewer.bench.agree.trial import FORGIVEN, STAGES, SUSPICIOUS
from pmviewer.bench.agree.verdict import DIED, Comparison, Verdict
from pmviewer.bench.agree.xml import MAX_DEPTH, SIZE
from pmviewer.bench.collected import revision, sources_stamp
from pmviewer.errors import OutputError


@dataclass(frozen=True)
class Entry:
    """A scene's verdict, and the revision and the sources that gave it."""

    verdict: Verdict
    revision: str
    sources: str


def effort() -> str:
    """Changes with whatever decides by which methods and how well a scene is looked at."""
    shares = MAIN, LOTS, PANES, SCATTERING
    return _digest(repr((STAGES, SUSPICIOUS, FORGIVEN, SIZE, BLOCK, MAX_DEPTH, METHODS, shares)))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Results:
    """Verdicts by number of scene, of one seed. Without a path nothing is kept."""

    def __init__(self, path: Path | None, seed: int) -> None:
        """Reads what the file has, if there is one. Raises OutputError where it can't be read or written."""
        self._path, self._seed, self._effort = path, seed, effort()
        self.revision, self.sources = revision() or "unknown", sources_stamp()
        self._entries: dict[int, Entry] = {}
        if path is None:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
            text = path.read_text("utf-8", "replace")
            if text and not text.endswith("\n"):
                self._append("")
        except OSError as error:
            raise self._refusal(error) from None
        for line in text.splitlines():
            try:
                self._read(json.loads(line))
            except (ValueError, KeyError, TypeError):
                continue  # a line that an ended run did not finish

    def _read(self, line: dict[str, Any]) -> None:
        if line["seed"] != self._seed or line["effort"] != self._effort:
            return
        entry = Entry(_verdict(line["verdict"]), line["revision"], line["sources"])
        reasons = {name for c in entry.verdict.comparisons if c.known for name in c.known.split(" + ")}
        if line["content"] == _content(self._seed, line["scene"]) and reasons <= {d.name for d in DEVIATIONS}:
            self._entries[line["scene"]] = entry

    def kept(self, wanted: Collection[int], again: bool = False) -> dict[int, Verdict]:
        """Those of the wanted scenes that need not be run; with `again`, those of the present sources alone. Scenes
        whose process died are run again: it may have been ended from outside."""
        found = {i: entry for i, entry in self._entries.items() if i in wanted and entry.verdict.refused != DIED}
        return {index: e.verdict for index, e in found.items() if not again or e.sources == self.sources}

    def keep(self, index: int, verdict: Verdict) -> None:
        """Add the verdict, found by the present sources, and its line to the file. Raises OutputError."""
        self._entries[index] = Entry(verdict, self.revision, self.sources)
        if self._path is None:
            return
        line = {"seed": self._seed, "scene": index, "content": _content(self._seed, index), "effort": self._effort,
                "revision": self.revision, "sources": self.sources, "verdict": asdict(verdict)}  # fmt: skip
        try:
            self._append(json.dumps(line, default=float))
        except OSError as error:
            raise self._refusal(error) from None

    def _append(self, line: str) -> None:
        assert self._path is not None
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(line + "\n")

    def _refusal(self, error: OSError) -> OutputError:
        return OutputError(f"{self._path}: results can't be kept there ({error.strerror}).")

    def revisions(self, wanted: Collection[int]) -> str:
        """Which revisions gave the verdicts of these scenes, and how many each: those of changed checkouts with a stamp
        of their sources."""
        entries = [self._entries[index] for index in wanted if index in self._entries]
        names = Counter(e.revision + (f" {e.sources[:8]}" if "dirty" in e.revision else "") for e in entries)
        return ", ".join(f"{name} ({count})" for name, count in names.most_common())


def _content(seed: int, index: int) -> str:
    return _digest(to_json(scene_of(seed, index)))


def _verdict(tree: dict[str, Any]) -> Verdict:
    comparisons = [Comparison(**{**c, "outcome": Outcome(**c["outcome"])}) for c in tree["comparisons"]]
    return Verdict(**{**tree, "comparisons": comparisons})
