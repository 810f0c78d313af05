"""Speed, memory and physics against their bars: `./eulerfsi bench speed [--quick] [--only GROUP,..] [--against DIR]`.

Each line prints bar, measured, the same time in triads, verdict, the conditions (resolution, step, preset, norm) and
the machine. A triad is a = b + s c over one float field of the scene's size with the same number of threads, measured
just before and after. Every case runs in a process of its own, which drives the solver through the binding alone, so
that its memory is the solver's. Core time is processor time of all threads as the system counts it. Exit code 1 if a
bar is missed, unless CI=true or --quick (coarse grids, on which the bars mean nothing).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", ROOT / "tests" / "bench"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from loop.table import cell, markdown, text  # noqa: E402
from speed import groups  # noqa: E402
from speed.groups import Outcome, Sizes, Table  # noqa: E402
from speed.lines import Line  # noqa: E402

RESULTS = Path(__file__).resolve().parent / "results"
LINE_NAMES = ("bar", "measured", "unit", "triads", "verdict", "conditions")


def machine() -> str:
    """Processor, number of cores, load."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    for entry in info.read_text().splitlines() if info.exists() else []:
        if entry.startswith("model name"):
            model = entry.split(":", 1)[1].strip()
            break
    return f"{model}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


def line_cells(line: Line, quick: bool) -> dict[str, str]:
    """One line as the texts of a table."""
    triads = "" if line.triads is None else f"{line.triads:.4g}"
    verdict = "not judged" if quick else line.verdict
    return {
        "bar": line.bar,
        "measured": cell(float(line.measured)),
        "unit": line.unit,
        "triads": triads,
        "verdict": verdict,
        "conditions": line.conditions,
    }


def line_text(line: Line, quick: bool, where: str) -> str:
    """One line as it is printed."""
    cells = line_cells(line, quick)
    triads = f" = {cells['triads']} triads" if cells["triads"] else ""
    measured = f"{cells['measured']} {line.unit}".rstrip()
    return f"{line.bar}: {measured}{triads} | {cells['verdict']} | {line.conditions} | {where}"


def table_cells(table: Table) -> list[dict[str, str]]:
    return [{name: cell(value) for name, value in row.items()} for row in table]


def report(title: str, where: str, lines: Sequence[Line], tables: dict[str, Table], quick: bool) -> str:
    """The Markdown of a run."""
    parts = [f"# {title}", where, "## Bars", markdown([line_cells(line, quick) for line in lines], LINE_NAMES)]
    for name, table in tables.items():
        parts += [f"## {name}", markdown(table_cells(table), table[0] if table else ())]
    return "\n\n".join(parts) + "\n"


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="eulerfsi bench speed", description=__doc__.splitlines()[0])
    names = [*groups.GROUPS, "against", "peer"]
    parser.add_argument("--quick", action="store_true", help="coarse grids everywhere: checks the benchmark itself")
    parser.add_argument(
        "--only", metavar="GROUP,..", help=f"some of {', '.join(names)}; peer (Blender's smoke) runs only when named"
    )
    parser.add_argument(
        "--against",
        type=Path,
        metavar="DIR",
        help="also compare ball and smoke with another checkout, set up by its own ./eulerfsi setup, taking turns",
    )
    parser.add_argument("--rounds", type=int, default=2, metavar="N", help="turns of --against; default: 2")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all lines to a file")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="also write all tables to a .md file; a name without folder goes to tests/bench/results",
    )
    options = parser.parse_args(arguments)
    options.groups = options.only.split(",") if options.only else [*groups.GROUPS]
    unknown = sorted(set(options.groups) - set(names))
    if unknown:
        parser.error(f"--only {options.only}: {', '.join(unknown)}: must be some of {', '.join(names)}")
    if options.against is None and "against" in options.groups:
        parser.error("--only against: needs --against DIR")
    if options.rounds < 1:
        parser.error(f"--rounds {options.rounds}: must be at least 1")
    if options.against is not None:
        options.against = options.against.resolve()
        if not options.only:
            options.groups.append("against")
    if options.output and options.output.parent == Path("."):
        options.output = RESULTS / options.output
    return options


def runs(options: argparse.Namespace, sizes: Sizes) -> Iterator[Callable[[], Outcome]]:
    """The groups that were asked for, in order."""
    for name in options.groups:
        if name == "against":
            yield lambda: groups.against(sizes, options.against, options.rounds)
        elif name == "peer":
            yield lambda: groups.beside_peer(sizes)
        else:
            yield lambda name=name: groups.GROUPS[name](sizes)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    options = parse(arguments)
    sizes, begun, where = groups.QUICK if options.quick else Sizes(), time.monotonic(), machine()
    lines: list[Line] = []
    tables: dict[str, Table] = {}
    for run in runs(options, sizes):
        outcome = run()
        for line in outcome.lines:
            print(line_text(line, options.quick, where))
        for title, table in outcome.tables.items():
            print(f"\n{title}\n{text(table_cells(table))}\n")
        sys.stdout.flush()
        lines += outcome.lines
        tables |= outcome.tables

    judged = [line for line in lines if line.verdict != "not judged"]
    missed = [line for line in judged if line.verdict == "MISSED"]
    minutes = (time.monotonic() - begun) / 60
    note = " (not judged: --quick)" if options.quick else ""
    print(f"{len(judged) - len(missed)} of {len(judged)} bars reached{note} in {minutes:.1f} minutes")
    if options.output:
        title = (
            "bench speed" + (" --quick" if options.quick else "") + (f" --only {options.only}" if options.only else "")
        )
        options.output.parent.mkdir(parents=True, exist_ok=True)
        where += f" at the start, {os.getloadavg()[0]:.1f} at the end; {minutes:.1f} minutes"
        options.output.write_text(report(title, where, lines, tables, options.quick))
    if options.json:
        rows = [{**dataclasses.asdict(line), "verdict": line.verdict, "machine": where} for line in lines]
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    forgiven = options.quick or os.environ.get("CI") == "true"
    return 1 if missed and not forgiven else 0


if __name__ == "__main__":
    sys.exit(main())
