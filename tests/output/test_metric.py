"""Image errors against their formulas written as loops; the z-test finds what is wrong and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.output.metric import (
    block_error,
    block_means,
    crossed_relmse,
    loglog_slope,
    mean_ratio,
    metrics,
    relmse,
    relmse_drop,
    z_test,
)


def naive_pixel_errors(image: np.ndarray, reference: np.ndarray) -> list[float]:
    errors = []
    for y in range(image.shape[0]):
        for x in range(image.shape[1]):
            terms = [(float(i) - float(r)) ** 2 / (float(r) ** 2 + 0.01) for i, r in zip(image[y, x], reference[y, x])]
            errors.append(sum(terms) / 3)
    return errors


@pytest.fixture
def pair() -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(3)
    reference = generator.lognormal(-1, 1, (40, 50, 3)).astype(np.float32)
    image = (reference * generator.lognormal(0, 0.3, reference.shape)).astype(np.float32)
    image[3, 4] = 900.0
    return image, reference


def test_relmse_is_its_formula(pair):
    errors = naive_pixel_errors(*pair)
    assert relmse(*pair) == pytest.approx(sum(errors) / len(errors), rel=1e-12)


def test_drop_leaves_out_the_worst_thousandth(pair):
    errors = sorted(naive_pixel_errors(*pair))
    assert len(errors) == 2000
    assert relmse_drop(*pair) == pytest.approx(sum(errors[:1998]) / 1998, rel=1e-12)
    assert relmse_drop(*pair, drop=0.0) == pytest.approx(relmse(*pair), rel=1e-12)


def test_float32_images_are_summed_in_float64():
    reference = np.full((512, 512, 3), 0.1, np.float32)
    image = reference * np.float32(1.0001)
    expected = (float(image[0, 0, 0]) - float(reference[0, 0, 0])) ** 2 / (float(reference[0, 0, 0]) ** 2 + 0.01)
    assert relmse(image, reference) == pytest.approx(expected, rel=1e-9)


def test_mean_ratio(pair):
    image, reference = pair
    assert mean_ratio(1.01 * reference.astype(np.float64), reference) == pytest.approx(1.01, rel=1e-12)
    assert mean_ratio(image, reference) == pytest.approx(image.astype(float).mean() / reference.astype(float).mean())


def test_block_means_leave_incomplete_blocks_out():
    image = np.random.default_rng(0).normal(size=(19, 26, 3))
    got = block_means(image, 8)
    assert got.shape == (2, 3, 3)
    np.testing.assert_allclose(got[1, 2], image[8:16, 16:24].mean(axis=(0, 1)), rtol=1e-12)
    with pytest.raises(ValueError, match="6×4 has no block of 8×8"):
        block_means(np.zeros((4, 6, 3)))


def test_block_error_forgets_noise_but_not_bias():
    generator = np.random.default_rng(1)
    reference = np.ones((64, 64, 3))
    noisy = reference + generator.normal(0, 0.4, reference.shape)
    assert block_error(noisy, reference) == pytest.approx(relmse(noisy, reference) / 64, rel=0.15)
    assert block_error(1.1 * reference, reference) == pytest.approx(relmse(1.1 * reference, reference), rel=1e-9)


def test_all_metrics_at_once(pair):
    got = metrics(*pair)
    assert got.relmse_all == relmse(*pair)
    assert got.relmse_drop == relmse_drop(*pair)
    assert got.mean_ratio == mean_ratio(*pair)
    assert got.block_error == block_error(*pair)


def test_images_of_different_shapes_are_refused():
    for function in (relmse, mean_ratio, block_error, metrics):
        with pytest.raises(ValueError, match="can't be compared"):
            function(np.zeros((8, 8, 3)), np.zeros((8, 1, 3)))


def test_slope_of_a_power_law_and_of_a_scattered_one():
    x = np.array([1, 2, 4, 8, 16])
    assert loglog_slope(x, 3.0 / x) == pytest.approx(-1, abs=1e-12)
    y = x**-0.667 * np.exp([0.1, -0.1, 0.05, 0.02, -0.06])
    assert loglog_slope(x, y) == pytest.approx(np.polyfit(np.log(x), np.log(y), 1)[0], abs=1e-12)


@pytest.mark.parametrize(("x", "y"), [([1], [1]), ([2, 2], [1, 3]), ([1, 2], [0, 1]), ([1, 2], [1, math.nan])])
def test_slope_needs_two_positive_points(x, y):
    with pytest.raises(ValueError, match="a slope"):
        loglog_slope(x, y)


def estimate(truth: np.ndarray, samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of the mean of skewed samples: most are 0, one in four is 4 times the truth."""
    hits = np.random.default_rng(seed).binomial(samples, 0.25, truth.shape) / samples
    mean = truth * hits * 4
    variance = truth**2 * 16 * hits * (1 - hits) / (samples - 1)
    return mean, variance


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    y, x = np.mgrid[0:64, 0:96] / 64
    return np.stack([0.2 + x, 0.5 + y * x, 1.5 - y], axis=-1)


def test_z_test_accepts_the_truth_and_is_fair(truth):
    outcomes = [z_test(*estimate(truth, 64, seed), truth) for seed in range(40)]
    assert all(outcome.blocks == 96 for outcome in outcomes)
    assert np.mean([outcome.beyond_2 for outcome in outcomes]) == pytest.approx(0.0455, abs=0.012)
    assert np.mean([outcome.chi2 for outcome in outcomes]) == pytest.approx(96 + 0.85 * math.sqrt(2 * 96), rel=0.08)
    assert sum(not outcome.passes(0.05) for outcome in outcomes) <= 5
    assert all(outcome.passes(1e-4) for outcome in outcomes)


def test_z_test_counts_the_noise_of_the_reference(truth):
    mean, variance = estimate(truth, 64, 1)
    reference, reference_variance = estimate(truth, 64, 2)
    assert z_test(mean, variance, reference, reference_variance).passes()
    assert not z_test(mean, variance, reference).passes()


def test_z_test_finds_a_small_error_everywhere(truth):
    mean, variance = estimate(truth, 256, 4)
    assert z_test(mean, variance, truth).passes()
    found = z_test(1.03 * mean, 1.03**2 * variance, truth)
    assert found.p_value < 1e-6
    assert found.chi2 > 130


def test_z_test_finds_an_error_in_one_block(truth):
    mean, variance = estimate(truth, 256, 3)
    mean[16:24, 40:48, 1] *= 1.25
    found = z_test(mean, variance, truth)
    assert found.p_value < 1e-4
    assert found.max_z > 6


def test_z_test_without_noise(truth):
    exact = z_test(truth.astype(np.float32), np.zeros_like(truth), truth)
    assert (exact.blocks, exact.p_value) == (0, 1.0)
    black = np.zeros((16, 16, 3))
    assert z_test(black, black, black).p_value == 1.0
    wrong = truth.copy()
    wrong[0, 0, 0] += 0.1
    assert z_test(wrong, np.zeros_like(truth), truth).p_value == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_z_test_fails_on_what_is_no_number(truth, bad):
    mean, variance = estimate(truth, 64, 1)
    mean[5, 5, 0] = bad
    assert not z_test(mean, variance, truth).passes()


def test_crossed_error_knows_nothing_of_the_noise_of_its_references():
    rng = np.random.default_rng(4)
    truth = np.broadcast_to(np.linspace(0.5, 2.0, 128)[:, None], (128, 128, 3))
    one, other = (truth + rng.normal(0, 0.3, truth.shape) for _ in range(2))
    for error in (0.0, 0.05):
        image = truth + error
        exact = float((error**2 / (truth**2 + 0.01)).mean())
        found = crossed_relmse(image, one, other)
        print(error, found, exact, relmse(image, one))
        assert found == pytest.approx(exact, rel=0.2, abs=1e-3)
        assert relmse(image, one) > exact + 0.05
