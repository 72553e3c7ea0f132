"""Dispersion as scenes say it: glasses, equations, Abbe's number; the spectrum that wavelengths come from (T10)."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.arrays.material_row import is_plain
from pmviewer.scene.cie import integrated
from pmviewer.scene.describe import describe
from pmviewer.scene.description import Material
from pmviewer.scene.dispersion import GLASSES, Dispersion, by_abbe, glass_named
from pmviewer.scene.editing.apply import edited
from pmviewer.scene.formats.gltf.transmission import _dispersion
from pmviewer.scene.spectrum import channel_indices, indices, over_spectrum, shown_colours, spectrum
from tests.scene.test_scene_materials import material
from tests.support.dispersive import SCHOTT, lit_sphere

DATA_SHEETS = {
    "BK7": (1.51680, 64.17),
    "F2": (1.62004, 36.37),
    "SF10": (1.72828, 28.53),
    "SF11": (1.78472, 25.68),
    "fused silica": (1.45846, 67.82),
    "water": (1.33336, 55.8),
    "diamond": (2.4175, 55.3),
}
"""n_d and Abbe's number as published."""


@pytest.mark.parametrize("name", DATA_SHEETS)
def test_glasses_have_their_published_numbers(name):
    n_d, abbe = DATA_SHEETS[name]
    glass = glass_named(name)
    assert glass is not None
    assert glass.n_d == pytest.approx(n_d, abs=1e-4)
    assert glass.abbe == pytest.approx(abbe, rel=2e-3)
    assert glass.problem == ""


def test_names_are_forgiving():
    assert glass_named("n-sf11") == glass_named("N_SF11") or glass_named("N-SF11") == GLASSES["sf11"]
    assert glass_named("Fused_Quartz") == GLASSES["fused silica"]
    assert glass_named("unobtainium") is None


def test_abbes_number_gives_cauchys_equation():
    glass = by_abbe(1.6, 30.0)
    line = {name: float(glass.index(nm)) for name, nm in (("F", 486.1327), ("d", 587.5618), ("C", 656.2725))}
    assert line["d"] == pytest.approx(1.6)
    assert (line["d"] - 1) / (line["F"] - line["C"]) == pytest.approx(30.0)


def test_all_wavelengths_together_are_white_and_none_is_negative():
    """By a fine Riemann sum of the joined lines, not by the function that normalised them."""
    nm, colours = spectrum()[:, 0], spectrum()[:, 1:]
    u = (np.arange(1_000_000) + 0.5) / 1_000_000
    mean = [np.interp(u, np.linspace(0, 1, len(nm)), colours[:, k]).mean() for k in range(3)]
    assert mean == pytest.approx([1, 1, 1], abs=1e-6)
    assert (colours >= 0).all()
    assert (np.diff(nm) > 0).all()
    assert over_spectrum(np.ones((len(nm), 1))) == pytest.approx([1.0])
    assert shown_colours().max(axis=1) == pytest.approx(1.0)


def test_wavelengths_are_drawn_by_their_share_of_white():
    """χ² of u's wavelengths over 35 bins of 10 nm against the mean of the three channels of daylight, negative parts
    left out, each channel scaled to 1: from the reader of spectra that Mitsuba's files go through."""
    edges = np.arange(380, 731, 10.0)
    parts = []
    for low, high in pairwise(edges):
        fine = np.linspace(low, high, 41)
        parts.append(
            np.mean(
                [np.maximum(integrated(lambda nm, c=c: np.exp(-0.5 * ((nm - c) / 0.6) ** 2), True), 0) for c in fine],
                axis=0,
            )
        )
    share = np.array(parts) / np.sum(parts, axis=0)
    p = share.mean(axis=1)
    N = 20_000
    u = np.random.default_rng(4).random(N)
    drawn = np.interp(u, np.linspace(0, 1, len(spectrum())), spectrum()[:, 0])
    counts, expected = np.histogram(drawn, edges)[0], N * p
    kept = expected > 5
    chi2 = ((counts[kept] - expected[kept]) ** 2 / expected[kept]).sum()
    assert chi2 < 65  # 34 degrees of freedom: p = 0.001 at 65.2
    # The mean wavelength and its spread, too: what a wrong density shifts most.
    middle = (edges[:-1] + edges[1:]) / 2
    assert drawn.mean() == pytest.approx((p * middle).sum(), abs=2.5)


def test_indices_are_relative_to_the_outside():
    """The scene's eta is n_d against the outside, and all others follow; channels' means lie in their order."""
    glass = GLASSES["sf11"]
    (b, c), nm = SCHOTT["SF11"], spectrum()[:, 0]
    x = (nm / 1000) ** 2
    n = np.sqrt(1 + sum(bi * x / (x - ci) for bi, ci in zip(b, c)))
    assert indices(glass, glass.n_d / 1.33) == pytest.approx(n / 1.33, rel=1e-6)
    red, green, blue = channel_indices(glass, glass.n_d)
    assert 1.77 < red < green < blue < 1.83


def glass_of(tmp_path: Path, inside: str, kind: str = "dielectric") -> tuple[Material, tuple[str, ...]]:
    return material(tmp_path, f'<bsdf type="{kind}">{inside}</bsdf>')


def test_files_name_glass_or_give_its_numbers(tmp_path):
    sf11, warnings = glass_of(tmp_path, '<string name="glass" value="SF11"/><float name="ext_ior" value="1"/>')
    assert sf11.dispersion == GLASSES["sf11"]
    assert sf11.eta == pytest.approx(1.78472, abs=1e-5)
    assert not is_plain(sf11)
    assert warnings == ()
    cauchy, warnings = glass_of(
        tmp_path, '<float name="cauchy_a" value="1.5"/><float name="cauchy_b" value="0.01"/>', "roughdielectric"
    )
    assert cauchy.kind == "rough dielectric"
    assert cauchy.dispersion is not None
    assert float(cauchy.dispersion.index(500.0)) == pytest.approx(1.5 + 0.01 / 0.25)
    assert warnings == ()
    three = (
        '<string name="sellmeier_b" value="1.03961212, 0.231792344, 1.01046945"/>'
        '<string name="sellmeier_c" value="0.00600069867 0.0200179144 103.560653"/>'
    )
    assert glass_of(tmp_path, three)[0].dispersion == replace(GLASSES["bk7"], name="")
    flint, warnings = glass_of(tmp_path, '<float name="int_ior" value="1.62"/><float name="abbe" value="36"/>')
    assert flint.dispersion is not None
    assert (flint.dispersion.n_d, flint.dispersion.abbe) == pytest.approx((1.62, 36.0))
    assert warnings == ()


@pytest.mark.parametrize(
    ("inside", "disperses", "sentence"),
    [
        ('<float name="abbe" value="0"/>', False, "is 0, less than 1: it does not disperse light"),
        ('<float name="abbe" value="-20"/>', False, "is -20, less than 1"),
        ('<string name="glass" value="jelly"/>', False, "'jelly' is none of BK7, F2"),
        ('<string name="sellmeier_b" value="1 2"/>', False, "as many numbers"),
        ('<float name="cauchy_b" value="0.01"/>', False, "without 'cauchy_a'"),
        (
            '<float name="cauchy_a" value="1.5"/><float name="cauchy_b" value="-0.01"/>',
            True,
            "bends red more than blue",
        ),
        ('<float name="cauchy_a" value="1.5"/><float name="cauchy_b" value="-0.2"/>', True, "between 380 and 6"),
        ('<float name="cauchy_a" value="0.5"/><float name="cauchy_b" value="0.001"/>', True, "between 380 and 730 nm"),
        ('<float name="cauchy_a" value="1.5"/><float name="cauchy_b" value="9"/>', True, "it is cut to that"),
        ('<string name="glass" value="F2"/><float name="abbe" value="30"/>', True, "the first is used"),
    ],
)
def test_hostile_numbers_are_cut_or_left_out_with_a_sentence(tmp_path, inside, disperses, sentence):
    made, warnings = glass_of(tmp_path, inside)
    assert made.disperses == disperses
    assert any(sentence in warning for warning in warnings), warnings
    if made.dispersion is not None:
        table = indices(made.dispersion, made.eta)
        assert np.isfinite(table).all()
        assert table.min() > 0


def test_a_pole_inside_the_visible_is_cut():
    table = indices(Dispersion("sellmeier", (1.0, 0.25)), 1.5)
    assert np.isfinite(table).all()
    assert Dispersion("sellmeier", (1.0, 0.25)).problem


def test_gltf_gives_twenty_over_abbes_number(tmp_path):
    from pmviewer.scene.diagnostics import Diagnostics
    from pmviewer.scene.formats.gltf.fields import Fields

    row = json.loads('{"extensions": {"KHR_materials_dispersion": {"dispersion": 0.5}}}')
    found = _dispersion(Fields(row, "glass", Diagnostics()), 1.5)
    assert found is not None
    assert found.abbe == pytest.approx(40.0)
    assert _dispersion(Fields({}, "glass", Diagnostics()), 1.5) is None


def test_dispersion_is_edited_and_told():
    scene = lit_sphere(GLASSES["sf11"])
    text = dict(describe(scene))["materials"]
    assert "glass: SF11, n_d 1.785, Abbe number 25.7" in text
    clear = edited(scene, {"material.glass.dispersion": (0.0,)})
    assert clear.materials[1].dispersion is None
    strong = edited(scene, {"material.glass.dispersion": (2.0,)}).materials[1].dispersion
    assert strong is not None
    assert strong.abbe == pytest.approx(10.0)
