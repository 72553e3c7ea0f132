"""Only what Python calls becomes machine code, and what comes back from disk does the same as what was compiled."""

import pytest

from tests.support import fresh

MODULE = """
import sys
import llvmlite.binding as llvm
import numpy as np
from numba.core import event
from pmviewer.kernels.compile.jit import device, kernel

@device
def squared(x):
    return x * x

@device
def length(v):
    return np.sqrt(squared(v[0]) + squared(v[1]))

@kernel
def lengths(vectors, out):
    for i in range(len(vectors)):
        out[i] = length(vectors[i])
    if len(out) != len(vectors):
        raise ValueError("another length")

@kernel
def twice(vectors, out):
    lengths(vectors, out)
    for i in range(len(out)):
        out[i] = squared(out[i])

parse, parsed = llvm.parse_bitcode, []
llvm.parse_bitcode = lambda *of: (parsed.append(of), parse(*of))[1]
names = []

class Count(event.Listener):
    def on_start(self, of):
        names.append(of.data["dispatcher"].py_func.__name__)
    def on_end(self, of):
        pass

event.register("numba:compile", Count())
v, out = np.array([[3.0, 4.0], [6.0, 8.0]]), np.zeros(2)
for function in sys.argv[1:]:
    globals()[function](v, out)
    print(*out, "by bitcode" if parsed else "as it is")
try:
    lengths(v, np.zeros(3))
except ValueError as error:
    print(error)
print(*names)
for dispatcher in (squared, length, lengths, twice):
    for result in dispatcher.overloads.values():
        print(dispatcher.py_func.__name__, result.library._native)
"""


def run(folder, *functions):
    (folder / "lengths.py").write_text(MODULE)
    done = fresh.python(folder / "lengths.py", *functions, env={"PMVIEWER_CACHE": str(folder / "cache")})
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of compiled code, which the first process finds empty."""
    return tmp_path_factory.mktemp("native")


@pytest.fixture(scope="module")
def first(folder):
    return run(folder, "lengths")


def test_machine_code_is_made_for_what_python_calls_alone(first):
    assert first == [
        "5.0 10.0 as it is",
        "another length",
        "lengths length squared",
        "squared False",
        "length False",
        "lengths True",
    ]


def test_what_was_saved_is_linked_into_what_is_compiled_later(folder, first):
    assert run(folder, "lengths", "twice") == [
        "5.0 10.0 as it is",
        "25.0 100.0 by bitcode",
        "another length",
        "twice",
        "squared False",
        "lengths True",
        "twice True",
    ]
    assert run(folder, "twice")[:2] == ["25.0 100.0 as it is", "another length"]
