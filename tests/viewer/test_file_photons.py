"""Photons written to a PLY file and read back, to be drawn over the picture."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.maps.record import unpack
from pmviewer.output.ply import read_ply, write_ply
from pmviewer.viewer.loaded_photons import read_photons
from tests.viewer.driver import drive, make_app, wait_until
from tests.viewer.fake_session import FakeSession


def columns(n=500, seed=3):
    rng = np.random.default_rng(seed)
    wi = rng.normal(size=(n, 3))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    place, power = rng.uniform(-1, 1, (n, 3)), rng.uniform(1e-5, 2e-3, (n, 3))
    named = [(f"{p}{x}", a[:, i].astype(np.float32)) for p, a in (("", place), ("n", wi)) for i, x in enumerate("xyz")]
    named += [(f"power_{x}", power[:, i].astype(np.float32)) for i, x in enumerate("rgb")]
    named += [("bounces", rng.integers(0, 32, n).astype(np.uint8))]
    named += [
        ("path_class", rng.integers(0, 4, n).astype(np.uint8)),
        ("light", rng.integers(0, 900, n).astype(np.uint16)),
    ]
    return named, place, wi, power


def test_what_is_written_comes_back(tmp_path):
    named, place, wi, power = columns()
    write_ply(tmp_path / "a.ply", named, ["photons"])
    photons = read_photons(tmp_path / "a.ply")
    got = unpack(photons.records, photons.power_unit)
    assert np.allclose(got["position"], place, atol=1e-6)
    assert ((got["wi"] * wi).sum(axis=1) > np.cos(np.radians(0.1))).all()
    assert np.allclose(got["Phi"], power, rtol=1e-3)
    for name in ("bounces", "path_class", "light"):
        assert np.array_equal(got[name], dict(named)[name])


def test_other_files_are_refused_in_a_sentence(tmp_path):
    named, *_ = columns(20)
    write_ply(tmp_path / "a.ply", named)
    whole = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "short.ply").write_bytes(whole[:-7])
    (tmp_path / "ascii.ply").write_bytes(whole.replace(b"binary_little_endian", b"ascii"))
    (tmp_path / "none.ply").write_bytes(b"P6 3 3 255")
    (tmp_path / "twice.ply").write_bytes(whole.replace(b"float y\n", b"float x\n"))
    for name in ("short", "ascii", "none", "twice"):
        with pytest.raises(SceneError):
            read_ply(tmp_path / f"{name}.ply")
    write_ply(tmp_path / "placeless.ply", named[3:])
    with pytest.raises(SceneError, match="place"):
        read_photons(tmp_path / "placeless.ply")


def test_the_overlay_shows_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_ply(tmp_path / "a.ply", columns(300)[0])
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)

    def script(c):
        before = app.viewport.redraws
        app.state.loaded.open(tmp_path / "a.ply")
        wait_until(c, lambda: app.state.settings.overlays.file.show)
        c.yield_(6)
        assert app.viewport.redraws > before
        source = app.viewport.source()
        (overlay,) = [o for o in app.viewport.picture.layers.shown(app.state.settings) if o.name == "file"]
        assert overlay.count(source) == 300
        app.state.loaded.open(tmp_path / "missing.ply")
        wait_until(c, lambda: any("missing.ply" in message.text for message in app.state.log))

    drive(app, script)
