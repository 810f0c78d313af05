"""libeulerfsi and what a user would take instead, on the same cases: error against processor seconds.

`python tests/bench/peers/run.py [--peer NAME,..] [--case NAME,..] [--quick] [--output FILE] [--no-install]`

Makes an environment of its own for each peer (.eulerfsi/peers), runs every case in a process of its own on one
processor, and appends rows to tests/bench/results/peers.csv; runs that it has are not made again. Exit code 1 where a
peer is absent.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import shared  # noqa: E402
from accuracy import table  # noqa: E402
from accuracy.table import Row  # noqa: E402
from eulerfsi.errors import UsageError  # noqa: E402

OUTPUT = HERE.parent / "results" / "peers.csv"
ENVIRONMENTS = ROOT / ".eulerfsi" / "peers"
OURS = table.SOLVER
LIMIT, START = 60, 60  # processor seconds of a run's steps; of what comes before, compiling included
NORMS = {
    "frequency": "|x / x_Lamb - 1|",
    "energy": "|energy kept - 1|",
    "restitution": "|e / e_ref - 1|",
    "sag": "|sag / sag_ref - 1|",
}
WINDOWS = {"oscillation": "10 periods", "bounce": "0.06 s", "cantilever": "at rest"}


class Absent(Exception):
    """A peer cannot be run here; the text says why."""


@dataclasses.dataclass(frozen=True)
class Solver:
    """One of solvers.toml."""

    name: str
    script: str
    environment: str
    runs: dict[str, list[dict[str, Any]]]  # by case: options, and `across` where it differs from the case's

    @property
    def requirements(self) -> Path:
        return HERE / f"requirements-{self.environment}.txt"

    @property
    def version(self) -> str:
        """Of the first requirement; "" of ours."""
        return self.requirements.read_text().split()[0].split("==")[1] if self.environment else ""

    @property
    def label(self) -> str:
        return f"{self.name} {self.version}".strip()


@dataclasses.dataclass(frozen=True)
class Run:
    """One process."""

    solver: Solver
    case: str
    across: int
    options: dict[str, Any]

    def row(self, measure: str, **columns: Any) -> Row:
        ours = self.solver.name == OURS
        first = {"commit": table.commit() if ours else self.solver.version, "machine": table.machine()}
        first |= {"case": f"peer_{measure}", "solver": self.solver.label, "sweep": "resolution" if ours else "peer"}
        first |= {"cells": self.across, "parameters": table.text_of(self.options), "norm": NORMS[measure]}
        return Row(**first | {"window": WINDOWS[self.case]} | columns)


MEASURES = {"oscillation": ("frequency", "energy"), "bounce": ("restitution",), "cantilever": ("sag",)}


def solvers(path: Path = HERE / "solvers.toml") -> dict[str, Solver]:
    listed = tomllib.loads(path.read_text())
    return {
        name: Solver(name, entry["script"], entry.get("environment", ""), {c: entry.get(c, []) for c in shared.CASES})
        for name, entry in listed.items()
    }


def planned(chosen: Sequence[Solver], cases: Sequence[str], quick: bool) -> list[Run]:
    """Runs, cheap ones first. quick: of each case and solver the first options at their coarsest resolution."""
    known, out = shared.read_cases(), []
    for solver in chosen:
        for case in cases:
            for options in solver.runs[case][: 1 if quick else None]:
                across = options.get("across", known[case]["across"])
                kept = {name: value for name, value in options.items() if name != "across"}
                out += [Run(solver, case, n, kept) for n in (across[:1] if quick else across)]
    return sorted(out, key=lambda run: run.across)


# --- environments ----------------------------------------------------------------------------------------------------


def interpreter(solver: Solver, install: bool) -> Path:
    """Python of the solver's environment, which is made where it is missing. Raises Absent."""
    if not solver.environment:
        return Path(sys.executable)
    place = ENVIRONMENTS / solver.environment
    python, stamp = place / "bin" / "python", place / "requirements.txt"
    wanted = solver.requirements.read_text()
    if python.exists() and stamp.exists() and stamp.read_text() == wanted:
        return python
    if not install:
        raise Absent(f"{solver.name}: absent: no environment {place.relative_to(ROOT)}; left out")
    try:
        venv.create(place, with_pip=True, clear=True)
        command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        done = subprocess.run([*command, "-r", str(solver.requirements)], capture_output=True, text=True, check=False)
    except (OSError, subprocess.CalledProcessError) as error:
        raise Absent(f"{solver.name}: absent: {place.relative_to(ROOT)} cannot be made: {error}; left out") from None
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["pip said nothing"])[-1]
        raise Absent(f"{solver.name}: absent: pip cannot install {solver.requirements.name}: {last}; left out")
    stamp.write_text(wanted)
    return python


# --- runs ------------------------------------------------------------------------------------------------------------


def child(run: Run, python: Path) -> dict[str, Any]:
    """What the script printed, or {"failure": why not}."""
    command = [str(python), str(HERE / run.solver.script), run.case, str(run.across)]
    command += ["--options", json.dumps(run.options)]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"}
    if run.solver.name == OURS:
        environment["PYTHONPATH"] = os.pathsep.join(str(ROOT / part) for part in ("batch", "usd_plugin"))
        if "EULERFSI_LIBRARY" in environment:
            environment["EULERFSI_LIBRARY"] = str(Path(environment["EULERFSI_LIBRARY"]).resolve())
    limit = LIMIT + START
    with tempfile.TemporaryDirectory() as folder:  # for what a peer writes where it runs
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            cwd=folder,
            env=environment,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
        )
    return read(done.stdout, done.stderr, done.returncode)


def read(output: str, errors: str, code: int) -> dict[str, Any]:
    """A script's result, or {"failure": one line}."""
    for line in output.splitlines():
        if line.startswith(shared.MARK):
            try:
                return json.loads(line.removeprefix(shared.MARK))
            except json.JSONDecodeError:
                return {"failure": f"its result is damaged: {line[:60]}"}
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"failure": f"over {LIMIT + START} processor seconds"}
    last = (errors.strip().splitlines() or ["no result"])[-1]
    return {"failure": f"ended with code {code}: {last}"}


def measured(run: Run, found: dict[str, Any]) -> list[Row]:
    """The rows of a result."""
    if "failure" in found:
        return [run.row(name, failure=found["failure"]) for name in MEASURES[run.case]]
    case = shared.case_of(run.case, run.across, run.options)
    cost = {"core_s": found["core"], "wall_s": found["wall"], "steps": found["steps"]}
    cost |= {"peak_mb": found["memory"] / 2**20, "numbers": table.text_of({"setup core s": found["setup"]})}
    if run.case != "cantilever" or run.solver.environment != "skfem":
        cost["step"] = f"{case.end / found['steps']:.3g}"
    rows = []
    for line in shared.judge(case, found):
        failure = ""
        if not found.get("clear", True):
            failure = f"still on the floor after {case.end:g} s"
        elif line["error"] != line["error"]:
            failure = "not a number"
        values = {} if failure else {name: line[name] for name in ("value", "reference", "error")}
        rows.append(run.row(line["measure"], failure=failure, **cost, **values))
    return rows


def carry_out(run: Run, python: Path) -> list[Row]:
    """Makes a run; the load is that of others, as in `bench accuracy`."""
    busy, begun, used = table.busy_seconds(), time.perf_counter(), os.times()
    found = child(run, python)
    now, wall = os.times(), time.perf_counter() - begun
    own = now.children_user + now.children_system - used.children_user - used.children_system
    load = None if busy is None else max(0.0, ((table.busy_seconds() or 0.0) - busy - own) / wall)
    return [dataclasses.replace(row, load=load, triad_ns=table.triad()) for row in measured(run, found)]


def text(row: Row) -> str:
    """One line of what is printed."""
    options = "" if row.parameters == "{}" else f" {row.parameters}"
    name = f"{row.case.removeprefix('peer_'):<11} {row.solver:<22} {row.cells:>3g}{options}"
    if row.failure:
        return f"{name}: {row.failure}"
    return f"{name}: error {row.error:.3g}, {row.core_s:.3g} core s, {row.steps} steps, {row.peak_mb:.0f} MiB"


def make(
    chosen: Sequence[Solver], cases: Sequence[str], output: Path, quick: bool = False, install: bool = True
) -> int:
    """Makes the runs that the table lacks; returns the number of peers that are absent."""
    table.demand_writable(output)
    identity = lambda row: (row.case, row.solver, row.cells, row.parameters, row.commit, row.machine)  # noqa: E731
    have = {identity(row) for row in table.read(output)}
    pythons, absent = {}, 0
    for solver in chosen:
        try:
            pythons[solver.name] = interpreter(solver, install)
        except Absent as reason:
            print(reason, flush=True)
            absent += 1
    for run in planned([solver for solver in chosen if solver.name in pythons], cases, quick):
        if all(identity(run.row(name)) in have for name in MEASURES[run.case]):
            continue
        for row in carry_out(run, pythons[run.solver.name]):
            table.append(output, row)
            print(text(row), flush=True)
    return absent


def picked(option: str, given: str | None, known: Sequence[str]) -> list[str]:
    """The names given, all without any. Raises UsageError for an unknown one."""
    names = given.split(",") if given else list(known)
    if unknown := [name for name in names if name not in known]:
        raise UsageError(f"--{option} {unknown[0]}: must be one of {', '.join(known)}")
    return names


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    parser = argparse.ArgumentParser(prog="run.py", description=__doc__.splitlines()[0], allow_abbrev=False)
    listed = solvers()
    parser.add_argument("--peer", metavar="NAME,..", help=f"some of {', '.join(listed)}; default all")
    parser.add_argument("--case", metavar="NAME,..", help=f"some of {', '.join(shared.CASES)}; default all")
    parser.add_argument("--quick", action="store_true", help="each solver and case once, at its coarsest")
    parser.add_argument("--output", type=Path, default=OUTPUT, metavar="FILE", help="default: tests/bench/results")
    parser.add_argument("--no-install", action="store_true", help="only peers whose environment exists")
    options = parser.parse_args(arguments)
    try:
        chosen = [listed[name] for name in picked("peer", options.peer, list(listed))]
        cases = picked("case", options.case, shared.CASES)
        absent = make(chosen, cases, options.output, options.quick, not options.no_install)
    except UsageError as error:
        print(error, file=sys.stderr)
        return 2
    return 1 if absent else 0


if __name__ == "__main__":
    sys.exit(main())
