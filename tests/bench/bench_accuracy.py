"""Error against run time: `./eulerfsi bench accuracy [--case NAME,..] [--group NAME,..] [--quick] [--compare FILE]`.

Every run is a process of its own with one thread and one line of tests/bench/results/accuracy.csv, whose columns
tests/bench/accuracy/README.md explains; a run that the table has already is not made again, so that an interrupted
call is continued by the same call. Prints every run, then the orders of every case. Exit code 1 where --compare finds
an error or a time that has grown; a run that fails is a line, and no failure of the benchmark.

--expectations measures the curves from which `validate` tells what to expect, and writes them where it reads them;
with --seed N random scenes at a third of their voxel size show whether that holds: exit code 1 where fewer than 16 of
20 keep twice of what was said.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", ROOT / "tests" / "bench"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from accuracy import fit, front, report, sweep, table  # noqa: E402
from accuracy.sweep import Case, Run  # noqa: E402
from accuracy.table import Row  # noqa: E402
from eulerfsi import files  # noqa: E402
from eulerfsi.errors import UsageError  # noqa: E402

PEERS = ROOT / "tests" / "bench" / "peers" / "accuracy_peers.py"
REPEATS = 3  # of runs that are compared
EXPECTED = table.RESULTS.with_name("expectations.csv")
PATIENCE = 10.0  # wall-clock seconds of a run per processor second of its limit, and a minute


def parse(arguments: Sequence[str] | None, cases: dict[str, Case]) -> argparse.Namespace:
    """Options; raises UsageError for a name that is none."""
    parser = argparse.ArgumentParser(prog="eulerfsi bench accuracy", description=__doc__.splitlines()[0])
    groups = sorted({case.group for case in cases.values()})
    parser.add_argument("--case", metavar="NAME,..", help=f"some of {', '.join(cases)}")
    parser.add_argument("--group", metavar="NAME,..", help=f"some of {', '.join(groups)}")
    parser.add_argument("--quick", action="store_true", help="every case at one point, coarse: at most 10 minutes")
    parser.add_argument("--sweep", metavar="NAME,..", help=f"some of {', '.join(table.SWEEPS[:4])}; default: all")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="draws other parameters; 0: those of the file")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="an earlier table: names what has become worse")
    parser.add_argument("--peers", action="store_true", help="also what a user would take instead (tests/bench/peers)")
    parser.add_argument("--expectations", action="store_true", help="what `validate` says, beside random scenes")
    parser.add_argument("--scenes", type=int, default=20, metavar="N", help="of --expectations; default: %(default)s")
    parser.add_argument("--list", action="store_true", help="print the cases and how many runs each has")
    parser.add_argument(
        "--output", type=Path, metavar="FILE", help=f"the table; default: {table.RESULTS}, or that of --expectations"
    )
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    for option in ("seed", "scenes"):
        if getattr(options, option) < 0:
            raise UsageError(f"--{option} {getattr(options, option)}: must be >= 0")
    options.output = options.output or (EXPECTED if options.expectations else table.RESULTS)
    for option, known in (("case", list(cases)), ("group", groups), ("sweep", list(table.SWEEPS[:4]))):
        unknown = [name for name in (getattr(options, option) or "").split(",") if name and name not in known]
        if unknown:
            raise UsageError(f"--{option} {unknown[0]}: must be one of {', '.join(known)}")
    if options.compare and not options.compare.is_file():
        raise UsageError(f"--compare {options.compare}: there is no such file")
    if options.peers and not PEERS.is_file():
        raise UsageError(f"--peers: {PEERS.relative_to(ROOT)} is missing: no peer can be run")
    return options


def chosen(options: argparse.Namespace, cases: dict[str, Case]) -> list[Case]:
    """The cases whose runs are made: those that are named, and of one measured on another's runs that other one."""
    names = options.case.split(",") if options.case else list(cases)
    groups = options.group.split(",") if options.group else None
    picked = [cases[n] for n in names if groups is None or cases[n].group in groups]
    return list({(case.of or case.name): cases[case.of or case.name] for case in picked}.values())


def planned(options: argparse.Namespace, cases: dict[str, Case], before: Sequence[Row]) -> list[Run]:
    """The runs, those of the front of an earlier table three times."""
    out = [run for case in chosen(options, cases) for run in sweep.runs(case, options.seed, options.quick)]
    if options.sweep:
        out = [run for run in out if run.sweep in options.sweep.split(",")]
    again = {row.identity for rows in front.by_case(before).values() for row in front.front(rows)}
    extra = [run for run in out if run.row().identity in again]
    return out + [dataclasses.replace(run, repeat=k) for k in range(2, REPEATS + 1) for run in extra]


def run_child(run: Run) -> dict[str, Any]:
    """What `registry.carry_out` says of a run, in a process of its own."""
    from accuracy import registry

    command = [sys.executable, str(Path(__file__).resolve()), "--child"]
    environment = {**os.environ, "OMP_WAIT_POLICY": "passive", "OMP_NUM_THREADS": "1"}
    wait = PATIENCE * run.limit + 60
    try:
        done = subprocess.run(
            command,
            input=registry.to_text(run),
            capture_output=True,
            text=True,
            check=False,
            env=environment,
            timeout=wait,
        )
    except subprocess.TimeoutExpired:
        return {"cost": {}, "measured": {}, "failure": f"given up after {wait:g} s"}
    if done.returncode == 0:
        answer = json.loads(done.stdout)
        said = [line for line in done.stderr.splitlines() if line.startswith("error: ")]  # of `simulate`
        return answer | {"failure": ": ".join([answer["failure"], *said[:1]])} if answer["failure"] else answer
    last = (done.stderr.strip().splitlines() or [""])[-1]
    return {"cost": {}, "measured": {}, "failure": f"the process ended with code {done.returncode}: {last}"}


def rows_of(run: Run, of: Sequence[str]) -> list[Row]:
    """A run's rows: its case's, and those of the cases in `of` that are measured on it."""
    busy, begun = table.busy_seconds(), time.perf_counter()
    used = os.times()
    answer = run_child(run)
    now, wall = os.times(), time.perf_counter() - begun
    own = now.children_user + now.children_system - used.children_user - used.children_system
    load = None if busy is None else max(0.0, ((table.busy_seconds() or 0.0) - busy - own) / wall)
    shared = answer["cost"] | {"failure": answer["failure"], "commit": table.commit(), "load": load} | table.here()
    out = []
    for name in (run.case, *of):
        columns = answer["measured"].get(name, {})
        columns |= {"numbers": table.text_of(columns.get("numbers", {}))}
        out.append(dataclasses.replace(run.row(**shared | columns), case=name))
    return out


def make(options: argparse.Namespace, cases: dict[str, Case], before: Sequence[Row]) -> list[Row]:
    """Makes the runs that the table lacks; returns all of its rows."""
    rows = table.read(options.output)
    have = {row.key for row in rows}
    here = {"commit": table.commit(), "machine": table.machine()}
    wanted = planned(options, cases, before)
    for done, run in enumerate(wanted, 1):
        if run.row(**here).key in have:
            continue
        made = rows_of(run, [name for name, case in cases.items() if case.of == run.case])
        for row in made:
            table.append(options.output, row)
        rows += made
        print(f"{done}/{len(wanted)} {report.line(made[0])}", flush=True)
    return rows


def current(rows: Sequence[Row], options: argparse.Namespace, cases: dict[str, Case]) -> list[Row]:
    """Rows of these cases on this machine and commit, with errors."""
    names = {
        name for case in chosen(options, cases) for name in cases if name == case.name or cases[name].of == case.name
    }
    here = (table.machine(), table.commit())
    rows = [row for row in rows if row.case in names and row.seed == options.seed]
    return fit.with_errors([row for row in rows if (row.machine, row.commit) == here])


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    _, cases = sweep.load()
    options = parse(arguments, cases)
    if options.child:
        from accuracy import registry

        json.dump(registry.carry_out(registry.from_text(sys.stdin.read())), sys.stdout)
        return 0
    if options.list:
        for case in cases.values():
            made = f"on the runs of {case.of}" if case.of else f"{len(sweep.runs(case))} runs; cells: {case.across}"
            print(f"{case.group:<10} {case.name:<22} {made}")
        return 0
    if options.expectations:
        from accuracy import expectations

        if options.seed:
            return 0 if expectations.check(options.seed, options.scenes) else 1
        options.case, options.sweep = ",".join(expectations.CASES), "resolution"
    before = fit.with_errors(table.read(options.compare)) if options.compare else []
    table.demand_writable(options.output)
    rows = current(make(options, cases, before), options, cases)
    if options.expectations:
        expectations.write(rows)
    if options.peers:
        sys.path.insert(0, str(PEERS.parent))
        code = importlib.import_module(PEERS.stem).main(
            options.output, [c.name for c in chosen(options, cases)], options.quick
        )
        if code:
            return int(code)
    print("\n".join(report.summary(rows)))
    if kept := fit.with_errors(front.newest(table.read(options.output))):
        files.write_text(options.output.with_suffix(".md"), report.document(kept))
    loaded = sum(row.loaded for row in rows)
    if loaded:
        busy = f"others kept over {table.LOADED:g} processors busy"
        print(f"warning: {loaded} of {len(rows)} runs shared the machine: {busy}")
    if not options.compare:
        return 0
    compared = front.compare(before, rows)
    print("\n".join(compared.lines or ["nothing has become worse"]))
    return 1 if compared.worse else 0


if __name__ == "__main__":
    sys.exit(main())
