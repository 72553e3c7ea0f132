"""Set up and start from a bare checkout: `python3 -m pmviewer.launch` opens the window, `… launch test` runs the tests.

`… launch setup` installs everything and compiles what the window's first clicks need; `--without-kernels` leaves that
to the first start.

Uses the standard library alone. Makes a virtual environment in `.venv`, installs pmviewer into it, and sees to the
system's OpenGL packages: as root on Debian or Ubuntu it installs what is missing, otherwise it says what to install.
"""

from __future__ import annotations

import ctypes.util
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from pmviewer.installing import install_with_pip, install_with_uv, to_bytecode

ROOT = Path(__file__).resolve().parent.parent
MOST_PROCESSES = 4
"""For tests: each grows to some two gigabytes."""
USUAL, EVERYTHING = ["-m", "not extensive"], ["-m", ""]
"""Pytest's options for the tests that every change passes, and for all of them; a later -m counts instead."""
ALL = "--all"
ENVIRONMENT = Path(os.environ.get("PMVIEWER_VENV", ROOT / ".venv"))
SCENE = "cornell_caustic"
WITHOUT_KERNELS = "--without-kernels"

LIBRARIES = {
    "GL": "libgl1",
    "EGL": "libegl1",
    "gomp": "libgomp1",
    "X11": "libx11-6",
    "Xext": "libxext6",
    "Xcursor": "libxcursor1",
    "Xi": "libxi6",
    "Xrandr": "libxrandr2",
    "Xinerama": "libxinerama1",
}
"""Shared libraries that the window needs, and their Debian packages."""

DRIVER = "libgl1-mesa-dri"
TEST_PROGRAMS = {"Xvfb": "xvfb", "xauth": "xauth", "xdotool": "xdotool"}


def missing_packages(testing: bool) -> list[str]:
    """Debian packages that are not there yet."""
    missing = [package for library, package in LIBRARIES.items() if ctypes.util.find_library(library) is None]
    if missing or (testing and shutil.which("dpkg") and not _installed(DRIVER)):
        missing.append(DRIVER)
    if testing:
        missing += [package for program, package in TEST_PROGRAMS.items() if shutil.which(program) is None]
    return missing


def _installed(package: str) -> bool:
    return subprocess.run(["dpkg", "-s", package], capture_output=True, check=False).returncode == 0


def install_system_packages(packages: list[str]) -> None:
    """Install with apt-get when that is possible; otherwise say what to do and go on."""
    if not packages:
        return
    command = "apt-get install -y --no-install-recommends " + " ".join(packages)
    if shutil.which("apt-get") and getattr(os, "geteuid", lambda: 1)() == 0:
        print(f"installing system packages: {' '.join(packages)}", flush=True)
        quiet = {"DEBIAN_FRONTEND": "noninteractive", **os.environ}
        subprocess.run(["apt-get", "update", "-qq"], check=False, env=quiet, stdout=subprocess.DEVNULL)
        if subprocess.run([*command.split(), "-qq"], check=False, env=quiet, stdout=subprocess.DEVNULL).returncode == 0:
            return
    if sys.platform.startswith("linux"):
        print(f"Missing system libraries. On Debian or Ubuntu:  sudo {command}", file=sys.stderr)


def environment_python() -> Path:
    """The environment's interpreter; makes the environment when it is not there."""
    python = ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if python.exists():
        return python
    print(f"making a virtual environment in {ENVIRONMENT}", flush=True)
    made = subprocess.run([sys.executable, "-m", "venv", str(ENVIRONMENT)], check=False, capture_output=True, text=True)
    if made.returncode != 0:
        shutil.rmtree(ENVIRONMENT, ignore_errors=True)
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        install_system_packages([f"python{version}-venv"])
        if subprocess.run([sys.executable, "-m", "venv", str(ENVIRONMENT)], check=False).returncode != 0:
            sys.exit("Python can't make a virtual environment: install its venv module and run this again.")
    return python


def install(python: Path, extras: str) -> None:
    """Install the checkout in editable form, once for each state of `pyproject.toml`."""
    wanted = hashlib.sha256((ROOT / "pyproject.toml").read_bytes() + extras.encode()).hexdigest()
    stamp = ENVIRONMENT / f"pmviewer-{extras or 'base'}.stamp"
    if stamp.exists() and stamp.read_text() == wanted:
        return
    print("installing pmviewer and what it needs (up to a minute the first time)", flush=True)
    target = f"{ROOT}[{extras}]" if extras else str(ROOT)
    if not install_with_uv(python, target, ROOT, translate=not extras) and not install_with_pip(python, target, ROOT):
        sys.exit("pip could not install pmviewer: see its message above.")
    to_bytecode(python, ROOT / "pmviewer")
    stamp.write_text(wanted)


def side_by_side(options: list[str]) -> list[str]:
    """pytest's options for several processes, each with files of its own, in the order of `tests/conftest.py`: most of
    the time is single-threaded. One more than processors, since they wait: for windows, for each other's kernels. One
    process where the user asks for what has none: output, the debugger, a number of their own."""
    single = ("-s", "-n", "--pdb", "--capture", "--trace")
    if any(option.startswith(single) for option in options):
        return []
    return ["-n", str(min((os.cpu_count() or 1) + 1, MOST_PROCESSES)), "--dist", "loadfile", "--no-loadscope-reorder"]


def with_bytecode(environment: dict[str, str]) -> dict[str, str]:
    """The environment of tests, which start Python some hundred times: where the user wants no bytecode in the
    checkout, it lies in the environment's folder, or every start would translate all sources anew."""
    if environment.pop("PYTHONDONTWRITEBYTECODE", ""):
        environment.setdefault("PYTHONPYCACHEPREFIX", str(ENVIRONMENT / "bytecode"))
    return environment


def main(arguments: list[str]) -> int:
    """`[SCENE and options]`, `test [--all] [pytest options]` or `setup [--without-kernels]`."""
    if tuple(sys.version_info) < (3, 11):
        sys.exit(f"pmviewer needs Python 3.11 or newer; this is {sys.version.split()[0]}.")
    testing = arguments[:1] in (["test"], ["setup"])
    install_system_packages(missing_packages(testing))
    python = environment_python()
    install(python, "test" if testing else "")
    if arguments[:1] == ["setup"]:
        if WITHOUT_KERNELS in arguments:
            return 0
        print("compiling what the window's first clicks need (about a minute the first time)", flush=True)
        return subprocess.run([str(python), "-m", "pmviewer", "compile"], check=False, cwd=ROOT).returncode
    if testing:
        options = [argument for argument in arguments[1:] if argument != ALL]
        which = EVERYTHING if ALL in arguments else USUAL
        command = [str(python), "-m", "pytest", *which, *side_by_side(options), *options]
        return subprocess.run(command, check=False, cwd=ROOT, env=with_bytecode(dict(os.environ))).returncode
    return subprocess.run([str(python), "-m", "pmviewer", *(arguments or [SCENE])], check=False, cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
