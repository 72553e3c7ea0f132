"""Final gather estimation: the mask, tiles, full gathers against what geometry says, and the plain gather's mean."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.estimation import NARROWEST, first_tiles, grid_lines, shrink_of
from pmviewer.engine.store import StageStore
from pmviewer.output.diagnostic_views import DIAGNOSTICS, coloured
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.estimation import (
    DIFFUSE,
    ESTIMATE,
    FOOTPRINT,
    KIND,
    NORMAL,
    OTHER,
    POINT,
    SAMPLE,
    TOLD,
    gather_samples,
    trace_samples,
)
from pmviewer.render.gather.tiles import (
    CRITICAL,
    GATHERED,
    INTERPOLATED,
    LEFT,
    NO_RECEIVER,
    SAFE,
    ask_corners,
    divide_tiles,
    mark_safe,
)
from pmviewer.scene.analysis import analyse
from tests.support.scenes import closed_sphere, cornell_box, diffuse_box, rendered, settings_of

ON = {"estimation": "on", "estimation_samples": 32}
WIDE = {**ON, "estimation_error": 2.0, "estimation_contrast": 4.0}
GATHER = {"render": {"method": "gather"}, "photons": {"N": 20_000}}


def estimated(scene, passes=2, threads=1, gather=ON, **groups):
    return rendered(scene, settings_of(**{**GATHER, "gather": gather, **groups}), passes, threads)


def flat(width, height):
    """Samples (pixels, SAMPLE) of the plane z = 0 that a pixel of width 1 each sees."""
    samples = np.zeros((height, width, SAMPLE), np.float32)
    samples[..., POINT], samples[..., POINT + 1] = np.meshgrid(np.arange(width), np.arange(height))
    samples[..., NORMAL + 2] = samples[..., FOOTPRINT] = 1.0
    samples[..., KIND] = DIFFUSE
    return samples


def mask_of(samples, degrees=10.0, step=0.5):
    height, width = samples.shape[:2]
    mask = np.empty(width * height, np.uint8)
    cosine = np.float32(np.cos(np.radians(degrees)))
    rows = samples.reshape(-1, SAMPLE)
    mark_safe(rows, np.int64(width), np.int64(height), cosine, np.float32(step), mask, 0, len(mask))
    return mask.reshape(height, width)


def test_the_mask_finds_creases_steps_and_what_is_no_receiver():
    width, height = 20, 8
    assert (mask_of(flat(width, height)) == SAFE).all()
    crease, step, hole, gentle = (flat(width, height) for _ in range(4))
    crease[:, 10:, NORMAL : NORMAL + 3] = (np.sin(0.2), 0, np.cos(0.2))
    step[:, 10:, POINT + 2] = 0.6
    hole[3, 5, KIND] = OTHER
    gentle[:, 10:, NORMAL : NORMAL + 3] = (np.sin(0.1), 0, np.cos(0.1))
    gentle[:, 10:, POINT + 2] = 0.3
    expected = np.full((height, width), SAFE)
    expected[:, 9:11] = CRITICAL
    np.testing.assert_array_equal(mask_of(crease), expected)
    np.testing.assert_array_equal(mask_of(step), expected)
    assert (mask_of(gentle) == SAFE).all()
    assert (mask_of(gentle, degrees=5.0) == expected).all()
    assert (mask_of(gentle, step=0.25) == expected).all()
    around = np.full((height, width), SAFE)
    around[2:5, 4:7] = CRITICAL
    around[3, 5] = NO_RECEIVER
    np.testing.assert_array_equal(mask_of(hole), around)


def solved(samples, E, R, rule, mask=None, tiles=None):
    """The rounds of the stage on given samples, the irradiance E (h, w) and distances R (h, w) known everywhere."""
    height, width = samples.shape[:2]
    rows = samples.reshape(-1, SAMPLE)
    unsafe = np.zeros((height + 1, width + 1), np.int32)
    if mask is not None:
        unsafe[1:, 1:] = np.cumsum(np.cumsum(mask != SAFE, axis=0), axis=1)
    estimates, told = np.zeros((width * height, ESTIMATE), np.float32), np.zeros((width * height, TOLD), np.float32)
    how, level = np.full((height, width), LEFT, np.uint8), np.zeros((height, width), np.uint8)
    tiles = first_tiles(width, height, 8, 1, 0) if tiles is None else tiles
    depth = 0
    while len(tiles):
        wanted = np.zeros((height, width), np.uint8)
        ask_corners(tiles, unsafe, how, wanted)
        corners = np.flatnonzero(wanted)
        estimates[corners, :3], estimates[corners, 3] = E.ravel()[corners, None], 1.0
        told[corners, 0] = R.ravel()[corners]
        how.ravel()[corners], level.ravel()[corners] = GATHERED, depth
        parts = np.empty((4 * len(tiles), 4), np.int32)
        count = divide_tiles(tiles, unsafe, rows, estimates, told, how, level, depth, rule, parts)
        tiles, depth = parts[:count], depth + 1
    return estimates.reshape(height, width, ESTIMATE), how, level


def test_a_linear_field_is_interpolated_exactly_from_few_points():
    height, width = 30, 41
    y, x = np.mgrid[:height, :width]
    E, R = 1.0 + 0.1 * x + 0.03 * y, np.full((height, width), 1e3)
    estimates, how, level = solved(flat(width, height), E, R, (0.2, 4.0, 2, 0.0, 7))
    assert set(np.unique(how)) == {INTERPOLATED, GATHERED}
    assert (how == GATHERED).sum() <= (width // 8 + 3) * (height // 8 + 3)
    np.testing.assert_allclose(estimates[..., 0], E, rtol=1e-5)
    assert (level == 0).all()


def test_tiles_are_divided_where_surfaces_are_near_and_where_estimates_differ():
    height, width = 33, 33
    x = np.arange(width) * np.ones((height, 1), int)
    tiles = np.array([[0, 0, 16, 32], [16, 0, 32, 32]], np.int32)
    R = np.where(x < 16, 1e3, 10.0)
    R[:, 16] = 1e3
    E = np.ones((height, width))
    _, how, level = solved(flat(width, height), E, R, (0.25, 4.0, 2, 0.0, 7), tiles=tiles)
    # ½·diagonal/R ≤ ¼ of the right half, R = 10: diagonal ≤ 5, tiles of 2 × 4 pixels, or of 4 × 2.
    assert (level[:, :16] == 0).all()
    assert set(level[(how == INTERPOLATED) & (x > 16)]) == {3}
    assert set(level[(how == GATHERED) & (x > 16)]) == {0, 1, 2, 3}
    E[:, 17:] = 2.0
    _, how, level = solved(flat(width, height), E, np.full_like(R, 1e3), (0.25, 0.3, 2, 0.0, 7), tiles=tiles)
    # The jump lies between the columns 16 and 17: no tile that holds both is interpolated, all others at once.
    assert (how[:, 17] != INTERPOLATED).all()
    assert (level[(how == INTERPOLATED) & (x < 16)] == 0).all()
    assert (how[:, 18:] != LEFT).all()


def test_smallest_tiles_that_err_are_left_but_for_a_share():
    height = width = 65
    E, R = np.ones((height, width)), np.full((height, width), 0.1)
    shares = []
    for share in (0.0, 0.5, 1.0):
        _, how, _ = solved(flat(width, height), E, R, (0.2, 4.0, 2, share, 7))
        shares.append((how == INTERPOLATED).mean() / (how != GATHERED).mean())
    assert shares[0] == 0
    assert 0.4 < shares[1] < 0.8  # edges count for both tiles beside them
    assert shares[2] == 1


def test_no_pixel_is_interpolated_over_a_critical_one():
    """A field that jumps at a critical column: estimates are exact on both sides."""
    height, width = 40, 40
    samples = flat(width, height)
    samples[:, 20:, POINT + 2] = 5.0
    mask = mask_of(samples)
    E = np.where(np.arange(width) < 20, 1.0, 3.0) * np.ones((height, 1))
    estimates, how, _ = solved(samples, E, np.full((height, width), 1e3), (0.5, 4.0, 2, 1.0, 7), mask)
    known = how != LEFT
    assert known[:, :17].all()
    assert known[:, 23:].all()
    assert not known[mask != SAFE].any()
    np.testing.assert_allclose(estimates[known, 0], E[known], rtol=1e-6)


def test_the_grid_moves_from_pass_to_pass_and_covers_the_picture():
    assert grid_lines(20, 8, 3).tolist() == [0, 3, 11, 19]
    assert grid_lines(1, 8, 3).tolist() == [0]
    offsets = set()
    for index in range(20):
        tiles = first_tiles(50, 30, 16, 1, index)
        seen = np.zeros((30, 50), bool)
        for x0, y0, x1, y1 in tiles:
            assert 0 <= x1 - x0 <= 16
            seen[y0 : y1 + 1, x0 : x1 + 1] = True
        assert seen.all()
        offsets.add((tiles[0][2], tiles[0][3]))
    assert len(offsets) > 10
    assert shrink_of(63) == pytest.approx(0.5)
    assert round(16 * shrink_of(10**9)) < NARROWEST


def test_a_full_gather_knows_irradiance_and_harmonic_mean_distance():
    """In the unit sphere, cosine-weighted rays go 2·cosθ, whose harmonic mean is 1; walls that reflect radiance ½ make
    the irradiance π/2."""
    renderer = estimated(closed_sphere(), 1, gather={**ON, "estimation_samples": 256}, photons={"N": 200_000})
    given = renderer.latest.given
    pixels = given.eye[0]["width"] * given.eye[0]["height"]
    samples, counts = np.empty((pixels, SAMPLE), np.float32), np.zeros(N_COUNTS, np.int64)
    trace_samples(given, samples, counts, 0, int(pixels))
    p, n = samples[:, POINT : POINT + 3], samples[:, NORMAL : NORMAL + 3]
    np.testing.assert_allclose(p, -n, atol=1e-3)
    chosen = np.arange(0, pixels, 16, dtype=np.int32)
    estimates, told = np.zeros((pixels, ESTIMATE), np.float32), np.zeros((pixels, TOLD), np.float32)
    gather_samples(given, chosen, samples, estimates, told, counts, 0, len(chosen))
    assert (estimates[chosen, 3] == 1).all()
    assert estimates[chosen, 0].mean() == pytest.approx(np.pi / 2, rel=0.02)
    assert told[chosen, 0].mean() == pytest.approx(1.0, rel=0.03)
    assert counts[0] == pixels + len(chosen) * given.cache[0]["rings"] * given.cache[0]["sectors"]


def block_means(scene, gather, seeds, passes, size=4):
    means = []
    for seed in range(1, seeds + 1):
        groups = {"render": {"method": "gather", "seed": seed}, "photons": {"N": 4000}, "gather": gather}
        image = rendered(scene, settings_of(**groups), passes).frame(0).image("indirect").astype(float).mean(axis=2)
        h, w = image.shape
        means.append(image.reshape(h // size, size, w // size, size).mean(axis=(1, 3)))
    return np.array(means)


@pytest.mark.parametrize("scene", [diffuse_box(size=32), cornell_box(size=32)], ids=["diffuse box", "mirror and glass"])
def test_the_mean_is_that_of_the_plain_gather(scene):
    """Blocks of 8 × 8 pixels over independent seeds: differences as large as their own scatter explains."""
    ours, plain = block_means(scene, {**ON, "estimation_error": 0.1}, 10, 4, 8), block_means(scene, {}, 10, 4, 8)
    variance = (ours.var(axis=0, ddof=1) + plain.var(axis=0, ddof=1)) / len(ours)
    lit = plain.mean(axis=0) > 0
    z = (ours.mean(axis=0) - plain.mean(axis=0))[lit] / np.sqrt(variance[lit])
    print("z", np.round(z, 1), "share", ours.mean() / plain.mean())
    assert np.abs(z).max() < 4
    assert (z**2).mean() < 2
    assert ours.mean() == pytest.approx(plain.mean(), rel=0.005)
    assert ours.std(axis=0, ddof=1).mean() < plain.std(axis=0, ddof=1).mean()


def test_later_passes_interpolate_less_so_that_the_limit_is_the_plain_gather():
    opened, pool, store = open_scene(diffuse_box(size=48)), WorkPool(1), StageStore(0)
    shares = []
    for index in (0, 63, 10**6, 10**9):
        renderer = Renderer(opened, settings_of(**GATHER, gather=ON), pool, store)
        renderer.film.passes = index
        renderer.step()
        counts = renderer.tally.estimates
        shares.append(counts["interpolated"] / counts["safe"])
    pool.close()
    assert shares[0] > shares[1] > shares[2] > shares[3]
    assert shares[0] > 0.6
    assert shares[3] < 0.05


def test_threads_and_history_do_not_change_the_picture():
    one, four = estimated(cornell_box(), 3, threads=1).frame(1), estimated(cornell_box(), 3, threads=4)
    assert np.array_equal(one.planes, four.frame(1).planes)
    opened, pool = open_scene(cornell_box()), WorkPool(2)
    renderer = Renderer(opened, settings_of(**GATHER, gather=ON), pool, StageStore())
    renderer.coarse_frame(2)
    for _ in range(3):
        renderer.step()
    pool.close()
    assert np.array_equal(renderer.frame(3).planes, one.planes)


def test_statistics_and_views_say_the_same():
    renderer = estimated(diffuse_box(size=64), 1, gather=WIDE)
    counts, frame = renderer.tally.estimates, renderer.frame(1)
    assert counts["safe"] + counts["critical"] + counts["other"] == 64 * 64
    assert counts["gathered"] + counts["interpolated"] + counts["left"] == counts["safe"]
    assert frame.statistics.interpolated == pytest.approx(
        (counts["gathered"] + counts["interpolated"]) / 64**2, abs=0.02
    )
    planes = renderer.inspect(Wanted("estimation")).planes
    views = {name for name, view in DIAGNOSTICS.items() if view.family == "estimation"}
    assert set(planes) == views - {"reprojected share"}
    assert (planes["estimation mask"] == 1).sum() == counts["safe"]
    points = planes["gathered points"]
    assert [(points == i).sum() for i in (1, 2)] == [counts["interpolated"], counts["gathered"]]
    level = planes["subdivision level"]
    assert ((level < 0) == (points < 1)).all()
    assert 0 <= level.max() <= 4
    for name, plane in planes.items():
        assert coloured(name, plane).shape == (64, 64, 3)


def test_what_it_is_for_and_why_it_has_no_effect():
    diffuse, glossy = analyse(diffuse_box()), analyse(cornell_box())
    on = settings_of(render={"method": "gather"}, gather=ON)
    assert plan_of(on, diffuse).estimation
    assert "gather estimation" in plan_of(on, diffuse).running
    assert inactive_reason("gather.estimation_error", on, diffuse) is None
    assert inactive_reason("display.view=estimation mask", on, diffuse) is None
    off = settings_of(render={"method": "gather"})
    assert ("gather estimation", "off") in plan_of(off, diffuse).skipped
    assert (
        inactive_reason("gather.estimation_error", off, diffuse) == "Only with estimated gathers (gather.estimation)."
    )
    assert inactive_reason("display.view=subdivision level", off, diffuse)
    for method in ("progressive", "path", "virtual lights"):
        other = settings_of(render={"method": method}, gather=ON)
        assert not plan_of(other, glossy).estimation
        assert method in inactive_reason("gather.estimation", other, glossy)
    both = settings_of(render={"method": "gather"}, gather={**ON, "cache": "on"})
    assert plan_of(both, diffuse).cache
    assert not plan_of(both, diffuse).estimation
    assert "irradiance cache" in inactive_reason("gather.estimation", both, diffuse)


def test_interpolation_next_to_darkness_is_never_negative():
    """Rounded sums may fall below zero by 1e-8 of the other corners, and a sample below zero would be dropped."""
    rng = np.random.default_rng(5)
    for _ in range(400):
        width, height = rng.integers(3, 40, 2)
        E = rng.random((height, width)) * (rng.random((height, width)) < 0.5)
        tiles = np.array([[0, 0, width - 1, height - 1]], np.int32)
        samples, R = flat(width, height), np.full_like(E, 1e3)
        estimates, _, _ = solved(samples, E, R, (1e3, 4.0, 2, 1.0, 7), tiles=tiles)
        assert estimates.min() >= 0


def test_scenes_with_media_gather_as_usual_and_say_so():
    traits = open_scene("fog_sphere").traits
    on = settings_of(render={"method": "gather"}, gather=ON)
    assert not plan_of(on, traits).estimation
    assert any("Estimated gathers" in warning for warning in plan_of(on, traits).warnings)
    assert "media" in inactive_reason("gather.estimation", on, traits)
