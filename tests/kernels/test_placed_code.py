"""Kernels from the disk, placed in memory without LLVM: they do the same, and take little more than their code."""

from __future__ import annotations

import ctypes
import mmap
import pickle
import sys
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding as llvm
import pytest

from pmviewer.kernels.compile import image
from tests.support import fresh

pytestmark = pytest.mark.skipif(not image.is_possible(), reason="object files are of another kind here")

MODULE = """
import sys
import numpy as np
from numba.core.environment import Environment
from pmviewer.kernels.compile import image, placed
from pmviewer.kernels.compile.jit import device, kernel
import pmviewer.kernels.compile.jit as jit

placed.install()
if "refused" in sys.argv:
    def load(*of):
        raise image.Unloadable("for the test")
    image.load = load

TABLE = np.arange(5000.0)

@device
def checked(x):
    if x > 1e6:
        raise ValueError("too long", "by far")
    return np.expm1(x) + TABLE[int(x) % 5000]

@kernel
def lengths(vectors, out):
    for i in range(len(vectors)):
        out[i] = checked(vectors[i, 0]) + np.sin(vectors[i, 1])
    return out.sum(), len(vectors)

@kernel
def twice(vectors, out):
    return lengths(vectors, out)[0] * 2.0

v, out = np.array([[3.0, 4.0], [6.0, 8.0]]), np.zeros(2)
for function in (lengths, twice) if "twice" in sys.argv else (lengths,):
    print(function(v, out))
    try:
        function(v * 1e6, out)
    except ValueError as error:
        print(error.args)
print(sum("checked" in name for name in Environment._memo), "kept")
for dispatcher in (lengths, twice):
    for result in dispatcher.overloads.values():
        print(dispatcher.py_func.__name__, result.library._image is not None)
"""

LARGE = """
import gc
import sys
from mmap import PAGESIZE
import llvmlite.binding as llvm
import numpy as np
from pmviewer.heap import give_back
from pmviewer.kernels.compile import placed
from pmviewer.kernels.compile.jit import device, kernel

if "placed" in sys.argv:
    placed.install()

def resident():
    return int(open("/proc/self/statm").read().split()[1]) * PAGESIZE / 2**20

@device
def step(x, i, out):
    x = np.sin(x * (i + 0.5)) + out[i] * np.exp(x - (i + 0.25))
    out[i] = x
    return x

@kernel
def large(x, out):
    STATEMENTS
    return x

given = [(kind(0.1), np.zeros(500, to)) for kind in (np.float32, np.float64) for to in (np.float32, np.float64)]
large(*given[0])  # the first one brings what all share
give_back()
before, modules = resident(), sum(isinstance(o, llvm.ModuleRef) for o in gc.get_objects())
for x, out in given[1:]:
    large(x, out)
give_back()
print((resident() - before) / len(given[1:]))
print(sum(isinstance(o, llvm.ModuleRef) for o in gc.get_objects()) - modules)
"""
PAGES = 10 * mmap.PAGESIZE / 2**20
"""MiB that filled pages and what Python keeps of a kernel take beside."""
STATEMENTS = "\n    ".join(f"x = step(x, {i}, out)" for i in range(40))


def run(folder: Path, module: str, *words: str) -> list[str]:
    (folder / "placed_lengths.py").write_text(module)
    done = fresh.python(folder / "placed_lengths.py", *words, env={"PMVIEWER_CACHE": str(folder / "cache")})
    return done.stdout.splitlines()


class Told(NamedTuple):
    """What a process has said: of calls, how many functions' constants are kept, and which kernel is placed."""

    calls: list[str]
    kept: str
    kernels: list[str]

    @classmethod
    def by(cls, folder: Path, *words: str) -> Told:
        lines = run(folder, MODULE, *words)
        kept = next(i for i, line in enumerate(lines) if line.endswith("kept"))
        return cls(lines[:kept], lines[kept], lines[kept + 1 :])


@pytest.fixture(scope="module")
def kept(tmp_path_factory) -> Path:
    """A folder in which nothing has been compiled, for all tests that run MODULE."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture(scope="module")
def compiled(kept) -> Told:
    """By the process that has compiled it."""
    return Told.by(kept)


@pytest.fixture(scope="module")
def refused(kept, compiled) -> Told:
    """By one that can't place what it finds."""
    return Told.by(kept, "refused")


@pytest.fixture(scope="module")
def linked(kept, compiled) -> Told:
    """By one that has found the first kernel and compiled the second, which calls it."""
    return Told.by(kept, "twice")


@pytest.fixture(scope="module")
def placed(kept, linked) -> Told:
    """By one that finds both."""
    return Told.by(kept, "twice")


def test_what_is_placed_gives_the_same_and_raises_the_same(compiled, linked, placed):
    assert compiled.kernels == ["lengths False"]
    assert placed.kernels == ["lengths True", "twice True"]
    assert placed.calls[:2] == compiled.calls
    assert placed.calls == linked.calls
    assert compiled.calls[1] == "('too long', 'by far')"


def test_constants_that_no_code_asks_for_are_not_kept(placed, refused):
    assert placed.kept == "0 kept"
    assert refused.kept == "1 kept"


def test_what_is_placed_can_be_linked_into_what_is_compiled(linked):
    assert linked.kernels == ["lengths True", "twice False"]


def test_what_cannot_be_placed_is_loaded_by_llvm(compiled, refused):
    assert refused.kernels == ["lengths False"]
    assert refused.calls == compiled.calls


def test_what_is_placed_takes_little_more_than_its_code(tmp_path):
    module = LARGE.replace("STATEMENTS", STATEMENTS)
    run(tmp_path, module)
    (placed, modules), (loaded, _) = (map(float, run(tmp_path, module, word)) for word in ("placed", "by LLVM"))
    files = list((tmp_path / "cache").rglob("*.large-*.nbc"))
    assert len(files) == 4
    size = sum(len(pickle.loads(file.read_bytes())[1][0][2][0]) for file in files) / 4 / 2**20
    assert placed < size + PAGES < loaded
    assert modules == 0  # LLVM's, of 80 KiB each


def object_file(text: str, model: str = "large") -> bytes:
    """Of what is written in LLVM's language, for a place anywhere in memory."""
    machine = llvm.Target.from_default_triple().create_target_machine(reloc="static", codemodel=model)
    return machine.emit_object(llvm.parse_assembly(text))


@pytest.fixture(autouse=True, scope="module")
def target():
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


ADDED = """
@shared = common global i64 0
@unused = external global i64
@own = internal global i64 40
@table = internal constant [2 x i64] [i64 1000, i64 2000]
declare i64 @further(i64)
define internal i64 @inner(i64 %x) noinline {
  %place = getelementptr [2 x i64], [2 x i64]* @table, i64 0, i64 %x
  %number = load volatile i64, i64* %place
  ret i64 %number
}
define i64 @added(i64 %x) {
  %a = call i64 @inner(i64 %x)
  %b = call i64 @further(i64 %a)
  %c = load i64, i64* @shared
  %old = load i64, i64* @own
  %new = add i64 %old, 1
  store i64 %new, i64* @own
  %d = add i64 %b, %c
  %e = add i64 %d, %old
  ret i64 %e
}
"""


def test_code_finds_its_own_and_what_is_outside():
    further = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(lambda x: 3 * x)
    shared, asked = ctypes.c_int64(7), []

    def outside(name: str) -> int:
        asked.append(name)
        return ctypes.cast(further, ctypes.c_void_p).value or 0

    placed = image.load(object_file(ADDED), outside, lambda name: ctypes.addressof(shared))
    assert asked == ["further"]
    assert list(placed.functions) == ["added"]
    added = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(placed.functions["added"])
    assert (added(0), added(1)) == (3000 + 7 + 40, 6000 + 7 + 41)
    shared.value = 8
    assert added(0) == 3000 + 8 + 42


def rights_at(address: int) -> str:
    """Rights of the memory there; the system joins neighbours of equal rights to one line, so none need begin there."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        start, end = (int(part, 16) for part in line.split()[0].split("-"))
        if start <= address < end:
            return line.split()[1]
    return "none"


def test_code_cannot_be_written_and_numbers_cannot_be_executed():
    placed = image.load(object_file(ADDED), lambda name: 1, lambda name: 1)
    assert [rights_at(placed.functions["added"])] == ["r-xp"]


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        (b"MZ" + bytes(100), "no relocatable file"),
        (Path(sys.executable).resolve().read_bytes()[:64], "no relocatable file"),
        (b"\x7fELF\x02\x01" + bytes(10) + (1).to_bytes(2, "little") + (183).to_bytes(2, "little"), "another processor"),
    ],
)
def test_other_files_are_refused(file, reason):
    with pytest.raises(image.Unloadable, match=reason):
        image.load(file, lambda name: 1, lambda name: 1)


OF_A_THREAD = """
@own = internal thread_local global i64 1
define i64 @f() {
  %x = load i64, i64* @own
  ret i64 %x
}
"""


def test_code_with_what_is_not_provided_for_is_refused():
    with pytest.raises(image.Unloadable, match="'further'"):
        image.load(object_file(ADDED), lambda name: 0, lambda name: 1)
    with pytest.raises(image.Unloadable, match="variables of threads"):
        image.load(object_file(OF_A_THREAD), lambda name: 1, lambda name: 1)
    with pytest.raises(image.Unloadable, match=r"too far|types"):
        image.load(object_file(ADDED, "small"), lambda name: 1, lambda name: 1)
