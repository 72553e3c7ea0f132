"""The comparison with and without importance: its two sides are what they claim, and its table's numbers are true."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.commands.comparing import compare_job, table
from pmviewer.commands.job import load_job
from pmviewer.engine.comparison.importance_gain import LONGER, compare
from pmviewer.engine.comparison.without_importance import plain, refusal
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import Cancelled, WorkPool
from pmviewer.errors import OutputError, SettingError
from pmviewer.output.frame_export import gain_sheet
from pmviewer.output.metric import metrics
from pmviewer.output.png import read_png
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape
from pmviewer.settings.access import Importance, Settings, with_values
from tests.support.scenes import cornell_box, diffuse, panel, rendered, settings_of

SIZE = 24


def wide_floor(size=SIZE):
    """A floor of which the camera sees a ninth, under a wide lamp: most photons are stored in vain."""
    floor = Shape("floor", Parallelogram((-3, 0, -3), (0, 0, 6), (6, 0, 0)), 0)
    camera = Camera((0, 2, 0.001), (0, 0, 0), (0, 0, -1), 53.0, near=0.0, far=np.inf)
    return Scene("wide floor", None, (floor, panel(1.0, 2.5, 2.5)), (diffuse(),), (), camera, size, size)


def settings(**compare_):
    return settings_of(
        render={"method": "global map"},
        photons={"N": 20_000, "projection": "off"},
        importance={"map": "screen", "N": 4000, "deposition": "Keller-Wald"},
        compare={"passes": 2, **compare_},
    )


@pytest.fixture(scope="module")
def scene():
    return open_scene(wide_floor())


@pytest.fixture(scope="module")
def gain(scene, pool):
    return compare(scene, settings(), pool, lambda text, share: None)


def test_equal_photons(scene, gain):
    a, b = gain.with_, gain.without
    assert b.stored == pytest.approx(a.stored, rel=0.05)
    assert b.N < 0.7 * a.N
    assert a.passes == b.passes == 2
    assert a.error.relmse_all < b.error.relmse_all, "the same photons where they are seen tell more"


def test_every_number_is_that_of_a_render_by_hand(scene, gain):
    """Each side's counts, memory and picture are those of the renderer with that side's settings; so is the error."""
    own = with_values(settings(), {"camera.width": SIZE, "camera.height": SIZE})
    longer = rendered(scene, with_values(plain(own), {"render.seed": own.render.seed + 1}), 2 * LONGER).frame(0)
    by_hand = with_values(plain(own), {"photons.N": gain.without.N})
    for side, how in ((gain.with_, own), (gain.without, by_hand)):
        renderer = rendered(scene, how, 2)
        image = renderer.frame(0).image()
        np.testing.assert_array_equal(side.frame.image(), image)
        assert (side.traced, side.stored) == (renderer.tally.emitted, sum(renderer.tally.stored.values()))
        assert side.map_bytes == renderer.tally.map_bytes
        assert side.error == metrics(image, longer.image())
        assert side.cpu_seconds > 0
    assert gain.without.frame.settings.importance == Importance()
    assert (gain.with_.importons, gain.without.importons) == (8000, 0)
    assert gain.with_.importance_bytes > 0 == gain.without.importance_bytes
    assert f"{2 * LONGER} passes without importance" in gain.truth


def test_table(gain):
    heading, *rows = gain.table()
    assert heading == ("equal stored photons", "with importance", "without", "without / with")
    shown = {row[0]: row[1:] for row in rows}
    a, b = gain.with_, gain.without
    assert shown["photons stored"] == (f"{a.stored:,}", f"{b.stored:,}", f"{b.stored / a.stored:.2f} ×")
    assert shown["trajectories a pass, N"][:2] == (f"{a.N:,}", f"{b.N:,}")
    assert float(shown["relMSE"][1]) == pytest.approx(b.error.relmse_all, rel=1e-3)
    lines = table(gain).splitlines()
    assert len({len(line) for line in lines[: len(rows)]}) == 1
    assert lines[-1].startswith("Errors are against a run of 8 passes")


def test_equal_error_adds_passes_until_the_error_is_reached(scene, pool):
    """Against a given truth, which is named."""
    truth = rendered(scene, with_values(plain(settings()), {"render.seed": 7}), 32).frame(0).image()
    gain = compare(scene, settings(equal="error", limit=32), pool, lambda text, share: None, (truth, "that picture"))
    a, b = gain.with_, gain.without
    assert gain.notes == ()
    assert b.error.relmse_all <= a.error.relmse_all
    assert 2 < b.passes <= 64
    assert b.stored / b.passes == pytest.approx(a.stored / a.passes, rel=0.05)
    assert b.error == metrics(b.frame.image(), truth)
    assert gain.sentences() == ["Errors are against that picture."]

    told = []
    bounded = compare(
        scene, settings(equal="error", limit=1), pool, lambda text, share: told.append((text, share)), (truth, "it")
    )
    assert bounded.without.passes == 2
    assert "not reached in 2 passes" in bounded.notes[0]
    assert (gain.heading, bounded.heading) == ("equal error", "error not reached")
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_nothing_to_compare_is_refused(scene, pool):
    for values in (
        {"importance.map": "off"},
        {"importance.deposition": "all"},
        {"render.method": "path"},
        {"render.method": "caustic map"},
    ):
        asked = with_values(settings(), values)
        assert refusal(asked, scene.traits) == inactive_reason("compare.passes", asked, scene.traits) is not None
        with pytest.raises(SettingError, match="No comparison"):
            compare(scene, asked, pool, lambda text, share: None)
    assert refusal(with_values(settings(), {"importance.deposition": "constant density"}), scene.traits) is None
    assert inactive_reason("compare.passes", settings(), scene.traits) is None
    assert inactive_reason("compare.limit", settings(), scene.traits) is not None
    blind = wide_floor()
    blind = Scene(
        "blind", None, blind.shapes, blind.materials, (), Camera((0, 1, 0), (0, 1, -9), (0, 1, 0), 20.0), 8, 8
    )
    discard = with_values(settings(), {"importance.cut_off": "discard"})
    with pytest.raises(SettingError, match="with importance no photon is stored"):
        compare(open_scene(blind), discard, pool, lambda text, share: None)


def test_cancelled(scene):
    pool = WorkPool(1)

    def cancel(text, share):
        if "longer run" in text:
            pool.cancel.set()

    with pytest.raises(Cancelled):
        compare(scene, settings(), pool, cancel)
    pool.close()


def test_sheet(gain):
    """Both pictures lie in it unchanged, the one with importance on the left."""
    sheet = gain_sheet(gain)
    left, right = (frame.image() for frame in gain.frames())
    from pmviewer.output.tone import to_uint8, tone_map

    for image, columns in ((left, slice(0, sheet.shape[1] // 2)), (right, slice(sheet.shape[1] // 2, None))):
        part, wanted = sheet[:, columns], to_uint8(tone_map(image, 0.0, "sRGB"))
        windows = np.lib.stride_tricks.sliding_window_view(part, wanted.shape)[:, :, 0]
        assert (windows == wanted).all(axis=(-1, -2, -3)).sum() == 1


def test_command(tmp_path, capsys):
    """On a bundled scene: against its reference at its size, against a longer run at another."""
    values = ["importance.map=screen", "importance.deposition=Keller-Wald", "photons.N=2000", "importance.N=500"]
    job = load_job("cornell_diffuse", [*values, "camera.width=32", "camera.height=24"], [])
    gain = compare_job(job, tmp_path / "a.png", passes=1, threads=2)
    assert gain.with_.passes == 1
    assert "another seed" in gain.truth
    printed = capsys.readouterr().out
    assert "photons stored" in printed
    assert read_png(tmp_path / "a.png")[0].shape[2] == 3
    gain = compare_job(load_job("cornell_diffuse", values, []), None, passes=1, threads=2)
    assert gain.truth == "the reference cornell_diffuse/reference.exr"
    with pytest.raises(OutputError, match="unknown format"):
        compare_job(job, tmp_path / "a.exr")
    with pytest.raises(OutputError, match="does not exist"):
        compare_job(job, tmp_path / "no" / "a.png")
    with pytest.raises(SettingError, match=r"compare\.equal"):
        compare_job(job, None, equal="time")
    assert with_values(Settings(), {"compare.equal": "error"}).compare.equal == "error"


def test_cornell_box_uses_both_maps(pool):
    """Counts hold where there are caustics."""
    how = with_values(settings(), {"render.method": "progressive", "compare.passes": 3, "photons.N": 10_000})
    gain = compare(open_scene(cornell_box(size=SIZE)), how, pool, lambda text, share: None)
    assert gain.without.stored == pytest.approx(gain.with_.stored, rel=0.05)
