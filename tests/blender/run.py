"""Tests the Blender extension (`./eulerfsi test --blender`): builds, validates, installs and uses it inside bpy.

    run.py [--bpy PYTHON] [NAME...]      NAME: of the checks in check_*.py; default: all

--bpy: another Blender's Python that has bpy; default: .eulerfsi/bpy, which is made with requirements-blender.txt.
Environment: EULERFSI_LIBRARY, the library that is packed; default: that of build/release.
"""

from __future__ import annotations

import argparse
import os
import runpy
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / ".eulerfsi" / "blender"
_REQUIREMENTS = ROOT / "requirements-blender.txt"
_CHECKS = ("check_scene.py", "check_panels.py", "check_faults.py", "check_units.py")


def main(arguments: list[str] | None = None) -> int:
    """Runs everything; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bpy", type=Path, metavar="PYTHON")
    parser.add_argument("names", nargs="*", metavar="NAME")
    options = parser.parse_args(arguments)
    python = options.bpy or _bpy()
    PLACE.mkdir(parents=True, exist_ok=True)
    package = _package(python)
    tool = _run(python, "-c", "import bpy; print(bpy.utils.system_resource('SCRIPTS'))").strip().splitlines()[-1]
    tool = Path(tool) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    print(_run(python, tool, "validate", package).strip())
    resources = PLACE / "user"
    shutil.rmtree(resources, ignore_errors=True)
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(resources), "PYTHONPATH": ""}
    status = 0
    for script, words in (("install.py", [package]), *((name, options.names) for name in _CHECKS)):
        words = [PLACE / "work", *words] if script != "install.py" else words
        start = time.monotonic()
        code = subprocess.run([python, ROOT / "tests" / "blender" / script, *words], env=environment).returncode
        print(f"{script}: {'passed' if code == 0 else 'FAILED'} in {time.monotonic() - start:.0f} s", flush=True)
        status |= code != 0
        if code and script == "install.py":
            break
    return int(status)


def _bpy() -> Path:
    """Python of the environment with bpy, made where its requirements have changed."""
    place = ROOT / ".eulerfsi" / "bpy"
    stamp, python = place / ".requirements", place / "bin" / "python"
    if not stamp.is_file() or stamp.read_text() != _REQUIREMENTS.read_text():
        shutil.rmtree(place, ignore_errors=True)
        base = shutil.which("python3.11") or sys.executable
        _run(base, "-m", "venv", place)
        _run(python, "-m", "pip", "install", "--quiet", "--no-input", "-r", _REQUIREMENTS)
        stamp.write_text(_REQUIREMENTS.read_text())
    return python


def _package(python: Path) -> Path:
    """The zip for that Python, around the library that is built; made anew where one of its sources has changed."""
    version = _run(python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])").strip()
    library = Path(os.environ.get("EULERFSI_LIBRARY", ROOT / "build/release/libeulerfsi/libeulerfsi.so"))
    sys.path.insert(0, str(ROOT / "packaging"))
    wheel = runpy.run_path(str(ROOT / "packaging" / "wheel.py"))["main"](PLACE, library)
    return runpy.run_path(str(ROOT / "packaging" / "blender.py"))["main"](PLACE, wheel, (version,))[0]


def _run(*words: str | Path) -> str:
    """Standard output of a command that must succeed."""
    done = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}: ended with exit code {done.returncode}\n{done.stdout}")
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
