"""What a loader has to say: warnings gathered by kind, unusable things counted, errors with file and line."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from pmviewer.errors import SceneError

_SHOWN_LINES = 5
_SHOWN_NAMES = 12
_LONGEST_NAME = 120


class Diagnostics:
    """Collects the warnings and counts of one scene. `path` is the file that errors name."""

    def __init__(self, path: Path | None = None) -> None:
        self.path = path
        self.dropped: Counter[str] = Counter()
        self._sentences: dict[str, str] = {}
        self._places: dict[str, dict[tuple[Path | None, int], None]] = {}
        self._names: dict[str, dict[str, None]] = {}

    def error(self, what: str, line: int | None = None, hint: str = "", file: Path | None = None) -> SceneError:
        """The error to raise. `file`: the included one that it is about, if it isn't the scene's own."""
        return SceneError(what, file or self.path, line, hint)

    def warn(self, sentence: str, line: int | None = None, kind: str | None = None, file: Path | None = None) -> None:
        """Keep one warning per kind (the sentence itself if no kind is given), with all places where it applies."""
        key = kind or sentence
        self._sentences.setdefault(key, sentence)
        places = self._places.setdefault(key, {})
        if line is not None:
            places[file, line] = None

    def warn_of(self, name: str, sentence: str, line: int | None = None, file: Path | None = None) -> None:
        """One warning for all names of a kind: `sentence` has {names} where they are listed."""
        self.warn(sentence, line, file=file)
        self._names.setdefault(sentence, {})[name] = None

    def left_out(self) -> str:
        """What was ignored or dropped, as a hint for an error about what is missing; empty if nothing was."""
        counts = ", ".join(f"{count} × {reason}" for reason, count in self.dropped.items())
        sentences = [*self.warnings(), *([f"{counts}."] if counts else [])]
        return f"Left out: {' '.join(sentences)}" if sentences else ""

    def warnings(self) -> tuple[str, ...]:
        """One sentence a kind, in the order of their first appearance."""
        return tuple(_located(self._filled(key), list(self._places[key])) for key in self._sentences)

    def _filled(self, key: str) -> str:
        names = list(self._names.get(key, ()))
        if not names:
            return self._sentences[key]
        more = f" and {len(names) - _SHOWN_NAMES} more" if len(names) > _SHOWN_NAMES else ""
        return self._sentences[key].replace("{names}", ", ".join(map(shortened, names[:_SHOWN_NAMES])) + more)


def shortened(name: str) -> str:
    """Both ends of a name that is longer than anybody reads."""
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME // 2]}…{name[-_LONGEST_NAME // 2 :]}"


def _located(sentence: str, places: list[tuple[Path | None, int]]) -> str:
    if not places:
        return sentence
    words = "line" if len(places) == 1 else "lines"
    shown: list[str] = []
    for file, line in places[:_SHOWN_LINES]:
        shown.append(str(line) if file is None else f"{line} of {file.name}")
    more = f" and {len(places) - _SHOWN_LINES} more" if len(places) > _SHOWN_LINES else ""
    return f"{words} {', '.join(shown)}{more}: {sentence}"
