"""Intrinsics below numba's arrays: stack scratch, loads from raw addresses, bit casts.

A kernel sees the scene as one record of addresses (`pmviewer.kernels.scene`). `load_f4(address, i)` reads element i of
a float32 array that starts at `address`; Python keeps the array alive.

Each has a twin in plain Python, which takes its place without the compiler (NUMBA_DISABLE_JIT=1). A pointer to scratch
is then an int32 array.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils, errors
from numba.extending import intrinsic

I8, I32, I64, F32, F64 = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.FloatType(), ir.DoubleType()


CACHE_LINE = 64


def aligned_empty(shape: tuple[int, ...], dtype: np.dtype | type) -> np.ndarray:
    """An uninitialised C-contiguous array that starts at a cache line, as aligned vector loads need."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = np.empty(size + CACHE_LINE, np.uint8)
    start = -raw.ctypes.data % CACHE_LINE
    return raw[start : start + size].view(dtype).reshape(shape)


def with_twin(twin: Callable[..., Any], **options: bool) -> Callable[[Callable[..., Any]], Any]:
    """Decorates the code generator of an intrinsic; `twin` does the same in plain Python."""
    if config.DISABLE_JIT:
        return lambda generator: twin
    return intrinsic(**options) if options else intrinsic


def at_address(address: int, count: int, dtype: type) -> np.ndarray:
    """The array (count,) that begins at an address; for twins."""
    size = count * np.dtype(dtype).itemsize
    return np.frombuffer((ctypes.c_char * size).from_address(int(address)), dtype)


@with_twin(lambda x: np.float32(x).view(np.uint32))
def bits_of_float(typingctx, x):
    """The bits of a float32 as uint32."""
    signature = types.uint32(types.float32)

    def codegen(context, builder, sig, args):
        return builder.bitcast(args[0], I32)

    return signature, codegen


@with_twin(lambda x: np.uint32(x).view(np.float32))
def float_of_bits(typingctx, x):
    """The float32 whose bits are the given uint32."""
    signature = types.float32(types.uint32)

    def codegen(context, builder, sig, args):
        return builder.bitcast(args[0], F32)

    return signature, codegen


@with_twin(lambda mask: np.int32((int(mask) & -int(mask)).bit_length() - 1))
def count_trailing_zeros(typingctx, mask):
    """Index of the lowest set bit of a non-zero int32."""
    signature = types.int32(types.int32)

    def codegen(context, builder, sig, args):
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return signature, codegen


def _loader(numba_type, llvm_type, dtype):
    size = np.dtype(dtype).itemsize

    @with_twin(lambda address, index: at_address(int(address) + size * int(index), 1, dtype)[0])
    def load(typingctx, address, index):
        signature = numba_type(types.int64, types.int64)

        def codegen(context, builder, sig, args):
            base = builder.inttoptr(args[0], llvm_type.as_pointer())
            return builder.load(builder.gep(base, [args[1]]))

        return signature, codegen

    return load


load_f4 = _loader(types.float32, F32, np.float32)
load_i4 = _loader(types.int32, I32, np.int32)
load_u4 = _loader(types.uint32, I32, np.uint32)
load_i8 = _loader(types.int64, I64, np.int64)
load_f8 = _loader(types.float64, F64, np.float64)


@with_twin(lambda address, index: None)
def prefetch(typingctx, address, index):
    """Have the processor fetch element `index` of an array of 4-byte elements into its caches, and go on meanwhile.
    Whether there is such an element doesn't matter."""
    signature = types.void(types.int64, types.int64)

    def codegen(context, builder, sig, args):
        place = builder.gep(builder.inttoptr(args[0], I32.as_pointer()), [args[1]])
        kind = ir.FunctionType(ir.VoidType(), [I8.as_pointer(), I32, I32, I32])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        to_read, to_all_caches, data = ir.Constant(I32, 0), ir.Constant(I32, 3), ir.Constant(I32, 1)
        builder.call(function, [builder.bitcast(place, I8.as_pointer()), to_read, to_all_caches, data])
        return context.get_dummy_value()

    return signature, codegen


def _storer(numba_type, llvm_type, dtype):
    size = np.dtype(dtype).itemsize

    def _store(address, index, value):
        at_address(int(address) + size * int(index), 1, dtype)[0] = value

    @with_twin(_store)
    def store(typingctx, address, index, value):
        signature = types.void(types.int64, types.int64, numba_type)

        def codegen(context, builder, sig, args):
            base = builder.inttoptr(args[0], llvm_type.as_pointer())
            builder.store(args[2], builder.gep(base, [args[1]]))
            return context.get_dummy_value()

        return signature, codegen

    return store


store_f4 = _storer(types.float32, F32, np.float32)
store_i4 = _storer(types.int32, I32, np.int32)


@with_twin(lambda array, row: array[row] if array.ndim > 1 else array[row:])
def row_of(typingctx, array, row):
    """Pointer to a row of a C-contiguous array (n, m), to be indexed like (m,); of one (n,) from that element on. The
    array is the caller's: tuples that hold it count references wherever they are made, which took a twentieth of the
    eye pass."""
    signature = types.CPointer(array.dtype)(array, types.int64)

    def codegen(context, builder, sig, args):
        opened = context.make_array(sig.args[0])(context, builder, args[0])
        at = args[1]
        if sig.args[0].ndim > 1:
            at = builder.mul(at, builder.extract_value(opened.shape, 1))
        return builder.gep(opened.data, [at])

    return signature, codegen


@with_twin(lambda address: at_address(address, 1, np.int64)[0])
def load_shared_i8(typingctx, address):
    """The int64 at a multiple of eight, whole even while another thread stores there (LLVM `monotonic`)."""
    signature = types.int64(types.int64)

    def codegen(context, builder, sig, args):
        return builder.load_atomic(builder.inttoptr(args[0], I64.as_pointer()), "monotonic", 8)

    return signature, codegen


def _store_shared_i8(address, value):
    at_address(address, 1, np.int64)[0] = value


@with_twin(_store_shared_i8)
def store_shared_i8(typingctx, address, value):
    """Stores an int64 at a multiple of eight, whole even while other threads load it (LLVM `monotonic`)."""
    signature = types.void(types.int64, types.int64)

    def codegen(context, builder, sig, args):
        builder.store_atomic(args[1], builder.inttoptr(args[0], I64.as_pointer()), "monotonic", 8)
        return context.get_dummy_value()

    return signature, codegen


@with_twin(lambda count: np.zeros(count, np.int32), prefer_literal=True)
def stack_i4(typingctx, count):
    """Pointer to `count` (a literal) uninitialised int32 on the stack, 64-byte aligned: scratch without a heap."""
    if not isinstance(count, types.IntegerLiteral):
        raise errors.RequireLiteralValue("the length must be a literal")
    length = count.literal_value
    signature = types.CPointer(types.int32)(count)

    def codegen(context, builder, sig, args):
        with builder.goto_entry_block():
            pointer = builder.alloca(ir.ArrayType(I32, length))
            pointer.align = 64
        return builder.bitcast(pointer, I32.as_pointer())

    return signature, codegen


def _stack_access(numba_type, llvm_type, dtype):
    @with_twin(lambda pointer, index: pointer.view(dtype)[index])
    def get(typingctx, pointer, index):
        signature = numba_type(pointer, types.int64)

        def codegen(context, builder, sig, args):
            return builder.load(builder.gep(builder.bitcast(args[0], llvm_type.as_pointer()), [args[1]]))

        return signature, codegen

    def _put(pointer, index, value):
        pointer.view(dtype)[index] = value

    @with_twin(_put)
    def put(typingctx, pointer, index, value):
        signature = types.void(pointer, types.int64, numba_type)

        def codegen(context, builder, sig, args):
            base = builder.bitcast(args[0], llvm_type.as_pointer())
            builder.store(args[2], builder.gep(base, [args[1]]))
            return context.get_dummy_value()

        return signature, codegen

    return get, put


stack_get_i4, stack_put_i4 = _stack_access(types.int32, I32, np.int32)
stack_get_f4, stack_put_f4 = _stack_access(types.float32, F32, np.float32)
stack_get_i8, stack_put_i8 = _stack_access(types.int64, I64, np.int64)
