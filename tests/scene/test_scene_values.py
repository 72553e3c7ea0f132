"""Numbers, vectors, colours: what is read and what is refused."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba import values as values
from pmviewer.scene.formats.mitsuba.expand import Expansion
from pmviewer.scene.formats.mitsuba.folders import Folders
from pmviewer.scene.formats.mitsuba.transform import OPERATIONS, operation
from pmviewer.scene.formats.mitsuba.xml import Element, parse_xml

PARSERS = [
    values.parse_float,
    values.parse_integer,
    values.parse_boolean,
    values.parse_vector,
    values.parse_rgb,
    values.parse_srgb,
    values.parse_list,
]


def outcome(call, error: type[Exception]):
    """What the call returns, or the one kind of error that it may raise."""
    try:
        return call()
    except error as raised:
        return raised


@pytest.mark.parametrize("text", ["1", " -2.5 ", "+.5", "1e3", "1.", "6.02E-23"])
def test_numbers_are_read_as_python_reads_them(text: str) -> None:
    assert values.parse_float(text) == float(text)


@pytest.mark.parametrize("text", ["", "nan", "inf", "1_000", "0x10", "1.2.3", "1e31", "٣", "1 2", "--1"])
def test_what_is_not_a_finite_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected a number"):
        values.parse_float(text)


def test_one_number_stands_for_three_and_commas_separate() -> None:
    assert values.parse_vector("2") == (2, 2, 2)
    assert values.parse_rgb("0.1, 0.2 ,0.3") == (0.1, 0.2, 0.3)
    with pytest.raises(ValueError, match="expected 1 or 3 numbers, found 2"):
        values.parse_rgb("1 2")


def test_srgb_is_decoded() -> None:
    assert values.parse_srgb("#ffffff") == (1, 1, 1)
    # The standard's own example: half of the code range is 21.4 % of the light.
    assert values.parse_srgb("0.5 0 1") == pytest.approx((0.21404, 0, 1), abs=1e-5)
    with pytest.raises(ValueError, match="between 0 and 1"):
        values.parse_srgb("1.5 0 0")


def test_samples_of_a_spectrum_are_sorted() -> None:
    assert values.parse_samples("700:2, 400:1 500:3") == ([400, 500, 700], [1, 3, 2])
    with pytest.raises(ValueError, match="two wavelengths or more"):
        values.parse_samples("400:2")
    with pytest.raises(ValueError, match="expected wavelength:value pairs, found '7'"):
        values.parse_samples("400:2 7")


def test_whole_numbers_and_truth_are_read_as_people_write_them() -> None:
    assert values.parse_integer("64.0") == 64
    assert values.parse_boolean("TRUE") is values.parse_boolean("1") is True
    with pytest.raises(ValueError, match="whole number"):
        values.parse_integer("64.5")
    with pytest.raises(ValueError, match="true or false"):
        values.parse_boolean("yes")


@given(st.floats(-1e30, 1e30))
def test_every_number_survives_writing_and_reading(number: float) -> None:
    assert values.parse_float(repr(number)) == number


@given(st.text(), st.sampled_from(PARSERS))
def test_random_text_gives_a_value_or_a_value_error(text, parse) -> None:
    result = outcome(lambda: parse(text), ValueError)
    if isinstance(result, ValueError):
        assert "expected" in str(result)
    else:
        assert all(math.isfinite(x) for x in (result if isinstance(result, tuple | list) else [result]))


@given(
    st.sampled_from(OPERATIONS),
    st.dictionaries(
        st.sampled_from(["value", "x", "y", "z", "angle", "origin", "target", "up"]),
        st.text("0123456789.,-+e: ", max_size=40),
    ),
)
def test_random_transformations_give_a_matrix_or_a_value_error(tag, attributes) -> None:
    result = outcome(lambda: operation(Element(tag, attributes, 1)), ValueError)
    if isinstance(result, ValueError):
        assert "expected" in str(result)
    else:
        assert result.shape == (4, 4)


@given(st.binary(max_size=200))
def test_random_bytes_as_xml_give_a_tree_or_a_scene_error(data: bytes) -> None:
    result = outcome(lambda: parse_xml(data), SceneError)
    assert result.what if isinstance(result, SceneError) else result.line >= 1


@given(st.text("$ab\\ ", max_size=20), st.dictionaries(st.sampled_from(["a", "b", "ab"]), st.text("$xy", max_size=5)))
def test_random_parameters_are_all_replaced_or_named(text, parameters) -> None:
    root = Element("scene", {"value": text, "version": "3.0.0"}, 1)
    diagnostics = Diagnostics()
    expansion = Expansion(parameters, Folders(Path()), diagnostics)
    expansion.expand(root, None)
    assert expansion.used <= parameters.keys()
    if "\\" not in text and not any("$" in value for value in parameters.values()):
        assert ("$" in root.attributes["value"]) == bool(diagnostics.warnings())
