"""Whatever goes wrong while a file is written, the old one is whole and nothing else is left."""

from __future__ import annotations

import errno
import os
import stat

import pytest

from pmviewer.errors import OutputError, SceneError
from pmviewer.output import files
from pmviewer.output.files import check_target, read_file, write_file


def test_new_file_gets_the_permissions_of_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write_file(tmp_path / "a.png", b"new", (".png",))
    finally:
        os.umask(before)
    assert (tmp_path / "a.png").read_bytes() == b"new"
    assert stat.S_IMODE((tmp_path / "a.png").stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["a.png"]


def test_replaced_file_keeps_its_permissions(tmp_path):
    target = tmp_path / "a.png"
    target.write_bytes(b"old")
    target.chmod(0o604)
    write_file(target, b"new", (".png",))
    assert target.read_bytes() == b"new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o604


def test_link_stays_a_link_to_the_new_content(tmp_path):
    (tmp_path / "real.png").write_bytes(b"old")
    (tmp_path / "link.png").symlink_to("real.png")
    write_file(tmp_path / "link.png", b"new", (".png",))
    assert (tmp_path / "link.png").is_symlink()
    assert (tmp_path / "real.png").read_bytes() == b"new"


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.ENOSPC, "no room on the disk for 3.0 MB"),
        (errno.EACCES, "no permission"),
        (errno.EROFS, "no permission"),
        (errno.EIO, "nput/output error"),
    ],
)
@pytest.mark.parametrize("step", ["write", "sync", "rename"])
def test_failure_leaves_the_old_file_whole(tmp_path, monkeypatch, number, said, step):
    target = tmp_path / "a.png"
    target.write_bytes(b"old")

    def fail(*_arguments, **_options):
        raise OSError(number, os.strerror(number))

    place = {"write": (files.os, "fdopen"), "sync": (files.os, "fsync"), "rename": (files.os, "replace")}[step]
    monkeypatch.setattr(*place, fail)
    with pytest.raises(OutputError, match=said):
        write_file(target, b"x" * 3_000_000, (".png",))
    monkeypatch.undo()
    assert target.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.png"]


def test_interrupt_leaves_the_old_file_whole(tmp_path, monkeypatch):
    target = tmp_path / "a.png"
    target.write_bytes(b"old")

    def interrupt(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_file(target, b"new", (".png",))
    assert target.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.png"]


def test_read_only_file_is_not_replaced(tmp_path, monkeypatch):
    target = tmp_path / "a.png"
    target.write_bytes(b"old")
    monkeypatch.setattr(files.os, "access", lambda path, mode: False)
    with pytest.raises(OutputError, match="no permission"):
        write_file(target, b"new", (".png",))
    assert target.read_bytes() == b"old"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nowhere/a.png", "the folder .*nowhere does not exist. Create it first"),
        ("a.jpg", r"unknown format '.jpg'. Use .png or .exr"),
        ("a", "unknown format ''"),
        ("folder.png", "this is a folder"),
        ("pipe.png", "not a regular file"),
        ("a\0.png", "can't be written"),
        ("x" * 300 + ".png", "too long"),
    ],
)
def test_wrong_names_are_explained(tmp_path, name, said):
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(OutputError, match=said):
        write_file(tmp_path / name, b"new", (".png", ".exr"))
    assert sorted(os.listdir(tmp_path)) == ["folder.png", "pipe.png"]


def test_ending_may_be_in_capitals(tmp_path):
    assert check_target(tmp_path / "A.PNG", (".png",)).name == "A.PNG"


@pytest.mark.parametrize(
    ("name", "said"), [("none.exr", "no such file"), (".", "not a regular file"), ("p", "regular")]
)
def test_unreadable_files_are_explained(tmp_path, name, said):
    os.mkfifo(tmp_path / "p")
    with pytest.raises(SceneError, match=f"(?i){said}"):
        read_file(tmp_path / name)
