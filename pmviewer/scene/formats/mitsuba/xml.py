"""Mitsuba's XML as a tree whose elements know their line; parameters substituted, entities and DTDs refused.

A scene file comes from anywhere, so nothing in it may reach outside (external entities) or blow up (entity bombs,
parameters that double each other).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from pmviewer.errors import SceneError

MAX_FILE_BYTES = 64 << 20
MAX_DEPTH = 64
MAX_ATTRIBUTE = 1 << 16


@dataclass
class Element:
    """One XML element; `line` counts from 1."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def __str__(self) -> str:
        kind = self.attributes.get("type")
        return f'<{self.tag} type="{kind}">' if kind else f"<{self.tag}>"


def read_xml(path: Path) -> Element:
    """Root element of the file. Raises SceneError."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            limit = MAX_FILE_BYTES >> 20
            raise SceneError(
                f"The scene file is larger than {limit} MiB.", path, hint="Keep meshes in files of their own."
            )
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"The file can't be read: {error.strerror or error}.", path) from None
    return parse_xml(data, path)


def parse_xml(data: bytes, path: Path | None = None) -> Element:
    """Root element of XML text. Raises SceneError naming the line for anything that is not plain, well-formed XML."""
    parser = expat.ParserCreate()
    root: list[Element] = []
    stack: list[Element] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        line = parser.CurrentLineNumber
        if len(stack) >= MAX_DEPTH:
            raise SceneError(f"Elements are nested deeper than {MAX_DEPTH}.", path, line, "Flatten the file.")
        for name, value in attributes.items():
            if len(value) > MAX_ATTRIBUTE:
                raise SceneError(
                    f"Attribute '{name}' of <{tag}> is longer than {MAX_ATTRIBUTE} characters.", path, line
                )
        element = Element(tag, attributes, line)
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


def substitute(root: Element, overrides: Mapping[str, str], path: Path | None = None) -> tuple[str, ...]:
    """Replace `$name` in all attributes, in document order, and take <default> elements out of the tree.

    `overrides` win over the file's defaults. A backslash before the dollar keeps it. Returns the names of overrides
    that the file never mentions. Raises SceneError for a name that is not defined at that point.
    """
    values = {str(k): str(v) for k, v in overrides.items()}
    used: set[str] = set()
    _substitute(root, values, used, path)
    return tuple(name for name in overrides if name not in used)


def _substitute(element: Element, values: dict[str, str], used: set[str], path: Path | None) -> None:
    for name, text in element.attributes.items():
        if "$" in text:
            element.attributes[name] = _expand(text, values, used, element, path)
    for child in element.children:
        _substitute(child, values, used, path)
        if child.tag == "default":
            key, value = child.attributes.get("name"), child.attributes.get("value")
            if not key or value is None:
                raise SceneError("<default> needs a name and a value.", path, child.line)
            used.add(key)
            values.setdefault(key, value)
    element.children = [c for c in element.children if c.tag != "default"]


def _expand(text: str, values: dict[str, str], used: set[str], element: Element, path: Path | None) -> str:
    def value(match: re.Match[str]) -> str:
        used.add(match[1])
        return values[match[1]]

    if values:
        # Longest names first: $resolution must not be read as $res followed by "olution".
        names = "|".join(re.escape(n) for n in sorted(values, key=len, reverse=True))
        # The substituted text is not looked at again, so parameters can't recurse.
        pieces = re.split(r"(\\\$)", text)
        text = "".join(p if p == r"\$" else re.sub(rf"\$({names})", value, p) for p in pieces)
    if len(text) > MAX_ATTRIBUTE:
        what = f"An attribute of {element} grows beyond {MAX_ATTRIBUTE} characters by its parameters."
        raise SceneError(what, path, element.line, "Use shorter <default> values.")
    undefined = re.search(r"(?<!\\)\$(\w*)", text)
    if undefined:
        hint = f'Put <default name="{undefined[1]}" value="…"/> before this line, or write \\$ for a dollar sign.'
        raise SceneError(f"Parameter ${undefined[1]} in {element} is not defined.", path, element.line, hint)
    return text.replace(r"\$", "$")
