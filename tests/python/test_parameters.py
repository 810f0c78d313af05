"""The parameter table, its generator and its faces (house rule: one table, many faces)."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "libeulerfsi"))

import generate_parameters  # noqa: E402
import parameter_table  # noqa: E402
from eulerfsi_usd import parameters as usd_parameters  # noqa: E402

GENERATOR = ROOT / "libeulerfsi" / "generate_parameters.py"


def broken_table(tmp_path: Path, old: str, new: str) -> Path:
    text = parameter_table.TABLE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "parameters.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_committed_outputs_equal_the_generator() -> None:
    result = subprocess.run([sys.executable, str(GENERATOR), "--check"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_check_reports_a_changed_output(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(generate_parameters, "ROOT", tmp_path)
    assert generate_parameters.main([]) == 0
    assert generate_parameters.main(["--check"]) == 0
    docs = tmp_path / "docs" / "parameters.md"
    docs.write_text(docs.read_text(encoding="utf-8").replace("0.02 m", "0.03 m"), encoding="utf-8")
    capsys.readouterr()
    assert generate_parameters.main(["--check"]) == 1
    printed = capsys.readouterr().out
    assert re.search(r"^-.*0\.03 m", printed, re.MULTILINE) and re.search(r"^\+.*0\.02 m", printed, re.MULTILINE)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "voxelSize"', 'name = "VoxelSize"', r"\[domain\] VoxelSize: name must be camelCase"),
        ('field = "voxel_size"', 'field = "voxel_length"', r"voxelSize: EfsiSimulationDef.voxel_length is missing"),
        ('field = "voxel_size"', 'field = "preset"', r"voxelSize: EfsiSimulationDef.preset is int32_t, must be double"),
        ('field = "wall[5]"', 'field = "wall[6]"', r"wallZMax: EfsiSimulationDef.wall\[6\] is missing"),
        ("default = 1.8", "default = 4500.0", r"cflSolid: default = 4500.0 is outside hard = \[0.0, 1000.0\]"),
        ("default = 1.8", "default = 2", r"cflSolid: default = 2 is not of type double"),
        ("default = 0.02", "default = 0.0", r"voxelSize: default = 0.0 is outside"),
        ("soft = [0.3, 3.0]", "soft = [0.3, 9000.0]", r"cflSolid: soft = \[0.3, 9000.0\] must be finite and within"),
        ('default = "slip"', 'default = "Slip"', r"wallXMin: default = 'Slip' is not one of"),
        ('stage_unit = "m^1"', 'stage_unit = "m^2"', r"voxelSize: unit = 'm' and stage_unit = 'm\^2' do not agree"),
        ("min_exclusive = true\nsoft", "minExclusive = true\nsoft", r"voxelSize: unknown keys \['minExclusive'\]"),
        ('name = "wallYMin"', 'name = "wallXMin"', r"wallXMin: name = 'wallXMin' occurs twice"),
        ("[solid]", "[solids]", r"sections are"),
    ],
)
def test_faulty_table_is_refused_with_a_message(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises((parameter_table.TableError, KeyError), match=message):
        parameter_table.load_table(broken_table(tmp_path, old, new))


def test_token_order_equals_the_constants_of_the_c_headers() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in parameter_table.HEADERS.glob("*.h"))
    constants = dict(re.findall(r"^  (EFSI_[A-Z0-9_]+) = (\d+)", text, flags=re.M))
    families = {"preset": "PRESET", "material": "MATERIAL", "mode": "EMITTER", "kind": "FORCE", "actsOn": "ACTS_ON"}
    compared = 0
    for section in parameter_table.load_table().values():
        for row in section["parameter"]:
            family = "WALL" if row["name"].startswith("wall") else families.get(row["name"])
            for index, token in enumerate(row.get("tokens", ())):
                upper = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", token).upper()
                assert int(constants[f"EFSI_{family}_{upper}"]) == index
                compared += 1
    assert compared >= 6 * 4 + 2 + 2 + 2


PROGRAM = r"""
#include <cstdio>
#include "eulerfsi/eulerfsi.h"
#include "parameter_table.inc"
#define DOUBLE(field, value) (def.field = value, def.field)
#define BOOL(field, value) (def.field = value, double(def.field))
#define TOKEN(field, value) (def.field = value, double(def.field))
#define VECTOR(field, value) (def.field = value, def.field.x + def.field.y + def.field.z)
#define ROW(name, field, kind, value, low, high, exclusive, unit) \
  std::printf("%s|%s|%s|%.17g|%.17g|%.17g|%d|%s\n", name, #field, #kind, kind(field, value), low, high, exclusive, \
              unit);
int main() {
  { EfsiSimulationDef def{}; EFSI_DOMAIN_PARAMETERS(ROW) }
  { EfsiSolidDef def{}; EFSI_SOLID_PARAMETERS(ROW) }
  { EfsiEmitterDef def{}; EFSI_EMITTER_PARAMETERS(ROW) }
  { EfsiForceDef def{}; EFSI_FORCE_PARAMETERS(ROW) }
  { EfsiSolidDef def{}; EFSI_COLLIDER_PARAMETERS(ROW) }
}
"""


@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
def test_cpp_table_compiles_and_holds_the_values_of_the_table(tmp_path: Path) -> None:
    (tmp_path / "rows.cpp").write_text(PROGRAM, encoding="utf-8")
    folders = [ROOT / "libeulerfsi" / "include", ROOT / "libeulerfsi" / "src" / "frame"]
    flags = [*(f"-I{folder}" for folder in folders), "-std=c++20", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command = ["c++", *flags, str(tmp_path / "rows.cpp"), "-o", str(tmp_path / "rows")]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    printed = subprocess.run([str(tmp_path / "rows")], capture_output=True, text=True, check=True).stdout.splitlines()

    expected = []
    for section in parameter_table.load_table().values():
        for row in (row for row in section["parameter"] if row["field"]):
            kind, default = row["type"], row["default"]
            value = row["tokens"].index(default) if kind == "token" else sum(default) if kind == "vector" else default
            low, high = row.get("hard", (0.0, len(row.get("tokens", "01")) - 1))
            exclusive = int(row.get("min_exclusive", False))
            numbers = (float(value), float(low), float(high), exclusive)
            expected.append((row["name"], row["field"], kind.upper(), *numbers, row.get("unit", "")))
    rows = [line.split("|") for line in printed]
    found = [(n, f, k, float(v), float(low), float(high), int(e), u) for n, f, k, v, low, high, e, u in rows]
    assert found == expected


def test_python_table_equals_the_toml_table() -> None:
    table = parameter_table.load_table()
    for scope, rows in usd_parameters.load().items():
        assert list(rows) == [row["name"] for row in table[scope]["parameter"]]
        for source in table[scope]["parameter"]:
            row = rows[source["name"]]
            default = tuple(source["default"]) if source["type"] == "vector" else source["default"]
            assert row.default == default and row.tokens == tuple(source.get("tokens", ()))
            assert (row.hard_min, row.hard_max) == tuple(source.get("hard", (-math.inf, math.inf)))
            assert row.min_exclusive == source.get("min_exclusive", False)
            assert row.depends_on_stage_units == (generate_parameters.stage_default(source) == -math.inf)


def test_docs_show_every_parameter_once() -> None:
    text = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    for scope, section in parameter_table.load_table().items():
        chapter = text.split(f"## EulerFsi{scope.title()}API")[1].split("\n## ")[0]
        for row in section["parameter"]:
            prefix = "physics" if row.get("usd_physics") else "eulerfsi"
            assert chapter.count(f"| `{prefix}:{row['name']}` |") == 1
