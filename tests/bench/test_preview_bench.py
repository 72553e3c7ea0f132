"""What `bench preview` measures with: errors without the noise of converged pictures, and pictures made large."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.measures.preview import _stretched, _Truth
from pmviewer.output.metric import relmse


def test_the_noise_of_converged_pictures_is_no_error():
    rng = np.random.default_rng(4)
    true = 1.0 + rng.random((64, 64, 3))
    a, b = (true + 0.03 * rng.standard_normal(true.shape) for _ in range(2))
    image = true + 0.05
    assert _Truth(a, b).error(image) == pytest.approx(relmse(image, true), rel=0.1)
    assert relmse(image, a) > 1.25 * relmse(image, true)  # which is what it is for


@pytest.mark.parametrize("axis", [0, 1])
def test_even_changes_stay_even_between_middles_of_pixels(axis):
    ramp = np.arange(4, dtype=np.float32)[:, None, None] * np.ones((4, 4, 3), np.float32)
    ramp = ramp if axis == 0 else ramp.transpose(1, 0, 2)
    large = _stretched(ramp, axis, 8)
    values = (large if axis == 0 else large.transpose(1, 0, 2))[:, 1, 2]
    assert values == pytest.approx([0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.0])
