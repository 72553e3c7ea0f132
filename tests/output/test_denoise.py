"""The denoiser on pictures whose truth is known."""

import sys
import threading

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.errors import OutputError
from pmviewer.heap import give_back
from pmviewer.output import denoise, oidn
from pmviewer.output.denoise import denoised
from tests.support.scenes import closed_sphere, rendered, settings_of


def two_walls(noise: float):
    """A bright and a dark wall, half a picture each, with the noise of few samples: truth, picture, albedo, normal."""
    truth = np.full((64, 96, 3), 0.2, np.float32)
    truth[:, 48:] = (2.0, 1.5, 1.0)
    rng = np.random.default_rng(3)
    noisy = (truth * rng.gamma(1 / noise**2, noise**2, truth.shape[:2] + (1,))).astype(np.float32)
    albedo, normal = np.where(truth > 0.5, 0.9, 0.3).astype(np.float32), np.zeros_like(truth)
    normal[..., 0], normal[:, 48:, 0], normal[:, 48:, 2] = 1.0, 0.0, 1.0
    return truth, noisy, albedo, normal


def test_noise_goes_and_edges_stay():
    truth, noisy, albedo, normal = two_walls(0.5)
    kept = noisy.copy()
    clean = denoised(noisy, albedo, normal, threads=1)
    assert clean.dtype == np.float32
    assert np.array_equal(noisy, kept), "what is given stays as it is"

    def error(image):
        return float((((image - truth) / truth) ** 2).mean())

    assert error(noisy) == pytest.approx(0.25, rel=0.1)
    assert error(clean) < error(noisy) / 50
    columns = clean.mean(axis=(0, 2))
    assert columns[47] < 0.4
    assert columns[48] > 1.2
    assert clean.mean() == pytest.approx(truth.mean(), rel=0.03)


def test_while_nothing_is_done_it_holds_nothing(monkeypatch):
    """The next picture is the same. What is at work is left alone."""
    _, noisy, albedo, normal = two_walls(0.5)
    give_back()  # those of other numbers of threads, which tests before may have asked for
    first = denoised(noisy, albedo, normal, threads=1)
    (device,) = denoise._devices.values()
    give_back()
    assert denoise._devices == {}
    assert device._device is None
    assert np.array_equal(denoised(noisy, albedo, normal, threads=1), first)
    seen = []
    run = oidn.Device.denoise

    def slow(device, images, quality):
        beside = threading.Thread(target=give_back)
        beside.start()
        beside.join()
        seen.append(device._device is not None)
        run(device, images, quality)

    monkeypatch.setattr(oidn.Device, "denoise", slow)
    assert np.array_equal(denoised(noisy, albedo, normal, threads=1), first)
    assert seen == [True]


def test_what_it_refuses_is_told():
    """A picture of other sizes than its guides."""
    _, noisy, albedo, normal = two_walls(0.5)
    with pytest.raises(OutputError, match=r"Open Image Denoise failed: .*\w"):
        denoised(noisy, albedo[:32], normal)
    assert np.isfinite(denoised(noisy, albedo, normal)).all()


def test_without_it_the_sentence_says_how_to_get_it(monkeypatch):
    oidn.library.cache_clear()
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    nothing = np.zeros((4, 4, 3), np.float32)
    with pytest.raises(OutputError, match=r"pip install 'pmviewer\[denoise\]'"):
        denoised(nothing, nothing, nothing)


def test_negative_samples_and_small_pictures_are_no_trouble():
    colour = np.full((3, 5, 3), 0.5, np.float32)
    colour[1, 2] = -4.0
    clean = denoised(colour, np.full_like(colour, 2.0), np.zeros_like(colour))
    assert np.isfinite(clean).all()
    assert clean.min() >= 0


@pytest.mark.parametrize("name", ["box", "Gaussian"])
def test_pictures_of_filters_lose_their_noise_too(name):
    """Radiance is 1 everywhere. Samples that pixels share have noise in common, which a denoiser takes for what is
    there: it left nine tenths of it."""
    renderer = rendered(closed_sphere(size=64), settings_of(render={"method": "path", "filter": name}), 2)
    frame = renderer.frame(1, Wanted(denoised=True))
    noisy, clean = (float(((frame.image(view) - 1) ** 2).mean()) for view in ("beauty", "denoised"))
    print(f"{name}: {noisy:.5f}, denoised {clean:.6f}")
    assert clean < noisy / 4
