"""Compiling ahead: what is prepared is what the passes then run, and nothing twice."""

from __future__ import annotations

import gc
from typing import Any

import numba
import pytest
from numba.core.registry import CPUDispatcher

from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.prepare import prepare, steps_of, types_of
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.pass_data import blank_eye, blank_pass
from pmviewer.engine.store import StageStore
from pmviewer.render.record import Evaluation, eye_record
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import cornell_box

GATHER = {"render.method": "gather"}
VIRTUAL = {"render.method": "virtual lights", "virtual.number": 20, "virtual.photons": 500}
VARIANTS: dict[str, dict[str, object]] = {
    "path": {"render.method": "path"},
    "progressive": {},
    "caustic map": {"render.method": "caustic map"},
    "nearest": {"estimate.lookup": "nearest"},
    "hull": {"estimate.area": "convex hull"},
    "differential, nearest": {"estimate.differential": True, "estimate.lookup": "nearest"},
    "pixel radii": {"estimate.radius_rule": "pixel"},
    "gather": GATHER,
    "radiance photons": GATHER | {"gather.radiance_photons": "1/4"},
    "radiance photons, nearest": GATHER | {"gather.radiance_photons": "1/4", "estimate.lookup": "nearest"},
    "guided, corners": GATHER | {"gather.directions": "photon cones", "gather.secondary": 1.0},
    "hemisphere grid": GATHER | {"gather.directions": "hemisphere grid"},
    "irradiance cache": GATHER | {"gather.cache": "on"},
    "gather estimation": GATHER | {"gather.estimation": "on"},
    "gather reprojection": GATHER | {"gather.estimation": "on", "gather.reprojection": "on"},
    "virtual lights": VIRTUAL,
    "virtual lights, paths": VIRTUAL | {"virtual.estimator": "every vertex"},
    "shadow photons": {"direct.shadow_photons": True},
    "projection": {"photons.projection": "on", "photons.q": 0.5},
    "importance": {"importance.map": "screen", "importance.deposition": "density control"},
    "guided emission": {"importance.map": "footprint", "importance.emission": "Christensen keep"},
}


@pytest.fixture(scope="module")
def box() -> OpenScene:
    return open_scene(cornell_box(size=8))


def settings_of(variant: str) -> Settings:
    return with_values(Settings(), {"photons.N": 3000, "importance.N": 500, **VARIANTS[variant]})


@pytest.mark.extensive
@pytest.mark.parametrize("variant", VARIANTS)
def test_blank_records_have_the_types_of_a_pass(variant, box, pool):
    settings = settings_of(variant)
    renderer = Renderer(box, settings, pool, StageStore(0))
    renderer.step()
    blank = blank_pass(box.flat.record, settings, plan_of(settings, box.traits))
    assert types_of(blank) == types_of(renderer.latest.given)


@pytest.mark.parametrize(
    "values",
    [
        {"camera.aperture": 0.1},
        {"render.filter": "Lanczos"},
        {"camera.aperture": 0.1, "render.filter": "box", "render.filter_radius": 1.0},
        {"camera.aperture": 0.1, "free_camera.on": True},
        {"render.filter": "box"},
    ],
)
def test_blank_eyes_have_the_types_of_lens_and_filter(values, box, pool):
    settings = with_values(Settings(), values)
    renderer = Renderer(box, settings, pool, StageStore(0))
    evaluated = Evaluation(splits=2, several=True)
    assert blank_eye(settings, renderer.plan).dtype == eye_record(renderer.camera, settings, 0, evaluated).dtype


def signatures() -> set[tuple[str, Any]]:
    """Of everything that is compiled in this process."""
    compiled = [f for f in gc.get_objects() if issubclass(type(f), CPUDispatcher)]
    return {(f"{f.py_func.__module__}.{f.py_func.__name__}", s) for f in compiled for s in f.signatures}


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize(
    "variant",
    [
        "progressive",
        "radiance photons",
        pytest.param("radiance photons, nearest", marks=pytest.mark.extensive),
        "guided emission",
        "virtual lights",
    ],
)
def test_the_large_kernels_of_a_pass_were_prepared(variant, box, pool):
    """Nothing that takes the eye's or the light pass's record compiles later."""
    settings = settings_of(variant)
    prepare(box, settings, pool, lambda text, share: None)
    before = signatures()
    renderer = Renderer(box, settings, pool, StageStore(0))
    renderer.step()
    late = {name for name, _ in signatures() - before}
    assert not {name for name in late if name.startswith(("pmviewer.render.", "pmviewer.photons."))}, late


def test_each_step_is_made_once(box, pool):
    told: list[str] = []
    for variant in ("progressive", "gather", "progressive", "gather"):
        told.clear()
        prepare(box, settings_of(variant), pool, lambda text, share: told.append(text))
    assert told == []


def test_keys_tell_apart_what_is_compiled_apart(box):
    """By the types alone: N, radii and filters change no key, the look-up and the estimate do."""

    def eye_key(values: dict[str, object]) -> object:
        return steps_of(box, with_values(Settings(), values))[-1].key

    plain = eye_key({})
    same = eye_key({"photons.N": 7, "estimate.radius": 0.1, "estimate.filter": "cone", "render.seed": 5})
    assert same == plain
    others = [eye_key(VARIANTS[name]) for name in ("nearest", "hull", "pixel radii", "shadow photons")]
    assert len({plain, *others}) == 5
