"""Mitsuba's XML as a tree whose elements know their file and line; entities and DTDs refused.

A scene file comes from anywhere, so nothing in it may reach outside (external entities) or blow up (entity bombs).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import shortened

MAX_FILE_BYTES = 64 << 20
MAX_DEPTH = 64
MAX_ATTRIBUTE = 1 << 16
MAX_ELEMENTS = 1_500_000
"""Of a file and of all that it includes: more take too long to read and gigabytes to keep."""


@dataclass(slots=True)
class Element:
    """One XML element; `line` counts from 1. `file` is the included file that it stands in, None in the scene's own."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    file: Path | None = None

    def __str__(self) -> str:
        kind = self.attributes.get("type")
        tag = shortened(self.tag)
        return f'<{tag} type="{shortened(kind)}">' if kind else f"<{tag}>"


def read_xml(path: Path, included: Path | None = None) -> Element:
    """Root element of the file, whose elements say that they stand in `included`. Raises SceneError."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            limit = MAX_FILE_BYTES >> 20
            raise SceneError(
                f"The scene file is larger than {limit} MiB.", path, hint="Keep meshes in files of their own."
            )
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"The file can't be read: {error.strerror or error}.", path) from None
    return parse_xml(data, path, included)


def parse_xml(data: bytes, path: Path | None = None, included: Path | None = None) -> Element:
    """Root element of XML text. Raises SceneError naming the line for anything that is not plain, well-formed XML."""
    parser = expat.ParserCreate()
    root: list[Element] = []
    stack: list[Element] = []
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        line = parser.CurrentLineNumber
        if len(stack) >= MAX_DEPTH:
            raise SceneError(f"Elements are nested deeper than {MAX_DEPTH}.", path, line, "Flatten the file.")
        if count > MAX_ELEMENTS:
            hint = "Keep many triangles in mesh files, and copies in nested groups."
            raise SceneError(f"The file has more than {MAX_ELEMENTS:,} elements.", path, line, hint)
        for name, value in attributes.items():
            if len(value) > MAX_ATTRIBUTE:
                raise SceneError(
                    f"Attribute '{name}' of <{tag}> is longer than {MAX_ATTRIBUTE} characters.", path, line
                )
        element = Element(tag, attributes, line, [], included)
        (stack[-1].children if stack else root).append(element)
        stack.append(element)

    def end(_tag: str) -> None:
        stack.pop()

    def refuse(*_args: object) -> NoReturn:
        raise SceneError(
            "Document types and entities (<!DOCTYPE …>, <!ENTITY …>) are refused.",
            path,
            parser.CurrentLineNumber,
            "Write the values out, or use <default> parameters.",
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code) or "malformed"
        hint = "The file is empty." if not data.strip() else "Is it complete, and a Mitsuba scene?"
        raise SceneError(f"This is not well-formed XML: {reason}.", path, error.lineno, hint) from None
    except (LookupError, ValueError) as error:
        raise SceneError(f"The XML's encoding can't be read: {error}.", path, 1, "Save the file as UTF-8.") from None
    return root[0]
