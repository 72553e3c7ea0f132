"""Shadow photons: where they lie, what they say, and that the picture stays right (T8)."""

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.record import unpack
from pmviewer.maps.shadow import LIT, SHADOW, SHADOW_FLAGS, UNKNOWN, build_shadows, shadow_record, visibility
from pmviewer.photons.shadow import shadow_pass
from pmviewer.scene.description import Camera, Parallelogram, PointLight, Scene, Shape
from pmviewer.settings.access import Settings, with_values
from tests.support import naive_maps as naive
from tests.support.scenes import diffuse

pytestmark = pytest.mark.usefixtures("every_path_may_split")

ON = {"direct.shadow_photons": True}


def serial(tasks):
    return [task() for task in tasks]


def plate(lights=((0.0, 3.0, 0.0),)):
    """A plate of side 1 hangs at height 1 over a floor, lamps above: its shadow ends sharply."""
    floor = Shape("floor", Parallelogram((-2, 0, -2), (0, 0, 4), (4, 0, 0)), 0)
    above = Shape("plate", Parallelogram((-0.5, 1, -0.5), (0, 0, 1), (1, 0, 0)), 0)
    lamps = tuple(PointLight(f"lamp {i}", p, (10.0,) * 3) for i, p in enumerate(lights))
    camera = Camera((0, 2, 6), (0, 0, 0), (0, 1, 0), 50.0)
    return Scene("plate", None, (floor, above), (diffuse(two_sided=False),), lamps, camera, 32, 32)


@pytest.fixture(scope="module")
def under_plate():
    opened = open_scene(plate())
    return opened, shadow_pass(opened.flat, 1, 0, 60_000, 0.2, serial)


def test_photons_are_lit_or_in_the_shadow_of_the_plate(under_plate):
    """Under a lamp at height 3, a plate of side 1 at height 1 shades a square of side 1.5."""
    p = unpack(under_plate[1].photons, 1.0)
    x, y, z = p["position"].T
    on_floor, dark = y < 0.5, p["bounces"] == 1
    shaded = np.maximum(abs(x), abs(z)) < 0.75
    sure = abs(np.maximum(abs(x), abs(z)) - 0.75) > 1e-3
    assert on_floor.sum() > 1000
    assert (dark & on_floor).sum() > 500
    np.testing.assert_array_equal(dark[on_floor & sure], shaded[on_floor & sure])
    assert not dark[~on_floor].any()
    assert (p["wi"][:, 1] > 0).all()  # the plate's back, which is black, keeps none


def test_the_same_photons_again_in_any_batches(under_plate):
    opened, shadows = under_plate
    backwards = shadow_pass(opened.flat, 1, 0, 60_000, 0.2, lambda tasks: [t() for t in tasks[::-1]][::-1])
    np.testing.assert_array_equal(shadows.photons.view(np.uint32), backwards.photons.view(np.uint32))
    assert shadows.rays > 60_000


@kernel
def decide(records, points, light, found):
    """`visibility` of a light at points (m, 3) on the floor."""
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        n = (np.float32(0.0), np.float32(1.0), np.float32(0.0))
        found[i] = visibility(records[0], p, n, light)


def decided(photons, points, light=0, fewest=8, radius=0.1):
    found = np.full(len(points), -1, np.int64)
    grid = build_shadows(photons, fewest, radius, 1.0)
    decide(shadow_record(grid, fewest), np.ascontiguousarray(points, np.float32), light, found)
    return found


def test_three_ways():
    """All lit, all dark, both, too few, another light's, from below."""
    rng = np.random.default_rng(2)

    def cloud(x, n, flags=0, light=0, wi=(0, 1, 0)):
        place = np.c_[x + rng.uniform(-0.02, 0.02, n), np.zeros(n), rng.uniform(-0.02, 0.02, n)]
        return naive.pack(place, wi, 1.0, flags, light)

    photons = np.vstack(
        [
            cloud(0, 20),
            cloud(1, 20, SHADOW_FLAGS),
            cloud(2, 20),
            cloud(2, 1, SHADOW_FLAGS),
            cloud(3, 7),
            cloud(4, 20, light=1),
            cloud(5, 20, wi=(0, -1, 0)),
        ]
    )
    points = np.array([[x, 0, 0] for x in range(6)], float)
    np.testing.assert_array_equal(decided(photons, points), [LIT, SHADOW, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN])
    np.testing.assert_array_equal(decided(photons, points, light=1)[[0, 4]], [UNKNOWN, LIT])
    np.testing.assert_array_equal(decided(photons, points, fewest=7)[3], LIT)


def test_a_smaller_disc_with_photons_enough_decides():
    """A crowd of lit photons at the point outweighs one in shadow at the rim of the widest disc."""
    crowd = naive.pack(np.c_[np.linspace(-0.01, 0.01, 20), np.zeros((20, 2))], (0, 1, 0))
    far = naive.pack(np.array([[0.09, 0, 0]]), (0, 1, 0), 1.0, SHADOW_FLAGS)
    assert decided(np.vstack([crowd, far]), [[0, 0, 0]])[0] == LIT
    assert decided(np.vstack([crowd[:5], far]), [[0, 0, 0]], fewest=6)[0] == UNKNOWN


def picture(source, values, passes=2):
    pool = WorkPool()
    try:
        opened = open_scene(source)
        small = {"camera.width": 48, "camera.height": 48, "photons.N": 1000}
        renderer = Renderer(opened, with_values(Settings(), small | values), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        return renderer, renderer.frame(0)
    finally:
        pool.close()


@pytest.mark.parametrize("source", ["cornell_caustic", "plate", "two lamps"])
def test_most_shadow_rays_are_saved_and_the_picture_stays(source):
    scene = {"plate": plate(), "two lamps": plate(((0.0, 3.0, 0.0), (1.5, 2.5, 0.5)))}.get(source, source)
    plain, a = picture(scene, {})
    with_photons, b = picture(scene, ON)
    assert plain.tally.saved_rays == 0
    assert "shadow" not in a.clouds
    assert with_photons.tally.saved_rays + with_photons.tally.shadow_rays == plain.tally.shadow_rays
    assert with_photons.tally.saved_rays > 0.7 * plain.tally.shadow_rays
    assert b.statistics.saved_rays == with_photons.tally.saved_rays
    assert b.statistics.stored_in_pass["shadow"] == len(b.clouds["shadow"].photons) > 0
    direct = a.image("direct").astype(float)
    difference = np.abs(b.image("direct") - direct).mean() / direct.mean()
    print(f"{source}: {with_photons.tally.saved_rays / plain.tally.shadow_rays:.1%} saved, difference {difference:.3%}")
    assert difference < 0.01


def test_each_pass_has_photons_of_its_own():
    """What one set misses for good, many sets miss by chance: with few photons and passes enough, the error of the
    former stays and that of the latter falls. Direct light alone, which `photons.renew` does not concern."""
    sparse = ON | {"direct.shadow_N": 1500, "direct.shadow_fewest": 2}

    def error(renew, passes, seed):
        of = {"photons.renew": renew, "render.seed": seed}
        _, plain = picture(plate(), of, passes)
        renderer, frame = picture(plate(), sparse | of, passes)
        assert renderer.tally.saved_rays > 0
        return (frame.image("direct").astype(float) - plain.image("direct")) / plain.image("direct").mean()

    chance = {
        (renew, passes): np.sqrt(((error(renew, passes, 1) - error(renew, passes, 2)) ** 2).mean() / 2)
        for renew in ("each pass", "once")
        for passes in (4, 64)
    }
    print(chance)
    assert chance["each pass", 64] < 0.35 * chance["each pass", 4]
    assert chance["once", 64] > 0.6 * chance["once", 4]


def test_photons_enough_to_ask_for_never_decide():
    """Nobody has a thousand photons near: every ray is cast and the picture is the same, bit for bit."""
    _, plain = picture(plate(), {})
    renderer, same = picture(plate(), ON | {"direct.shadow_N": 100, "direct.shadow_fewest": 1000})
    assert renderer.tally.saved_rays == 0
    np.testing.assert_array_equal(same.image("beauty"), plain.image("beauty"))


@pytest.mark.parametrize(
    ("path", "values", "inactive"),
    [
        ("direct.shadow_photons", {}, False),
        ("direct.shadow_photons", {"render.method": "path"}, True),
        ("direct.shadow_N", {}, True),
        ("direct.shadow_N", ON, False),
        ("overlays.shadow.show", {}, True),
        ("overlays.shadow.show", ON, False),
    ],
)
def test_settings_without_effect_say_so(under_plate, path, values, inactive):
    assert (inactive_reason(path, with_values(Settings(), values), under_plate[0].traits) is not None) == inactive
