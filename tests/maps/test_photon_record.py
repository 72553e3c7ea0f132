"""The 24-byte photon record."""

import numpy as np
import pytest

from pmviewer.maps import photon_words, record
from pmviewer.maps.first import first_in_classes
from pmviewer.maps.search import sides
from tests.support import naive_maps as naive
from tests.support.device import from_python

encode_direction = from_python(photon_words.encode_direction)
decode_direction = from_python(photon_words.decode_direction)
decode_normal = from_python(photon_words.decode_normal)
encode_arrival = from_python(photon_words.encode_arrival)
is_apart = from_python(sides.is_apart)
encode_power, decode_power = from_python(photon_words.encode_power), from_python(photon_words.decode_power)

f4 = np.float32
WORST_ANGLE, WORST_ARRIVAL = 0.06, 0.5  # degrees; of a direction alone and with a normal
WORST_NORMAL = 30.0


@pytest.fixture(scope="module")
def directions():
    rng = np.random.default_rng(1)
    wi = rng.normal(size=(3000, 3))
    axes = np.vstack([np.eye(3), -np.eye(3), np.array([[1, 1, 0], [1, -1, 0], [-1, 0, -1], [0, -1, -1], [1, 1, -1]])])
    wi = np.vstack([wi, axes])
    return (wi / np.linalg.norm(wi, axis=1, keepdims=True)).astype(f4)


def test_direction_round_trip(directions):
    for wi in directions:
        decoded = np.array(decode_direction(encode_direction(*wi)), np.float64)
        length = np.linalg.norm(decoded)
        assert 0.57 < length < 1.0001
        sine = np.linalg.norm(np.cross(decoded / length, wi.astype(np.float64)))
        assert sine < np.radians(WORST_ANGLE)
        assert decoded @ wi > 0


def test_directions_and_normals_round_trip_in_one_word(directions):
    """And no surface is taken to be apart from what leans less than 30°, nor one with what leans more than 90°."""
    normals = np.roll(directions, 7, axis=0)
    for wi, n in zip(directions, normals, strict=True):
        code = encode_arrival(tuple(wi), tuple(n))
        assert int(code) & 0xFF == 0
        w, m = (np.array(decode(code), np.float64) for decode in (decode_direction, decode_normal))
        assert w @ wi / np.linalg.norm(w) > np.cos(np.radians(WORST_ARRIVAL))
        assert m @ n / np.linalg.norm(m) > np.cos(np.radians(WORST_NORMAL))
        middle = record.decode_normals(np.array([code], np.uint32))[0]
        np.testing.assert_allclose(middle, m / np.linalg.norm(m), atol=1e-6)
        cell, beside = tuple(m.astype(f4)), np.cross(n, wi)
        for other in (n + 1e-3 * beside, n + 0.55 * beside, wi):
            other = (other / np.linalg.norm(other)).astype(f4)
            if other @ n >= 0.87:
                bent = n - other  # to a place on the convex side of an edge or a bend between both
                assert not is_apart(cell, tuple(bent), tuple(other))
                assert not is_apart(cell, tuple(-bent), tuple(other))
        assert is_apart(cell, tuple(beside), tuple(-n))
        assert is_apart(cell, tuple(beside), tuple((beside - 0.01 * n).astype(f4)))
    obvious = naive.encode_arrival(directions, normals)
    assert np.mean([int(encode_arrival(tuple(w), tuple(n))) for w, n in zip(directions, normals)] == obvious) > 0.99


def test_axes_are_exact(directions):
    for wi in np.vstack([np.eye(3), -np.eye(3)]).astype(f4):
        np.testing.assert_array_equal(decode_direction(encode_direction(*wi)), wi)


def test_power_round_trip():
    rng = np.random.default_rng(2)
    for x in np.exp2(rng.uniform(-46.9, 15.9, 3000)).astype(f4):
        assert abs(decode_power(encode_power(x)) / x - 1) <= 2.0**-11


@pytest.mark.parametrize(
    ("x", "decoded"), [(0.0, 0.0), (1.0, 1.0), (0.5, 0.5), (2.0**-60, 0.0), (2.0**15, 2.0**15), (1e9, 131008.0)]
)
def test_power_special_values(x, decoded):
    assert decode_power(encode_power(f4(x))) == f4(decoded)


def test_kernels_agree_with_the_obvious_encoding(directions):
    rng = np.random.default_rng(3)
    # Powers on code boundaries are a matter of rounding; these are not.
    power = np.exp2(rng.uniform(-40, 15, len(directions))).astype(f4)
    np.testing.assert_array_equal([encode_power(x) for x in power], naive.encode_power(power))
    kernel = np.array([int(encode_direction(*wi)) for wi in directions])
    obvious = naive.encode_direction(directions).astype(np.int64)
    for shift in (20, 8):
        assert np.abs((kernel >> shift & 0xFFF) - (obvious >> shift & 0xFFF)).max() <= 1
    assert np.mean(kernel == obvious) > 0.99


def test_unpack_names_everything(directions):
    n = len(directions)
    rng = np.random.default_rng(4)
    position, power = rng.normal(size=(n, 3)).astype(f4), rng.uniform(0.01, 2, (n, 3))
    flags = rng.integers(0, 256, n)
    light = rng.integers(0, 1 << 16, n)
    unpacked = record.unpack(naive.pack(position, directions, power, flags, light), 3.0)
    np.testing.assert_array_equal(unpacked["position"], position)
    np.testing.assert_allclose(unpacked["Phi"], 3 * power, rtol=2.0**-11 * 1.001)
    assert np.linalg.norm(np.cross(unpacked["wi"], directions), axis=1).max() < np.radians(WORST_ARRIVAL)
    np.testing.assert_array_equal(unpacked["bounces"], flags & 0x1F)
    np.testing.assert_array_equal(unpacked["path_class"], flags >> 6)
    np.testing.assert_array_equal(unpacked["light"], light)


def test_the_first_photons_of_some_classes():
    """Against a loop over the flags, which say two bits of the class."""
    rng = np.random.default_rng(2)
    photons = rng.random((500, 6), np.float32)
    photons.view(np.uint32)[:, 3] = rng.integers(0, 1 << 32, 500, np.uint32)
    flags = photons.view(np.uint32)[:, 3] & 0xFF
    for mask in (0b0001, 0b0110, 0b1111, 0):
        wanted = [i for i in range(500) if mask >> (int(flags[i]) >> 6) & 1]
        for most in (1, 100, 10_000):
            found = first_in_classes(photons, mask, most)
            assert np.array_equal(found.view(np.uint32), photons[wanted[:most]].view(np.uint32))
