"""What benches found, kept in files: one JSON a bench, from which a report is written at any time."""

from __future__ import annotations

import hashlib
import json
import platform
import subprocess
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from pmviewer.bench.report import BenchResult, Target
from pmviewer.errors import OutputError, SceneError
from pmviewer.output.files import read_file, write_file
from pmviewer.progress import available_threads
from pmviewer.resources import PACKAGE
from pmviewer.version import __version__

PACKAGES = ("numpy", "numba", "llvmlite", "scipy", "mitsuba", "embreex", "pyoidn", "moderngl", "imgui-bundle")


@dataclass(frozen=True)
class Kept:
    """A bench's name, its result, None where it has `failed` (and why), and the seconds that it took."""

    name: str
    result: BenchResult | None
    failed: str
    seconds: float
    quick: bool
    revision: str


def save(folder: Path, kept: Kept) -> None:
    """Write it as NAME.json. Raises OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: the folder can't be made ({error.strerror}).") from None
    write_file(folder / f"{kept.name}.json", json.dumps(asdict(kept), default=float).encode(), (".json",))


def load(folder: Path, names: Iterable[str]) -> list[Kept]:
    """What there is of these benches, in their order. Raises SceneError for files that hold something else."""
    found = []
    for name in names:
        path = folder / f"{name}.json"
        if path.is_file():
            found.append(_read(path))
    return found


def _read(path: Path) -> Kept:
    try:
        tree: dict[str, Any] = json.loads(read_file(path))
        result = tree["result"]
        if result is not None:
            targets = [Target(**target) for target in result["targets"]]
            result = BenchResult(**{**result, "targets": targets})
        return Kept(**{**tree, "result": result})
    except (ValueError, KeyError, TypeError) as error:
        raise SceneError(f"This is no result of a bench ({error}).", path) from None


def machine() -> list[str]:
    """Processor, threads, system, versions."""
    versions = [f"Python {platform.python_version()}"]
    for package in PACKAGES:
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            continue
    return [
        f"processor: {_processor()}, {available_threads()} threads",
        f"system: {platform.system()} {platform.machine()}",
        f"pmviewer {__version__}, revision {revision() or 'unknown'}; {', '.join(versions)}",
    ]


def revision() -> str:
    """Of the sources, "" where they are no checkout."""
    command = ["git", "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def sources_stamp() -> str:
    """Changes with any source file of the package."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
