"""The package as a reader meets it: modules that import in one direction, functions and files of a size to be read."""

from __future__ import annotations

import ast
import statistics
from collections.abc import Iterator
from functools import cache

from tests.support.sources import PACKAGE, package_files, parsed, statements, within

MOST_PARAMETERS, MOST_LINES, MEDIAN_FILE, LONGEST_FILE = 12, 100, 130, 500


@cache
def modules() -> dict[str, ast.Module]:
    """Every module of the package by its name without `pmviewer.`, parsed."""
    found = {}
    for file in package_files():
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = parsed(file)
    return found


@cache
def functions() -> list[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Every function of the package, with its module's name before its own."""
    return [
        (f"{module}.{node.name}", node)
        for module, tree in modules().items()
        for node in statements(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]


def imports(tree: ast.AST) -> Iterator[str]:
    """Modules of the package that running this code imports, within functions too; not what type checkers alone see."""
    for node in within(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            for other in node.orelse:
                yield from imports(ast.Module([other], []))
        elif isinstance(node, ast.Import):
            yield from (_inner(alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = _inner(node.module)
            for alias in node.names:
                submodule = f"{inner}.{alias.name}".lstrip(".")
                yield submodule if submodule in modules() else inner
        else:
            yield from imports(node)


def _inner(name: str) -> str:
    return name.removeprefix("pmviewer").removeprefix(".") if name.split(".")[0] == "pmviewer" else "-"


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Sets of modules that reach each other (Tarjan's strongly connected components of more than one)."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        number[name] = low[name] = len(number)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in number:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], number[other])
        if low[name] == number[name]:
            circle = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(circle) > 1:
                found.append(sorted(circle))

    for name in graph:
        if name not in number:
            visit(name)
    return found


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    a = function.args
    return len(a.posonlyargs) + len(a.args) + len(a.kwonlyargs) + (a.vararg is not None) + (a.kwarg is not None)


def test_circles_are_found():
    """Of the check itself: two that import each other, over a third."""
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []
    tree = ast.parse(
        "if TYPE_CHECKING:\n    import pmviewer.engine\ndef f():\n    from pmviewer.engine import session\n"
    )
    assert set(imports(tree)) == {"engine.session"}


def test_no_module_imports_itself_over_others():
    graph = {
        name: {other for other in imports(tree) if other in modules()} - {name} for name, tree in modules().items()
    }
    assert sum(map(len, graph.values())) > len(graph), "imports are read"
    assert circles(graph) == []


def test_no_function_has_too_many_parameters():
    """A command's are the options of its command line."""
    many = {name for name, function in functions() if parameters(function) > MOST_PARAMETERS}
    assert {name for name in many if not name.startswith("commands.")} == set()


def test_no_function_is_too_long():
    long = {name for name, f in functions() if (f.end_lineno or 0) - f.lineno + 1 > MOST_LINES}
    assert long == set()


def test_files_have_a_size_to_be_read():
    lines = {str(file.relative_to(PACKAGE)): file.read_bytes().count(b"\n") for file in package_files()}
    assert {name: n for name, n in lines.items() if n > LONGEST_FILE} == {}
    assert statistics.median(lines.values()) <= MEDIAN_FILE


def undocumented(trees: dict[str, ast.Module]) -> set[str]:
    """Public functions, methods and classes without a docstring. Public is what no underscore begins, at the top of a
    module or in a public class. A method that overrides one that a base class of the package documents is documented
    there; setters by their property."""
    classes: dict[str, list[ast.ClassDef]] = {}
    for tree in trees.values():
        for node in statements(tree):
            if isinstance(node, ast.ClassDef):
                classes.setdefault(node.name, []).append(node)

    def bases(owner: ast.ClassDef) -> Iterator[ast.ClassDef]:
        for base in owner.bases:
            base = base.value if isinstance(base, ast.Subscript) else base
            name = base.attr if isinstance(base, ast.Attribute) else getattr(base, "id", "")
            for found in classes.get(name, []):
                if found is not owner:
                    yield found
                    yield from bases(found)

    def is_inherited(name: str, owner: ast.ClassDef) -> bool:
        return any(
            isinstance(node, ast.FunctionDef) and node.name == name and ast.get_docstring(node)
            for base in bases(owner)
            for node in base.body
        )

    def missing(body: list[ast.stmt], where: str, owner: ast.ClassDef | None = None) -> Iterator[str]:
        for node in body:
            if isinstance(node, ast.If | ast.Try):
                yield from missing([*node.body, *node.orelse], where, owner)
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) or node.name[0] == "_":
                continue
            is_setter = any(isinstance(d, ast.Attribute) and d.attr == "setter" for d in node.decorator_list)
            if not (ast.get_docstring(node) or is_setter or (owner and is_inherited(node.name, owner))):
                yield f"{where}.{node.name}"
            if isinstance(node, ast.ClassDef):
                yield from missing(node.body, f"{where}.{node.name}", node)

    return {name for module, tree in trees.items() for name in missing(tree.body, module)}


def test_undocumented_is_found():
    """Of the check itself."""
    tree = ast.parse("""
class Base:
    "A base."
    def said(self): "What it is for."
    def unsaid(self): ...
class Child(Base):
    "Its child."
    def said(self): ...
    def unsaid(self): ...
    def _private(self): ...
class _Hidden:
    def hidden(self): ...
def plain(): ...
def said():
    "Documented."
    def inner(): ...
""")
    assert undocumented({"m": tree}) == {"m.Base.unsaid", "m.Child.unsaid", "m.plain"}


def test_everything_public_is_documented():
    assert undocumented(modules()) == set()
