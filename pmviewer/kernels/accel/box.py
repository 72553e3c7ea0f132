"""Bounding boxes while a tree is built.

A box is eight float32 in one row of 32 bytes: lower corner, a number, the upper corner negated, a number. The union of
two boxes is then the smaller of each of the eight; the numbers are integers in the same memory and of no account there.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types

from pmviewer.kernels.accel.simd import LANES, ROW_BYTES, V8, V8I
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import at_address, with_twin


def _row(builder, address):
    value = builder.load(builder.inttoptr(address, V8.as_pointer()))
    value.align = ROW_BYTES
    return value


def _shrink(builder, address, other):
    """Keep the smaller of what is at the address and `other`, lane by lane."""
    old = _row(builder, address)
    smaller = builder.select(builder.fcmp_ordered("<", other, old), other, old)
    builder.store(smaller, builder.inttoptr(address, V8.as_pointer())).align = ROW_BYTES


def _lanes(address):
    return at_address(address, LANES, np.float32)


def _shrink_row(address, other):
    row = _lanes(address)
    row[:] = np.where(other < row, other, row)


def _center_row(box, other):
    row = _lanes(other)
    with np.errstate(invalid="ignore"):
        _shrink_row(box, row - np.concatenate([row[4:], row[:4]]))


def _copy_row(box, to):
    _lanes(to)[:] = _lanes(box)


def _clear_row(box):
    _lanes(box)[:] = np.inf


@with_twin(lambda box, other: _shrink_row(box, _lanes(other)))
def grow(typingctx, box, other):
    """The box at one address grows by that at the other."""
    signature = types.void(types.int64, types.int64)

    def codegen(context, builder, sig, args):
        _shrink(builder, args[0], _row(builder, args[1]))
        return context.get_dummy_value()

    return signature, codegen


@with_twin(_center_row)
def grow_by_center(typingctx, box, other):
    """The box at one address grows by twice the centre of that at the other."""
    signature = types.void(types.int64, types.int64)

    def codegen(context, builder, sig, args):
        row = _row(builder, args[1])
        undefined = ir.Constant(V8, ir.Undefined)
        turned = builder.shuffle_vector(row, undefined, ir.Constant(V8I, [4, 5, 6, 7, 0, 1, 2, 3]))
        # lower - (-upper) in the first four lanes, its negative in the others
        _shrink(builder, args[0], builder.fsub(row, turned))
        return context.get_dummy_value()

    return signature, codegen


@with_twin(_copy_row)
def copy_row(typingctx, box, to):
    """Copy the row at one address to the other."""
    signature = types.void(types.int64, types.int64)

    def codegen(context, builder, sig, args):
        row = _row(builder, args[0])
        builder.store(row, builder.inttoptr(args[1], V8.as_pointer())).align = ROW_BYTES
        return context.get_dummy_value()

    return signature, codegen


@with_twin(_clear_row)
def clear(typingctx, box):
    """The row at the address becomes a box around nothing."""
    signature = types.void(types.int64)

    def codegen(context, builder, sig, args):
        nothing = ir.Constant(V8, [float("inf")] * LANES)
        builder.store(nothing, builder.inttoptr(args[0], V8.as_pointer())).align = ROW_BYTES
        return context.get_dummy_value()

    return signature, codegen


@device
def clear_rows(address, rows):
    """So many rows from the address on become boxes around nothing."""
    for i in range(rows):
        clear(address + ROW_BYTES * i)


@device
def half_area(box):
    """Half the surface of a box (8,)."""
    dx, dy, dz = -(box[0] + box[4]), -(box[1] + box[5]), -(box[2] + box[6])
    return dx * dy + dy * dz + dz * dx
