"""What numba's compiler is spared gives the same answers, by numba's own definitions."""

from __future__ import annotations

import numpy as np
from llvmlite import ir as llvm
from numba import float32, float64, int64, types
from numba.core import base, event, ir
from numba.core.compiler import Flags, run_frontend
from numba.core.registry import cpu_target
from numba.core.typing import npydecl
from numba.np import numpy_support

from pmviewer.kernels.compile import jit, quicker


def test_it_is_installed():
    assert not jit.numba.config.DISABLE_JIT, "or nothing is compiled"
    for function in (base.BaseContext.get_abi_sizeof, npydecl.ufunc_find_matching_loop, ir.Inst._rec_list_vars):
        assert function.__module__ == quicker.__name__


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
