"""The CSV of runs: its columns, reading it with refusals in one line, appending to it, what it was made on."""

from __future__ import annotations

import csv
import dataclasses
import functools
import hashlib
import io
import json
import math
import os
import platform
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi.errors import UsageError

ROOT = Path(__file__).resolve().parents[3]
RESULTS = ROOT / "tests" / "bench" / "results" / "accuracy.csv"
SOLVER = "eulerfsi"
SOURCES = ("libeulerfsi/src", "libeulerfsi/include", "batch/eulerfsi/run", "batch/eulerfsi/solver")  # of results
LOADED = 0.5  # processors that others keep busy: more is marked
TRIAD_SIZE, TRIAD_BLOCK, TRIAD_ROUNDS = 1 << 23, 1 << 14, 3
SWEEPS = ("resolution", "step", "tolerance", "preset", "peer")


@dataclasses.dataclass(frozen=True)
class Row:
    """One run. Columns: README.md. None is an empty field."""

    case: str
    solver: str = SOLVER
    preset: str = ""
    sweep: str = "resolution"
    cells: float = 0.0
    step: str = "default"
    tolerance: float | None = None
    seed: int = 0
    repeat: int = 1
    parameters: str = "{}"
    core_s: float | None = None
    wall_s: float | None = None
    peak_mb: float | None = None
    steps: int = 0
    velocity_iterations: int = 0
    pressure_iterations: int = 0
    value: float | None = None
    reference: float | None = None
    error: float | None = None
    norm: str = ""
    window: str = ""
    numbers: str = "{}"
    failure: str = ""
    commit: str = ""
    machine: str = ""
    load: float | None = None
    triad_ns: float | None = None

    @property
    def key(self) -> tuple:
        """What makes it the same run on the same code and machine."""
        return (*self.identity, self.repeat, self.commit, self.machine)

    @property
    def identity(self) -> tuple:
        """What makes it the same run."""
        names = ("case", "solver", "preset", "cells", "step", "tolerance", "seed", "parameters")
        return tuple(getattr(self, name) for name in names)

    @property
    def loaded(self) -> bool:
        """Whether others kept the machine busy meanwhile."""
        return (self.load or 0.0) > LOADED

    def number(self, name: str) -> float | None:
        """One of `numbers`; None where it has none of that name."""
        return json.loads(self.numbers).get(name)


COLUMNS = [field.name for field in dataclasses.fields(Row)]
_TYPES = {field.name: str(field.type).removesuffix(" | None") for field in dataclasses.fields(Row)}
_READ = {"int": int, "float": float, "str": str}


def read(path: Path) -> list[Row]:
    """All rows, [] where there is no file. Raises UsageError for a file that is none of these or is damaged."""
    if not path.exists():
        return []
    try:
        lines = list(csv.reader(io.StringIO(path.read_text())))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{path}: cannot be read: {error}") from None
    if not lines or lines[0] != COLUMNS:
        raise UsageError(f"{path}: no table of `bench accuracy`: its first line must be {','.join(COLUMNS[:5])},...")
    return [_row(path, number, cells) for number, cells in enumerate(lines[1:], 2)]


def _row(path: Path, number: int, cells: list[str]) -> Row:
    if len(cells) != len(COLUMNS):
        raise UsageError(f"{path}: line {number}: damaged: {len(cells)} fields, must be {len(COLUMNS)}")
    values: dict[str, Any] = {}
    for name, text in zip(COLUMNS, cells, strict=True):
        kind = _TYPES[name]
        try:
            values[name] = None if text == "" and kind != "str" else _READ[kind](text)
            if name in ("parameters", "numbers") and not isinstance(json.loads(text), dict):
                raise ValueError(text)
            if kind == "float" and values[name] is not None and not math.isfinite(values[name]):
                raise ValueError(text)
        except ValueError:
            what = {"str": "a JSON object", "int": "a whole number"}.get(kind, "a number")
            raise UsageError(f"{path}: line {number}: damaged: {name} is {text[:40]!r}, must be {what}") from None
        if kind == "int" and values[name] is None:
            raise UsageError(f"{path}: line {number}: damaged: {name} is empty, must be a whole number")
    return Row(**values)


def append(path: Path, row: Row) -> None:
    """Adds a row, and the head before the first one. Raises UsageError where it cannot be written."""
    head = not path.exists() or path.stat().st_size == 0
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            if head:
                writer.writerow(COLUMNS)
            writer.writerow([_cell(getattr(row, name)) for name in COLUMNS])
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None


def demand_writable(path: Path) -> None:
    """Raises UsageError where a row could not be written at the end of a run."""
    folder = path.parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir() or not os.access(path if path.exists() else folder, os.W_OK):
        raise UsageError(f"{path}: cannot be written: the folder or the file is read-only")


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def text_of(values: dict[str, Any]) -> str:
    """A JSON object for a column: sorted, numbers with six digits, those that are not finite left out."""

    def short(value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            return [short(v) for v in value]
        return float(f"{value:.6g}") if isinstance(value, float) else value

    kept = {k: short(v) for k, v in values.items() if not isinstance(v, float) or math.isfinite(v)}
    return json.dumps(kept, sort_keys=True)


# --- where it was made -----------------------------------------------------------------------------------------------


def machine() -> str:
    """Processor and number of cores."""
    model, info = platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    for entry in info.read_text().splitlines() if info.exists() else []:
        if entry.startswith("model name"):
            model = entry.split(":", 1)[1].strip()
            break
    return f"{model}, {os.cpu_count()} cores"


@functools.cache
def commit() -> str:
    """The last commit that changed the solver, with a hash of the changes since; "unknown" outside a repository."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=False)
        return done.stdout if done.returncode == 0 else ""

    last = git("log", "-1", "--format=%h", "--", *SOURCES).strip()
    changes = git("diff", "HEAD", "--", *SOURCES)
    mark = f"+{hashlib.sha1(changes.encode()).hexdigest()[:6]}" if changes else ""
    return f"{last or 'unknown'}{mark}"


@functools.cache
def triad() -> float:
    """ns per element of a = b + s c over 32 MiB of floats in one thread, by blocks of the cache; best of 3."""
    b, c = np.ones(TRIAD_SIZE, np.float32), np.ones(TRIAD_SIZE, np.float32)
    a, scaled, best = np.zeros(TRIAD_SIZE, np.float32), np.empty(TRIAD_BLOCK, np.float32), math.inf
    for _ in range(TRIAD_ROUNDS):
        begun = time.perf_counter()
        for at in range(0, TRIAD_SIZE, TRIAD_BLOCK):
            block = slice(at, at + TRIAD_BLOCK)
            np.multiply(c[block], np.float32(3.0), out=scaled)
            np.add(b[block], scaled, out=a[block])
        best = min(best, time.perf_counter() - begun)
    return 1e9 * best / TRIAD_SIZE


def here() -> dict[str, Any]:
    """machine and triad_ns of a row."""
    return {"machine": machine(), "triad_ns": triad()}


def busy_seconds() -> float | None:
    """Processor seconds that the whole machine has worked so far; None where the system does not tell."""
    stat = Path("/proc/stat")
    if not stat.exists():
        return None
    user, nice, system, _idle, _wait, irq, soft, steal = map(int, stat.read_text().split(None, 9)[1:9])
    return (user + nice + system + irq + soft + steal) / os.sysconf("SC_CLK_TCK")
