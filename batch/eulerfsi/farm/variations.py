"""What differs between the jobs of a wedge: lists of values on the command line, rows of a table."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import math
import re
from collections.abc import Sequence
from pathlib import Path

from pxr import Usd

from ..errors import UsageError
from ..parameters import NAMESPACE
from ..scene.instancers import expand_instancers
from ..scene.overrides import apply_overrides
from ..scene.read import open_stage

MOST_JOBS = 10_000
_LONGEST_NAME = 120  # characters of a folder; jobs with a longer one are numbered
_TARGET = re.compile(r"[^.]+\.[^.]+")

# One step along an axis of the wedge: {"Ball.youngsModulus": "1e4"}.
Choice = dict[str, str]


@dataclasses.dataclass(frozen=True)
class Job:
    """One run of a wedge. folder: its name; values: what it sets, in the order of the command line."""

    folder: str
    values: Choice

    def settings(self) -> list[str]:
        """As `--set` takes them."""
        return [f"{target}={value}" for target, value in self.values.items()]


@dataclasses.dataclass(frozen=True)
class Axis:
    """Choices that exclude each other. where: the option that gave them, for messages."""

    where: str
    choices: tuple[Choice, ...]


def parse_list(text: str) -> Axis:
    """`--vary PRIM.ATTR=V1,V2,...`; commas inside brackets belong to a value: (0,-2,0),(0,-4,0)."""
    where = f"--vary {text}"
    target, equals, values = text.partition("=")
    target = target.strip()
    if not equals or not _TARGET.fullmatch(target):
        raise UsageError(f"{where}: must read PRIM.ATTR=VALUE,VALUE, for example Ball.youngsModulus=1e4,4e4")
    found = _split(values)
    for number, value in enumerate(found, 1):
        if not value:
            raise UsageError(f"{where}: value {number} of {len(found)} is empty")
    return Axis(where, tuple({target: value} for value in found))


def read_table(path: Path) -> Axis:
    """`--table FILE.csv`: a column PRIM.ATTR for each parameter, a row for each job. Raises UsageError."""
    where = f"--table {path}"
    try:
        rows = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if row]
    except OSError as error:
        raise UsageError(f"{where}: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{where}: is no table of comma-separated values: {error}") from error
    if len(rows) < 2:
        raise UsageError(f"{where}: must have a line of names PRIM.ATTR and at least one row of values")
    names = [name.strip() for name in rows[0]]
    for name in names:
        if not _TARGET.fullmatch(name):
            raise UsageError(f"{where}: line 1: {name!r}: must read PRIM.ATTR, for example Ball.youngsModulus")
        if names.count(name) > 1:
            raise UsageError(f"{where}: line 1: {name} is there {names.count(name)} times: must be there once")
    choices = []
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise UsageError(f"{where}: row {line} has {len(row)} values: must have {len(names)}, one for each name")
        choice = {name: value.strip() for name, value in zip(names, row, strict=True)}
        for name, value in choice.items():
            if not value:
                raise UsageError(f"{where}: row {line}: {name} is empty")
        choices.append(choice)
    return Axis(where, tuple(choices))


def plan(axes: Sequence[Axis], together: bool) -> list[Job]:
    """The jobs: all combinations of the axes, the last one fastest, or, together, the axes side by side.

    Raises UsageError for none, too many, lists of unequal length, and two jobs with one folder.
    """
    if not axes:
        raise UsageError("wedge: nothing varies; give --vary PRIM.ATTR=VALUE,VALUE or --table FILE.csv")
    names = [name for axis in axes for name in axis.choices[0]]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"wedge: {name} is given {names.count(name)} times: must be given once")
    if together and len({len(axis.choices) for axis in axes}) > 1:
        lengths = "; ".join(f"{axis.where} has {len(axis.choices)}" for axis in axes)
        raise UsageError(f"--together: the lists must have as many values as each other: {lengths}")
    count = len(axes[0].choices) if together else math.prod(len(axis.choices) for axis in axes)
    if count > MOST_JOBS:
        raise UsageError(f"wedge: {count} jobs: must be at most {MOST_JOBS}")
    lists = [axis.choices for axis in axes]
    steps = zip(*lists, strict=True) if together else itertools.product(*lists)
    chosen = [{name: value for choice in step for name, value in choice.items()} for step in steps]
    folders = [folder_name(values) for values in chosen]
    first: dict[str, int] = {}
    for number, folder in enumerate(folders, 1):
        if (before := first.setdefault(folder, number)) != number:
            raise UsageError(f"wedge: jobs {before} and {number} would both write to the folder {folder}")
    if any(len(folder) > _LONGEST_NAME for folder in folders):
        digits = len(str(count))
        folders = [f"{number:0{digits}d}" for number in range(1, count + 1)]
    return [Job(folder, values) for folder, values in zip(folders, chosen, strict=True)]


def check(scene: Path, axes: Sequence[Axis], path_map: Sequence[str] = (), confine: bool = False) -> dict[str, str]:
    """Opens the scene and tries every value. Returns {"Ball.youngsModulus": "/World/Ball.eulerfsi:youngsModulus"}.

    Raises SceneError for a scene that cannot be opened, UsageError that names the list and suggests the nearest names.
    """
    stage: Usd.Stage = open_stage(scene, path_map, confine)
    expand_instancers(stage)
    attributes: dict[str, str] = {}
    for axis in axes:
        for name in axis.choices[0]:
            values = dict.fromkeys(choice[name] for choice in axis.choices)
            option = "--vary" if axis.where.startswith("--vary") else f"{axis.where}:"
            applied = apply_overrides(stage, [f"{name}={value}" for value in values], option)
            attribute = next(iter(applied))
            for other, same in attributes.items():
                if same == attribute:
                    raise UsageError(f"wedge: {other} and {name} are both {attribute}: must be given once")
            attributes[name] = attribute
    return attributes


def _split(text: str) -> list[str]:
    """At the commas outside brackets."""
    found, depth = [""], 0
    for character in text:
        depth += (character in "([") - (character in ")]")
        if character == "," and depth <= 0:
            found.append("")
        else:
            found[-1] += character
    return [value.strip() for value in found]


def folder_name(values: Choice) -> str:
    """Ball.youngsModulus_10000__Domain.voxelSize_0.05: the same for values that are the same number."""
    parts = []
    for target, value in values.items():
        prim, _, name = target.rpartition(".")
        parts.append(f"{prim.rpartition('/')[2]}.{name.removeprefix(NAMESPACE)}_{_plain(value)}")
    return re.sub(r"[^\w.+-]", "_", "__".join(parts))


def _plain(value: str) -> str:
    try:
        return f"{float(value):.12g}"
    except ValueError:
        return re.sub(r"[\s()\[\]]+", "", value).replace(",", "_")
