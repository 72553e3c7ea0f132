"""Compiled code that a running process uses is never removed, whoever starts beside it."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pmviewer.kernels.compile import cache_folder, jit
from pmviewer.kernels.compile.cache_folder import KEPT_CACHES, KEPT_DAYS, claim

pytest.importorskip("fcntl", reason="the system has no locks that end with their process")

HOLD = "import sys; from pathlib import Path; from pmviewer.kernels.compile.cache_folder import claim; "
HOLD += "print(claim(Path(sys.argv[1]), sys.argv[2]), flush=True); sys.stdin.read()"


class Holder:
    """Another process that uses a cache until it is let go."""

    def __init__(self, root: Path, name: str) -> None:
        command = [sys.executable, "-c", HOLD, str(root), name]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.folder = Path(self.process.stdout.readline().strip())

    def let_go(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(autouse=True)
def nothing_held(monkeypatch):
    """What a test claims is let go when the test ends."""
    held: list = []
    monkeypatch.setattr(cache_folder, "_held", held)
    yield
    for lock in held:
        lock.close()


def used(folder: Path, days_ago: float) -> Path:
    """The folder, with compiled code in it, last used so long ago."""
    (folder / "kernel.nbc").touch()
    then = time.time() - days_ago * 86400
    os.utime(folder, (then, then))
    return folder


def others(root: Path, count: int) -> None:
    """Caches of other versions, each used since and by nobody now."""
    for i in range(count):
        folder = root / f"version {i}"
        folder.mkdir(parents=True)
        used(folder, 1)


def test_the_oldest_unused_versions_go(tmp_path):
    others(tmp_path, KEPT_CACHES)
    old = used(claim(tmp_path, "old"), 100)
    for lock in cache_folder._held:
        lock.close()
    claim(tmp_path, "new")
    assert not old.exists()
    assert len(list(tmp_path.iterdir())) == KEPT_CACHES


def test_a_version_in_use_stays_however_old(tmp_path):
    holder = Holder(tmp_path, "in use")
    try:
        used(holder.folder, 100)
        others(tmp_path, KEPT_CACHES + 2)
        claim(tmp_path, "new")
        assert (holder.folder / "kernel.nbc").is_file()
    finally:
        holder.let_go()
    claim(tmp_path, "newer")
    assert not holder.folder.exists()


def test_modules_in_use_stay_however_old(tmp_path):
    """A process that has run for weeks still finds what it has not asked for yet."""
    holder = Holder(tmp_path, "same")
    try:
        module = holder.folder / "render.eye-0123"
        module.mkdir()
        used(module, KEPT_DAYS + 1)
        assert claim(tmp_path, "same") == holder.folder
        assert (module / "kernel.nbc").is_file()
    finally:
        holder.let_go()
        for lock in cache_folder._held:
            lock.close()
    claim(tmp_path, "same")
    assert not module.exists()


def test_a_folder_removed_while_one_waits_for_it_is_made_again(tmp_path, monkeypatch):
    """Between opening the lock and having it, another process removes the folder."""
    alone, calls = cache_folder._alone, []

    def slow(lock):
        calls.append(lock)
        if len(calls) == 1:
            cache_folder.shutil.rmtree(tmp_path / "name")
        return alone(lock)

    monkeypatch.setattr(cache_folder, "_alone", slow)
    folder = claim(tmp_path, "name")
    assert (folder / cache_folder.LOCK).is_file()
    assert len(calls) == 2


def test_without_locks_nothing_is_removed(tmp_path, monkeypatch):
    others(tmp_path, KEPT_CACHES + 4)
    monkeypatch.setattr(cache_folder, "fcntl", None)
    claim(tmp_path, "new")
    assert len(list(tmp_path.iterdir())) == KEPT_CACHES + 5


def test_this_process_holds_its_own_cache():
    with (jit.CACHE_FOLDER / cache_folder.LOCK).open("ab") as lock:
        assert not cache_folder._alone(lock)


def test_code_is_compiled_where_it_cannot_be_kept(tmp_path):
    """Another program emptied the cache, and a file stands in the folder's place."""
    file = jit._OneFileEach(str(tmp_path / "gone" / "deeper"), "name", "stamp")
    file.save("key", 1)
    assert file.load("key") == 1
    (tmp_path / "blocked").touch()
    blocked = jit._OneFileEach(str(tmp_path / "blocked"), "name", "stamp")
    blocked.save("key", 1)
    assert blocked.load("key") is None
