"""The table of random dimensions: no two draws of a stream share one, and kernels draw by the table alone."""

from __future__ import annotations

import ast
import functools
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from pmviewer.kernels import dimensions
from pmviewer.kernels.dimensions import BOUNCE, DEPTH, DIMENSIONS, IMPORTON_DEPTH, LIGHT_SAMPLE, STREAMS
from pmviewer.settings.access import info_of
from tests.support.sources import PACKAGE, package_files, parsed

TABLE = "pmviewer.kernels.dimensions"
DRAWS = {"draw1", "draw4", "chain_numbers", "Sampler"}
"""What takes a dimension last; a `Sampler` hands its own on."""
SALTED = "hash3"


def largest(setting: str) -> int:
    value = info_of(setting).upper
    assert value is not None
    return int(value)


def lengths() -> dict[str | None, int]:
    depth = largest("render.max_depth")
    samples = largest("direct.con_samples") + largest("direct.noncon_samples")
    return {
        None: 1,
        DEPTH: depth,
        IMPORTON_DEPTH: 2 * depth + 2,
        BOUNCE: largest("photons.max_bounces"),
        LIGHT_SAMPLE: max(samples, largest("direct.samples")),
    }


@pytest.mark.parametrize("stream", STREAMS)
def test_the_ranges_of_a_stream_are_disjoint(stream):
    taken: dict[int, str] = {}
    for line in DIMENSIONS:
        if stream in line.streams:
            for i in range(lengths()[line.over]):
                at = line.first + line.stride * i
                assert 0 <= at < 2**31
                assert at not in taken, f"{stream}: {taken.get(at)} and {line.meaning} share dimension {at}"
                taken[at] = line.meaning
    assert taken


def test_every_stream_of_the_table_is_listed():
    assert {stream for line in DIMENSIONS for stream in line.streams} == set(STREAMS)


def test_kernels_know_dimensions_as_int64():
    named = [value for name, value in vars(dimensions).items() if isinstance(value, np.integer)]
    assert sorted(int(value) for value in named) == sorted(line.first for line in DIMENSIONS)
    assert all(type(value) is np.int64 for value in named)


def test_seeds_made_from_a_renders_by_exclusive_or_differ():
    """Photons, importons, test rays (traced as importons), importons scattered on, shadow photons, virtual lights: they
    draw the same dimensions."""
    d = dimensions
    seeds = [0, d.IMPORTON_SALT, d.TEST_RAY_SALT ^ d.IMPORTON_SALT, d.SCATTERED_SALT, d.SHADOW_SALT, d.VIRTUAL_SALT]
    assert len(set(seeds)) == len(seeds)


@functools.cache
def sources() -> list[tuple[Path, ast.Module]]:
    """Those that name what draws or salts."""
    names = (*DRAWS, SALTED)
    files = [p for p in package_files() if p.name not in ("random.py", "dimensions.py")]
    return [(p, parsed(p)) for p in files if any(name in p.read_text(encoding="utf-8") for name in names)]


def called(node: ast.Call) -> str:
    return node.func.id if isinstance(node.func, ast.Name) else ""


def assigned(function: ast.AST) -> dict[str, list[ast.expr]]:
    """What the local names of a function are assigned, tuples taken apart."""
    values = defaultdict(list)
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            if isinstance(target, ast.Name):
                values[target.id].append(value)
            elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                for one, element in zip(target.elts, value.elts, strict=False):  # a starred part is no dimension
                    if isinstance(one, ast.Name):
                        values[one.id].append(element)
    return values


def parameters(function: ast.FunctionDef | ast.Lambda) -> set[str]:
    return {argument.arg for argument in function.args.args}


def draws() -> list[tuple[str, ast.expr, dict[str, list[ast.expr]], set[str], set[str]]]:
    """Every draw of the package: where, its dimension, local values, parameters around it, names of the table."""
    found = []
    for path, tree in sources():
        table = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and node.module == TABLE
            for alias in node.names
        }
        if not any(isinstance(node, ast.Call) and called(node) in DRAWS for node in ast.walk(tree)):
            continue
        for function in (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.Lambda)):
            local = assigned(function) if isinstance(function, ast.FunctionDef) else {}
            for node in ast.walk(function):
                if isinstance(node, ast.Call) and called(node) in DRAWS:
                    where = f"{path.relative_to(PACKAGE)}:{node.lineno}"
                    found.append((where, node.args[-1], local, parameters(function), table))
    return found


def numbers(expression: ast.expr) -> list[object]:
    return [node.value for node in ast.walk(expression) if isinstance(node, ast.Constant)]


def named(expression: ast.expr, local: dict[str, list[ast.expr]], table: set[str]) -> bool:
    """Whether a dimension, or every value of the local name that it is, has a name of the table in it and no number."""
    if numbers(expression):
        return False
    names = {node.id for node in ast.walk(expression) if isinstance(node, ast.Name)}
    values = [value for name in names for value in local.get(name, [])]
    return bool(names & table) or (bool(values) and all(named(value, {}, table) for value in values))


def test_kernels_draw_by_the_table():
    everywhere = draws()
    assert len({where.split(":")[0] for where, *_ in everywhere}) > 10
    for where, dimension, local, given, table in everywhere:
        of_sampler = ast.unparse(dimension).split(" + ")[0] == "sampler.dimension" and "sampler" in given
        passed_on = of_sampler or (isinstance(dimension, ast.Name) and dimension.id in given)
        assert passed_on or named(dimension, local, table), f"{where}: {ast.unparse(dimension)} is not from the table"


def test_kernels_salt_seeds_by_the_table():
    for path, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and called(node) == SALTED:
                for argument in node.args:
                    inner = argument.args[0] if isinstance(argument, ast.Call) else argument
                    number = inner.value if isinstance(inner, ast.Constant) else 0
                    assert number == 0, f"{path.name}:{node.lineno}: {number} is not from the table"
