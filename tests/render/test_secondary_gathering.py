"""Secondary gathering: it keeps the energy, class by class, and mends corners that the map's look-up darkens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.render.planes import TERMS
from pmviewer.scene.analysis import analyse
from tests.support.scenes import box_walls, closed_sphere, cornell_box, diffuse_box, rendered, settings_of

EVERYWHERE = {"estimate": {"radius": 0.1, "alpha": 1.0}, "gather": {"rays": 2, "secondary": 20.0}}
"""A threshold longer than the scene: every gather ray gathers again."""


def means(scene, passes, **values):
    groups = {"render": {"method": "gather"}, "photons": {"N": 60_000}} | values
    renderer = rendered(scene, settings_of(**groups), passes)
    assert renderer.tally.dropped == {"photons": 0, "samples": 0}
    frame = renderer.frame(1)
    return {term: float(frame.image(term).mean()) for term in TERMS}


def test_closed_sphere_keeps_its_terms():
    """All gather rays take direct light from light samples and the light that they find: ¼ is indirect as before."""
    found = means(closed_sphere(), 8, **EVERYWHERE)
    print(found)
    assert found["direct"] == pytest.approx(0.25, rel=0.01)
    assert found["indirect"] == pytest.approx(0.25, rel=0.01)


@pytest.mark.extensive
@pytest.mark.parametrize("indirect_caustics", [True, False])
@pytest.mark.parametrize("mis", [True, False])
def test_every_class_of_paths_is_counted_once(mis, indirect_caustics):
    """Mirror and glass among diffuse walls: direct light, caustics and the rest add up to what the map holds.

    Small look-ups hardly darken corners, so that the plain gather is right."""
    values = {
        "photons": {"N": 25_000, "indirect_caustics": indirect_caustics},
        "direct": {"mis": mis},
        "estimate": {"radius": 0.02, "alpha": 1.0, "caustic_radius": 1.0},
    }
    scene = open_scene(cornell_box(size=32, light=0.75))
    plain = means(scene, 16, gather={"rays": 4}, **values)
    second = means(scene, 16, gather={"rays": 4, "secondary": 20.0}, **values)
    near = means(scene, 16, gather={"rays": 4, "secondary": 5.0}, **values)
    print(plain, second, sep="\n")
    for term in ("indirect", "caustic", "specular"):
        assert second[term] == pytest.approx(plain[term], rel=0.015)
        assert near[term] == pytest.approx(plain[term], rel=0.015)


def test_corners_are_no_longer_dark():
    """In a closed box wide look-ups by whole discs lose light at edges. Short rays that gather again leave pixels there
    as wrong as others, which see the dark edges from afar."""
    scene = open_scene(diffuse_box(size=32))
    estimate = {"radius": 0.1, "alpha": 1.0, "area": "disc"}
    images = {}
    for secondary in (0.0, 3.0):
        groups = {"render": {"method": "gather"}, "photons": {"N": 60_000}, "estimate": estimate}
        settings = settings_of(gather={"rays": 8, "secondary": secondary}, **groups)
        images[secondary] = rendered(scene, settings, 16).frame(1).image("indirect").astype(float)
    path = settings_of(render={"method": "path"})
    right = rendered(scene, path, 300).frame(1).image("indirect").astype(float)
    edges = edge_pixels(rendered(scene, path, 1))
    errors = {s: image[edges].mean() / right[edges].mean() - 1 for s, image in images.items()}
    elsewhere = {s: image[~edges].mean() / right[~edges].mean() - 1 for s, image in images.items()}
    print(f"{edges.sum()} pixels at edges: error {errors}, elsewhere {elsewhere}")
    assert errors[0.0] - elsewhere[0.0] < -0.03
    assert abs(errors[3.0] - elsewhere[3.0]) < 0.01


def edge_pixels(renderer):
    """Pixels with a neighbour whose surface faces another way."""
    normal = renderer.frame(1).image("normal")
    edges = np.zeros(normal.shape[:2], bool)
    for axis in (0, 1):
        turn = np.abs(np.diff(normal, axis=axis)).sum(axis=2) > 0.1
        low = [slice(None), slice(None)]
        high = [slice(None), slice(None)]
        low[axis], high[axis] = slice(0, -1), slice(1, None)
        edges[tuple(low)] |= turn
        edges[tuple(high)] |= turn
    return edges


MUCH_MORE = {"gather": {"directions": "photon cones", "radiance_photons": "1/4"}, "estimate": {"lookup": "nearest"}}


@pytest.mark.parametrize(
    "more", [{}, pytest.param(MUCH_MORE, marks=pytest.mark.extensive)], ids=["alone", "with all that gathers have"]
)
def test_threads_change_nothing(more):
    scene = open_scene(cornell_box(size=32))
    settings = settings_of(
        render={"method": "gather"},
        photons={"N": 20_000},
        gather={"rays": 2, "secondary": 3.0, **more.get("gather", {})},
        estimate=more.get("estimate", {}),
    )
    one, two = (rendered(scene, settings, 2, threads) for threads in (1, 2))
    assert np.array_equal(one.film.sums, two.film.sums)
    assert one.tally.shadow_rays == two.tally.shadow_rays


def test_off_without_the_gather():
    traits = analyse(replace(diffuse_box(), shapes=(*box_walls(), diffuse_box().shapes[-1])))
    settings = settings_of(render={"method": "progressive"}, gather={"secondary": 3.0})
    assert "gather" in (inactive_reason("gather.secondary", settings, traits) or "")
