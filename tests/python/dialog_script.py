"""The Houdini asset as text: its files, and a parser of its dialog script."""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "houdini_hda"
ASSET = FOLDER / "otls" / "eulerfsi_solver.hda"
OPERATOR = "eulerfsi::Sop/solver::1.0"

TOKEN = re.compile(r'\s+|#[^\n]*|(?P<string>"(?:[^"\\]|\\.)*")|(?P<brace>[{}])|(?P<word>[^\s{}"]+)')
BLOCKS = {"parm", "group", "multiparm"}
INPUT_LABEL = "inputlabel"


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
        if key == INPUT_LABEL:
            key, values, at = f"{key}{tokens[at]}", [tokens[at + 1]], at + 2
        elif tokens[at] == "{":
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
