"""Kernels compiled by another process: this one loads them, knows nothing of how they were made, and compiles by itself
what the other can't."""

from tests.support import fresh

LOADED = """
import numpy as np
from pmviewer.kernels.compile import elsewhere
from pmviewer.kernels.compile.jit import _DeviceDispatcher, _KernelDispatcher
from pmviewer.kernels.meshes.rows import count_words

compiler = elsewhere.install()
{before}
data = np.frombuffer(b"one two  three four", np.uint8)
print(count_words(data, 0), compiler.count, sum(count_words.stats.cache_hits.values()))
"""


def run(folder, before=""):
    return fresh.python(LOADED.format(before=before), env={"PMVIEWER_CACHE": str(folder)}).stdout.split()


def test_a_kernel_is_compiled_by_the_other_process_and_loaded_here(tmp_path):
    assert run(tmp_path) == ["4", "1", "1"]
    assert run(tmp_path) == ["4", "0", "1"], "what is saved is loaded at once"


def test_without_the_other_process_it_is_compiled_here(tmp_path):
    assert run(tmp_path, "sys = elsewhere.sys; sys.executable = '/nowhere/python'") == ["4", "0", "0"]
