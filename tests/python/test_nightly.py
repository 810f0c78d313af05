"""The parts of the nightly run: every nightly test is in one slice, and the options choose."""

from __future__ import annotations

import ast
import re
import shlex
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

import nightly  # noqa: E402

PARTS = nightly.read_parts()
SLICES = [part for part in PARTS if part["kind"] == "slice"]


def option(command: str, name: str) -> str | None:
    words = shlex.split(command)
    return words[words.index(name) + 1] if name in words else None


def nightly_cases() -> list[str]:
    """As CTest names them: "room: title"."""
    case = re.compile(r'TEST_CASE\(\s*"([^"]*)",\s*"[^"]*\[nightly\][^"]*"\)')
    unit = ROOT / "tests" / "unit"
    return [
        f"{path.relative_to(unit).parts[0]}: {title}"
        for path in sorted(unit.rglob("test_*.cpp"))
        for title in case.findall(path.read_text())
    ]


def nightly_functions() -> list[str]:
    """As pytest -k sees them: "module::function"."""
    found = []
    for path in sorted((ROOT / "tests" / "python").glob("test_*.py")):
        for node in ast.parse(path.read_text()).body:
            marks = [ast.unparse(mark) for mark in getattr(node, "decorator_list", [])]
            if any("pytest.mark.nightly" in mark for mark in marks):
                found.append(f"{path.name}::{node.name}")
    return found


def slices_of_case(name: str) -> list[str]:
    def takes(command: str) -> bool:
        only, but = option(command, "-R"), option(command, "-E")
        return (not only or re.search(only, name) is not None) and not (but and re.search(but, name))

    return [part["name"] for part in SLICES if "ctest --preset nightly" in part["command"] and takes(part["command"])]


def slices_of_function(name: str) -> list[str]:
    return [
        part["name"]
        for part in SLICES
        if "-m pytest" in part["command"] and any(word in name for word in option(part["command"], "-k").split(" or "))
    ]


def test_every_nightly_case_is_in_one_slice() -> None:
    cases = nightly_cases()
    assert len(cases) > 20
    assert {name: slices_of_case(name) for name in cases if len(slices_of_case(name)) != 1} == {}


def test_every_nightly_function_is_in_one_slice() -> None:
    functions = nightly_functions()
    assert len(functions) > 5
    assert {name: slices_of_function(name) for name in functions if len(slices_of_function(name)) != 1} == {}


def test_a_slice_takes_at_most_three_minutes_and_finds_tests() -> None:
    assert [part["name"] for part in SLICES if part["seconds"] > 180] == []
    names = {name for case in nightly_cases() for name in slices_of_case(case)}
    names |= {name for function in nightly_functions() for name in slices_of_function(function)}
    tests = {
        part["name"] for part in SLICES if "ctest --preset nightly" in part["command"] or "-m pytest" in part["command"]
    }
    assert names == tests


def test_the_numbers_of_commits_go_through_all_slices() -> None:
    names = [nightly.chosen(PARTS, str(number), None)[0]["name"] for number in range(700, 700 + len(SLICES))]
    assert sorted(names) == sorted(part["name"] for part in SLICES)
    heaps = [part["name"] for number in range(3) for part in nightly.chosen(PARTS, f"{number}/3", None)]
    assert sorted(heaps) == sorted(names)


def test_names_choose_and_unknown_ones_are_refused() -> None:
    first, last = PARTS[0]["name"], PARTS[-1]["name"]
    assert [part["name"] for part in nightly.chosen(PARTS, None, f"{last},{first}")] == [last, first]
    with pytest.raises(ValueError, match="no such part: nothing"):
        nightly.chosen(PARTS, None, "nothing")
    assert {part["kind"] for part in nightly.chosen(PARTS, None, None)} == {"slice", "whole"}


def test_every_check_in_blender_is_run_by_ci_each_time_or_by_one_slice() -> None:
    files = {path.stem.removeprefix("check_") for path in (ROOT / "tests" / "blender").glob("check_*.py")}
    commands = [*(ROOT / ".ci" / "run").read_text().splitlines(), *(part["command"] for part in SLICES)]
    named = [line.partition("tests/blender/run.py")[2].split() for line in commands if "tests/blender/run.py" in line]
    assert sorted(name for names in named for name in names) == sorted(files) and {"scene", "panels"} <= set(named[0])
