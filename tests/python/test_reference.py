"""The rendered reference: complete, and no fault passes (docs/reference)."""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path

import eulerfsi.errors
import eulerfsi.simulate
import eulerfsi.solver
import pytest
from conftest import ROOT
from eulerfsi.solver import c_api

pytestmark = pytest.mark.skipif(not shutil.which("doxygen"), reason="doxygen is not installed")


def render(root: Path, output: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, root / "docs" / "reference" / "render.py", output]
    return subprocess.run(command, capture_output=True, text=True)


def is_error(value: object) -> bool:
    return inspect.isclass(value) and issubclass(value, Exception)


def python_names() -> set[str]:
    """Public names of the package, with the methods and properties of its classes."""
    names = {}
    for module, public in (
        (eulerfsi, eulerfsi.__all__),
        (eulerfsi.solver, set(eulerfsi.solver.__all__) - set(eulerfsi.__all__)),
        (eulerfsi.simulate, eulerfsi.simulate.__all__),
        (eulerfsi.errors, [name for name, value in vars(eulerfsi.errors).items() if is_error(value)]),
    ):
        names |= {f"{module.__name__}.{name}": getattr(module, name) for name in public}
    for path, value in list(names.items()):
        if inspect.isclass(value):
            names |= {f"{path}.{name}": member for name, member in vars(value).items() if not name.startswith("_")}
    return {path for path, value in names.items() if callable(value) or isinstance(value, property)}


def test_every_name_has_an_entry_and_nothing_warns(tmp_path):
    result = render(ROOT, tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    assert not result.stderr
    pages = {page.stem: set(re.findall(r'\bid="([^"]+)"', page.read_text())) for page in tmp_path.glob("html/*.html")}
    declared = set(c_api.FUNCTIONS) | set(c_api.STRUCTURES)
    assert len(declared) > 80
    assert {f"c.{name}" for name in declared} - pages["c_api"] == set()
    members = {f"c.{name}.{member}" for name, kind in c_api.STRUCTURES.items() for member, *_ in kind._fields_}
    assert members - pages["c_api"] == set()
    expected = python_names()
    assert {"eulerfsi.Simulation.step", "eulerfsi.solver.slab_axis", "eulerfsi.simulate.Options"} <= expected
    assert expected - pages["python"] == set()


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A root with the C part of the reference alone."""
    shutil.copytree(ROOT / "libeulerfsi" / "include", tmp_path / "libeulerfsi" / "include")
    shutil.copytree(ROOT / "docs" / "reference", tmp_path / "docs" / "reference")
    (tmp_path / "batch").symlink_to(ROOT / "batch")
    (tmp_path / "docs" / "reference" / "python.rst").unlink()
    (tmp_path / "docs" / "reference" / "c_api.rst").write_text("C API\n=====\n\n.. doxygenfunction:: efsi_version\n")
    index = tmp_path / "docs" / "reference" / "index.rst"
    index.write_text(index.read_text().replace("   python\n", ""))
    return tmp_path


def plant(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("base.h", " * @param[out] minor likewise\n", "", "parameter 'minor'"),
        ("base.h", "[out] minor likewise", "[out] minus likewise", "'minus' of command @param is not found"),
        ("simulation.h", " * @param max_dt upper limit of its size [s]\n", "", "parameter 'max_dt'"),
        ("mesh.h", "destroyed with efsi_mesh_destroy", "destroyed with efsi_mesh_free", "'efsi_mesh_free'"),
        ("fields.h", " /**< 1 or 3 */", "", "Member components"),
        ("io.h", "/** A .vdb file. */", "", "EfsiVdbDef is not documented"),
    ],
)
def test_a_fault_of_a_header_is_an_error(small, file, old, new, message):
    plant(small / "libeulerfsi" / "include" / "eulerfsi" / file, old, new)
    result = render(small, small / "output")
    assert result.returncode == 1 and message in result.stderr


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (".. doxygenfunction:: efsi_vision", "Cannot find function"),
        ("See :c:func:`efsi_vision`.", "efsi_vision"),
        (".. autofunction:: eulerfsi.solver.load_mash", "has no attribute 'load_mash'"),
    ],
)
def test_a_broken_reference_is_an_error(small, line, message):
    page = small / "docs" / "reference" / "c_api.rst"
    page.write_text(f"{page.read_text()}\n{line}\n")
    result = render(small, small / "output")
    assert result.returncode == 1 and message in result.stderr
