"""Both photon methods converge to the references, and the path tracer agrees with them (figures with -s)."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.measures.error import reference
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import loglog_slope, metrics, z_test
from pmviewer.settings.access import Settings, with_values

OWN_ERROR = {"cornell_diffuse": 2.0e-5, "cornell_caustic": 6.5e-5}
"""relMSE of the references themselves."""


def halved(image: np.ndarray) -> np.ndarray:
    """The picture of half as many pixels either way: a quarter of the work for the same error of a pixel, since the
    box of a pixel is that of four."""
    return image.reshape(image.shape[0] // 2, 2, image.shape[1] // 2, 2, 3).mean(axis=(1, 3))


def half(target: np.ndarray) -> dict[str, object]:
    """The settings of such a picture."""
    return {"camera.width": target.shape[1] // 2, "camera.height": target.shape[0] // 2}


def renderer_of(scene: str, pool: WorkPool, **settings: object) -> Renderer:
    values = {name.replace("__", "."): value for name, value in settings.items()}
    return Renderer(open_scene(scene), with_values(Settings(), values), pool, StageStore(0))


@pytest.mark.parametrize(
    ("scene", "method"),
    [
        ("cornell_diffuse", "progressive"),
        pytest.param("cornell_diffuse", "gather", marks=pytest.mark.extensive),
        ("cornell_caustic", "progressive"),
        ("cornell_caustic", "gather"),
    ],
)
def test_error_falls_below_a_thousandth(scene, method, pool):
    target = reference(scene)
    smaller = scene == "cornell_caustic"  # the other has its thousandth so soon that its rims are dark still
    renderer = renderer_of(scene, pool, render__method=method, **(half(target) if smaller else {}))
    target = halved(target) if smaller else target
    passes, errors = [], []
    while not errors or errors[-1] > 1e-3:
        renderer.step()
        n = renderer.passes
        if n & (n - 1) == 0 or n % 16 == 0:
            measured = metrics(renderer.frame(0).image().astype(float), target)
            passes.append(n)
            errors.append(measured.relmse_all)
        assert n < 160, f"relMSE is still {errors[-1]:.2e} after {n} passes"
    slope = loglog_slope(passes, errors)
    print(
        f"{scene} {method}: relMSE {errors[-1]:.2e} after {passes[-1]} passes, {renderer.tally.cpu_seconds:.1f} CPU s, "
        f"slope {slope:.2f}, mean ratio {measured.mean_ratio:.4f}"
    )
    assert slope < -0.7
    assert measured.mean_ratio == pytest.approx(1, abs=5e-3)
    assert renderer.tally.dropped == {"photons": 0, "samples": 0}


@pytest.mark.extensive
def test_radiance_photons_keep_the_mean(pool):
    """With shrinking radius and few photons in a disc, against the reference and against the plain gather."""
    target = reference("cornell_diffuse")
    images = {}
    for share in ("off", "all", "1/8"):
        renderer = renderer_of("cornell_diffuse", pool, render__method="gather", gather__radiance_photons=share)
        for _ in range(12):
            renderer.step()
        images[share] = renderer.frame(0).image().astype(float)
        measured = metrics(images[share], target)
        plain = images[share].mean() / images["off"].mean()
        print(f"{share}: mean ratio {measured.mean_ratio:.4f}, {plain:.4f} of plain, relMSE {measured.relmse_all:.2e}")
        assert measured.mean_ratio == pytest.approx(1, abs=5e-3)
        assert plain == pytest.approx(1, abs=5e-4)


@pytest.mark.parametrize(
    ("scene", "block"), [pytest.param("cornell_diffuse", 8, marks=pytest.mark.extensive), ("cornell_caustic", 32)]
)
def test_path_tracer_agrees_with_the_reference(scene, block, pool):
    """Blocks are averaged before testing: a pixel of a caustic is lit by few, bright paths and far from Gaussian."""
    whole = reference(scene)
    target = halved(whole)
    opened = open_scene(scene)
    images = []
    for seed in range(1, 13):
        settings = with_values(Settings(), {"render.method": "path", "render.seed": seed, **half(whole)})
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for _ in range(4):
            renderer.step()
        images.append(renderer.frame(0).image().astype(float))
    mean = np.mean(images, axis=0)
    variance = np.var(images, axis=0, ddof=1) / len(images)
    own = OWN_ERROR[scene] * (target**2 + 0.01) / 4  # of means of four pixels
    result = z_test(mean, variance, target, own, block=block)
    print(f"{scene} path: {result}, mean ratio {mean.mean() / target.mean():.4f}")
    assert result.passes(0.001)
    assert mean.mean() / target.mean() == pytest.approx(1, abs=5e-3)
