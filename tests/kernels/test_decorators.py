"""Device functions can't be called from Python: they say so instead of crashing."""

import shutil
import weakref

import pytest

from pmviewer.kernels.compile import sources
from pmviewer.kernels.compile.jit import CACHE_FOLDER, _OneFileEach, loaded, user_cache_root
from pmviewer.kernels.vector import dot
from tests.support import fresh


def test_device_function_called_from_python_is_an_error():
    with pytest.raises(TypeError, match="dot is a device function"):
        dot((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def test_compiled_code_is_kept_in_the_users_cache():
    assert CACHE_FOLDER.is_relative_to(user_cache_root())


def test_compiled_code_depends_on_what_its_module_imports_and_on_nothing_else():
    eye = {
        path.relative_to(sources.PACKAGE).as_posix() for path in sources.sources_of(sources.PACKAGE / "render/eye.py")
    }
    assert {"render/eye.py", "kernels/accel/bvh.py", "maps/search/grid.py", "kernels/compile/jit.py"} <= eye
    assert not {"render/path.py", "photons/light_pass/trace.py", "viewer/app.py"} & eye


def test_an_edit_in_an_imported_source_makes_compiled_code_stale(tmp_path):
    package = tmp_path / "pmviewer"
    shutil.copytree(sources.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    code = "from pathlib import Path; from pmviewer.kernels.compile.sources import stamp, PACKAGE as p; "
    code += (
        "print(stamp(p / 'render/eye.py'), stamp(p / 'photons/light_pass/trace.py'), stamp(p / 'kernels/vector.py'))"
    )

    def stamps() -> list[str]:
        return fresh.python(code, env={"PYTHONPATH": str(tmp_path)}).stdout.split()

    before = stamps()
    (package / "maps" / "search" / "grid.py").open("a").write("# edited\n")
    after = stamps()
    assert [a == b for a, b in zip(before, after, strict=True)] == [False, True, True]


def test_unwritable_cache_falls_back_to_the_temporary_folder(tmp_path):
    blocked = tmp_path / "file"
    blocked.touch()
    run = fresh.python(
        "from pmviewer.kernels.compile.jit import CACHE_FOLDER as c; print(c)",
        env={"PMVIEWER_CACHE": str(blocked), "TMPDIR": str(tmp_path)},
    )
    assert run.stdout.startswith(str(tmp_path / "pmviewer-kernels-"))


def test_a_copy_of_the_package_elsewhere_shares_compiled_code(tmp_path):
    package = tmp_path / "pmviewer"
    shutil.copytree(sources.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    code = "from pmviewer.kernels.vector import dot; print(dot._cache.cache_path)"

    def folder(path) -> str:
        return fresh.python(code, env={"PYTHONPATH": str(path)}).stdout

    assert folder(tmp_path) == folder(sources.PACKAGE.parent)


def test_two_signatures_saved_at_the_same_time_keep_their_own_code(tmp_path):
    """Both writers begin with an empty cache, as two processes do."""
    one, other = (_OneFileEach(str(tmp_path), "name", "stamp") for _ in range(2))
    one.save("first", 1)
    other.save("second", 2)
    reader = _OneFileEach(str(tmp_path), "name", "stamp")
    assert (reader.load("first"), reader.load("second"), reader.load("third")) == (1, 2, None)


def test_counting_what_is_loaded_passes_over_references_to_what_has_gone():
    class Gone:
        pass

    gone = Gone()
    proxy = weakref.proxy(gone)
    before = loaded()
    del gone
    assert loaded() == before
    with pytest.raises(ReferenceError):
        isinstance(proxy, Gone)
