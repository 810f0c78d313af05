"""The parameter table, its generator and its faces (house rule: one table, many faces)."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "libeulerfsi"))

import generate  # noqa: E402
from eulerfsi_usd import parameters as usd_parameters  # noqa: E402
from faces import headers, table, words  # noqa: E402


def broken_table(tmp_path: Path, old: str, new: str) -> Path:
    text = table.TABLE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "parameters.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_generated_files_are_those_of_the_table_and_no_part_of_the_repository(tmp_path: Path) -> None:
    assert generate.main(["--tree", str(tmp_path)]) == 0
    written = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file())
    assert written == sorted(generate.TREE)
    stale = [name for name in written if (ROOT / name).read_text("utf-8") != (tmp_path / name).read_text("utf-8")]
    assert stale == []  # else the build has not run since the table or a header was changed
    asked = subprocess.run(["git", "check-ignore", "--no-index", *written], cwd=ROOT, capture_output=True, text=True)
    assert asked.returncode == 128 or sorted(asked.stdout.split()) == written  # 128: no repository
    build = (ROOT / "libeulerfsi" / "cmake" / "EfsiGenerate.cmake").read_text("utf-8")
    named = re.search(r"set\(asset \"\$\{tree\}/(.*)\"\)", build)[1]
    for name in written:
        assert f'"${{tree}}/{name}"' in build or f'"${{asset}}/{name.removeprefix(named + "/")}"' in build


def test_a_file_that_is_up_to_date_is_left_alone(tmp_path: Path) -> None:
    assert generate.main(["--sources", str(tmp_path)]) == 0
    old, changed = (tmp_path / name for name in generate.SOURCES)
    text = changed.read_text("utf-8")
    changed.write_text("stale", encoding="utf-8")
    os.utime(old, (1, 1))
    assert generate.main(["--sources", str(tmp_path)]) == 0
    assert old.stat().st_mtime == 1 and changed.read_text("utf-8") == text
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == sorted([old, changed])


def test_header_of_an_unknown_form_is_refused() -> None:
    known = headers.Header(
        "typedef struct A { const float* x[2]; int32_t i, j; } A; void f(struct B** b, double c[4]);"
    )
    assert known.structs["A"] == [
        headers.Declared("x", "float", const=True, stars=1, count=2),
        headers.Declared("i", "int32_t"),
        headers.Declared("j", "int32_t"),
    ]
    assert [(a.base, a.stars, a.count) for a in known.functions["f"].arguments] == [("B", 2, None), ("double", 0, 4)]
    for text in (
        "union U { int a; };",
        "typedef struct A { int a : 3; } A;",
        "int a",
        "struct A { struct { int b; } c; };",
    ):
        with pytest.raises(headers.HeaderError, match="unknown declaration"):
            headers.Header(text)


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
        ("least = 0.001", "least = 11.0", r"stepTolerance: least = 11.0 must be within limits that begin at 0"),
        ("loose = 0.5", "loose = 50.0", r"stepTolerance: names: loose = 50.0 must be a number within the limits"),
        ('another = "fast"\n', "", r"preset: missing keys \['another'\]"),
        ("on a {prims}. It is on", "on a {prim}. It is on", r"\[force\]: {prim}: must be {prims} or one of"),
    ],
)
def test_faulty_table_is_refused_with_a_message(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises((table.TableError, KeyError), match=message):
        table.load_table(broken_table(tmp_path, old, new))


def test_token_order_equals_the_constants_of_the_c_headers() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in headers.HEADERS.glob("*.h"))
    constants = dict(re.findall(r"^  (EFSI_[A-Z0-9_]+) = (\d+)", text, flags=re.M))
    families = {"preset": "PRESET", "material": "MATERIAL", "mode": "EMITTER", "kind": "FORCE", "actsOn": "ACTS_ON"}
    compared = 0
    for section in table.load_table().values():
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
#define ROW(name, field, kind, value, low, high, exclusive, least, unit) \
  std::printf("%s|%s|%s|%.17g|%.17g|%.17g|%d|%.17g|%s\n", name, #field, #kind, kind(field, value), low, high, \
              exclusive, least, unit);
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
    assert generate.main(["--sources", str(tmp_path)]) == 0
    folders = [ROOT / "libeulerfsi" / "include", tmp_path / "frame"]
    flags = [*(f"-I{folder}" for folder in folders), "-std=c++20", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command = ["c++", *flags, str(tmp_path / "rows.cpp"), "-o", str(tmp_path / "rows")]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    printed = subprocess.run([str(tmp_path / "rows")], capture_output=True, text=True, check=True).stdout.splitlines()

    expected = []
    for section in table.load_table().values():
        for row in (row for row in section["parameter"] if row["field"]):
            kind, default = row["type"], row["default"]
            value = row["tokens"].index(default) if kind == "token" else sum(default) if kind == "vector" else default
            low, high = row.get("hard", (0.0, len(row.get("tokens", "01")) - 1))
            exclusive = int(row.get("min_exclusive", False))
            numbers = (float(value), float(low), float(high), exclusive, row.get("least", 0.0))
            expected.append((row["name"], row["field"], kind.upper(), *numbers, row.get("unit", "")))
    rows = [line.split("|") for line in printed]
    found = [(*row[:3], *map(float, row[3:6]), int(row[6]), float(row[7]), row[8]) for row in rows]
    assert found == expected


def test_python_table_equals_the_toml_table() -> None:
    loaded = table.load_table()
    for scope, rows in usd_parameters.load().items():
        assert list(rows) == [row["name"] for row in loaded[scope]["parameter"]]
        assert usd_parameters.prim_types()[scope] == tuple(loaded[scope]["prims"])
        for source in loaded[scope]["parameter"]:
            row = rows[source["name"]]
            default = tuple(source["default"]) if source["type"] == "vector" else source["default"]
            assert row.default == default and row.tokens == tuple(source.get("tokens", ()))
            assert (row.hard_min, row.hard_max) == tuple(source.get("hard", (-math.inf, math.inf)))
            assert row.min_exclusive == source.get("min_exclusive", False)
            assert row.least == source.get("least", 0.0) and row.names == source.get("names", {})
            assert row.depends_on_stage_units == (words.stage_default(source) == -math.inf)


def test_reference_shows_every_parameter_once() -> None:
    text = (ROOT / "docs" / "reference" / "parameters.rst").read_text(encoding="utf-8")
    for scope, section in table.load_table().items():
        name = f"EulerFsi{scope.title()}API"
        chapter = text.split(f"{name}\n{'-' * len(name)}\n")[1].split("\n---")[0]
        for row in section["parameter"]:
            prefix = "physics" if row.get("usd_physics") else "eulerfsi"
            assert chapter.count(f"* - ``{prefix}:{row['name']}``\n") == 1
