"""A plain file dialog drawn in the window, for desktops without one."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.format import data_size

Answer = Callable[[Path | None], None]


@dataclass(frozen=True)
class Entry:
    """A row of the list; `size` is in bytes, 0 for folders."""

    name: str
    is_folder: bool
    size: int = 0


def list_folder(folder: Path, patterns: list[str]) -> list[Entry]:
    """Folders first, then files that match one of the patterns, by name; hidden ones are left out.

    Raises OSError when the folder can't be read.
    """
    entries = []
    with os.scandir(folder) as items:
        for item in items:
            if item.name.startswith("."):
                continue
            try:
                if item.is_dir():
                    entries.append(Entry(item.name, True))
                elif any(fnmatch.fnmatch(item.name.lower(), pattern) for pattern in patterns):
                    entries.append(Entry(item.name, False, item.stat().st_size))
            except OSError:  # a link to nowhere, a file that went away meanwhile
                continue
    return sorted(entries, key=lambda e: (not e.is_folder, e.name.lower()))


@dataclass
class FileBrowser:
    """`answer` gets the chosen path once, or None when the user cancelled. Saving over a file asks first."""

    title: str
    folder: Path
    patterns: list[str]
    answer: Answer
    saving: bool = False
    name: str = ""
    _entries: list[Entry] = field(default_factory=list)
    _listed: Path | None = None
    _folder_text: str = ""
    _problem: str = ""
    _opened: bool = False

    def draw(self) -> bool:
        """False once the dialog is over."""
        if not self._opened:
            imgui.open_popup(self.title)
            self._opened = True
        em = imgui.get_font_size()
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.always, (0.5, 0.5))
        imgui.set_next_window_size((44 * em, 30 * em), imgui.Cond_.appearing)
        shown, still_open = imgui.begin_popup_modal(self.title, True, imgui.WindowFlags_.no_saved_settings)
        if not shown:
            self.answer(None)
            return False
        self._list()
        self._path_row()
        self._files(-2.6 * imgui.get_frame_height_with_spacing())
        chosen = self._name_row()
        cancelled = self._buttons_cancel() or not still_open or imgui.is_key_pressed(imgui.Key.escape)
        over = chosen is not None or cancelled
        if over:
            imgui.close_current_popup()
        imgui.end_popup()
        if over:
            self.answer(chosen)
        return not over

    def _list(self) -> None:
        if self._listed == self.folder:
            return
        self._listed, self._folder_text, self._problem = self.folder, str(self.folder), ""
        try:
            self._entries = list_folder(self.folder, self.patterns)
        except OSError as error:
            self._entries, self._problem = [], f"{self.folder}: {error.strerror}"

    def _path_row(self) -> None:
        if imgui.button(f"{fa.ICON_FA_ARROW_UP}##up"):
            self.folder = self.folder.parent
        imgui.set_item_tooltip("Folder above")
        imgui.same_line()
        if imgui.button(f"{fa.ICON_FA_HOUSE}##home"):
            self.folder = Path.home()
        imgui.set_item_tooltip("Home folder")
        imgui.same_line()
        imgui.set_next_item_width(-1)
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self._folder_text = imgui.input_text("##folder", self._folder_text, flags)
        if entered:
            path = Path(self._folder_text).expanduser()
            if path.is_dir():
                self.folder = path.absolute()
            else:
                self._problem = f"{path} is no folder."

    def _files(self, height: float) -> None:
        if not imgui.begin_child("##files", (0, height), imgui.ChildFlags_.borders):
            imgui.end_child()
            return
        if self._problem:
            imgui.text_colored(imgui.ImVec4(*theme.ERROR), self._problem)
        elif not self._entries:
            imgui.text_disabled(f"Nothing here that matches {' '.join(self.patterns)}")
        for entry in self._entries:
            icon = fa.ICON_FA_FOLDER if entry.is_folder else fa.ICON_FA_FILE
            clicked, _ = imgui.selectable(f"{icon}  {entry.name}", not entry.is_folder and entry.name == self.name)
            if not entry.is_folder:
                text = data_size(entry.size)
                imgui.same_line(imgui.get_content_region_avail().x - imgui.calc_text_size(text).x)
                imgui.text_disabled(text)
            if clicked and entry.is_folder:
                self.folder = self.folder / entry.name
            elif clicked:
                self.name = entry.name
        imgui.end_child()

    def _name_row(self) -> Path | None:
        """The path once it is confirmed."""
        em = imgui.get_font_size()
        imgui.set_next_item_width(-1)
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self.name = imgui.input_text_with_hint("##name", "file name", self.name, flags)
        path = self.folder / self.name if self.name.strip() else None
        exists = path is not None and path.is_file()
        verb = "Open" if not self.saving else "Replace" if exists else "Save"
        usable = path is not None and (exists or (self.saving and not path.is_dir()))
        imgui.begin_disabled(not usable)
        pressed = imgui.button(f"{verb}###confirm", (7 * em, 0))
        imgui.end_disabled()
        if self.saving and exists:
            imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*theme.WARNING), "There is a file of this name.")
        # Enter doesn't overwrite: that takes a click on "Replace".
        confirmed = pressed or (entered and usable and not (self.saving and exists))
        return path if confirmed else None

    @staticmethod
    def _buttons_cancel() -> bool:
        em = imgui.get_font_size()
        imgui.same_line(imgui.get_window_width() - 7 * em - imgui.get_style().window_padding.x)
        return imgui.button("Cancel", (7 * em, 0))
