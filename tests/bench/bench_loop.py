"""The laboratory of the full loop: laws of solids in fluid and their bars: `./eulerfsi bench loop [--quick|--full]`.

Runs a matrix of scenes, resolutions and choices through the binding, each in a process of its own with one thread,
--jobs at a time. Prints one row a run, then for every law: bar, measured, verdict, conditions and the machine.
--set changes a field of EfsiSimulationDef or EfsiSolidDef in every run; a name that is set more than once is tried with
each value, and the laws are judged for every combination. Exit code 1 if a bar is missed, unless CI=true.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import itertools
import json
import os
import platform
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", Path(__file__).resolve().parent):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from loop import (  # noqa: E402
    contact_laws,
    elastic_laws,
    energy_laws,
    given_laws,
    laws,
    meeting_laws,
    mirror_law,
    probes,
    survival,
    table,
    thin_laws,
    wall_laws,
)
from loop.experiment import TOKENS, Experiment, field_of, simulate  # noqa: E402
from loop.laws import Law, Line, Results  # noqa: E402
from loop.measure import Result, run_process  # noqa: E402
from loop.shapes import available  # noqa: E402

LAWS = (
    Law("survival", survival.survival_runs, survival.judge_survival),
    Law("bounce", laws.bounce_runs, laws.judge_bounce),
    Law("flight", laws.bounce_runs, laws.judge_flight),
    Law("fall", laws.bounce_runs, laws.judge_fall),
    Law("spin", laws.spin_runs, laws.judge_spin),
    Law("load", elastic_laws.load_runs, elastic_laws.judge_load),
    Law("oscillation", elastic_laws.oscillation_runs, elastic_laws.judge_oscillation),
    Law("added-mass", laws.release_runs, laws.judge_release),
    Law("rest", laws.rest_runs, laws.judge_rest),
    Law("squash", elastic_laws.squash_runs, elastic_laws.judge_squash),
    Law("divergence", lambda tier: [*laws.bounce_runs(tier), *laws.spin_runs(tier)], laws.judge_divergence),
    Law("momentum", laws.momentum_runs, laws.judge_momentum),
    Law("mirror", mirror_law.mirror_runs, mirror_law.judge_mirror),
    Law("energy", energy_laws.recorded_runs, energy_laws.judge_energy),
    Law("repairs", energy_laws.energy_runs, energy_laws.judge_repairs),
    Law("walls", wall_laws.wall_runs, wall_laws.judge_walls),
    Law("mass", energy_laws.energy_runs, energy_laws.judge_mass),
    Law("stack", contact_laws.stack_runs, contact_laws.judge_stack),
    Law("thin", thin_laws.thin_runs, thin_laws.judge_thin),
    Law("friction", meeting_laws.friction_runs, meeting_laws.judge_friction),
    Law("overlap", meeting_laws.overlap_runs, meeting_laws.judge_overlap),
    Law("off-centre", meeting_laws.spin_runs, meeting_laws.judge_spin),
    Law("hertz", contact_laws.hertz_runs, contact_laws.judge_hertz),
    Law("pin", given_laws.pin_runs, given_laws.judge_pin),
    Law("cantilever", given_laws.cantilever_runs, given_laws.judge_cantilever),
    Law("jet", given_laws.jet_runs, given_laws.judge_jet),
    Law("channel", given_laws.channel_runs, given_laws.judge_channel),
    Law("plate", given_laws.plate_runs, given_laws.judge_plate),
    Law("transport", energy_laws.energy_runs, energy_laws.judge_transport),
)
Settings = tuple[tuple[str, Any], ...]


def parse_setting(text: str) -> tuple[str, Any]:
    """NAME=VALUE: a number, a vector as [x,y,z], or a token of preset, wall[i] and material."""
    name, equals, value = text.partition("=")
    if not equals or field_of(name) is None:
        raise argparse.ArgumentTypeError(f"{text!r}: must be NAME=VALUE, a field of EfsiSimulationDef or EfsiSolidDef")
    tokens = TOKENS.get(name.partition("[")[0], {})
    try:
        parsed = value if value in tokens else json.loads(value)
    except json.JSONDecodeError:
        known = f" or one of {', '.join(tokens)}" if tokens else ""
        raise argparse.ArgumentTypeError(f"{text!r}: the value must be a number{known}") from None
    return name, tuple(parsed) if isinstance(parsed, list) else parsed


def run_child(run: Experiment) -> Result:
    """Runs an experiment in a process of its own."""
    child = [sys.executable, str(Path(__file__).resolve()), "--child"]
    return run_process(run, child, json.dumps(dataclasses.asdict(run)))


def child() -> int:
    """Reads an experiment from standard input, writes what it measured to standard output."""
    values = {name: tuple(v) if isinstance(v, list) else v for name, v in json.load(sys.stdin).items()}
    values["settings"] = tuple((name, tuple(v) if isinstance(v, list) else v) for name, v in values["settings"])
    run = Experiment(**values)
    json.dump(probes.simulate(run) if run.probe else simulate(run), sys.stdout)
    return 0


def combinations(settings: Sequence[tuple[str, Any]]) -> list[Settings]:
    """Every choice of one value for each name; [()] when nothing is set."""
    values: dict[str, list[Any]] = {}
    for name, value in settings:
        values.setdefault(name, []).append(value)
    return [tuple(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]


def run_all(runs: Sequence[Experiment], choices: Sequence[Settings], jobs: int) -> dict[Settings, Results]:
    """Every experiment once with every choice, the long ones first; says on standard error how far it is.

    An interrupt (Ctrl-C or SIGTERM) ends it with what is finished.
    """
    results: dict[Settings, dict[Experiment, Result]] = {choice: {} for choice in choices}
    jobs_to_do = sorted(itertools.product(runs, choices), key=lambda job: -job[0].cost)
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        waiting = {
            pool.submit(run_child, dataclasses.replace(run, settings=choice)): (run, choice)
            for run, choice in jobs_to_do
        }
        try:
            for done, future in enumerate(concurrent.futures.as_completed(waiting), start=1):
                (run, choice), result = waiting[future], future.result()
                results[choice][run] = result
                state = "" if result.finished else f": {result.failure}"
                print(
                    f"{done}/{len(waiting)} {run.scene}, {run.choices}, {result['seconds'].sum():.1f} s{state}",
                    file=sys.stderr,
                )
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
    return results


def machine() -> str:
    """Processor, number of cores, load."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    for entry in info.read_text().splitlines() if info.exists() else []:
        if entry.startswith("model name"):
            model = entry.split(":", 1)[1].strip()
            break
    return f"{model}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="eulerfsi bench loop", description=__doc__.splitlines()[0])
    tier = parser.add_mutually_exclusive_group()
    tier.add_argument("--quick", action="store_true", help="coarse and short, about 10 minutes on 2 cores (default)")
    tier.add_argument("--full", action="store_true", help="all resolutions and the whole matrix, 2.5 hours")
    names = [law.name for law in LAWS]
    parser.add_argument("--only", metavar="LAW,..", help=f"some of {', '.join(names)}")
    parser.add_argument("--match", default="", metavar="TEXT,..", help="runs whose line holds all of these texts")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="runs at a time")
    parser.add_argument(
        "--set",
        dest="settings",
        type=parse_setting,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="in every run; a field of EfsiSimulationDef or EfsiSolidDef, e.g. preset=paper2016; may be repeated",
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="also write a .md or, rows alone, a .csv file; a name without folder goes to tests/bench/results",
    )
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    options.laws = [law for law in LAWS if options.only is None or law.name in options.only.split(",")]
    unknown = set((options.only or "").split(",")) - set(names) - {""}
    if unknown or options.jobs < 1:
        parser.error(
            f"--only {options.only}: must be some of {', '.join(names)}" if unknown else "--jobs: must be >= 1"
        )
    if options.output and options.output.parent == Path("."):
        options.output = Path(__file__).resolve().parent / "results" / options.output
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    options = parse(arguments)
    if options.child:
        return child()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    tier, begun, where = "full" if options.full else "quick", time.monotonic(), machine()
    runs = list(dict.fromkeys(run for law in options.laws for run in law.experiments(tier)))
    wanted = options.match.split(",")
    runs = [run for run in runs if all(text in f"{run.scene}, {run.choices}" for text in wanted)]
    absent = sorted({run.shape for run in runs if not available(run.shape)})
    for shape in absent:
        print(f"{shape}: its mesh file is not installed (package glmark2-data); its runs are skipped")
    runs = [run for run in runs if run.shape not in absent]
    results = run_all(runs, combinations(options.settings), options.jobs)

    lines: list[Line] = [
        line for choice in results for law in options.laws for line in law.lines(results[choice], tier)
    ]
    ordered = [results[choice][run] for choice in results for run in runs if run in results[choice]]
    unfinished = len(runs) * len(results) - len(ordered)
    print(table.text([table.row(result) for result in ordered]))
    print()
    for line in lines:
        measured = f"{line.measured:.4g} {line.unit}".rstrip()
        print(f"{line.law}: {line.bar}: {measured} | {line.verdict} | {line.conditions} | {where}")
    judged = [line for line in lines if line.verdict != "not judged"]
    missed = [line for line in judged if line.verdict == "MISSED"]
    minutes = (time.monotonic() - begun) / 60
    made = f"{len(ordered)} runs" + (f" ({unfinished} were not made: interrupted)" if unfinished else "")
    print(f"{len(judged) - len(missed)} of {len(judged)} bars reached, {made} in {minutes:.1f} minutes")
    if options.output:
        title = f"bench loop --{tier}" + "".join(f" --set {name}={value}" for name, value in options.settings)
        if options.only:
            title += f" --only {options.only}"
        if options.match:
            title += f' --match "{options.match}"'
        table.write(options.output, title, f"{where}; {made} in {minutes:.1f} minutes", ordered, lines)
    return 1 if (missed or unfinished) and os.environ.get("CI") != "true" else 0


if __name__ == "__main__":
    sys.exit(main())
