"""One scene file while it is read: identifiers, references, files, and what is said about them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba.folders import Folders
from pmviewer.scene.formats.mitsuba.properties import OBJECT_TAGS as OBJECT_TAGS
from pmviewer.scene.formats.mitsuba.properties import SILENT_TAGS as SILENT_TAGS
from pmviewer.scene.formats.mitsuba.properties import Properties as Properties
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.texture import Texture

MISSING = (
    "Files that do not exist: the shapes, lights or parts of the scene that need them are left out: {names}. "
    "Put them there, or name their folder with --search-path."
)


class MissingFile(SceneError):
    """A file that an object needs does not exist. `name` is what it is called in the scene."""

    def __init__(self, name: str, what: str, path: Path | None, line: int, hint: str) -> None:
        super().__init__(what, path, line, hint)
        self.name = name


class Document:
    """The tree with everything that reading it needs. `folders` say where files are looked for; `pictures`, `meshes`
    and `broken_meshes` keep what was read, `displaced` counts the triangles that displacement has made."""

    def __init__(
        self, root: Element, path: Path | None, diagnostics: Diagnostics, folders: Folders | None = None
    ) -> None:
        self.root = root
        self.folders = folders or Folders(path.parent if path is not None else Path())
        self.diagnostics = diagnostics
        self.pictures: dict[tuple[str, bool], NDArray[np.float32]] = {}
        self.textures: dict[int, tuple[Texture | None, list[Element]]] = {}
        self.displaced = 0
        self.meshes: dict[tuple[str, str, int], Mesh] = {}
        self.broken_meshes: dict[tuple[str, str, int], SceneError] = {}
        self.ids: dict[str, Element] = {}
        self._index()
        for alias in (c for c in root.children if c.tag == "alias"):
            name, target = alias.attributes.get("id", ""), alias.attributes.get("as", "")
            if name in self.ids:
                self.ids.setdefault(target, self.ids[name])
            else:
                self.warn(f"<alias> refers to the id '{name}', which is not defined: it was ignored.", alias)

    def _index(self) -> None:
        todo = [self.root]
        while todo:
            element = todo.pop()
            name = element.attributes.get("id")
            if name is not None and element.tag not in ("ref", "alias"):
                if name in self.ids:
                    where = self.ids[name].line
                    what = f"The id '{name}' of {element} is already taken in line {where}: references mean that one."
                    self.warn(what, element)
                else:
                    self.ids[name] = element
            todo += reversed(element.children)

    def error(self, what: str, element: Element, hint: str = "") -> SceneError:
        """To be raised: what is wrong with this element, its file and line, and what to do about it."""
        return self.diagnostics.error(what, element.line, hint, element.file)

    def warn(self, sentence: str, element: Element, kind: str | None = None) -> None:
        """Say a sentence with the element's file and line; those of one `kind` are said together."""
        self.diagnostics.warn(sentence, element.line, kind, element.file)

    def ignore(self, element: Element, reason: str = "is not supported and was ignored") -> None:
        """Name what is not read, once a kind."""
        self.warn(f"{element} {reason}.", element, kind=str(element) + reason)

    def find(self, reference: Element) -> Element | None:
        """The object a <ref> stands for; None, with a warning, if there is none."""
        name = reference.attributes.get("id")
        target = None if name is None else self.ids.get(name)
        if name is None:
            self.warn("<ref> needs an id: it was ignored.", reference)
        elif target is None:
            self.warn(f"<ref> refers to the id '{name}', which is not defined: it was ignored.", reference)
        return target

    def resolve(self, reference: Element) -> Element:
        """The object a <ref> stands for. Raises SceneError if there is none."""
        target = self.ids.get(reference.attributes.get("id", ""))
        if target is None:
            name = reference.attributes.get("id", "")
            raise self.error(f"<ref> refers to the id '{name}', which is not defined.", reference)
        return target

    def file(self, name: str, element: Element) -> Path:
        """Existing plain file that an object names. Raises MissingFile."""
        path = self.folders.file(name, None if element.file is None else element.file.parent)
        if path is None:
            hint = f"Put it there, relative to {self.folders.home}, or name its folder with --search-path."
            what = f"The file {name[:200]!r} named by {element} does not exist."
            raise MissingFile(name[:200], what, element.file or self.diagnostics.path, element.line, hint)
        return path

    def missing(self, name: str, element: Element) -> None:
        """Put a file that was not found on the list of the one warning about them."""
        self.diagnostics.warn_of(name, MISSING, element.line, element.file)

    def circular(self, element: Element) -> bool:
        """Does the object contain itself, over references?"""
        seen: set[int] = set()
        todo = list(element.children)
        while todo:
            child = todo.pop()
            if child.tag == "ref":
                target = self.ids.get(child.attributes.get("id", ""))
                if target is None:
                    continue
                child = target
            if child.children is element.children:  # a reference with a name of its own is a copy that shares them
                return True
            if id(child) not in seen:
                seen.add(id(child))
                todo += child.children
        return False
