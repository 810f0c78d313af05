"""Stress: one line a case with its worst figure: `./eulerfsi bench stress [--full] [--only S2,..] [--jobs N]`.

Runs experiments of `bench loop` (survival, squash, stacks, rest), runs of `bench accuracy` and others at the ends of
their ranges, each in a process of its own, and calls that have to be refused; then scenes of `bench random` of a seed
that is printed. Passes where every run finishes, energy never rises by more than 2 % of its largest, volume stays
within 5 %, no solid is faster than ten reference speeds, and what the case names beside these is kept. Exit code 1
where a case misses, unless CI=true.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", ROOT / "tests" / "bench"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from bench_accuracy import run_child as measure  # noqa: E402
from bench_loop import run_child  # noqa: E402
from eulerfsi.errors import UsageError  # noqa: E402
from stress import judge  # noqa: E402
from stress.cases import Case, cases, refusal  # noqa: E402

RANDOM_MINUTES = 2


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="eulerfsi bench stress", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--full", action="store_true", help="whole matrices and finer grids, hours; default: 10 minutes"
    )
    parser.add_argument(
        "--only", metavar="NUMBER,..", help=f"some of {', '.join(c.number for c in cases(False))}, random"
    )
    parser.add_argument("--seed", type=int, default=None, metavar="N", help="of the random scenes; default: a new one")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="runs at a time")
    parser.add_argument("--child", metavar="NUMBER", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    known = [case.number for case in cases(False)] + ["random"]
    unknown = [name for name in (options.only or "").split(",") if name and name not in known]
    if unknown:
        raise UsageError(f"--only {unknown[0]}: must be one of {', '.join(known)}")
    if options.jobs < 1:
        raise UsageError(f"--jobs {options.jobs}: must be >= 1")
    return options


def refused(case: Case) -> judge.Line:
    """The calls of a case, in a process of their own, which a crash ends."""
    command = [sys.executable, str(Path(__file__).resolve()), "--child", case.number]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [""])[-1]
        return judge.Line(case, False, f"the process ended with code {done.returncode}: {last}")
    return judge.of_refusals(case, json.loads(done.stdout))


def scenes(seed: int) -> tuple[bool, str]:
    """Random scenes for two minutes: (whether they were made, what `bench random` says last)."""
    command = [sys.executable, str(Path(__file__).with_name("bench_random.py")), "--seed", str(seed)]
    command += ["--minutes", str(RANDOM_MINUTES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "CI": "false"})
    last = (done.stdout.strip().splitlines() or done.stderr.strip().splitlines() or [""])[-1]
    return done.returncode in (0, 1) and bool(done.stdout), f"seed {seed}: {last}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    options = parse(arguments)
    some = {case.number: case for case in cases(options.full)}
    if options.child:
        print(json.dumps({name: refusal(call) for name, call in some[options.child].refused}))
        return 0
    begun, missed = time.monotonic(), 0
    wanted = options.only.split(",") if options.only else [*some, "random"]
    with ThreadPoolExecutor(options.jobs) as pool:
        for case in (some[number] for number in wanted if number != "random"):
            if case.runs:
                line = judge.of_runs(case, list(pool.map(run_child, case.runs)))
            elif case.measured:
                line = judge.of_measured(case, list(pool.map(measure, case.measured)))
            else:
                line = refused(case)
            missed += not line.passed
            print(f"{case.number} {case.name}: {line.text} | {'pass' if line.passed else 'MISSED'}", flush=True)
    if "random" in wanted:
        seed = options.seed if options.seed is not None else int(time.time()) % 100000
        passed, text = scenes(seed)
        missed += not passed
        print(f"random scenes (`bench random`): {text} | {'pass' if passed else 'MISSED'}")
    print(f"{len(wanted) - missed} of {len(wanted)} pass in {(time.monotonic() - begun) / 60:.1f} minutes")
    return 1 if missed and os.environ.get("CI") != "true" else 0


if __name__ == "__main__":
    sys.exit(main())
