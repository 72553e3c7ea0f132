"""Bench results as text: TARGET lines, tables, CSV, Markdown."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pytest

from pmviewer.bench.report import BenchResult, Target, format_number, print_result, to_csv, to_markdown, to_text


@pytest.mark.parametrize(
    ("target", "line"),
    [
        (Target("P9", 87, 100, "ms", False), "TARGET P9 87 ms <= 100 ms ok"),
        (Target("P9", 187, 100, "ms", False), "TARGET P9 187 ms <= 100 ms short"),
        (Target("P9", 100, 100, "ms", False, "median"), "TARGET P9 100 ms <= 100 ms ok (median)"),
        (Target("P6", 1.3456, 1.2, "× Embree", True), "TARGET P6 1.35 × Embree >= 1.2 × Embree ok"),
        (Target("P7", 4.4, 5, "", True), "TARGET P7 4.40 >= 5 short"),
        (Target("P8", 3.6e6, 3.5e6, "photons/s", True), "TARGET P8 3600000 photons/s >= 3500000 photons/s ok"),
        (Target("P1", math.nan, 0.4, "s", False), "TARGET P1 nan s <= 0.4 s short"),
        (Target("P1", math.inf, 0.4, "s", False), "TARGET P1 inf s <= 0.4 s short"),
        (Target("P9", 100.004, 100, "ms", False), "TARGET P9 100.004 ms <= 100 ms short"),
        (Target("P6", np.float32(1.1999), 1.2, "", True), "TARGET P6 1.1999 >= 1.2 short"),
    ],
)
def test_target_line(target, line):
    assert target.line() == line
    assert target.ok == (" ok" in line)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (2.0, "2"),
        (9.996, "10.0"),
        (0.0123456, "0.0123"),
        (-3.14159, "-3.14"),
        (87.25, "87.2"),
        (999.6, "1000"),
        (12345.6, "12346"),
        (1e-5, "1e-05"),
        (1.234e-9, "1.23e-09"),
        (4.56789e9, "4.57e+09"),
        (math.inf, "inf"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert format_number(value) == text


@pytest.fixture
def result() -> BenchResult:
    rows = [["box", 1_000_000, 1.23456], ["a|b, c", np.int64(20), np.float32(0.5)], ["", 3, math.inf]]
    targets = [Target("P1", 0.3, 0.4, "s", False), Target("P2", 30.0, 20.0, "s", False, "box")]
    return BenchResult("Error against time", ["scene", "photons", "seconds"], rows, targets, ["two rounds"])


def test_table_is_aligned_with_numbers_to_the_right(result):
    assert to_text(result) == (
        "Error against time\n"
        "\n"
        "scene     photons  seconds\n"
        "──────  ─────────  ───────\n"
        "box     1 000 000     1.23\n"
        "a|b, c         20    0.500\n"
        "                3      inf\n"
        "\n"
        "note: two rounds\n"
        "TARGET P1 0.300 s <= 0.4 s ok\n"
        "TARGET P2 30 s <= 20 s short (box)\n"
    )


def test_printing_survives_a_terminal_without_unicode(result):
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    print_result(result, stream)
    assert b"TARGET P1 0.300 s <= 0.4 s ok\n" in raw.getvalue()


def test_printing_goes_to_standard_output(result, capsys):
    print_result(result)
    assert capsys.readouterr().out == to_text(result)


def test_csv_has_unrounded_numbers(result):
    rows = list(csv.reader(io.StringIO(to_csv(result))))
    assert rows == [
        ["scene", "photons", "seconds"],
        ["box", "1000000", "1.23456"],
        ["a|b, c", "20", "0.5"],
        ["", "3", "inf"],
    ]


def test_markdown_has_table_notes_and_targets(result):
    text = to_markdown(result)
    assert (
        "## Error against time\n\n| scene | photons | seconds |\n| --- | ---: | ---: |\n| box | 1 000 000 | 1.23 |"
        in text
    )
    assert "| a\\|b, c | 20 | 0.500 |" in text
    assert "\n- two rounds\n" in text
    assert "```\nTARGET P1 0.300 s <= 0.4 s ok\nTARGET P2 30 s <= 20 s short (box)\n```\n" in text


def test_a_row_with_a_missing_cell_is_refused():
    with pytest.raises(ValueError, match="a row has 1 cells for 2 columns"):
        BenchResult("x", ["a", "b"], [["1"]], [])


def test_empty_table_is_printed():
    assert to_text(BenchResult("x", ["a", "b"], [], [])) == "x\n\na  b\n─  ─\n"
