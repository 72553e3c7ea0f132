"""Views of achieved density, its ratio to the required one and the probability of storing, by their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.importance.rules import probability_of
from pmviewer.maps.record import unpack
from pmviewer.output.diagnostic_views import coloured, view_scale
from pmviewer.output.falsecolour import DIVERGING
from tests.render.test_diagnostics import hits
from tests.support import naive_maps as naive
from tests.support.scenes import cornell_box, diffuse_box, settings_of

SIZE = 16


def encode_normals(n):
    return np.ascontiguousarray(naive.pack(np.zeros_like(n), n).view(np.uint32)[:, 3])


@pytest.fixture(scope="module")
def box():
    return open_scene(diffuse_box(size=SIZE))


def stepped(scene, pool, passes=1, method="global map", N=40_000, **importance):
    settings = settings_of(
        render={"method": method}, photons={"N": N}, importance={"N": 4000, **importance}, estimate={"radius": 0.1}
    )
    renderer = Renderer(scene, settings, pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    return renderer


def solid_angles(camera):
    """(pixels, 3) unit directions and the solid angles of the pixels."""
    x, y = np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5)
    corner, right, down = camera.ray_frame()[1:4]
    d = corner + x.reshape(-1, 1) * right + y.reshape(-1, 1) * down
    forward = camera.axes()[2]
    area = np.linalg.norm(np.cross(right, down))
    distance = np.linalg.norm(d, axis=1)
    cosine = np.abs(d @ forward) / distance
    return d / distance[:, None], area * cosine / distance**2


@pytest.mark.parametrize("deposition", ["all", "constant density"])
def test_achieved_density_sums_up_to_the_photons_that_are_seen(box, pool, deposition):
    """Density times the area that a pixel sees, summed: the photons stored on the back wall."""
    renderer = stepped(box, pool, deposition=deposition, density=600.0)
    density = renderer.inspect(Wanted("density", "global")).planes["achieved density"].reshape(-1)
    camera = renderer.camera
    p, n = hits(camera)
    d, solid = solid_angles(camera)
    off = p - np.asarray(camera.origin)
    area = solid * (off**2).sum(axis=1) / np.abs((d * n).sum(axis=1))
    wall = n[:, 2] == 1
    photons = unpack(renderer.light.stored("global"), 1.0)
    x, y, z = photons["position"].T
    seen = (z < -0.999) & (photons["wi"][:, 2] > 0)
    edges = (np.abs(p[wall, :2]) + np.sqrt(area[wall])[:, None] / 2).max(axis=0)
    inside = seen & (np.abs(x) < edges[0]) & (np.abs(y) < edges[1])
    assert wall.sum() > 40
    assert (density[wall] * area[wall]).sum() == pytest.approx(np.count_nonzero(inside), rel=0.05)
    one_by_one = np.sqrt(area[wall])[:, None] / 2
    for place, half, told in zip(p[wall][::7], one_by_one[::7] * 2, density[wall][::7], strict=True):
        box_ = seen & (np.abs(x - place[0]) < half) & (np.abs(y - place[1]) < half)
        expected = np.count_nonzero(box_) / (4 * half[0] ** 2)
        assert told == pytest.approx(expected, rel=0.5)


def test_ratio_is_one_where_photons_suffice(box, pool):
    """Far more photons arrive than are asked for: density control stores as many, without it there are too many."""
    controlled = stepped(box, pool, map="screen", deposition="density control", M_r=100.0, N=150_000)
    planes = controlled.inspect(Wanted("density", "global")).planes
    required = controlled.inspect(Wanted("importance", "global")).planes["required density"]
    ratio = planes["density ratio"]
    np.testing.assert_allclose(ratio[ratio >= 0], (planes["achieved density"] / required)[ratio >= 0], rtol=1e-5)
    assert np.exp(np.median(np.log(ratio[ratio > 0]))) == pytest.approx(1.0, abs=0.25)
    everything = stepped(box, pool, map="screen", M_r=100.0, N=150_000)
    assert np.median(everything.inspect(Wanted("density", "global")).planes["density ratio"]) > 2.0


def test_required_density_is_the_rules(box, pool):
    """Of constant density everywhere the same; of later passes as much denser as the rule asks."""
    constant = stepped(box, pool, deposition="constant density", density=500.0)
    planes = constant.inspect(Wanted("importance", "global")).planes
    assert set(planes) == {"required density"}
    assert set(np.unique(planes["required density"])) <= {np.float32(500.0), np.float32(-1.0)}
    third = stepped(box, pool, 3, method="progressive", map="screen", deposition="density control")
    planes = third.inspect(Wanted("importance", "global")).planes
    seen = planes["importance"] > 0
    growth = (third.first_radius / third.tally.radius["global"]) ** 2
    assert growth > 1.2
    share = planes["required density"][seen] / planes["importance"][seen]
    np.testing.assert_allclose(share, third.settings.importance.M_r * growth, rtol=1e-4)
    p, n = hits(third.camera)
    some = np.flatnonzero(~np.isnan(p[:, 0]))[::9]
    rule = third.light.latest.rules.required["global"](p[some].astype(np.float32), encode_normals(n[some]))
    shown = planes["required density"].reshape(-1)[some]
    assert np.isclose(rule, shown, rtol=1e-3).mean() > 0.9, (
        "rays and formulas differ by rounding, at an importon's edge"
    )


@pytest.mark.parametrize("cut_off", ["clamp", "discard"])
def test_probability_is_that_of_the_rule(box, pool, cut_off):
    how = {"map": "average", "neighbours": 20, "f": 0.4, "epsilon": 0.3, "cut_off": cut_off}
    renderer = stepped(box, pool, deposition="Keller-Wald", **how)
    shown = renderer.inspect(Wanted("storing", "global")).planes["storing probability"].reshape(-1)
    rule = renderer.light.latest.rules.deposition.global_
    p, n = hits(renderer.camera)
    some = ~np.isnan(p[:, 0])
    asked = rule.probability(p[some].astype(np.float32), encode_normals(n[some]))
    again = probability_of(renderer.importance.latest.global_, 0.4)
    np.testing.assert_array_equal(asked, again(p[some].astype(np.float32), encode_normals(n[some])))
    expected = np.where(asked < 0.3, 0.3 if cut_off == "clamp" else 0.0, np.minimum(asked, 1.0))
    np.testing.assert_allclose(shown[some], expected, rtol=2e-2, atol=1e-6)
    assert len(np.unique(shown[some])) > 10
    assert 0.02 < (asked < 0.3).mean() < 0.98
    scale = view_scale("storing probability", shown.reshape(SIZE, SIZE, 1))
    assert (scale.lower, scale.upper) == (0.0, 1.0)


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_both_methods_show_both_maps(pool, method):
    scene = open_scene(cornell_box(size=SIZE))
    renderer = stepped(scene, pool, method=method, map="average", deposition="Keller-Wald", N=4000)
    for name in ("caustic", "global"):
        for family in ("importance", "density", "storing"):
            for view, plane in renderer.inspect(Wanted(family, name)).planes.items():
                assert plane.shape == (SIZE, SIZE, 1)
                assert np.isfinite(plane).all(), view
                assert (plane >= 0).mean() > 0.5, (view, name)


def test_ratios_are_coloured_around_one():
    plane = np.array([[[0.1], [1.0]], [[10.0], [-1.0]]], np.float32)
    scale = view_scale("density ratio", plane)
    assert scale.lower * scale.upper == pytest.approx(1.0)
    pixels = coloured("density ratio", plane)
    assert np.abs(pixels[0, 1] - DIVERGING[127]).max() < 0.02
    assert pixels[0, 0, 2] > pixels[0, 0, 0]  # blue: too few
    assert pixels[1, 0, 2] < pixels[1, 0, 0]
    assert view_scale("density ratio", np.full((2, 2, 1), -1.0)).upper == 2.0


def test_refusals(box):
    off = settings_of(render={"method": "progressive"})
    on = settings_of(importance={"map": "average"})
    constant = settings_of(importance={"deposition": "constant density"})
    rule = settings_of(importance={"map": "average", "deposition": "Keller-Wald"})
    path = settings_of(render={"method": "path"})

    def shown(settings):
        views = ("required density", "achieved density", "density ratio", "storing probability")
        return [v for v in views if inactive_reason(f"display.view={v}", settings, box.traits) is None]

    assert shown(off) == ["achieved density"]
    assert shown(on) == ["required density", "achieved density", "density ratio"] == shown(constant)
    assert len(shown(rule)) == 4
    assert shown(path) == []
