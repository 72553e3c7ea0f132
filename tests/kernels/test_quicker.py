"""What numba's compiler is spared gives the same answers, by numba's own definitions."""

from __future__ import annotations

import operator
import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
from llvmlite import ir as llvm
from numba import float32, float64, int64, njit, types
from numba.core import base, event, funcdesc, ir, itanium_mangler, transforms
from numba.core.compiler import Flags, run_frontend
from numba.core.lowering import Lower
from numba.core.postproc import PostProcessor
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python, rtsys
from numba.core.runtime.context import NRTContext
from numba.core.typing import npydecl
from numba.np import numpy_support

from pmviewer.engine.opened import open_scene
from pmviewer.kernels.compile import jit, quicker
from pmviewer.settings.access import Settings, with_values
from tests.support import fresh
from tests.support.scenes import rendered


def test_it_is_installed():
    assert not jit.numba.config.DISABLE_JIT, "or nothing is compiled"
    spared = (base.BaseContext.get_abi_sizeof, npydecl.ufunc_find_matching_loop, ir.Inst._rec_list_vars,
              NRTContext.get_meminfos, Lower.storevar, Lower.delvar, PostProcessor.run, transforms.canonicalize_cfg,
              types.BaseFunction.get_call_type, funcdesc.default_mangler)  # fmt: skip
    for function in spared:
        assert function.__module__ == quicker.__name__, function


class Pair(NamedTuple):
    """Of something that is counted by references, and something that is not."""

    array: np.ndarray
    number: float


class Triple(NamedTuple):
    """Of pairs, whose written type is long."""

    first: Pair
    second: Pair
    third: Pair


def test_records_have_names_of_their_own_in_every_process():
    """What one process has compiled another one links with its own: names must not depend on what came before."""
    script = (
        "import sys, numpy as np; from numba import from_dtype; from numba.core.registry import cpu_target;"
        "from pmviewer.kernels.compile import jit;"
        "before = [from_dtype(np.dtype([(f'x{i}', 'f8')])) for i in range(int(sys.argv[1]))];"
        "records = [from_dtype(np.dtype([('a', 'f4'), (name, 'i8')])) for name in 'bc'];"
        "print(*[cpu_target.target_context.mangler('a.f', (record,)) for record in records])"
    )
    found = [fresh.python(script, before).stdout.split() for before in ("0", "7")]
    assert found[0] == found[1]
    assert len(set(found[0])) == 2


def test_names_are_short_and_tell_types_apart():
    mangled = cpu_target.target_context.mangler
    assert mangled("a.f", (float32, int64)) == itanium_mangler.mangle("a.f", (float32, int64))
    names = set()
    for number in (float32, float64):
        pair = types.NamedTuple((types.Array(number, 1, "C"), number), Pair)
        nested = types.NamedTuple((types.NamedTuple((pair,) * 3, Triple),) * 3, Triple)
        for arguments in ((nested,), (nested, nested)):
            for name, tags, uid in (("a.f", (), None), ("a.f", ("t",), None), ("a.f", (), 1), ("a.g", (), None)):
                assert len(itanium_mangler.mangle(name, arguments)) > 500
                names.add(mangled(name, arguments, abi_tags=tags, uid=uid))
                assert mangled(name, arguments, abi_tags=tags, uid=uid) in names
                assert itanium_mangler.prepend_namespace(mangled(name, arguments), ns="cpython")
    assert len(names) == 2 * 2 * 4
    assert max(map(len, names)) < 100


def test_sizes_are_those_of_llvm():
    context, word, byte = cpu_target.target_context, llvm.IntType(64), llvm.IntType(8)
    expected = {
        byte: 1,
        word: 8,
        llvm.FloatType(): 4,
        llvm.ArrayType(byte, 3): 3,
        llvm.LiteralStructType([byte, word]): 16,
        llvm.LiteralStructType([word, byte, byte]): 16,
        llvm.LiteralStructType([byte, byte]): 2,
    }
    for _ in range(2):
        for kind, size in expected.items():
            assert context.get_abi_sizeof(kind) == size


def test_named_types_of_one_name_have_their_own_sizes():
    sizes = []
    for elements in ([llvm.IntType(8)], [llvm.IntType(64)] * 3):
        kind = llvm.Context().get_identified_type("one name")
        kind.set_body(*elements)
        sizes.append(cpu_target.target_context.get_abi_sizeof(llvm.LiteralStructType(kind.elements)))
    assert sizes == [1, 24]


def test_loops_are_numbas():
    for ufunc in (np.add, np.sqrt, np.less, np.left_shift):
        for kinds in ((float32, float32), (float32, float64), (int64, float32), (types.boolean, int64)):
            arguments = kinds[: ufunc.nin]
            right = numpy_support.ufunc_find_matching_loop(ufunc, arguments)
            for _ in range(2):
                assert npydecl.ufunc_find_matching_loop(ufunc, list(arguments)) == right


def test_options_are_all_of_them_with_their_defaults():
    flags = Flags()
    for change in ({}, {"nrt": True}, {"nrt": True, "error_model": "numpy"}):
        for name, value in change.items():
            setattr(flags, name, value)
        assert flags.values() == {name: getattr(flags, name) for name in flags.options}
        assert list(flags.values()) == list(flags.options)
    assert flags != Flags()
    assert flags == flags.copy()


def variables(value):
    """In plain words: every variable, in order, however deep."""
    if isinstance(value, ir.Var):
        return [value]
    if isinstance(value, ir.Inst):
        return value.list_vars()
    if isinstance(value, dict):
        value = list(value.values())
    return [v for part in value for v in variables(part)] if isinstance(value, list | tuple) else []


def test_variables_of_instructions_are_all_of_them():
    def function(a, b, *c):
        total = 0
        for i in range(a):
            total += b[i : a + 1] * (a, [b, c][i])[0]
        return {a: total, "b": c}

    found = 0
    for block in run_frontend(function).blocks.values():
        for statement in block.body:
            expected = variables(statement.__dict__)
            assert [id(v) for v in statement.list_vars()] == [id(v) for v in expected]
            found += len(expected)
    assert found > 20


def test_calls_of_llvm_are_no_events():
    with event.install_recorder("numba:llvm_lock") as heard:
        cpu_target.target_context.get_abi_sizeof(llvm.ArrayType(llvm.IntType(8), 12345))
    assert heard.buffer == []


def test_what_is_counted_by_references_is_counted_and_freed():
    @njit
    def turns(n, record):
        kept = Pair(np.zeros(3), 0.0)
        total = 0.0
        for i in range(n):
            if i % 3 == 0:
                kept = Pair(np.full(5, float(i)), kept.number + record["a"])
            elif i % 3 == 1:
                kept = Pair(kept.array[1:], kept.number)
            place = (i, (kept, total))
            total = place[1][0].array.sum() + place[1][1] + place[0]
        return total, kept.array

    record = np.zeros(1, [("a", "f8"), ("b", "i4")])[0]
    record["a"] = 2.0
    expected = turns.py_func(50, record)
    turns(1, record)
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        total, array = turns(50, record)
        assert total == expected[0]
        np.testing.assert_array_equal(array, expected[1])
        del array
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    assert after.alloc - before.alloc == after.free - before.free > 10


def test_a_call_that_is_known_is_what_numba_finds():
    context = cpu_target.typing_context
    context.refresh()
    plain = float32, float64, int64, types.int32, types.uint64, types.boolean
    for function in (operator.add, operator.truediv, operator.lt, operator.lshift, operator.neg):
        resolver = context.resolve_value_type(function)
        for a in plain:
            for b in plain if function is not operator.neg else (None,):
                arguments = (a,) if b is None else (a, b)
                try:
                    again = type(resolver)(resolver.templates).get_call_type(context, arguments, {})
                except Exception:  # no such operation, as a shift of floats
                    continue
                for _ in range(2):
                    assert resolver.get_call_type(context, arguments, {}) == again


LOADED_ONCE = """
import numpy as np
from pmviewer.kernels.compile import jit
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

loads, load = [], jit._KernelCache.load_overload
jit._KernelCache.load_overload = lambda self, *a: (loads.append(self), load(self, *a))[1]
values = {"photons.N": 1000, "camera.width": 16, "camera.height": 16}
renderer = Renderer(open_scene("cornell_caustic"), with_values(Settings(), values), WorkPool(1), StageStore(0))
for i in range(6):
    renderer.step()
    print(len(loads))
"""


def test_what_another_process_has_compiled_is_loaded_once():
    """Types are saved with kernels, and have to be found again where strings have other hashes."""
    values = with_values(Settings(), {"photons.N": 1000, "camera.width": 16, "camera.height": 16})
    rendered(open_scene("cornell_caustic"), values, 6)  # by a process whose strings have hashes of its own
    told = subprocess.run(
        [sys.executable, "-c", LOADED_ONCE],
        env={**os.environ, "PYTHONHASHSEED": "2", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    counts = [int(line) for line in told.split()]
    assert counts[0] > 5
    assert counts[-1] == counts[-2]


def test_loops_keep_their_shape():
    def function(n):
        total = 0
        for i in range(n):
            if i % 2:
                continue  # a second way back to the loop's head
            if i > 20:
                break
            total += i
        return total

    assert njit(function)(30) == function(30)
    straight = run_frontend(lambda a: a if a > 1 else -a).blocks
    shaped = transforms.canonicalize_cfg(straight)
    assert shaped == straight
    assert shaped is not straight
