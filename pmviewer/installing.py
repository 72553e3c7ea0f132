"""Commands that install into an environment, for `pmviewer.launch`. Uses the standard library alone.

uv fetches and unpacks packages side by side, in a fifth of the time of pip. It knows nothing of pip's configuration
(indexes, constraints, certificates), and is told what pip would do. Where it can't be had, or fails, pip installs.
"""

from __future__ import annotations

import ast
import os
import subprocess
from pathlib import Path

PIP = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
OPTIONS = {
    "index-url": "--default-index",
    "extra-index-url": "--index",
    "find-links": "--find-links",
    "constraint": "--constraints",
    "trusted-host": "--allow-insecure-host",
}
"""Of pip's configuration, and what uv calls them."""
AS_PIP = ["--index-strategy", "unsafe-best-match"]
"""pip takes the newest version of all indexes, not the first index that has one."""


def install_with_uv(python: Path, target: str, root: Path, translate: bool) -> bool:
    """Whether uv could install the editable `target`; `translate`: all modules to bytecode at once, not when they are
    first imported."""
    if subprocess.run([str(python), *PIP, "uv"], check=False, capture_output=True).returncode != 0:
        return False
    asked = subprocess.run(
        [str(python), "-m", "pip", "config", "list"], check=False, capture_output=True, text=True, cwd=root
    )
    options, environment = as_pip_is_set(asked.stdout if asked.returncode == 0 else "")
    command = [str(python), "-m", "uv", "pip", "install", "--quiet", "--python", str(python), *options]
    command += [*(["--compile-bytecode"] if translate else []), "--editable", target]
    made = subprocess.run(command, check=False, capture_output=True, cwd=root, env={**os.environ, **environment})
    return made.returncode == 0


def as_pip_is_set(listed: str) -> tuple[list[str], dict[str, str]]:
    """uv's options and environment for what `pip config list` has printed. What is set by the environment counts
    instead of what files say."""
    found: dict[str, str] = {}
    for line in sorted(listed.splitlines(), key=lambda line: line.startswith(":env:")):
        name, _, value = line.partition("=")
        where, _, key = name.rpartition(".")
        if where in ("global", "install", "site", ":env:"):
            try:
                found[key] = str(ast.literal_eval(value))
            except (SyntaxError, ValueError):
                continue
    options = list(AS_PIP)
    for key, option in OPTIONS.items():
        for value in found.get(key, "").split():
            options += [option, value]
    if found.get("no-index", "").lower() in ("1", "true", "yes", "on"):
        options.append("--no-index")
    return options, {"SSL_CERT_FILE": found["cert"]} if "cert" in found else {}


def install_with_pip(python: Path, target: str, root: Path) -> bool:
    """Whether pip could; it says itself what is wrong."""
    return subprocess.run([str(python), *PIP, "-e", target], check=False, cwd=root).returncode == 0


def to_bytecode(python: Path, package: Path) -> None:
    """Sources to bytecode, as an installation does that is not editable: three processes work at the first start, and
    each would translate all that it imports. Where nothing can be written they do."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [str(python), "-m", "compileall", "-q", "-j", "0", str(package)]
    subprocess.run(command, check=False, env=environment, capture_output=True)
