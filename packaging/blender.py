"""The Blender extension: one zip per Python, with the solver inside (`./eulerfsi package blender`).

A zip holds blender_addon/, the tables of parameters and materials and, below solver/, the wheel of `package wheel` with
what it needs, for one Python. Blender never has that folder on its path: usd-core would take the place of Blender's own
`pxr`. The solver runs in a process of its own that has. Validating is Blender's own tool's business (tests/blender).
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from eulerfsi.errors import EulerFsiError, UsageError

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "blender_addon"
TABLES = [ROOT / "usd_plugin" / "eulerfsi_usd" / name for name in ("parameters.json", "presets.json")]
# Python: the versions of Blender that have it, from the first to before the second.
BLENDERS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", "6.0.0")}
_PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64")
_NEEDED = ("usd-core", "numpy", "fileseq", "tqdm")  # of pyproject.toml, at the versions of requirements.txt
_DATE = (2026, 1, 1, 0, 0, 0)  # of every file: the same sources make the same zip


def main(output: Path, wheel: Path | None = None, pythons: tuple[str, ...] = tuple(BLENDERS)) -> list[Path]:
    """Builds the zips into a folder; returns their paths. wheel: one of `package wheel`, None: makes it."""
    if wheel is None:
        sys.path.insert(0, str(Path(__file__).parent))
        import wheel as maker

        output.mkdir(parents=True, exist_ok=True)
        wheel = maker.main(output)
    if not wheel.is_file():
        raise UsageError(f"--wheel {wheel}: no such file")
    return [_package(output, wheel, python) for python in pythons]


def _package(output: Path, wheel: Path, python: str) -> Path:
    """The zip for one Python."""
    with tempfile.TemporaryDirectory(prefix="eulerfsi-blender-") as folder:
        tree = Path(folder) / "eulerfsi"
        shutil.copytree(ADDON, tree, ignore=shutil.ignore_patterns("__pycache__"))
        for file in TABLES:
            shutil.copy(file, tree)
        _install(tree / "solver", wheel, python)
        manifest = tree / "blender_manifest.toml"
        manifest.write_text(_manifest(manifest.read_text(), python), encoding="utf-8")
        version = re.search(r'^version = "(.*)"$', manifest.read_text(), re.MULTILINE)[1]
        if f"eulerfsi-{version}-" not in wheel.name:
            raise EulerFsiError(f"{wheel.name}: the version of blender_addon/blender_manifest.toml is {version}")
        output.mkdir(parents=True, exist_ok=True)
        name = f"eulerfsi_blender-{version}-linux_x64-py{python.replace('.', '')}.zip"
        return _zip(tree, output / name)


def _manifest(text: str, python: str) -> str:
    first, beyond = BLENDERS[python]
    line = f'blender_version_min = "{first}"\nblender_version_max = "{beyond}"'
    return re.sub(r'^blender_version_min = ".*"$', line, text, flags=re.MULTILINE)


def _install(place: Path, wheel: Path, python: str) -> None:
    """The wheel and what it needs, as that Python would have it in its site-packages."""
    pins = dict(re.findall(r"^([\w-]+)==(\S+)$", (ROOT / "requirements.txt").read_text(), re.MULTILINE))
    pins = {name.lower(): version for name, version in pins.items()}
    words = [sys.executable, "-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check"]
    words += ["--no-deps", "--only-binary", ":all:", "--no-compile", "--target", str(place)]
    words += ["--python-version", python, "--implementation", "cp"]
    # The wheel's own platform may be newer than that of the others.
    platforms = (*re.findall(r"manylinux_\d+_\d+_x86_64", wheel.name), *_PLATFORMS)
    words += [word for platform in dict.fromkeys(platforms) for word in ("--platform", platform)]
    words += [str(wheel.resolve()), *(f"{name}=={pins[name]}" for name in _NEEDED)]
    if code := subprocess.run(words, stdout=sys.stderr).returncode:
        raise EulerFsiError(f"{' '.join(words)}: ended with exit code {code}")
    shutil.rmtree(place / "bin", ignore_errors=True)
    for tests in place.glob("numpy/**/tests"):
        shutil.rmtree(tests)


def _zip(tree: Path, path: Path) -> Path:
    """All files of a folder, in a fixed order, below no folder of its own, as Blender's tool makes it."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(p for p in tree.rglob("*") if p.is_file()):
            entry = zipfile.ZipInfo(str(file.relative_to(tree)), _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, file.read_bytes())
    return path
