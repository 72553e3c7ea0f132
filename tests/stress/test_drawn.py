"""Settings and scenes at random: one film for any number of threads, finite views, a ledger that balances."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pmviewer.bench.stress import drawn
from pmviewer.bench.stress.drawn import PLAIN, STRUCTURAL, STRUCTURES, Spec, check, drawable, scene_of, value_of
from pmviewer.settings.access import SETTINGS

UNIT = st.floats(0, 1)
VALUES = st.fixed_dictionaries({info.path: UNIT.map(lambda u, info=info: value_of(info, u)) for info in drawable()})
PLACE = st.floats(-0.6, 0.6)
SPECS = st.builds(
    Spec,
    kind=st.integers(0, 2),
    size=st.floats(-6, 6),
    brightness=st.floats(-20, 20),
    albedo=st.sampled_from([0.0, 0.01, 0.5, 0.99, 1.0]),
    balls=st.lists(st.tuples(PLACE, PLACE, PLACE, st.floats(1e-4, 0.4), st.integers(0, 2)), max_size=4).map(tuple),
    eta=st.sampled_from([0.3, 0.999, 1.0, 1.5, 3.0]),
    points=st.sampled_from([1, 2, 20]),
    fov=st.floats(1, 170),
    width=st.integers(1, 12),
    height=st.integers(1, 12),
)


PLAIN_KERNELS = {
    "render.filter": "box",
    "render.filter_radius": "auto",
    "estimate.radius_rule": SETTINGS["estimate.radius_rule"].default,
    "render.lights": "shown",
    "render.splits": SETTINGS["render.splits"].default,
    "photons.maps": 1,
}
VARIANTS = {
    "progressive": {"estimate.radius_rule": "pixel"},
    "nearest": {"photons.maps": 3},
    "gather": {"render.filter": "Mitchell-Netravali"},
    "path": {"render.lights": "hidden"},
    "global map": {},
    "caustic map": {},
}
"""Of the settings that kernels are compiled for: one value a structure, one that another test has kernels for.
`bench stress` draws from all."""


@pytest.mark.parametrize("structure", PLAIN)
@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(values=VALUES, spec=SPECS)
def test_anything_the_schema_allows(structure, values, spec):
    chosen = PLAIN[structure] | PLAIN_KERNELS | VARIANTS[structure]
    assert check(scene_of(spec), drawn.settings_of(chosen, values, spec), views=structure != "nearest") == ""


def test_structures_are_settings():
    """A setting that is renamed is noticed here, not left out in silence."""
    assert set(SETTINGS) >= STRUCTURAL | set(PLAIN_KERNELS)
    assert {path for values in STRUCTURES.values() for path in values} <= set(SETTINGS)
    for name in STRUCTURES:
        drawn.settings_of(STRUCTURES[name], {}, Spec())


@pytest.mark.parametrize("u", [0.0, 0.1, 0.5, 1.0])
def test_drawn_values_are_allowed(u):
    values = {info.path: value_of(info, u) for info in drawable()}
    assert drawn.settings_of({}, values, Spec()).photons.N in (1, 2, 45, 2000)


def test_check_finds_what_is_wrong(monkeypatch):
    """Each promise, broken on purpose."""
    import numpy as np

    from pmviewer.engine.renderer import Renderer

    spec = Spec(kind=1)
    chosen = drawn.settings_of({}, {"photons.N": 100}, spec)
    assert check(scene_of(spec), chosen, views=False) == ""
    original = Renderer.step

    def poisoned(self):
        original(self)
        self.film.sums[0, 3] = np.nan

    def depends_on_threads(self):
        original(self)
        self.film.sums[0, 3] += self.pool.threads

    def leaks(self):
        original(self)
        self.tally.energy.sums[1] *= 0.9

    for step, said in ((poisoned, "not finite"), (depends_on_threads, "different films"), (leaks, "ledger misses")):
        monkeypatch.setattr(Renderer, "step", step)
        assert said in check(scene_of(spec), chosen, views=False)
