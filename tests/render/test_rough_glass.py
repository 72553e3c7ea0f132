"""A sheet of rough glass before a sky of radiance 1: what is seen in it is known by integrating over its facets."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.scene.description import Camera, ConstantEnvironment, Material, Parallelogram, Scene, Shape
from tests.support.scenes import rendered, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

ALPHA = 0.3


def masking(cos):
    """Smith's G₁ of GGX."""
    return 2 / (1 + np.sqrt(1 + ALPHA**2 * (1 / cos**2 - 1)))


def radiance_seen(eta):
    """Radiance towards the normal, under a sky of 1 on both sides; eta: index behind the sheet over that before it.

    Facets by D·cos (Walter et al. 2007, eq. 35), which is the density of those seen from the normal; each reflects by
    Fresnel, refracts the rest, and what leaves it is masked. Refracted radiance is divided by eta².
    """
    share = (np.arange(400_000) + 0.5) / 400_000
    tan2 = ALPHA**2 * share / (1 - share)
    c = 1 / np.sqrt(1 + tan2)
    sin2_t = (1 - c * c) / eta**2
    refracts = sin2_t < 1
    ct = np.sqrt(np.where(refracts, 1 - sin2_t, 0))
    fresnel = (((c - eta * ct) / (c + eta * ct)) ** 2 + ((eta * c - ct) / (eta * c + ct)) ** 2) / 2
    fresnel = np.where(refracts, fresnel, 1)
    reflected = 2 * c * c - 1  # cosine of the direction to the sheet's normal
    up = np.where(reflected > 0, fresnel * masking(np.maximum(reflected, 1e-6)), 0)
    refracted = (1 / eta) - (c / eta - ct) * c
    through = np.where(refracted > 0, (1 - fresnel) * masking(np.maximum(refracted, 1e-6)), 0)
    return up.mean() + through.mean() / eta**2


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize(("method", "mis"), [("path", True), ("path", False), ("progressive", True)])
def test_light_through_rough_glass_is_compressed_by_every_technique(method, mis, behind):
    """Light samples, BSDF samples and both together must see the same; light samples once forgot the compression."""
    glass = Material("glass", "rough dielectric", (1.0, 1.0, 1.0), eta=1.5, alpha=(ALPHA, ALPHA), distribution="ggx")
    camera = Camera((0, 0, -4 if behind else 4), (0, 0, 0), (0, 1, 0), 2.0, near=0.0, far=np.inf)
    sheet = Shape("sheet", Parallelogram((-1, -1, 0), (2, 0, 0), (0, 2, 0)), 0)
    scene = Scene("sheet", None, (sheet,), (glass,), (ConstantEnvironment("sky", (1.0, 1.0, 1.0)),), camera, 24, 24)
    renderer = rendered(scene, settings_of(render={"method": method}, direct={"mis": mis}), passes=64 if mis else 1024)
    expected = radiance_seen(1 / 1.5 if behind else 1.5)
    assert renderer.frame(1).image().mean() == pytest.approx(expected, rel=0.01)
