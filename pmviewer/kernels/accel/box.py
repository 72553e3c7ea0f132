"""Bounding boxes in a register, while a tree is built.

A box is a row of eight float32: lower corner, a number, the upper corner negated, a number. The union of two boxes is
then the smaller of each of the eight; the numbers are integers in the same memory and of no account there. Compiled
code holds a row as one value, and memory by its address, a multiple of 32: neither costs what arrays cost to compile.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.extending import register_model

from pmviewer.kernels.accel.simd import FLAGS, LANES, ROW_BYTES, V8, V8I, splat
from pmviewer.kernels.memory import F32, I32, I64, at_address, with_twin

BINS = 16
"""Intervals of an axis that boxes are sorted into."""


class _Row(types.Type):
    """Eight float32 as one value."""

    def __init__(self) -> None:
        super().__init__(name="Row8")


ROW = _Row()


@register_model(_Row)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager: object, kind: _Row) -> None:
        super().__init__(manager, kind, V8)


_NOTHING = ir.Constant(V8, [float("inf")] * LANES)
_UNDEFINED = ir.Constant(V8, ir.Undefined)


def _pointer(builder, address):
    return builder.inttoptr(address, V8.as_pointer())


def _turned(builder, row):
    """Both halves changed over."""
    return builder.shuffle_vector(row, _UNDEFINED, ir.Constant(V8I, [4, 5, 6, 7, 0, 1, 2, 3]))


def _smaller(builder, row, other):
    # A comparison with a choice would become a masked store where the result goes to memory, for which the next load
    # waits. No element is NaN, save numbers that are of no account.
    smallest = cgutils.get_or_insert_function(builder.module, ir.FunctionType(V8, [V8, V8]), "llvm.minnum.v8f32")
    return builder.call(smallest, [row, other], fastmath=("nnan", "nsz"))


def _sub(builder, a, b):
    # With flags of its own, so that numba's, by which (a - b) - c may be rounded otherwise elsewhere, stay away.
    return builder.fsub(a, b, flags=FLAGS)


def _position(builder, center, low, scale):
    return builder.fmul(_sub(builder, center, low), scale, flags=FLAGS)


def _halves(row):
    return np.concatenate([row[4:], row[:4]])


def _joined(row, other):
    return np.where(other < row, other, row)


def _center(row):
    with np.errstate(invalid="ignore", over="ignore"):
        return row - _halves(row)


def _positions(center, low, scale):
    with np.errstate(invalid="ignore", over="ignore"):
        return (center - low) * scale


def _bins(center, low, scale):
    position = np.nan_to_num(_positions(center, low, scale)[:3])
    return tuple(int(i) + BINS * k for k, i in enumerate(np.clip(position, 0, BINS - 1)))


def _half_area(row):
    with np.errstate(invalid="ignore", over="ignore"):
        x, y, z = (row + _halves(row))[:3]
        return x * y + y * z + z * x


@with_twin(lambda address: at_address(address, LANES, np.float32).copy())
def row_at(typingctx, address):
    """The row at an address."""
    signature = ROW(types.int64)

    def codegen(context, builder, sig, args):
        value = builder.load(_pointer(builder, args[0]))
        value.align = ROW_BYTES
        return value

    return signature, codegen


def _put(row, address):
    at_address(address, LANES, np.float32)[:] = row


@with_twin(_put)
def put_row(typingctx, row, address):
    """Store a row at an address."""
    signature = types.void(ROW, types.int64)

    def codegen(context, builder, sig, args):
        builder.store(args[0], _pointer(builder, args[1])).align = ROW_BYTES
        return context.get_dummy_value()

    return signature, codegen


@with_twin(lambda: np.full(LANES, np.inf, np.float32))
def nothing(typingctx):
    """The box around nothing."""
    return ROW(), lambda context, builder, sig, args: _NOTHING


@with_twin(_joined)
def joined(typingctx, row, other):
    """The box around two boxes."""
    return ROW(ROW, ROW), lambda context, builder, sig, args: _smaller(builder, *args)


@with_twin(_center)
def center(typingctx, row):
    """The box around a box's centre, twice as far out: its lower corner less its upper one negated, and the reverse."""
    signature = ROW(ROW)
    return signature, lambda context, builder, sig, args: _sub(builder, args[0], _turned(builder, args[0]))


@with_twin(_half_area)
def half_area(typingctx, row):
    """Half the surface of a box."""
    signature = types.float32(ROW)

    def codegen(context, builder, sig, args):
        # Lower corner and negated upper one: minus the extents, whose products are the same.
        extent = builder.fadd(args[0], _turned(builder, args[0]))
        x, y, z = (builder.extract_element(extent, ir.Constant(I32, k)) for k in range(3))
        return builder.fadd(builder.fadd(builder.fmul(x, y), builder.fmul(y, z)), builder.fmul(z, x))

    return signature, codegen


@with_twin(_bins)
def bins_of(typingctx, center, low, scale):
    """In which bin a centre is along x, y and z: (center - low) · scale cut to 0 … BINS - 1, those of y after those of
    x, those of z last; a NaN is in the first."""
    signature = types.UniTuple(types.int64, 3)(ROW, ROW, ROW)

    def codegen(context, builder, sig, args):
        position = _position(builder, *args)
        # Cut in floating point: the conversion of a huge number or a NaN to an integer is anything.
        for bound, beyond in ((0.0, "<="), (BINS - 1.0, ">")):
            limit = ir.Constant(V8, [bound] * LANES)
            outside = (builder.fcmp_ordered if beyond == ">" else builder.fcmp_unordered)(beyond, position, limit)
            position = builder.select(outside, limit, position)
        index = builder.fptosi(position, V8I)
        each = (builder.zext(builder.extract_element(index, ir.Constant(I32, k)), I64) for k in range(3))
        return context.make_tuple(
            builder, sig.return_type, [builder.add(i, ir.Constant(I64, BINS * k)) for k, i in enumerate(each)]
        )

    return signature, codegen


def _position_along(address, axis, low, scale):
    center = _center(at_address(address, LANES, np.float32))
    return np.full(LANES, _positions(center[axis], low, scale), np.float32)


@with_twin(_position_along)
def position_along(typingctx, address, axis, low, scale):
    """(center - low) · scale of the box at an address along an axis, in all elements: bit for bit the number that
    `bins_of` cuts."""
    signature = ROW(types.int64, types.int64, types.float32, types.float32)

    def codegen(context, builder, sig, args):
        address, axis, low, scale = args
        corner = builder.inttoptr(address, F32.as_pointer())
        upper = builder.load(builder.gep(corner, [builder.add(axis, ir.Constant(I64, LANES // 2))]))
        middle = _sub(builder, builder.load(builder.gep(corner, [axis])), upper)
        return splat(builder, _position(builder, middle, low, scale))

    return signature, codegen


def _reaches(builder, position, border):
    return builder.fcmp_ordered(">=", position, splat(builder, border))


@with_twin(lambda row, position, border: np.where(position >= border, row, np.float32(np.inf)))
def beyond(typingctx, row, position, border):
    """The box if its position reaches the border, else that around nothing."""
    signature = ROW(ROW, ROW, types.float32)

    def codegen(context, builder, sig, args):
        row, position, border = args
        return builder.select(_reaches(builder, position, border), row, _NOTHING)

    return signature, codegen


@with_twin(lambda row, position, border: np.where(position >= border, np.float32(np.inf), row))
def short_of(typingctx, row, position, border):
    """The box unless its position reaches the border, else that around nothing."""
    signature = ROW(ROW, ROW, types.float32)

    def codegen(context, builder, sig, args):
        row, position, border = args
        return builder.select(_reaches(builder, position, border), _NOTHING, row)

    return signature, codegen


@with_twin(lambda position, border: int(position[0] >= border))
def is_beyond(typingctx, position, border):
    """Whether the position reaches the border, 1 or 0."""
    signature = types.int64(ROW, types.float32)

    def codegen(context, builder, sig, args):
        return builder.zext(builder.extract_element(_reaches(builder, *args), ir.Constant(I32, 0)), I64)

    return signature, codegen


def _count(address, index):
    at_address(address + 4 * index, 1, np.int32)[0] += 1


@with_twin(_count)
def count_one(typingctx, address, index):
    """Element `index` of the int32 at the address becomes one more."""
    signature = types.void(types.int64, types.int64)

    def codegen(context, builder, sig, args):
        place = cgutils.gep(builder, builder.inttoptr(args[0], I32.as_pointer()), args[1])
        builder.store(builder.add(builder.load(place), ir.Constant(I32, 1)), place)
        return context.get_dummy_value()

    return signature, codegen
