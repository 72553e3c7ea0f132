"""Eight-lane vector operations of the ray caster: one ray against eight boxes, one ray against eight triangles.

LLVM has portable vectors, so `<8 x float>` becomes one AVX register, two SSE or NEON registers, or whatever the machine
has. Each intrinsic returns an 8-bit mask of lanes as int32; lanes are then visited with `count_trailing_zeros`.

Memory layouts (float32 unless noted, each row is eight lanes = 32 bytes, addresses 32-byte aligned):

- node, 256 bytes: rows lo x, hi x, lo y, hi y, lo z, hi z, child (int32), one unused row;
- block, 320 bytes: rows v0 x, y, z, e1 x, y, z, e2 x, y, z, primitive id (int32), with e1 = v1 - v0, e2 = v2 - v0.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from pmviewer.kernels.memory import F32, I8, I32, I64, at_address, with_twin

LANES = 8
ROW_BYTES = 4 * LANES
NODE_ROWS, NODE_BYTES, CHILD_OFFSET = 8, 8 * ROW_BYTES, 6 * ROW_BYTES
BLOCK_ROWS, BLOCK_BYTES, ID_OFFSET = 10, 10 * ROW_BYTES, 9 * ROW_BYTES

EDGE_TOLERANCE = 1e-5
"""A triangle reaches this far over its edges, in barycentrics, so that rays don't slip between neighbours."""

FAR_FACTOR = 1.0 + 2.0**-21
"""Widens a slab interval by more than its relative rounding error."""

V8 = ir.VectorType(F32, LANES)
V8I = ir.VectorType(I32, LANES)
FLAGS = ("contract",)


def _constant(value: float) -> ir.Constant:
    return ir.Constant(V8, [value] * LANES)


def splat(builder, scalar):
    """Eight times the same float32, in LLVM's builder."""
    vector = builder.insert_element(ir.Constant(V8, ir.Undefined), scalar, ir.Constant(I32, 0))
    return builder.shuffle_vector(vector, ir.Constant(V8, ir.Undefined), ir.Constant(V8I, [0] * LANES))


def _load(builder, address):
    value = builder.load(builder.inttoptr(address, V8.as_pointer()))
    value.align = ROW_BYTES
    return value


def _store(builder, value, pointer, row):
    slot = builder.gep(builder.bitcast(pointer, V8.as_pointer()), [ir.Constant(I32, row)])
    builder.store(value, slot).align = ROW_BYTES


def _mask(builder, lanes):
    return builder.zext(builder.bitcast(lanes, I8), I32)


def _bits(lanes):
    return np.int32(np.packbits(lanes, bitorder="little")[0])


def _hit_boxes(node, nears, origin, inverse, tmin, tmax, out):
    enter, leave = np.full(LANES, tmin, np.float32), np.full(LANES, tmax, np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        for near, o, i in zip(nears, origin, inverse):
            t0 = (at_address(node + near, LANES, np.float32) - o) * i
            t1 = (at_address(node + (near ^ ROW_BYTES), LANES, np.float32) - o) * i
            enter, leave = np.where(t0 > enter, t0, enter), np.where(t1 < leave, t1, leave)
        leave = leave * np.float32(FAR_FACTOR)
        out.view(np.float32)[:LANES] = enter
        return _bits(enter <= leave)


@with_twin(_hit_boxes)
def hit_boxes(typingctx, node, nears, origin, inverse, tmin, tmax, out):
    """Lanes of the node at address `node` whose boxes the ray meets in [tmin, tmax]; entry distances go to `out`.

    `nears` (int64 triple) are the byte offsets of the rows of the planes that the ray meets first, `inverse` (float32
    triple) the reciprocals of the direction, `out` points to 8 float32.

    Differences come before products, so all rounding errors are relative to t and `FAR_FACTOR` covers them. A ray in a
    plane of the box gives 0 · inf there: comparisons with the NaN fail and the other planes decide.
    """
    f = types.float32
    triple = types.UniTuple(f, 3)
    signature = types.int32(types.int64, types.UniTuple(types.int64, 3), triple, triple, f, f, out)

    def codegen(context, builder, sig, args):
        node, nears, origin, inverse, tmin, tmax, out = args
        enter, leave = splat(builder, tmin), splat(builder, tmax)
        for near, o, i in zip(*(cgutils.unpack_tuple(builder, values, 3) for values in (nears, origin, inverse))):
            first = _load(builder, builder.add(node, near))
            last = _load(builder, builder.add(node, builder.xor(near, ir.Constant(I64, ROW_BYTES))))
            o, i = splat(builder, o), splat(builder, i)
            t0 = builder.fmul(builder.fsub(first, o), i)
            t1 = builder.fmul(builder.fsub(last, o), i)
            enter = builder.select(builder.fcmp_ordered(">", t0, enter), t0, enter)
            leave = builder.select(builder.fcmp_ordered("<", t1, leave), t1, leave)
        leave = builder.fmul(leave, _constant(FAR_FACTOR))
        _store(builder, enter, out, 0)
        return _mask(builder, builder.fcmp_ordered("<=", enter, leave))

    return signature, codegen


def _hit_triangles(block, ox, oy, oz, dx, dy, dz, tmin, tmax, out):
    v0, e1, e2 = at_address(block, 9 * LANES, np.float32).reshape(3, 3, LANES)
    d, o = np.array([dx, dy, dz], np.float32)[:, None], np.array([ox, oy, oz], np.float32)[:, None]
    with np.errstate(all="ignore"):
        p = np.cross(d, e2, axis=0)
        inverse = np.float32(1.0) / (e1 * p).sum(axis=0)
        s = o - v0
        u = (s * p).sum(axis=0) * inverse
        q = np.cross(s, e1, axis=0)
        v = (d * q).sum(axis=0) * inverse
        t = (e2 * q).sum(axis=0) * inverse
        low, high = np.float32(-EDGE_TOLERANCE), np.float32(1.0 + EDGE_TOLERANCE)
        out.view(np.float32)[: 3 * LANES] = np.concatenate([t, u, v])
        return _bits((u >= low) & (v >= low) & (u + v <= high) & (t > tmin) & (t < tmax))


@with_twin(_hit_triangles)
def hit_triangles(typingctx, block, ox, oy, oz, dx, dy, dz, tmin, tmax, out):
    """Lanes of the block at address `block` whose triangles the ray meets with tmin < t < tmax.

    Three rows go to `out`: t, u, v of all lanes. The test is that of Möller and Trumbore ("Fast, minimum storage
    ray/triangle intersection", 1997). A triangle without area is never met: its reciprocal determinant is infinite.
    """
    f = types.float32
    signature = types.int32(types.int64, *[f] * 8, out)

    def codegen(context, builder, sig, args):
        block, tmin, tmax, out = args[0], args[7], args[8], args[9]

        def mul(x, y):
            return builder.fmul(x, y, flags=FLAGS)

        def sub(x, y):
            return builder.fsub(x, y, flags=FLAGS)

        def add(x, y):
            return builder.fadd(x, y, flags=FLAGS)

        def cross(x, y):
            return [sub(mul(x[i], y[j]), mul(x[j], y[i])) for i, j in ((1, 2), (2, 0), (0, 1))]

        def dot(x, y):
            return add(add(mul(x[0], y[0]), mul(x[1], y[1])), mul(x[2], y[2]))

        rows = [_load(builder, builder.add(block, ir.Constant(I64, ROW_BYTES * k))) for k in range(9)]
        v0, e1, e2 = rows[0:3], rows[3:6], rows[6:9]
        origin, direction = ([splat(builder, x) for x in args[k : k + 3]] for k in (1, 4))
        p = cross(direction, e2)
        inverse = builder.fdiv(_constant(1.0), dot(e1, p))
        s = [sub(o, v) for o, v in zip(origin, v0)]
        u = mul(dot(s, p), inverse)
        q = cross(s, e1)
        v = mul(dot(direction, q), inverse)
        t = mul(dot(e2, q), inverse)
        low = _constant(-EDGE_TOLERANCE)
        lanes = builder.and_(builder.fcmp_ordered(">=", u, low), builder.fcmp_ordered(">=", v, low))
        lanes = builder.and_(lanes, builder.fcmp_ordered("<=", add(u, v), _constant(1.0 + EDGE_TOLERANCE)))
        lanes = builder.and_(lanes, builder.fcmp_ordered(">", t, splat(builder, tmin)))
        lanes = builder.and_(lanes, builder.fcmp_ordered("<", t, splat(builder, tmax)))
        for row, value in enumerate((t, u, v)):
            _store(builder, value, out, row)
        return _mask(builder, lanes)

    return signature, codegen
