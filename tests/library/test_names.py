"""Settings by short names, and values as Python has them."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import SettingError
from pmviewer.library.names import MEANT, changed_by, path_of
from pmviewer.settings.access import SETTINGS, Settings


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("photons.N", "photons.N"),
        ("N", "photons.N"),
        ("q", "photons.q"),
        ("k", "estimate.k"),
        ("radius", "estimate.radius"),
        ("alpha", "estimate.alpha"),
        ("method", "render.method"),
        ("seed", "render.seed"),
        ("width", "camera.width"),
        ("caustic.show", "overlays.caustic.show"),
    ],
)
def test_names_are_found(name, path):
    assert path_of(name) == path


def test_names_that_are_meant_are_ambiguous_and_there():
    for name, path in MEANT.items():
        assert path in SETTINGS
        assert len([other for other in SETTINGS if other.endswith(f".{name}")]) > 1


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("roulette", "may be photons.roulette or gather.roulette"),
        ("n", "no setting 'n'"),
        ("radiu", "Did you mean"),
        ("", "no setting"),
        ("estimate", "no setting"),
    ],
)
def test_other_names_are_one_error(name, said):
    with pytest.raises(SettingError, match=said):
        path_of(name)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("N", np.int64(5), 5),
        ("N", 2e5, 200_000),
        ("N", "2e5", 200_000),
        ("q", np.float32(0.5), 0.5),
        ("q", "0.25", 0.25),
        ("radius", "auto", "auto"),
        ("indirect_caustics", False, False),
        ("indirect_caustics", "false", False),
        ("origin", np.array([1.0, 2.0, 3.0]), (1.0, 2.0, 3.0)),
        ("origin", "1 2 3", (1.0, 2.0, 3.0)),
        ("name", "2e5", "2e5"),
    ],
)
def test_values_of_python_and_texts(name, value, expected):
    changed = changed_by(Settings(), {name: value})
    group, last = path_of(name).split(".")
    assert getattr(getattr(changed, group), last) == expected


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"N": True}, "photons.N = True is not allowed: expected a whole number from"),
        ({"q": 2}, "photons.q = 2 is not allowed"),
        ({"q": None}, "photons.q"),
        ({"q": float("nan")}, "photons.q"),
        ({"origin": [1, 2]}, "three numbers"),
        ({"method": "radiosity"}, "one of progressive"),
        ({"N": 10, "photons.N": 20}, "given twice"),
    ],
)
def test_what_is_not_allowed_is_one_error(values, said):
    with pytest.raises(SettingError, match=said):
        changed_by(Settings(), values)
