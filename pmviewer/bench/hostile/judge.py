"""What must not happen when a hostile file is opened."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

CPU_SECONDS = 10.0
EXTRA_MEMORY = 1 << 30
"""Beyond what the honest file of the same kind takes."""
LONGEST_MESSAGE = 1500
"""Characters of a sentence that somebody may still read."""

_QUOTED = re.compile(r"(?<!\w)'[^'\n]{0,300}'(?!\w)|\"[^\"\n]{0,300}\"|‘[^’\n]*’|“[^”\n]*”")
INTERNALS = re.compile(
    r"object at 0x|\b0x[0-9a-f]{6,}|<(?:class|function|module|bound method|built-in)|Traceback|\bself\.\w"
    r"|\b(?!SceneError)[A-Z]\w*(?:Error|Exception|Warning)\b|\b(?:struct|zlib|np|numpy|json|zipfile)\.\w+"
    r"|\bNoneType\b|\bndarray\b|\bdtype\b|b'\\?x?|\barray\(|OrderedDict|\bcodec can't|invalid start byte"
    r"|list index|not subscriptable|has no attribute|unhashable|unexpected keyword|positional argument"
    r"|could not convert|invalid literal|cannot reshape|broadcast|is out of bounds for|buffer is smaller"
    r"|must be real number|must be str|Expecting (?:value|property|',')|operands|unpack|bytes-like|index out of range"
    r"|maximum recursion|Error -?\d+ while|not enough values|expected str"
)


@dataclass(frozen=True)
class Finding:
    """`kind`: traceback, time, memory, died, internals or long. `detail` tells equal ones from others."""

    kind: str
    detail: str


def internals(sentence: str) -> str:
    """The first piece of Python in a sentence; empty if there is none. What it quotes is the user's own text."""
    found = INTERNALS.search(_QUOTED.sub("''", sentence))
    return found[0] if found else ""


def findings(answer: dict[str, Any], honest_memory: int) -> list[Finding]:
    """All that is wrong with an answer of the server."""
    found = []
    if answer["outcome"] == "traceback":
        found.append(Finding("traceback", f"{answer['said'][0][:120]} at {answer['where']}"))
    if answer["cpu"] > CPU_SECONDS:
        found.append(Finding("time", f"{answer['cpu']:.0f} CPU seconds"))
    if answer["memory"] > honest_memory + EXTRA_MEMORY:
        found.append(Finding("memory", f"{answer['memory'] / 2**30:.1f} GiB"))
    if answer["outcome"] != "traceback":
        found += _words(answer["said"])
    return found


def _words(sentences: Sequence[str]) -> list[Finding]:
    found = []
    for sentence in sentences:
        if piece := internals(sentence):
            found.append(Finding("internals", f"'{piece}' in: {_plain(sentence)}"))
        if len(sentence) > LONGEST_MESSAGE:
            found.append(Finding("long", f"{len(sentence)} characters: {_plain(sentence)[:80]}…"))
    return found


def _plain(sentence: str) -> str:
    """Without what differs from file to file."""
    return re.sub(r"0x[0-9a-f]+|\d+", "#", _QUOTED.sub("'…'", sentence))[:200]
