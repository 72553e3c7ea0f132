"""What compiled code depends on is read from the text of the sources: all that Python's own parser finds, and hardly
more."""

import ast

import pytest

from pmviewer.kernels.compile.sources import PACKAGE, imported_names, sources_of
from tests.support.sources import package_files, parsed, statements


def imports(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in statements(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names


def test_of_every_file_of_the_package():
    for file in package_files():
        ours = {name for name in imported_names(file.read_bytes()) if name.startswith(PACKAGE.name)}
        imported = {name for name in imports(parsed(file)) if name.startswith(PACKAGE.name)}
        # A docstring may show how the package is imported.
        assert imported <= ours <= imported | {PACKAGE.name}, file


@pytest.mark.parametrize(
    "source",
    [
        "import a.b as c, d",
        "from a.b import (\n    c as e,  # and (some) text\n    d,\n)\n",
        "def f():\n\tfrom a import b\n",
        "from a import b  # c\nimport d",
    ],
)
def test_of_every_way_to_write_an_import(source):
    assert imported_names(source.encode()) == imports(ast.parse(source))


def test_what_is_imported_by_what_is_imported_counts():
    reached = sources_of(PACKAGE / "engine" / "session.py")
    assert PACKAGE / "kernels" / "vector.py" in reached
    assert PACKAGE / "viewer" / "app.py" not in reached


@pytest.mark.parametrize("module", ["render/eye", "render/path", "photons/light_pass/trace", "importance/trace"])
def test_pictures_are_not_compiled_again_when_a_setting_or_the_description_of_scenes_changes(module):
    """Each variant of their kernels takes seconds to compile."""
    reached = {source.relative_to(PACKAGE).parts[0] for source in sources_of(PACKAGE / f"{module}.py")}
    assert "maps" in reached
    assert not reached & {"settings", "scene", "engine"}
