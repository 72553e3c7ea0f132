"""What the bench of automatic mode makes of errors against references that have noise themselves."""

import numpy as np
import pytest

from pmviewer.bench.measures.auto import LEAST_KNOWN, without_noise
from pmviewer.bench.measures.error import reference, reference_noise
from pmviewer.output.metric import relmse


def test_noise_of_the_reference_is_no_error_of_the_picture():
    """A picture and a reference of known noise around a known truth."""
    rng = np.random.default_rng(4)
    truth = rng.uniform(0.2, 2.0, (256, 256, 3))
    halves = [truth * (1 + 0.1 * rng.normal(size=truth.shape)) for _ in range(2)]
    mean = sum(halves) / 2
    noise = relmse(halves[0], halves[1]) / 4
    image = truth * (1 + 0.03 * rng.normal(size=truth.shape))
    assert relmse(image, mean) > 5 * relmse(image, truth)
    assert without_noise(relmse(image, mean), noise) == pytest.approx(relmse(image, truth), rel=0.15)
    assert without_noise(0.9 * noise, noise) == LEAST_KNOWN * noise, "the reference tells no less"


def test_references_say_how_noisy_they_are():
    for scene in ("cornell_glossy", "cornell_caustic"):
        image = reference(scene)
        assert image.shape[2] == 3
        assert 1e-6 < reference_noise(scene) < 1e-2
