"""The tree of a scene file once everything stands in its place: parameters, <include>, <path>.

As in Mitsuba 3, elements are gone through in the order of the file: a <default> counts from where it stands, in
included files and after them too, and a <path> is searched by everything that is read in its file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import Diagnostics, shortened
from pmviewer.scene.formats.mitsuba.folders import Folders
from pmviewer.scene.formats.mitsuba.versions import upgrade
from pmviewer.scene.formats.mitsuba.xml import MAX_ATTRIBUTE, MAX_ELEMENTS, MAX_FILE_BYTES, Element, read_xml

MOST_INCLUDED_DEPTH = 15
MOST_INCLUDED_FILES = 1000


class Expansion:
    """Puts parameters and included files into a tree. `overrides` win over the file's defaults.

    `used` are the names of parameters that the file mentions, `missing` the (name, element) of included files that
    don't exist. What is left out is said in `diagnostics`.
    """

    def __init__(self, overrides: Mapping[str, str], folders: Folders, diagnostics: Diagnostics) -> None:
        self.values = {str(k): str(v) for k, v in overrides.items()}
        self.folders = folders
        self.diagnostics = diagnostics
        self.used: set[str] = set()
        self.missing: list[tuple[str, Element]] = []
        self._names: re.Pattern[str] | None = None
        self._open: list[Path] = []
        self._files = self._bytes = self._elements = 0

    def expand(self, root: Element, path: Path | None) -> None:
        """Change the tree of the scene file `path` in place. Raises SceneError for circles and sizes."""
        if path is not None:
            self._open.append(path.resolve())
        upgrade(root, self.diagnostics)
        self._attributes(root)
        root.children = self._children(root, at_root=True)

    def _children(self, element: Element, at_root: bool = False) -> list[Element]:
        kept: list[Element] = []
        for child in element.children:
            whole = self._attributes(child)
            if child.tag == "include":
                kept += self._include(child) if whole else []
            elif child.tag == "path":
                self._path(child, at_root)
            elif child.tag == "default":
                self._default(child, whole)
            elif whole or not child.attributes.get("name") or child.tag in ("texture", "transform"):
                child.children = self._children(child)
                kept.append(child)
        return kept

    def _warn(self, sentence: str, element: Element) -> None:
        self.diagnostics.warn(sentence, element.line, file=element.file)

    def _error(self, what: str, element: Element, hint: str) -> SceneError:
        return self.diagnostics.error(what, element.line, hint, element.file)

    # Parameters

    def _default(self, element: Element, whole: bool) -> None:
        key, value = element.attributes.get("name"), element.attributes.get("value")
        if not key or value is None:
            self._warn("<default> needs a name and a value: it was ignored.", element)
            return
        self.used.add(key)
        if whole and key not in self.values:
            self.values[key] = value
            self._names = None

    def _attributes(self, element: Element) -> bool:
        """Replace `$name` in all attributes; False if one of the names is not defined."""
        whole = True
        for name, text in element.attributes.items():
            if "$" in text:
                element.attributes[name], undefined = self._substituted(text, element)
                whole = whole and not undefined
                if undefined:
                    sentence = (
                        f"Parameter ${undefined} in {element} is not defined: the value counts as not given. "
                        f'Give it with -D {undefined}=…, put <default name="{undefined}" value="…"/> before this line,'
                        " or write \\$ for a dollar sign."
                    )
                    self._warn(sentence, element)
        return whole

    def _substituted(self, text: str, element: Element) -> tuple[str, str]:
        """The text with its parameters, and the first name that is not defined ("" if all are)."""

        def value(match: re.Match[str]) -> str:
            self.used.add(match[1])
            return self.values[match[1]]

        if self.values:
            if self._names is None:
                # Longest names first: $resolution must not be read as $res followed by "olution".
                names = "|".join(re.escape(n) for n in sorted(self.values, key=len, reverse=True))
                self._names = re.compile(rf"\$({names})")
            # The substituted text is not looked at again, so parameters can't recurse.
            pieces = re.split(r"(\\\$)", text)
            text = "".join(p if p == r"\$" else self._names.sub(value, p) for p in pieces)
        if len(text) > MAX_ATTRIBUTE:
            what = f"An attribute of {element} grows beyond {MAX_ATTRIBUTE} characters by its parameters."
            raise self._error(what, element, "Use shorter <default> values.")
        undefined = re.search(r"(?<!\\)\$(\w*)", text)
        return text.replace(r"\$", "$"), undefined[1] or "?" if undefined else ""

    # Files

    def _path(self, element: Element, at_root: bool) -> None:
        name = element.attributes.get("value", "")
        folder = self.folders.folder(name, element.file.parent if element.file else self.folders.home)
        if folder is None:
            self._warn(f"The folder '{shortened(name)}' that <path> names does not exist: it was ignored.", element)
        elif not at_root:
            self._warn("<path> counts only directly inside <scene>: it was ignored.", element)
        elif self.folders.too_wide(folder):
            sentence = (
                f"<path> names '{shortened(name)}', which holds all files of this machine or user: it was refused."
            )
            self._warn(sentence, element)
        else:
            self.folders.add(folder)

    def _include(self, element: Element) -> list[Element]:
        """What stands in the place of an <include>."""
        name = element.attributes.get("filename", "")
        near = element.file.parent if element.file else None
        path = self.folders.file(name, near)
        if not self.folders.allowed(path) if path else self.folders.leads_out(name, near):
            self._warn(
                f"<include> of '{shortened(name)}' was refused: {path.resolve() if path else 'it'} lies outside of the "
                "scene's folder. If you trust it, name its folder with <path> or --search-path.",
                element,
            )
            return []
        if path is None:
            self.missing.append((name, element))
            return []
        real = path.resolve()
        if real in self._open:
            what = f"{path.name} includes itself, over {len(self._open)} files."
            raise self._error(what, element, "Remove the circular <include>.")
        if len(self._open) > MOST_INCLUDED_DEPTH:
            what = f"Files include each other more than {MOST_INCLUDED_DEPTH} deep."
            raise self._error(what, element, "Include them directly.")
        self._files += 1
        self._bytes += path.stat().st_size
        if self._files > MOST_INCLUDED_FILES or self._bytes > MAX_FILE_BYTES:
            what = f"More than {MOST_INCLUDED_FILES} files or {MAX_FILE_BYTES >> 20} MiB are included."
            raise self._error(what, element, "Keep meshes in files of their own.")
        try:
            root = read_xml(path, path)
        except SceneError as error:
            self._warn(f"{path.name} can't be included (line {error.line or 1}): {error.what}", element)
            return []
        self._elements += _count(root)
        if self._elements > MAX_ELEMENTS:
            what = f"The included files have more than {MAX_ELEMENTS:,} elements."
            raise self._error(what, element, "Keep many triangles in mesh files, and copies in nested groups.")
        return self._included(root, real)

    def _included(self, root: Element, real: Path) -> list[Element]:
        upgrade(root, self.diagnostics)
        # Mitsuba forgets the folders of an included file at its end. Here they stay, behind those of the scene, so that
        # the file's meshes are found as well.
        before = list(self.folders.searched)
        self._open.append(real)
        self._attributes(root)
        root.children = self._children(root, at_root=True)
        self._open.pop()
        self.folders.put_last(before)
        if root.tag == "scene":
            return root.children
        root.attributes.pop("version", None)
        return [root]


def _count(root: Element) -> int:
    total, todo = 0, [root]
    while todo:
        element = todo.pop()
        total += 1
        todo += element.children
    return total
