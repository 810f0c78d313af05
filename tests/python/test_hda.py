"""The Houdini asset as text: files, dialog, callbacks, help. Its Python code: test_hda_code.py."""

from __future__ import annotations

import ast
import email
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from dialog_script import (
    ASSET,
    DIALOG,
    FOLDER,
    OPERATOR,
    PARMS,
    ROOT,
    encode,
    parse_dialog,
    section,
    sections_list,
    walk,
)
from eulerfsi_usd.parameters import load
from eulerfsi_usd.presets import presets

PYTHON_SECTIONS = ("PythonModule", "OnCreated")
SCOPE_PREFIX = {"domain": "", "solid": "solid#_", "emitter": "emitter#_", "force": "force#_", "collider": "collider#_"}


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
    disk = {name.replace("Contents.gz", "Contents.dir") for name in listed}  # a network is a folder of text
    assert {path.name for path in folder.iterdir()} == {*disk, "Sections.list"}
    assert all(encode(name).replace("_", "") == disk.replace("_", "") for disk, name in listed.items())


def test_network_is_text_and_passes_the_first_input_on() -> None:
    folder = ASSET / encode(OPERATOR) / "Contents.dir"
    assert {path.name for path in folder.iterdir()} == {*sections_list(folder / "Sections.list"), "Sections.list"}
    message = email.message_from_string((folder / "Contents.mime").read_text("utf-8"))
    parts = {part.get_filename(): part.get_payload() for part in message.walk() if part.get_filename()}
    assert parts["node_type"].strip() == "Sop" and f"type = {DIALOG['name'][0]}" in parts["hdaroot.init"]
    nodes = parts["hdaroot.order"].split()
    assert nodes == ["1", "output0"] and {f"hdaroot/{nodes[1]}.{kind}" for kind in ("init", "def", "parm")} <= {*parts}
    assert "type = output" in parts["hdaroot/output0.init"]
    assert re.search(r'inputsNamed3\n{\n0 \t\(0\) "" 1 "input1"\n}', parts["hdaroot/output0.def"])
    index = (ASSET / "INDEX__SECTION").read_text("utf-8")
    inputs = int(re.search(r"^Inputs: +0 to (\d)$", index, re.MULTILINE)[1])
    labels = [DIALOG[f"inputlabel{number}"] for number in range(1, inputs + 1)]
    assert labels == [["Solids"], ["Pins"], ["Colliders"]] and int(parts["hdaroot.inp"].split()[0]) == inputs
    for name in ("createtimes", "modtimes"):
        assert json.loads((folder / f"Contents.{name}").read_text("utf-8"))


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
            if isinstance(values[name], str):
                variables.setdefault(f"${name}", values[name])
    assert expand(package["hpath"]) == FOLDER and (FOLDER / "otls").is_dir()
    for place, name in zip(values["PYTHONPATH"], ("eulerfsi_usd", "eulerfsi_houdini"), strict=True):
        assert (expand(place) / name / "__init__.py").is_file()
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
    assert DIALOG["name"] == ["eulerfsi::solver::1.0"] and DIALOG["script"] == ["eulerfsi::solver::1.0"]
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
        for row in rows.values():
            multiparm, parm = PARMS[SCOPE_PREFIX[scope] + row.name]
            seen.add(SCOPE_PREFIX[scope] + row.name)
            assert multiparm == (f"{scope}s" if SCOPE_PREFIX[scope] else None)
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


def test_names_of_values_are_a_menu_above_the_number() -> None:
    order, found = list(PARMS), []
    for scope, rows in load().items():
        for row in (row for row in rows.values() if row.names):
            name = SCOPE_PREFIX[scope] + row.name
            _, menu = PARMS[order[order.index(name) - 1]]
            assert menu["name"] == [f"{name}Name"] and menu["default"] == ["custom"]
            assert menu["menu"][::2] == ["custom", *row.names]
            assert all(f"({value:g})" in menu["help"][0] for value in row.names.values())
            assert PARMS[name][1]["disablewhen"] == [f"{{ {name}Name != custom }}"]
            found.append(row.name)
    assert found == ["stepTolerance"]


def test_every_callback_exists() -> None:
    package = FOLDER / "python" / "eulerfsi_houdini" / "callbacks.py"
    functions = {node.name for node in ast.parse(package.read_text("utf-8")).body if isinstance(node, ast.FunctionDef)}
    (offered,) = (node for node in ast.parse(section("PythonModule")).body if isinstance(node, ast.ImportFrom))
    assert offered.module == "eulerfsi_houdini.callbacks"
    called = [parm for _, parm in PARMS.values() if "script_callback" in parm["tags"]]
    names = [re.fullmatch(r"hou\.phm\(\)\.(\w+)\(kwargs\)", parm["tags"]["script_callback"])[1] for parm in called]
    assert sorted(names) == sorted(alias.name for alias in offered.names) and {*names} <= functions
    assert all(parm["tags"]["script_callback_language"] == "python" for parm in called)
    assert [parm for _, parm in PARMS.values() if parm["type"] == ["button"] and parm not in called] == []


def test_disablewhen_names_parameters_and_tokens_of_their_menus() -> None:
    conditions = [(name, parm["disablewhen"][0]) for name, (_, parm) in PARMS.items() if "disablewhen" in parm]
    assert len(conditions) > 1
    for _, condition in conditions:
        name, token = re.fullmatch(r"{ (\S+) != (\S+) }", condition).groups()
        assert token in PARMS[name][1]["menu"][::2]


def test_materials_are_those_of_the_table() -> None:
    _, parm = PARMS["solid#_preset"]
    menu = dict(zip(parm["menu"][::2], parm["menu"][1::2], strict=True))
    assert menu == {"custom": "Custom"} | {name: preset.label for name, preset in presets().items()}
    assert all(f"{preset.label}: {preset.behaves}." in parm["help"][0] for preset in presets().values())


def test_every_parameter_has_a_card_of_help() -> None:
    cards = dict(re.findall(r"^.+:\n    #id: (\S+)\n\n    (.+)$", section("Help"), re.MULTILINE))
    assert cards == {name: parm["help"][0] for name, (_, parm) in PARMS.items() if parm["type"] != ["multiparm"]}
    assert "#internal: eulerfsi::solver::1.0" in section("Help")


def test_readme_says_that_it_was_never_loaded() -> None:
    assert "never been loaded in Houdini" in (FOLDER / "README.md").read_text("utf-8")
