"""Every source and every id that the code names is listed in docs/references.md."""

from __future__ import annotations

import functools
import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIST = (ROOT / "docs" / "references.md").read_text("utf-8")
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in LIST.splitlines() if line.startswith("| ")]
NAMES = [row[0] for row in ROWS]
"""Short names and ids."""
NOT_IDS = {"X11"}
"""What looks like an id of a feature or target and is something else."""

ID = re.compile(r"(?<![\w.×/-])([TMERIVXP]\d{1,2})(?:[–-]([TMERIVXP])?(\d{1,2}))?(?![\w.])")
NAME = r"[A-ZÀ-Ž][\w’'-]*[a-zà-ž](?:-[A-Z][a-z]+)?"
CITED = re.compile(
    rf"({NAME})((?:, {NAME})*(?:,? (?:and|&) {NAME}| and others| et al\.)?),? \(?((?:19|20)\d\d)(?![\d-])"
)
TITLED = re.compile(r'"([A-Z][^"]{9,})"[^"]{0,40}?\(?\b((?:19|20)\d\d)\b')
SECTION = re.compile(r"([\w.]+(?: \w+)?),? §")
MONTHS = {"January", "July"}
"""In dates of daylight."""


@functools.cache
def texts() -> list[tuple[str, str]]:
    """Comments and strings of the package, one run of comment lines or one string each, white space folded."""
    found = []
    for path in sorted((ROOT / "pmviewer").rglob("*.py")):
        run: list[str] = []
        pieces: list[str] = []
        for token in tokenize.generate_tokens(io.StringIO(path.read_text("utf-8")).readline):
            if token.type == tokenize.COMMENT:
                run.append(token.string.lstrip("# "))
            elif token.type == tokenize.STRING:
                run.append(token.string.strip("rbf\"'"))
            elif token.type not in (tokenize.NL, tokenize.INDENT, tokenize.DEDENT) and run:
                pieces, run = [*pieces, " ".join(run)], []
        found += [(str(path.relative_to(ROOT)), " ".join(piece.split())) for piece in [*pieces, *run]]
    return found


def ids(text: str) -> set[str]:
    found = set()
    for first, letter, last in ID.findall(text):
        found.add(first)
        if last and (not letter or letter == first[0]):
            found |= {f"{first[0]}{i}" for i in range(int(first[1:]), int(last) + 1)}
    return found - NOT_IDS


def listed_ids() -> set[str]:
    return {name for cell in NAMES for name in re.findall(r"\b[TMERIVXP]\d{1,2}\b", cell)}


def test_ids_are_listed():
    used = {(where, name) for where, text in texts() for name in ids(text)}
    listed = listed_ids()
    assert len(used) > 40
    assert not {(where, name) for where, name in used if name not in listed}


def test_authors_and_years_are_listed():
    used = set()
    for where, text in texts():
        for first, others, year in CITED.findall(text):
            if first not in MONTHS:
                used.add((where, first.removesuffix("'s"), others, year))
    assert len(used) > 40
    missing = [cited for cited in used if not any(cited[1] in name and cited[3] in name for name in NAMES)]
    assert not missing


def test_titles_are_listed():
    listed = " ".join(LIST.lower().split())
    used = {(where, title) for where, text in texts() for title, _ in TITLED.findall(text)}
    assert len(used) > 5
    assert not [(where, title) for where, title in used if title.lower() not in listed]


def test_sections_are_of_listed_sources():
    """What stands before a § is a short name, or the end of one."""
    used = {(where, before) for where, text in texts() for before in SECTION.findall(text)}
    assert len(used) > 15
    known = {name.lower() for name in NAMES} | {re.sub(r" \d{4}.*", "", name).lower() for name in NAMES}
    for where, before in used:
        word = before.split()[-1]
        year = bool(re.fullmatch(r"(19|20)\d\d", word))  # with its author, tested above
        again = bool(re.fullmatch(r"§?[\d.]+", word)) or word in ("and", "eq", "in")  # a second section of the same
        assert year or again or any(name.endswith(before.lower()) or name == word.lower() for name in known), (
            where,
            before,
        )


@pytest.mark.parametrize("name", [name for name in NAMES if re.search(r"\d{4}$", name)])
def test_a_source_is_told_in_full(name):
    row = next(row for row in ROWS if row[0] == name)
    assert re.search(r"\*.+?\*", row[1]) or "standard" in row[1], "no title"
    assert NAMES.count(name) == 1
