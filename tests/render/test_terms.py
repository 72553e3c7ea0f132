"""The terms of the image: their sum, each against path tracing, and the properties of the first hit."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.planes import TERMS
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape
from tests.support.scenes import cornell_box, diffuse, panel, rendered, settings_of


def pass_means(method, passes=24, **groups):
    """(passes, terms) means of the image's terms, pass by pass: their scatter gives the standard error."""
    values = {"render": {"method": method}, "photons": {"N": 16_000, "q": 0.5}} | groups
    opened = open_scene(cornell_box(size=48, light=0.75))
    totals = []
    pool = WorkPool(1)
    renderer = Renderer(opened, settings_of(**values), pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
        totals.append(renderer.film.sums[:, :15].reshape(-1, 5, 3).mean(axis=(0, 2)))
    pool.close()
    assert sum(renderer.tally.dropped.values()) == 0
    return np.diff(np.array(totals), axis=0, prepend=0)


@pytest.fixture(scope="module")
def path_terms():
    """A light this large is found by enough paths over mirror and glass."""
    return pass_means("path", passes=100)


@pytest.mark.parametrize("method", ["gather", "progressive"])
def test_each_term_agrees_with_path_tracing(method, path_terms):
    """Means over the image within four standard errors of the passes (½ % more for bias), and within 2 % where the
    path tracer's own error is smaller."""
    ours = pass_means(method, estimate={"radius": 0.02, "caustic_radius": 2.0}, gather={"rays": 2})
    for k, term in enumerate(TERMS):
        a, b = ours[:, k], path_terms[:, k]
        error = np.hypot(a.std() / np.sqrt(len(a)), b.std() / np.sqrt(len(b)))
        print(f"{method} {term}: {a.mean():.5f}, path {b.mean():.5f} ± {error:.5f}, ratio {a.mean() / b.mean():.4f}")
        assert abs(a.mean() - b.mean()) < 4 * error + 0.005 * b.mean()
        assert abs(a.mean() - b.mean()) < max(0.02 * b.mean(), 2 * error)


@pytest.mark.parametrize("method", ["gather", "path"])
def test_indirect_caustics_move_between_terms(method, path_terms):
    """With the switch on, more light is a caustic and less is indirect; the image's mean stays."""
    passes = 24 if method == "gather" else 48
    off = pass_means(method, passes, photons={"N": 16_000, "indirect_caustics": False})
    off = off.mean(0)
    on = (path_terms[:passes] if method == "path" else pass_means(method)).mean(0)
    caustic, indirect = TERMS.index("caustic"), TERMS.index("indirect")
    print(f"caustic {on[caustic]:.4f} and {off[caustic]:.4f}, indirect {on[indirect]:.4f} and {off[indirect]:.4f}")
    assert on[caustic] > 1.2 * off[caustic]
    assert on[indirect] < off[indirect]
    assert on.sum() == pytest.approx(off.sum(), rel=0.01)


@pytest.mark.parametrize("term", ["direct", "caustic"])
def test_approximate_terms_are_the_same_light(term):
    """From the global map instead of light samples or the caustic map: the same light, blurred, within four standard
    errors of the passes and 2 % for what look-ups lose at edges."""
    sharp = {"estimate": {"radius": 0.02}, "passes": 16}
    accurate = pass_means("progressive", **sharp)
    approximate = pass_means("progressive", render={"method": "progressive", term: "approximate"}, **sharp)
    for k, name in enumerate(TERMS):
        a, b = approximate[:, k], accurate[:, k]
        error = np.hypot(a.std(), b.std()) / np.sqrt(len(a))
        print(f"{name}: {a.mean():.5f}, accurate {b.mean():.5f} ± {error:.5f}, ratio {a.mean() / b.mean():.4f}")
        assert abs(a.mean() - b.mean()) <= 4 * error + (0.02 * b.mean() if name in (term, "specular") else 1e-9)
    assert not np.array_equal(approximate[:, TERMS.index(term)], accurate[:, TERMS.index(term)])


@pytest.mark.parametrize(("method", "indirect"), [("gather", "approximate"), ("progressive", "accurate")])
def test_methods_are_ways_to_evaluate_the_terms(method, indirect):
    """`gather` with approximate indirect light is `progressive`, and the other way round, bit for bit."""
    other = "progressive" if method == "gather" else "gather"
    settings = settings_of(render={"method": method, "indirect": indirect}, photons={"N": 5000})
    same = settings_of(render={"method": other}, photons={"N": 5000})
    pictures = [rendered(cornell_box(), s, passes=2).frame(1).image() for s in (settings, same)]
    assert np.array_equal(*pictures)


@pytest.mark.parametrize("method", ["gather", "progressive", "path", "global map", "caustic map"])
def test_terms_sum_to_the_image_bit_for_bit(method):
    frame = rendered(cornell_box(), settings_of(render={"method": method}, photons={"N": 5000}), passes=2).frame(1)
    total = np.zeros_like(frame.image())
    for term in TERMS:
        total = total + frame.image(term)
    assert np.array_equal(total, frame.image())
    assert frame.image().dtype == np.float32
    assert all(frame.image(term).min() >= 0 for term in TERMS)
    assert frame.image().max() > 0


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("mis", [True, False])
@pytest.mark.parametrize("method", ["progressive", "gather", "path"])
def test_direct_light_is_the_same_by_any_samples(method, mis, samples):
    """Irradiance of a large panel straight above a floor, closed form; MIS and sample numbers change noise alone."""
    floor = Parallelogram((-0.01, 0, -0.01), (0, 0, 0.02), (0.02, 0, 0))
    shapes = (Shape("floor", floor, 0), panel(half=0.8, y=0.5, radiance=(1.0,) * 3, material=1))
    camera = Camera((0, 0.3, 0.0), (0, 0, 0), (0, 0, 1), 2.0, near=0.0, far=np.inf)
    materials = (diffuse(), diffuse("black", (0.0, 0.0, 0.0)))
    scene = Scene("panel", None, shapes, materials, (), camera, 16, 16)
    settings = settings_of(
        render={"method": method}, direct={"mis": mis, "samples": samples}, photons={"N": 1000}, gather={"rays": 2}
    )
    image = rendered(scene, settings, passes=128).frame(1).image("direct")
    # A square of half-width a at height h over its centre: E = 4 L · A/√(1+A²)·arctan(A/√(1+A²)), A = a/h (Lambert).
    ratio = 0.8 / 0.5
    slope = ratio / np.sqrt(1 + ratio**2)
    expected = 4 * slope * np.arctan(slope) * 0.5 / np.pi
    print(f"{method}, MIS {mis}, {samples} samples: {image.mean():.5f}, analytic {expected:.5f}")
    assert image.mean() == pytest.approx(expected, rel=3e-3 if mis else 8e-3)


@pytest.mark.parametrize("method", ["progressive", "path"])
def test_first_hit_properties(method):
    frame = rendered(cornell_box(size=32), settings_of(render={"method": method}, photons={"N": 1000}), 4).frame(1)
    albedo, normal, depth = frame.image("albedo"), frame.image("normal"), frame.image("depth")
    # The back wall: z = -1, seen from z = 0.95; the left wall is red and faces +x.
    assert albedo[12, 16] == pytest.approx((0.7, 0.7, 0.7), rel=1e-5)
    assert normal[12, 16] == pytest.approx((0, 0, 1), abs=1e-5)
    assert depth[12, 16, 0] == pytest.approx(1.95, rel=1e-5)
    assert albedo[14, 0] == pytest.approx((0.6, 0.1, 0.1), rel=1e-5)
    assert normal[14, 0] == pytest.approx((1, 0, 0), abs=1e-5)
    assert np.linalg.norm(normal, axis=2).max() < 1 + 1e-5


def test_first_hit_normal_faces_the_eye():
    """Seen from behind, a two-sided surface's normal is turned round."""
    wall = Parallelogram((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    for eye in (2.0, -2.0):
        camera = Camera((0, 0, eye), (0, 0, 0), (0, 1, 0), 20.0, near=0.0, far=np.inf)
        scene = Scene("wall", None, (Shape("wall", wall, 0, (1.0,) * 3),), (diffuse(),), (), camera, 4, 4)
        frame = rendered(scene, settings_of(render={"method": "path"}), 1).frame(1)
        assert frame.image("normal")[2, 2] == pytest.approx((0, 0, np.sign(eye)), abs=1e-6)
        assert frame.image("depth")[2, 2, 0] == pytest.approx(2.0, rel=1e-6)
        assert (frame.image("emission")[2, 2, 0] == 1.0) == (eye > 0)  # emits on its front alone
