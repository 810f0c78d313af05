"""The Houdini asset as text: files, dialog, callbacks; and its Python code against a substitute for `hou`."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import types
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import eulerfsi_usd  # noqa: F401  (registers the schema before the first stage)
import pytest
from eulerfsi_usd import checks
from eulerfsi_usd.parameters import load
from pxr import Gf, Usd, UsdGeom, UsdPhysics

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "houdini_hda"
ASSET = FOLDER / "otls" / "eulerfsi_bake.hda"
OPERATOR = "eulerfsi::Driver/bake::1.0"
PYTHON_SECTIONS = ("PythonModule", "OnCreated")
SCOPE_PREFIX = {"domain": "", "solid": "solid#_", "emitter": "emitter#_", "force": "force#_"}

# ------------------------------------------------------------------------------------------------- dialog script parser

TOKEN = re.compile(r'\s+|#[^\n]*|(?P<string>"(?:[^"\\]|\\.)*")|(?P<brace>[{}])|(?P<word>[^\s{}"]+)')
BLOCKS = {"parm", "group", "multiparm"}


def tokens_of(text: str) -> list[str]:
    """Tokens of a dialog script; strings keep their quotes. Raises ValueError where the text is none."""
    result, position = [], 0
    while position < len(text):
        match = TOKEN.match(text, position)
        if match is None:
            raise ValueError(f"dialog script: {text[position : position + 20]!r}")
        position = match.end()
        if match.lastgroup:
            result.append(match.group())
    return result


def parse_block(tokens: list[str], at: int) -> tuple[dict, int]:
    """A block from the token after "{" to its "}": {"children": [(kind, block)], "tags": {...}, key: [words]}."""
    block: dict = {"children": [], "tags": {}}
    while tokens[at] != "}":
        key, at = tokens[at], at + 1
        if key in BLOCKS:
            assert tokens[at] == "{", key
            child, at = parse_block(tokens, at + 1)
            block["children"].append((key, child))
            continue
        values = []
        if tokens[at] == "{":
            end = tokens.index("}", at)
            values, at = tokens[at + 1 : end], end + 1
        elif key not in ("joinnext", "nolabel", "invisible", "baseparm"):
            values, at = [tokens[at]], at + 1
        words = [json.loads(word) if word.startswith('"') else word for word in values]
        if key == "parmtag":
            block["tags"][words[0]] = words[1]
        else:
            assert key not in block, f"{key} occurs twice"
            block[key] = words
    return block, at + 1


def parse_dialog(text: str) -> dict:
    tokens = tokens_of(text)
    assert tokens[0] == "{"
    block, end = parse_block(tokens, 1)
    assert end == len(tokens)
    return block


def walk(block: dict, multiparm: str | None = None) -> list[tuple[str | None, dict]]:
    """[(name of the multiparm around it or None, parm block)], multiparms included as parms."""
    result = []
    for kind, child in block["children"]:
        if kind == "parm":
            result.append((multiparm, child))
        elif kind == "multiparm":
            result += [(None, child | {"type": ["multiparm"]}), *walk(child, child["name"][0])]
        else:
            result += walk(child, multiparm)
    return result


def section(name: str) -> str:
    return (ASSET / encode(OPERATOR) / name).read_text(encoding="utf-8")


def encode(operator: str) -> str:
    """Folder name of an operator in an expanded asset."""
    return operator.replace("_", "__").replace("/", "_1").replace(":", "_8")


def sections_list(path: Path) -> dict[str, str]:
    first, *lines = path.read_text(encoding="utf-8").splitlines()
    assert first == '""'
    return dict(line.split("\t") for line in lines)


DIALOG = parse_dialog(section("DialogScript"))
PARMS = {parm["name"][0]: (multiparm, parm) for multiparm, parm in walk(DIALOG)}

# ------------------------------------------------------------------------------------------------------ files and text


def test_index_sections_and_folders_agree() -> None:
    index = dict(re.findall(r"^(\w+): *(.*?) *$", (ASSET / "INDEX__SECTION").read_text("utf-8"), re.MULTILINE))
    assert index["Path"] == f"oplib:/{OPERATOR}?{OPERATOR}"
    assert index["Icon"] == f"opdef:/{OPERATOR}?IconSVG"
    scope, name = OPERATOR.split("/")
    assert index["Table"] == scope.split("::")[1]
    assert index["Operator"] == f"{scope.split('::')[0]}::{name}"
    listed = sections_list(ASSET / "Sections.list")
    assert listed == {
        "INDEX__SECTION": "INDEX_SECTION",
        "houdini.hdalibrary": "houdini.hdalibrary",
        encode(OPERATOR): OPERATOR,
    }
    assert {path.name for path in ASSET.iterdir()} == {*listed, "Sections.list"}
    assert (ASSET / "houdini.hdalibrary").read_bytes() == b""


def test_every_listed_section_exists_and_no_other() -> None:
    folder = ASSET / encode(OPERATOR)
    listed = sections_list(folder / "Sections.list")
    assert {path.name for path in folder.iterdir()} == {*listed, "Sections.list"}
    assert all(encode(name).replace("_", "") == disk.replace("_", "") for disk, name in listed.items())


def test_text_sections_are_well_formed() -> None:
    for name in ("Tools.shelf", "IconSVG"):
        ElementTree.fromstring(section(name).encode())
    options = json.loads(section("ExtraFileOptions"))
    for name in PYTHON_SECTIONS:
        compile(section(name), name, "exec")
        assert options[f"{name}/IsPython"] == {"type": "bool", "value": True}
    assert all(re.fullmatch(r"\w+ := \d;", line) for line in section("TypePropertiesOptions").splitlines())


def test_package_points_at_what_the_checkout_has() -> None:
    package = json.loads((FOLDER / "packages" / "eulerfsi.json").read_text("utf-8"))
    variables = {"$HOUDINI_PACKAGE_PATH": str(FOLDER / "packages")}

    def expand(text: str) -> Path:
        for _ in range(3):
            for name, value in variables.items():
                text = text.replace(name, value)
        assert "$" not in text
        return Path(text).resolve()

    values = {}
    for entry in package["env"]:
        for name, value in entry.items():
            values[name] = value["value"] if isinstance(value, dict) else value
            variables.setdefault(f"${name}", values[name])
    assert expand(package["hpath"]) == FOLDER and (FOLDER / "otls").is_dir()
    assert (expand(values["PYTHONPATH"]) / "eulerfsi_usd" / "__init__.py").is_file()
    assert (expand(values["PXR_PLUGINPATH_NAME"]) / "plugInfo.json").is_file()
    assert expand(values["EULERFSI"]) == ROOT
    assert PARMS["command"][1]["default"] == ["$EULERFSI/eulerfsi"]


# -------------------------------------------------------------------------------------------------------------- dialog


def test_parser_refuses_broken_scripts() -> None:
    text = section("DialogScript")
    for broken in (text.rstrip()[:-1], text.replace("parm {", "parm", 1), text + "}"):
        with pytest.raises((AssertionError, IndexError, ValueError)):
            parse_dialog(broken)


def test_dialog_has_the_name_of_the_operator_and_unique_parameters() -> None:
    assert DIALOG["name"] == ["eulerfsi::bake::1.0"] and DIALOG["script"] == ["eulerfsi::bake::1.0"]
    names = [parm["name"][0] for _, parm in walk(DIALOG)]
    assert len(names) == len(set(names))
    for multiparm, parm in walk(DIALOG):
        name = parm["name"][0]
        assert re.fullmatch(r"[A-Za-z_][A-Za-z0-9_#]*", name) and parm["label"][0]
        assert name.count("#") == (1 if multiparm else 0)
        kind, size = parm["type"][0], int(parm.get("size", ["1"])[0])
        assert kind in {"float", "integer", "string", "toggle", "vector", "file", "directory", "oppath", "button"} | {
            "multiparm"
        }
        assert len(parm["default"]) == size and (kind != "vector" or size == 3)
        assert kind == "multiparm" or parm["help"][0].endswith(".")


def test_defaults_and_limits_equal_the_table() -> None:
    seen = set()
    for scope, rows in load().items():
        if scope not in SCOPE_PREFIX:
            continue  # the asset makes no colliders
        for row in rows.values():
            multiparm, parm = PARMS[SCOPE_PREFIX[scope] + row.name]
            seen.add(SCOPE_PREFIX[scope] + row.name)
            assert multiparm == {"domain": None, "solid": "solids", "emitter": "emitters", "force": "forces"}[scope]
            assert parm["tags"]["eulerfsi"] == f"{scope}.{row.name}" and parm["label"] == [row.label]
            default = parm["default"]
            if row.type == "token":
                assert default == [row.default] and tuple(parm["menu"][::2]) == row.tokens
            elif row.type == "bool":
                assert parm["type"] == ["toggle"] and default == [str(int(row.default))]
            elif row.type == "asset":
                assert parm["type"] == ["file"] and default == [row.default]
            else:
                expected = row.default if row.type == "vector" else (row.default,)
                assert tuple(float(word) for word in default) == expected
                for word, hard in zip(parm["range"], (row.hard_min, row.hard_max), strict=True):
                    assert word.endswith("!") == math.isfinite(hard)
                    assert not math.isfinite(hard) or float(word[:-1]) == hard
    assert seen == {name for name, (_, parm) in PARMS.items() if "eulerfsi" in parm["tags"]}


def test_every_callback_exists() -> None:
    functions = set(re.findall(r"^def (\w+)\(kwargs\)", section("PythonModule"), re.MULTILINE))
    callbacks = [parm["tags"]["script_callback"] for _, parm in PARMS.values() if "script_callback" in parm["tags"]]
    assert {re.fullmatch(r"hou\.phm\(\)\.(\w+)\(kwargs\)", text)[1] for text in callbacks} <= functions
    buttons = [parm for _, parm in PARMS.values() if parm["type"] == ["button"]]
    assert len(callbacks) == len(buttons) > 0
    assert all(parm["tags"]["script_callback_language"] == "python" for parm in buttons)


# -------------------------------------------------------------------------------------- the Python code of the asset


class Parm:
    """A parameter tuple of the substitute node."""

    def __init__(self, values: list) -> None:
        self.values = values

    def eval(self) -> tuple:
        return tuple(self.values)

    def set(self, values: tuple) -> None:
        self.values = list(values)


class Node:
    """A node whose parameters and defaults are those of the dialog script."""

    def __init__(self, nodes: dict[str, object], counts: dict[str, int]) -> None:
        self.nodes, self.parms = nodes, {}
        for name, (multiparm, parm) in PARMS.items():
            kind = parm["type"][0]
            convert = {"float": float, "vector": float, "integer": int, "toggle": int, "multiparm": int}.get(kind, str)
            for number in range(1, counts[multiparm] + 1) if multiparm else (0,):
                values = [convert(word) for word in parm["default"]]
                self.parms[name.replace("#", str(number))] = Parm(values)
        for name, count in counts.items():
            self.parms[name].set((count,))

    def evalParm(self, name: str):  # noqa: N802
        (value,) = self.parms[name].values
        return value

    def parmTuple(self, name: str) -> Parm:  # noqa: N802
        return self.parms[name]

    def node(self, path: str):
        return self.nodes.get(path)

    def path(self) -> str:
        return "/out/bake1"


class Matrix:
    def asTuple(self) -> tuple:  # noqa: N802
        return tuple(x for row in Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0.1, 0)) for x in row)


class Sop:
    """A SOP that holds a tetrahedron whose faces turn clockwise, as Houdini's do."""

    points = (0, 0, 0, 0.2, 0, 0, 0, 0.2, 0, 0, 0, 0.2)
    faces = ((1, 2, 0), (3, 1, 0), (2, 3, 0), (3, 2, 1))

    def geometryAtFrame(self, _frame: float):  # noqa: N802
        def vertex(number: int):
            return types.SimpleNamespace(point=lambda: types.SimpleNamespace(number=lambda: number))

        prims = [types.SimpleNamespace(vertices=lambda face=face: tuple(map(vertex, face))) for face in self.faces]
        return types.SimpleNamespace(prims=lambda: prims, pointFloatAttribValues=lambda _name: self.points)

    def parent(self):
        return types.SimpleNamespace(worldTransformAtTime=lambda _time: Matrix())


class NodeError(Exception):
    pass


@pytest.fixture
def module(monkeypatch) -> types.ModuleType:
    """PythonModule with a substitute for `hou` that has no user interface."""
    hou = types.ModuleType("hou")
    hou.fps = lambda: 24.0
    hou.frameToTime = lambda frame: (frame - 1) / 24.0
    hou.isUIAvailable = lambda: False
    hou.NodeError = NodeError
    monkeypatch.setitem(sys.modules, "hou", hou)
    code = types.ModuleType("PythonModule")
    exec(compile(section("PythonModule"), "PythonModule", "exec"), code.__dict__)
    return code


@pytest.fixture
def node(tmp_path: Path) -> Node:
    """A new node with one solid, one emitter and one force, after OnCreated."""
    result = Node({"/obj/geo1/OUT": Sop()}, {"solids": 1, "emitters": 1, "forces": 1})
    exec(compile(section("OnCreated"), "OnCreated", "exec"), {"kwargs": {"node": result}})
    result.parms["solid1_path"].set(("/obj/geo1/OUT",))
    result.parms["scene"].set((str(tmp_path / "sub" / "scene.usda"),))
    result.parms["output"].set((str(tmp_path / "cache"),))
    return result


def test_a_new_node_makes_a_valid_scene_with_every_parameter(module, node: Node) -> None:
    node.parms["solid1_velocity"].set((1.0, -2.0, 3.0))
    node.parms["solid1_density"].set((700.0,))
    stage = Usd.Stage.Open(module.save_scene({"node": node}))
    assert checks.check_stage(stage) == []
    names = ("Domain", "Solid1", "Emitter1", "Force1")
    domain, solid, emitter, force = (stage.GetPrimAtPath(f"/World/{name}") for name in names)
    for scope, prim in (("domain", domain), ("solid", solid), ("emitter", emitter), ("force", force)):
        for row in load()[scope].values():
            assert prim.GetAttribute(row.attribute).HasAuthoredValue() == (row.type != "asset"), row.name
    assert solid.GetAttribute("eulerfsi:velocity").Get() == Gf.Vec3d(1, -2, 3)
    assert solid.GetAttribute("physics:density").Get() == 700.0
    assert domain.GetAttribute("eulerfsi:voxelSize").Get() == load()["domain"]["voxelSize"].default
    gravity = UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene")).GetGravityMagnitudeAttr().Get()
    assert gravity == pytest.approx(9.81, rel=1e-6)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (1, 48, 24)


def test_mesh_turns_outwards_and_lies_where_the_object_is(module, node: Node) -> None:
    stage = module.make_scene(node)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Solid1"))
    points = [Gf.Vec3d(p) for p in mesh.GetPointsAttr().Get()]
    indices = list(mesh.GetFaceVertexIndicesAttr().Get())
    faces = [[points[i] for i in indices[k : k + 3]] for k in range(0, len(indices), 3)]
    volume = sum(Gf.Dot(a, Gf.Cross(b, c)) for a, b, c in faces) / 6.0
    assert volume == pytest.approx(0.2**3 / 6.0, rel=1e-6)
    assert mesh.ComputeLocalToWorldTransform(Usd.TimeCode.Default()).ExtractTranslation() == Gf.Vec3d(0, 0.1, 0)


def test_surface_file_and_sphere_emitter(module, node: Node) -> None:
    node.parms["solid1_surfaceFile"].set((__file__,))
    node.parms["emitter1_shape"].set(("Sphere",))
    stage = Usd.Stage.Open(module.save_scene({"node": node}))
    assert stage.GetPrimAtPath("/World/Solid1").GetTypeName() == "Xform"
    assert stage.GetPrimAtPath("/World/Emitter1").GetTypeName() == "Sphere"
    assert checks.check_stage(stage) == []


@pytest.mark.parametrize(
    ("parm", "value", "message"),
    [
        ("size", (0.0, 1.0, 1.0), "/World/Domain.eulerfsi:size = (0, 1, 1): must be > 0 in every component"),
        ("solid1_youngsModulus", (-1.0,), "/World/Solid1.eulerfsi:youngsModulus = -1: must be > 0"),
        ("solid1_path", ("/obj/nothing",), "/World/Solid1.points = empty: must be the points and faces"),
    ],
)
def test_faulty_scene_is_reported_and_not_written(module, node: Node, parm: str, value: tuple, message: str) -> None:
    node.parms[parm].set(value)
    with pytest.raises(NodeError, match=re.escape(message)):
        module.save_scene({"node": node})
    assert not os.path.exists(node.evalParm("scene"))


def test_simulate_starts_the_command_with_its_arguments(module, node: Node, tmp_path: Path, monkeypatch) -> None:
    tool = tmp_path / "tool"
    tool.write_text('#!/bin/sh\nprintf "%s\\n" "$@" "python=$PYTHONPATH"\n', encoding="utf-8")
    tool.chmod(0o755)
    monkeypatch.setenv("PYTHONPATH", "/houdini/python")
    node.parms["command"].set((str(tool),))
    node.parms["threads"].set((3,))
    node.parms["overwrite"].set((1,))
    assert module.simulate({"node": node}).wait(timeout=30) == 0
    scene, output = node.evalParm("scene"), node.evalParm("output")
    printed = Path(scene).with_suffix(".log").read_text(encoding="utf-8").splitlines()
    expected = ["simulate", scene, "-o", output, "--frames", "1-48", "--progress", "plain", "--threads", "3"]
    assert printed == [*expected, "--overwrite", "python="]


def test_a_missing_command_is_named(module, node: Node) -> None:
    node.parms["command"].set(("/nowhere/eulerfsi",))
    with pytest.raises(NodeError, match=r"/out/bake1\.command = /nowhere/eulerfsi: No such file"):
        module.simulate({"node": node})
