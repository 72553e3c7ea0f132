"""Embree's single-ray calls by address, from compiled loops: the yardstick of the ray bench, never used for rendering.

`embreex` brings the library; its own array interface would add its overhead to every ray, so `rtcIntersect1` and
`rtcOccluded1` are called directly (structures RTCRay and RTCRayHit of Embree 4).
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pmviewer.errors import PmviewerError
from pmviewer.kernels.compile.jit import kernel

_I8, _I32, _F32 = ir.IntType(8), ir.IntType(32), ir.FloatType()
_POINTER = _I8.as_pointer()
# Byte offsets in RTCRay and, from 48 on, in the RTCHit that follows it in an RTCRayHit.
_ORIGIN, _TNEAR, _DIRECTION, _TIME, _TFAR, _MASK, _ID, _FLAGS = 0, 12, 16, 28, 32, 36, 40, 44
_U, _V, _PRIMITIVE, _GEOMETRY, _INSTANCE = 60, 64, 68, 72, 76
_INVALID = 0xFFFFFFFF
_TRIANGLE_GEOMETRY, _INDEX_BUFFER, _VERTEX_BUFFER, _UINT3, _FLOAT3 = 0, 0, 1, 0x5003, 0x9003


class EmbreeScene:
    """Embree's tree over triangles (n, 3, 3) float32, default build quality, and the addresses the kernels below take.

    `scene`, `intersect1`, `occluded1` are valid as long as this object lives.
    """

    def __init__(self, triangles: np.ndarray) -> None:
        library = _load_embree()
        pointer, unsigned, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
        for name, result, arguments in (
            ("rtcNewDevice", pointer, [ctypes.c_char_p]),
            ("rtcNewScene", pointer, [pointer]),
            ("rtcNewGeometry", pointer, [pointer, ctypes.c_int]),
            ("rtcSetNewGeometryBuffer", pointer, [pointer, ctypes.c_int, unsigned, ctypes.c_int, size, size]),
            ("rtcCommitGeometry", None, [pointer]),
            ("rtcAttachGeometry", unsigned, [pointer, pointer]),
            ("rtcCommitScene", None, [pointer]),
            ("rtcReleaseGeometry", None, [pointer]),
            ("rtcReleaseScene", None, [pointer]),
            ("rtcReleaseDevice", None, [pointer]),
        ):
            getattr(library, name).restype, getattr(library, name).argtypes = result, arguments
        self._library = library
        self._device = library.rtcNewDevice(None)
        if not self._device:
            raise PmviewerError("Embree refuses to start on this processor; the ray bench needs it to compare with.")
        self.scene = library.rtcNewScene(self._device)
        geometry = library.rtcNewGeometry(self._device, _TRIANGLE_GEOMETRY)
        vertices = np.ascontiguousarray(triangles, np.float32).reshape(-1, 3)
        indices = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        for kind, layout, data in ((_INDEX_BUFFER, _UINT3, indices), (_VERTEX_BUFFER, _FLOAT3, vertices)):
            buffer = library.rtcSetNewGeometryBuffer(geometry, kind, 0, layout, 12, len(data))
            ctypes.memmove(buffer, data.ctypes.data, data.nbytes)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self.scene, geometry)
        library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(self.scene)
        self.intersect1 = ctypes.cast(library.rtcIntersect1, pointer).value
        self.occluded1 = ctypes.cast(library.rtcOccluded1, pointer).value

    def close(self) -> None:
        """Free the scene and the device, which the library holds outside of Python's memory."""
        self._library.rtcReleaseScene(self.scene)
        self._library.rtcReleaseDevice(self._device)


def _load_embree() -> ctypes.CDLL:
    try:
        import embreex
        import embreex.rtcore_scene  # loads what the library depends on
    except ImportError as error:
        raise PmviewerError("The ray bench compares with Embree: pip install pmviewer[bench]") from error
    package = Path(embreex.__file__).parent
    found = [*package.parent.glob("embreex.libs/*embree4*"), *package.glob(".dylibs/*embree4*")]
    if not found:
        raise PmviewerError(f"No Embree 4 library beside {package}: pip install --force-reinstall pmviewer[bench]")
    return ctypes.CDLL(str(found[0]))


def _call(builder, function, scene, ray, tmin, tmax, size):
    """Fill an RTCRay(Hit) of `size` bytes on the stack, call the function on it, return a reader of its fields."""
    with builder.goto_entry_block():
        slot = builder.alloca(ir.ArrayType(_I8, size))
        slot.align = 16
    base = builder.bitcast(slot, _POINTER)

    def field(offset, llvm_type):
        return builder.bitcast(builder.gep(base, [ir.Constant(_I32, offset)]), llvm_type.as_pointer())

    for k in range(3):
        builder.store(ray[k], field(_ORIGIN + 4 * k, _F32))
        builder.store(ray[3 + k], field(_DIRECTION + 4 * k, _F32))
    for offset, value in ((_TNEAR, tmin), (_TFAR, tmax), (_TIME, ir.Constant(_F32, 0.0))):
        builder.store(value, field(offset, _F32))
    words = [(_MASK, _INVALID), (_ID, 0), (_FLAGS, 0)]
    if size > 48:
        words += [(_PRIMITIVE, _INVALID), (_GEOMETRY, _INVALID), (_INSTANCE, _INVALID)]
    for offset, word in words:
        builder.store(ir.Constant(_I32, word), field(offset, _I32))
    signature = ir.FunctionType(ir.VoidType(), [_POINTER, _POINTER, _POINTER])
    callee = builder.inttoptr(function, signature.as_pointer())
    builder.call(callee, [builder.inttoptr(scene, _POINTER), base, ir.Constant(_POINTER, None)])
    return lambda offset, llvm_type: builder.load(field(offset, llvm_type))


@intrinsic
def _intersect1(typingctx, function, scene, ox, oy, oz, dx, dy, dz, tmin, tmax):
    result = types.Tuple((types.float32, types.int32, types.float32, types.float32))
    signature = result(types.int64, types.int64, *[types.float32] * 8)

    def codegen(context, builder, sig, args):
        read = _call(builder, args[0], args[1], args[2:8], args[8], args[9], 96)
        values = [read(_TFAR, _F32), read(_PRIMITIVE, _I32), read(_U, _F32), read(_V, _F32)]
        return context.make_tuple(builder, sig.return_type, values)

    return signature, codegen


@intrinsic
def _occluded1(typingctx, function, scene, ox, oy, oz, dx, dy, dz, tmin, tmax):
    signature = types.boolean(types.int64, types.int64, *[types.float32] * 8)

    def codegen(context, builder, sig, args):
        read = _call(builder, args[0], args[1], args[2:8], args[8], args[9], 48)
        return builder.fcmp_ordered("<", read(_TFAR, _F32), ir.Constant(_F32, 0.0))  # a hit sets tfar to -inf

    return signature, codegen


@kernel
def embree_closest(function, scene, origins, directions, tmin, tmax, t, primitive, uv):
    """The counterpart of `raycast.cast_closest`."""
    for i in range(len(origins)):
        t[i], primitive[i], uv[i, 0], uv[i, 1] = _intersect1(
            function, scene, origins[i, 0], origins[i, 1], origins[i, 2],
            directions[i, 0], directions[i, 1], directions[i, 2], tmin[i], tmax[i],
        )  # fmt: skip


@kernel
def embree_occluded(function, scene, origins, directions, tmin, tmax, hit):
    """The counterpart of `occlusion.cast_occluded`."""
    for i in range(len(origins)):
        hit[i] = _occluded1(
            function, scene, origins[i, 0], origins[i, 1], origins[i, 2],
            directions[i, 0], directions[i, 1], directions[i, 2], tmin[i], tmax[i],
        )  # fmt: skip
