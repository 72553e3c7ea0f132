"""Numbers in text against Python's own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.kernels.meshes.text import numbers
from tests.support.marks import warnings_are_errors


def read(text: str, n: int) -> np.ndarray:
    out = np.full(n, -77.0)
    numbers(np.frombuffer(text.encode() + b"\n\n\n", np.uint8), 0, out)
    return out


@warnings_are_errors
def test_numbers_as_they_are_written() -> None:
    words = ["0", "-0", "+1", "-.5", "5.", "1e3", "1E-3", "1e+22", "123456789012345", "0.1", "00012.50"]
    words += ["2.2250738585072014e-308", "1e308", "-1e400", "1e-400"]
    found = read(" ".join(words), len(words))
    expected = [float(w) for w in words]
    assert found == pytest.approx(expected, rel=1e-15, abs=0)
    assert math.copysign(1, found[1]) == -1


def test_random_numbers_within_an_ulp() -> None:
    generator = np.random.default_rng(0)
    values = generator.normal(size=3000) * 10.0 ** generator.uniform(-30, 30, 3000)
    short = [f"{v:.6g}" for v in values] + [f"{v:.6f}" for v in values]
    exact = [float(w) for w in short if "e" not in w]
    assert read("\n".join(w for w in short if "e" not in w), len(exact)).tolist() == pytest.approx(exact, rel=3e-16)
    long = [repr(float(v)) for v in values]
    assert read("\t".join(long), len(long)) == pytest.approx(values, rel=1e-15)


def test_what_is_no_number() -> None:
    found = read("nan NaN inf -Infinity - abc 1.5x 1e", 8)
    assert np.isnan(found[[0, 1, 4, 5]]).all()
    assert found[[2, 3, 6, 7]].tolist() == [math.inf, -math.inf, 1.5, 1.0]
