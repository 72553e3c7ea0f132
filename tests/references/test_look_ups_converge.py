"""Look-ups of the k nearest converge as those of a fixed radius do, and radii by pixel as radii by pass (E6).

On a floor under a lamp, whose light is known, and in the box. Figures with -s.
"""

import numpy as np
import pytest

from pmviewer.bench.measures.error import reference
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import loglog_slope, metrics
from pmviewer.scene.description import Camera, Parallelogram, PointLight, Scene, Shape
from pmviewer.settings.access import Settings, with_values
from tests.references.test_convergence import halved
from tests.support.scenes import diffuse

ALBEDO = 0.5
PASSES = (16, 64, 256)
SIDE = 24


def floor_under_a_lamp():
    """A lamp of 1 W/sr hangs 1 over a wide floor; the camera sees what lies below it."""
    floor = Shape("floor", Parallelogram((-4, 0, -4), (0, 0, 8), (8, 0, 0)), 0)
    lamp = PointLight("lamp", (0.0, 1.0, 0.0), (1.0,) * 3)
    camera = Camera((0, 0.9, 0), (0, 0, 0), (0, 0, 1), 60.0)
    return Scene("floor", None, (floor,), (diffuse(albedo=(ALBEDO,) * 3),), (lamp,), camera, SIDE, SIDE)


def radiance_of_floor(depth):
    """ρ/π · cos θ / d² below the lamp, averaged over each pixel: (SIDE, SIDE)."""
    fine = 8
    v = (np.arange(SIDE * fine) + 0.5) / (SIDE * fine) * 2 - 1
    x, y = np.meshgrid(v * depth * np.tan(np.radians(30)), v * depth * np.tan(np.radians(30)))
    L = ALBEDO / np.pi / (1 + x**2 + y**2) ** 1.5
    return L.reshape(SIDE, fine, SIDE, fine).mean(axis=(1, 3))


def errors(renderer, target, passes):
    found = []
    while renderer.passes < passes[-1]:
        renderer.step()
        if renderer.passes in passes:
            found.append(metrics(renderer.frame(0).image().astype(float), target))
    return found


NEAREST = {"lookup": "nearest", "k": 100, "max_radius": 2.0}


def floor_errors(pool, **estimate):
    values = {f"estimate.{name}": value for name, value in estimate.items()}
    values |= {"render.method": "global map", "photons.N": 2000}
    renderer = Renderer(open_scene(floor_under_a_lamp()), with_values(Settings(), values), pool, StageStore(0))
    truth = np.repeat(radiance_of_floor(0.9)[..., None], 3, axis=2)
    found = errors(renderer, truth, PASSES)
    slope = loglog_slope(PASSES, [m.relmse_all for m in found])
    print(estimate, [f"{m.relmse_all:.2e} ({m.mean_ratio:.4f})" for m in found], f"slope {slope:.2f}")
    return found, slope


@pytest.mark.extensive
@pytest.mark.parametrize(
    "estimate",
    [
        {},
        {"rim": "half"},
        {"rim": "whole", "filter": "cone"},
        {"filter": "epanechnikov"},
        {"differential": True},
        {"max_radius": 0.06},
    ],
    ids=lambda estimate: " ".join(f"{v}" for v in estimate.values()) or "default",
)
def test_every_estimate_of_the_nearest_converges(pool, estimate):
    """What a curved field adds falls as r⁴: with the default α, with the passes to the power of −2/3."""
    found, slope = floor_errors(pool, **NEAREST | estimate)
    assert slope == pytest.approx(-2 / 3, abs=0.1)
    assert found[-1].relmse_all < 6e-4


@pytest.mark.parametrize("rule", ["pass", "pixel"])
def test_radii_converge_by_pass_and_by_pixel(pool, rule):
    found, slope = floor_errors(pool, radius=0.08, radius_rule=rule)
    assert slope == pytest.approx(-2 / 3, abs=0.1)
    assert found[-1].relmse_all < 6e-4


def test_without_shrinking_they_would_not(pool):
    found, slope = floor_errors(pool, **NEAREST | {"k": 200, "alpha": 1.0})
    assert abs(slope) < 0.05
    assert found[-1].relmse_all > 5e-3


@pytest.mark.extensive
def test_in_the_box_as_look_ups_of_their_size_do(pool):
    """The rest of the error is the dark rim along edges, whose width falls with the radius: nearest look-ups have it as
    look-ups of a fixed radius that holds as many photons."""
    target = reference("cornell_diffuse")
    smaller = {"camera.width": target.shape[1] // 2, "camera.height": target.shape[0] // 2}
    target = halved(target)
    relmse = {}
    for lookup, size in (("nearest", {"estimate.k": 20}), ("radius", {"estimate.radius": 0.053})):
        values = {"render.method": "progressive", "photons.N": 20_000, "estimate.lookup": lookup} | size | smaller
        renderer = Renderer(open_scene("cornell_diffuse"), with_values(Settings(), values), pool, StageStore(0))
        found = errors(renderer, target, (16, 64))
        relmse[lookup] = [m.relmse_all for m in found]
        print(lookup, relmse[lookup], found[-1].mean_ratio)
    slopes = {lookup: loglog_slope((16, 64), errors) for lookup, errors in relmse.items()}
    print(slopes)
    assert slopes["nearest"] == pytest.approx(slopes["radius"], abs=0.1)
    assert relmse["nearest"][-1] < 1.3 * relmse["radius"][-1]
