"""Parts of the window that need none: numbers, jobs, recent files, the link to a session that is still starting."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest

from pmviewer.engine.energy import Energy
from pmviewer.maps.record import unpack
from pmviewer.photons.deposition.deposited import Deposited, weight_histogram
from pmviewer.render.camera import resolve_camera
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer import format as fmt
from pmviewer.viewer.background import Background
from pmviewer.viewer.dialogs.recent import LENGTH, RecentFiles
from pmviewer.viewer.gl.points import even_thinning
from pmviewer.viewer.gl.records import brightest_channel
from pmviewer.viewer.overlays.light_importance import projected
from pmviewer.viewer.panels.importance_panel import bias_row, deposition_rows, histogram_of, weight_text
from pmviewer.viewer.panels.statistics_panel import energy_rows
from pmviewer.viewer.session_link import SessionLink
from pmviewer.viewer.theme import drawable
from pmviewer.viewer.viewport.legend import tick_text
from tests.support.scenes import diffuse_box
from tests.viewer.fake_session import FakeSession, photons_at, wall_photons


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0, "", "0"),
        (7_432_000, "", "7.43 M"),
        (412_000, "", "412 k"),
        (200_000, "", "200 k"),
        (0.0081, "m", "8.10 mm"),
        (14.2e6, "rays/s", "14.2 Mrays/s"),
        (999_999, "", "1.00 M"),
        (15, "", "15"),
        (2.5e-7, "W", "250 nW"),
        (float("inf"), "m", "inf m"),
    ],
)
def test_si(value, unit, text):
    assert fmt.si(value, unit) == text


def test_other_numbers():
    assert fmt.grouped(1234567) == "1,234,567"
    assert fmt.duration(0.0042) == "4 ms"
    assert fmt.duration(12.34) == "12.3 s"
    assert fmt.duration(125) == "2 min 05 s"
    assert fmt.duration(7380) == "2 h 03 min"
    assert fmt.data_size(24) == "24 B"
    assert fmt.data_size(3 * 1024**2) == "3.0 MiB"
    assert fmt.short(50_000_000.0) == "50,000,000"


def test_text_has_only_characters_of_the_font():
    assert drawable("r²ᵢ₊₁ = r²ᵢ·(i+α)/(i+1)") == "r²_(i+1) = r²_i·(i+α)/(i+1)"


def test_text_of_ticks():
    assert [tick_text(v) for v in (0.02, 5.0, 500.0, 5000.0, 20_000.0, 3e7)] == [
        "0.02",
        "5",
        "500",
        "5000",
        "20 k",
        "30 M",
    ]


@pytest.mark.parametrize("count", [0, 1, 999, 1000, 1001, 250_000])
def test_thinning_keeps_to_the_limit_and_wastes_little_of_it(count):
    stride = even_thinning(count, 1000)
    drawn = -(-count // stride)
    assert drawn <= 1000
    assert drawn >= min(count, 500)


def test_powers_are_decoded_as_the_record_says():
    photons = photons_at(wall_photons()[:3], (0.5, 0.125, 0.03125))
    np.testing.assert_array_equal(brightest_channel(photons), unpack(photons, 1.0)["Phi"].max(axis=1))
    np.testing.assert_allclose(unpack(photons, 2.0)["Phi"][0], (1.0, 0.25, 0.0625))
    assert np.all(brightest_channel(photons_at(wall_photons()[:1], (0, 0, 0))) == 0)


def test_recent_files_are_capped_unique_and_kept(tmp_path):
    store = tmp_path / "config" / "recent.txt"
    recent = RecentFiles(store)
    for number in range(LENGTH + 5):
        recent.add(f"scene{number}")
    recent.add("scene12")
    assert len(recent.entries) == LENGTH
    assert recent.entries[0] == "scene12"
    assert RecentFiles(store).entries == recent.entries
    store.parent.chmod(0o500)
    recent.add("another")  # a folder that can't be written is no reason to fail
    store.parent.chmod(0o700)


def test_the_link_hands_everything_over_once_the_session_is_there():
    fake, ready = FakeSession(), threading.Event()

    def make():
        ready.wait(10)
        return fake

    woken = threading.Event()
    link = SessionLink(make, Settings())
    link.on_update = woken.set
    changed = with_values(Settings(), {"photons.N": 5000})
    link.open("box", Settings())
    link.set(changed)
    link.pause()
    link.connect(Background(print))
    assert link.status.state == "preparing"
    assert link.settings == changed
    assert link.frame is None
    ready.set()
    assert woken.wait(10)
    assert fake.opened == ["box"]
    assert link.settings == changed
    assert link.paused
    assert link.frame is fake.frame
    link.close()
    assert fake.closed


def test_a_session_that_does_not_start_is_an_error_in_the_log():
    said, failed = [], threading.Event()

    def make():
        raise OSError("no room for the cache")

    link = SessionLink(make)
    link.on_update = failed.set
    background = Background(lambda level, text: said.append((level, text)))
    link.connect(background)
    assert failed.wait(10)
    assert background.finish(10)
    assert link.status.state == "failed"
    assert said == [("error", "The engine did not start: no room for the cache")]


def test_figures_of_deposition():
    counts = weight_histogram(np.array([0.6, 1.0, 5.0]))
    lossy = Deposited(arrived=1000, stored=250, arrived_power=10.0, discarded_power=2.5, histogram=counts)
    shared = Deposited(arrived=1000, stored=400, redistributed=600, arrived_power=10.0)
    rows = {name: [text.split() for text in texts] for name, texts in deposition_rows({"a": lossy, "b": shared})}
    assert rows["Arrived"] == [["1,000"], ["1,000"]]
    assert rows["Stored"] == [["250", "25%"], ["400", "40%"]]
    assert rows["Rejected"] == [["750", "75%"], ["0", "0%"]]
    assert rows["Redistributed"] == [["0", "0%"], ["600", "60%"]]
    assert rows["Memory saved"] == [fmt.data_size(24 * n).split() for n in (750, 600)]
    assert "Rejected" not in dict(deposition_rows({"b": shared}))
    assert bias_row({"a": lossy, "b": shared}) == ["25.00%", "0.00%"]
    assert bias_row({"b": shared}) is None
    middles, counts = histogram_of(lossy)
    np.testing.assert_array_equal(middles, [-1.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(counts, [1, 1, 0, 1])
    assert histogram_of(shared)[0].size == 0
    assert [weight_text(e) for e in (-2.0, 0.0, 5.0)] == ["1/4", "1", "32"]


def test_points_are_projected_where_the_camera_sees_them():
    camera = resolve_camera(diffuse_box(size=20), Settings().camera)
    corner, right, down = camera.ray_frame()[1:4]
    d = corner + 7.5 * right + 15 * down
    assert projected(camera, np.asarray(camera.origin) + 2.5 * d) == pytest.approx((7.5 / 20, 15 / 20), abs=1e-4)
    assert projected(camera, np.asarray(camera.origin) - d) is None
    assert projected(camera, np.asarray(camera.origin) + corner - 5 * right) is None
    assert projected(camera, np.full(3, np.nan)) is None


def test_energy_rows_are_shares_with_errors():
    rows = dict(energy_rows(Energy(4, (12.0, 9.0, 2.4, 0.6, 0.0), (0.0, 0.06, 0.06, 0.012, 0.0), uncounted=3.0)))
    assert rows["Emitted"] == "12 W"
    assert rows["Absorbed"] == "75.00 ± 0.5 %"
    assert rows["Escaped from the scene"] == "20.00 ± 0.5 %"
    assert rows["On its way after the last scattering"] == "5.00 ± 0.1 %"
    assert rows["Dropped, not finite"] == "0.00 %"
    assert rows["With test photons, not in this ledger"] == "3 W"
    one = dict(energy_rows(Energy(1, (12.0, 12.0, 0.0, 0.0, 0.0), (math.nan,) * 5)))
    assert one["Absorbed"] == "100.00 %"
