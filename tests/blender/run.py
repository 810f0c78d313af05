"""Tests the Blender extension (`./eulerfsi test --blender`): builds, validates, installs and uses it inside bpy.

    run.py [--bpy PYTHON] [NAME...]      NAME: of files check_NAME.py, or in names of their checks; default: all
    run.py --package 3.13                builds the zip for that Python alone, and prints where it is

--bpy: another Blender's Python that has bpy; default: that of EULERFSI_BPY.
Environment: EULERFSI_BPY, a folder with that environment, made with requirements-blender.txt where it is not; default:
.eulerfsi/bpy. EULERFSI_LIBRARY, the library that is packed; default: that of build/release.
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
_FILES = ("scene", "panels", "faults", "units")


def main(arguments: list[str] | None = None) -> int:
    """Runs everything; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bpy", type=Path, metavar="PYTHON")
    parser.add_argument("--package", metavar="VERSION")
    parser.add_argument("names", nargs="*", metavar="NAME")
    options = parser.parse_args(arguments)
    PLACE.mkdir(parents=True, exist_ok=True)
    if options.package:
        print(_package(options.package))
        return 0
    python = options.bpy or _bpy()
    package = _package(_run(python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])").strip())
    tool = _run(python, "-c", "import bpy; print(bpy.utils.system_resource('SCRIPTS'))").strip().splitlines()[-1]
    tool = Path(tool) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    print(_run(python, tool, "validate", package).strip())
    resources = PLACE / "user"
    shutil.rmtree(resources, ignore_errors=True)
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(resources), "PYTHONPATH": ""}
    status = 0
    files = [name for name in _FILES if name in options.names]
    checks = [name for name in options.names if name not in _FILES]
    scripts = [(f"check_{name}.py", [PLACE / "work", *checks]) for name in files or _FILES]
    for script, words in (("install.py", [package]), *scripts):
        start = time.monotonic()
        code = subprocess.run([python, ROOT / "tests" / "blender" / script, *words], env=environment).returncode
        print(f"{script}: {'passed' if code == 0 else 'FAILED'} in {time.monotonic() - start:.0f} s", flush=True)
        status |= code != 0
        if code and script == "install.py":
            break
    return int(status)


def _bpy() -> Path:
    """Python of the environment with bpy, made where its requirements have changed."""
    place = Path(os.environ.get("EULERFSI_BPY", ROOT / ".eulerfsi" / "bpy"))
    stamp, python = place / ".requirements", place / "bin" / "python"
    if not stamp.is_file() or stamp.read_text() != _REQUIREMENTS.read_text():
        if place.is_dir() and any(place.iterdir()) and not (place / "pyvenv.cfg").is_file():
            sys.exit(f"EULERFSI_BPY={place}: holds other things than an environment of Python")
        shutil.rmtree(place, ignore_errors=True)
        base = shutil.which("python3.11") or sys.executable
        _run(base, "-m", "venv", place)
        _run(
            python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--no-input",
            "--retries",
            "5",
            "--timeout",
            "60",
            "-r",
            _REQUIREMENTS,
        )
        stamp.write_text(_REQUIREMENTS.read_text())  # last: what was interrupted is made again
    return python


def _package(version: str) -> Path:
    """The zip for a version of Python, around the library that is built."""
    library = Path(os.environ.get("EULERFSI_LIBRARY", ROOT / "build/release/libeulerfsi/libeulerfsi.so"))
    sys.path[:0] = [str(ROOT / folder) for folder in ("packaging", "batch", "usd_plugin")]
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
