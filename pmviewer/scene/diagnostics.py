"""What a loader has to say: warnings gathered by kind, unusable things counted, errors with file and line."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from pmviewer.errors import SceneError

_SHOWN_LINES = 5
_SHOWN_NAMES = 12


class Diagnostics:
    """Collects the warnings and counts of one scene. `path` is the file that errors name."""

    def __init__(self, path: Path | None = None) -> None:
        self.path = path
        self.dropped: Counter[str] = Counter()
        self._sentences: dict[str, str] = {}
        self._lines: dict[str, list[int]] = {}
        self._names: dict[str, list[str]] = {}

    def error(self, what: str, line: int | None = None, hint: str = "") -> SceneError:
        """The error to raise."""
        return SceneError(what, self.path, line, hint)

    def warn(self, sentence: str, line: int | None = None, kind: str | None = None) -> None:
        """Keep one warning per kind (the sentence itself if no kind is given), with all lines where it applies."""
        key = kind or sentence
        self._sentences.setdefault(key, sentence)
        lines = self._lines.setdefault(key, [])
        if line is not None and line not in lines:
            lines.append(line)

    def warn_of(self, name: str, sentence: str, line: int | None = None) -> None:
        """One warning for all names of a kind: `sentence` has {names} where they are listed."""
        self.warn(sentence, line)
        names = self._names.setdefault(sentence, [])
        if name not in names:
            names.append(name)

    def left_out(self) -> str:
        """What was ignored or dropped, as a hint for an error about what is missing; empty if nothing was."""
        counts = ", ".join(f"{count} × {reason}" for reason, count in self.dropped.items())
        sentences = [*self.warnings(), *([f"{counts}."] if counts else [])]
        return f"Left out: {' '.join(sentences)}" if sentences else ""

    def warnings(self) -> tuple[str, ...]:
        """One sentence a kind, in the order of their first appearance."""
        return tuple(_located(self._filled(key), self._lines[key]) for key in self._sentences)

    def _filled(self, key: str) -> str:
        names = self._names.get(key)
        if names is None:
            return self._sentences[key]
        more = f" and {len(names) - _SHOWN_NAMES} more" if len(names) > _SHOWN_NAMES else ""
        return self._sentences[key].replace("{names}", ", ".join(names[:_SHOWN_NAMES]) + more)


def _located(sentence: str, lines: list[int]) -> str:
    if not lines:
        return sentence
    if len(lines) == 1:
        return f"line {lines[0]}: {sentence}"
    shown = ", ".join(map(str, lines[:_SHOWN_LINES]))
    more = f" and {len(lines) - _SHOWN_LINES} more" if len(lines) > _SHOWN_LINES else ""
    return f"lines {shown}{more}: {sentence}"
