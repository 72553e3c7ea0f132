"""Mitsuba as an optional peer: a clear word when it is missing or broken, and its curve beside ours."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import math
import sys

import pytest

from pmviewer.bench import peer
from pmviewer.bench.measures import error
from pmviewer.errors import PmviewerError

FAKE = """
import numpy as np
class LogLevel:
    Error = 0
def set_log_level(level): pass
def set_variant(name):
    if name == "llvm_ad_rgb":
        raise SystemExit("no usable compiler")
def load_file(path, **parameters):
    assert path.endswith("scene.xml"), path
    return int(parameters.get("res", 4))
def render(scene, spp, seed, integrator=None):
    return np.full((scene, scene, 3), 1 + 1e-3 * seed)
"""


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A package `mitsuba` whose llvm variant ends the process, as a wrong LLVM does."""
    (tmp_path / "mitsuba.py").write_text(FAKE)
    root = next(p for p in sys.modules["pmviewer"].__path__)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{root}/..")
    spec = importlib.machinery.ModuleSpec("mitsuba", None)
    real = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: spec if name == "mitsuba" else real(name, *a))
    peer.variant.cache_clear()
    yield tmp_path
    peer.variant.cache_clear()


def test_missing_package_is_said_once_and_clearly(monkeypatch):
    monkeypatch.setattr(peer, "installed", lambda: False)
    peer.variant.cache_clear()
    with pytest.raises(PmviewerError, match=r"pip install 'pmviewer\[mitsuba\]'"):
        peer.variant()


def test_a_variant_that_kills_the_process_is_passed_over(fake):
    assert peer.variant() == "scalar_rgb"
    images = peer.independent_images("cornell_diffuse", {"res": "8"}, 3, 100)
    assert images.shape == (3, 8, 8, 3)
    # Runs of 64 + 36 samples with seeds 1 2, 3 4, 5 6.
    expected = [1 + 1e-3 * (0.64 * (2 * i + 1) + 0.36 * (2 * i + 2)) for i in range(3)]
    assert images[:, 0, 0, 0] == pytest.approx(expected)


def test_reason_of_a_failure_reaches_the_user(fake):
    (fake / "mitsuba.py").write_text("raise RuntimeError('out of order')")
    with pytest.raises(PmviewerError, match="renders nothing: RuntimeError: out of order"):
        peer.variant()


def test_curve_doubles_its_samples(fake):
    spp, cpu, images = peer.error_images("cornell_diffuse", 0.02)
    assert spp[:3] == [1, 2, 4]
    assert cpu[-1] >= 0.02
    assert list(cpu) == sorted(cpu)
    assert images.shape == (len(spp), 4, 4, 3)


def test_targets_against_the_peer():
    ours = [error.Curve(s, "gather", [1, 2], [1.0, 2.0], [1e-1, 1e-4], [1, 1]) for s in error.SCENES]
    slow = [error.Curve(s, error.PEER, [1, 2], [40.0, 80.0], [1e-1, 1e-4], [1, 1]) for s in error.SCENES]
    never = [error.Curve(s, error.PEER, [1], [9.0], [1e-1], [1]) for s in error.SCENES]
    assert all(t.value == pytest.approx(0.025) and t.ok for t in error.against_peer(ours, slow))
    bounds = error.against_peer(ours, never)
    assert all(t.value == pytest.approx(ours[0].time_to(e[2]) / 9) for t, e in zip(bounds, error.TARGETS, strict=True))
    assert "did not reach" in bounds[0].line()
    assert all(math.isinf(t.value) and not t.ok for t in error.against_peer(never, slow))
