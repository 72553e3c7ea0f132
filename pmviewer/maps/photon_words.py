"""Photons in kernels: writing and reading the words of `pmviewer.maps.record`."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, inlined
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.dimensions import BAND_SALT
from pmviewer.kernels.memory import bits_of_float, float_of_bits
from pmviewer.kernels.random import hash3
from pmviewer.maps.record import EXPONENT_BASE

_EXPONENT_BASE = np.uint32(EXPONENT_BASE)
_f4 = np.float32
_u4 = np.uint32


@device
def encode_power(x):
    """Non-negative float32 in units of the map's power → 16-bit code (round to nearest, 0 below 2⁻⁴⁷)."""
    bits = _u4(bits_of_float(_f4(x)))
    if bits < _u4(_EXPONENT_BASE + _u4(0x2000)):
        return _u4(0)
    code = _u4(_u4(bits + _u4(0x1000) - _EXPONENT_BASE) >> _u4(13))
    return min(code, _u4(0xFFFF))


@device
def decode_power(code):
    """16-bit code → float32 in units of the map's power."""
    if _u4(code) == _u4(0):
        return _f4(0.0)
    return float_of_bits(_u4(_u4(_u4(code) << _u4(13)) + _EXPONENT_BASE))


@device
def _octahedral(x, y, z):
    """Unit vector → its place (u, v) on the octahedron's square, from −1 to 1."""
    s = _f4(1.0) / (abs(x) + abs(y) + abs(z))
    u, v = x * s, y * s
    if z < _f4(0.0):
        a = (_f4(1.0) - abs(v)) * (_f4(1.0) if u >= _f4(0.0) else _f4(-1.0))
        v = (_f4(1.0) - abs(u)) * (_f4(1.0) if v >= _f4(0.0) else _f4(-1.0))
        u = a
    return u, v


@device
def encode_direction(x, y, z):
    """Unit vector → 24-bit octahedral code in the high bits of a uint32 (worst error 0.06°)."""
    u, v = _octahedral(x, y, z)
    iu = _u4(min(max(u * _f4(2047.0) + _f4(2047.5), _f4(0.0)), _f4(4094.0)))
    iv = _u4(min(max(v * _f4(2047.0) + _f4(2047.5), _f4(0.0)), _f4(4094.0)))
    return _u4((iu << _u4(20)) | (iv << _u4(8)))


@device
def _with_cell(place, cell):
    """A coordinate from −1 to 1 as the nearest of 4095 steps whose three lowest bits are those of the cell that
    another one is in, of eight."""
    low = min(_u4((cell + _f4(1.0)) * _f4(4.0)), _u4(7))
    most = _f4(511.0) if low < _u4(7) else _f4(510.0)  # 4094 is the last step
    high = min(max((place * _f4(2047.0) + _f4(2047.0) - _f4(low)) * _f4(0.125) + _f4(0.5), _f4(0.0)), most)
    return _u4(_u4(_u4(high) << _u4(3)) | low)


@specialised
def encode_arrival(wi, n):
    """Unit direction and normal → their code in the high 24 bits of word 3 (`pmviewer.maps.record`); that of the
    direction alone without a normal, None."""
    if absent(n):
        return lambda wi, n: encode_direction(wi[0], wi[1], wi[2])

    def with_normal(wi, n):
        u, v = _octahedral(wi[0], wi[1], wi[2])
        nu, nv = _octahedral(n[0], n[1], n[2])
        return _u4(_u4(_with_cell(u, nu) << _u4(20)) | _u4(_with_cell(v, nv) << _u4(8)))

    return with_normal


@device
def decode_normal(code):
    """The middle of the cell that the normal is in → vector, not normalised."""
    u = _f4(2.0) * _f4(_u4(_u4(code) >> _u4(20)) & _u4(7)) - _f4(7.0)
    v = _f4(2.0) * _f4(_u4(_u4(code) >> _u4(8)) & _u4(7)) - _f4(7.0)
    z = _f4(8.0) - abs(u) - abs(v)
    t = max(-z, _f4(0.0))
    x = u - t if u >= _f4(0.0) else u + t
    y = v - t if v >= _f4(0.0) else v + t
    return x, y, z


@device
def decode_direction(code):
    """24-bit octahedral code → vector of the right direction, not normalised (length in [0.57, 1])."""
    scale = _f4(1.0 / 2047.0)
    u = _f4(np.int32(_u4(code) >> _u4(20)) - np.int32(2047)) * scale
    v = _f4(np.int32((_u4(code) >> _u4(8)) & _u4(0xFFF)) - np.int32(2047)) * scale
    z = _f4(1.0) - abs(u) - abs(v)
    t = max(-z, _f4(0.0))
    x = u - t if u >= _f4(0.0) else u + t
    y = v - t if v >= _f4(0.0) else v + t
    return x, y, z


@device
def write_photon(rows, row, p, wi, n, power, flags, light):
    """Photon `row` of rows, pointer to float32 (n, 6): point p, unit wi, unit normal n (None in media),
    power (red, green, blue) in units of the map's, flags and id of the light."""
    at = np.int64(row) * 6
    rows[at], rows[at + 1], rows[at + 2] = p
    r, g, b = encode_power(power[0]), encode_power(power[1]), encode_power(power[2])
    rows[at + 3] = float_of_bits(_u4(encode_arrival(wi, n) | _u4(flags)))
    rows[at + 4] = float_of_bits(_u4(r | _u4(g << _u4(16))))
    rows[at + 5] = float_of_bits(_u4(b | _u4(_u4(light) << _u4(16))))


@device
def encode_marked(x, mark, noise):
    """`encode_power` with the two lowest bits of the code replaced by `mark`; `noise` is a random number below 2¹⁵,
    which makes the power right in the mean."""
    bits = _u4(bits_of_float(_f4(x)))
    if bits < _u4(_EXPONENT_BASE + _u4(0x10000)):
        return _u4(mark)
    steps = _u4(_u4(bits - _EXPONENT_BASE) - _u4(_u4(mark) << _u4(13)) + _u4(noise)) >> _u4(15)
    return _u4(_u4(min(steps, _u4(0x3FFF)) << _u4(2)) | _u4(mark))


@device
def write_banded(rows, row, p, wi, n, power, flags, light, band):
    """`write_photon` of a photon of that band of wavelengths (`pmviewer.maps.record`)."""
    write_photon(rows, row, p, wi, n, power, flags, light)
    noise = hash3(_u4(bits_of_float(p[0])), _u4(bits_of_float(p[1])), _u4(bits_of_float(p[2])))
    at = np.int64(row) * 6
    more = hash3(noise, _u4(BAND_SALT), _u4(band))
    r = encode_marked(power[0], _u4(band) & _u4(3), _u4(noise & _u4(0x7FFF)))
    g = encode_marked(power[1], _u4(_u4(band) >> _u4(2)) & _u4(3), _u4(_u4(noise >> _u4(16)) & _u4(0x7FFF)))
    b = encode_marked(power[2], _u4(_u4(band) >> _u4(4)) & _u4(3), _u4(more & _u4(0x7FFF)))
    rows[at + 4] = float_of_bits(_u4(r | _u4(g << _u4(16))))
    rows[at + 5] = float_of_bits(_u4(b | _u4(_u4(light) << _u4(16))))


@inlined
def decode_powers(rg, b):
    """Words 4 and 5 of a photon → red, green, blue float32 in units of the map's power."""
    return decode_power(_u4(rg) & _u4(0xFFFF)), decode_power(_u4(rg) >> _u4(16)), decode_power(_u4(b) & _u4(0xFFFF))
