"""Random scenes and the laws that hold for all of them: `./eulerfsi bench random --seed N --minutes M`.

Scene 0, c0, e0, 1, c1, e1, ... of a seed, drawn from tests/bench/random_scenes/ranges.toml: one solid each, two or
three with contact (c), and with everything (e) that they yield, are pinned, meet a collider or a jet; with --only thin
straps, sheets, ropes, rings and chains of 3 to 6 cells (t0, t1, ...), with --only compact compressible bodies of 15 to
30 cells that are thrown hard (b0, b1, ...). Each runs in a process of its own with one thread, --jobs at a time, until
the minutes are over. Every record is judged by laws that need no reference. A missed law prints the command that
repeats its scene alone.
--seeds-file runs a fixed list of scenes; a law that the list says a scene misses, with the cause, is expected. Exit
code 1 if an unexpected bar is missed, unless CI=true; with --seeds-file in any case.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import datetime
import itertools
import json
import os
import signal
import sys
import time
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", Path(__file__).resolve().parent):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from bench_loop import machine  # noqa: E402
from loop import table  # noqa: E402
from loop.experiment import simulate  # noqa: E402
from loop.laws import Line  # noqa: E402
from loop.measure import Result, run_process  # noqa: E402
from random_scenes import judge  # noqa: E402
from random_scenes.compact import make_compact_scene  # noqa: E402
from random_scenes.contact import make_contact_scene  # noqa: E402
from random_scenes.everything import make_everything_scene  # noqa: E402
from random_scenes.scenes import Scene, make_scene  # noqa: E402
from random_scenes.solids import Absent  # noqa: E402
from random_scenes.thin import make_thin_scene  # noqa: E402

ONE_SCENE = 600.0  # wall-clock seconds that a scene may take
# And the letter of their numbers.
KINDS = {"single": "", "contact": "c", "everything": "e", "thin": "t", "compact": "b"}
USUAL = ("single", "contact", "everything")  # that are run where nothing is said
LEAST = 1.0  # s: what a scene that starts as the minutes end may still take


@dataclasses.dataclass(frozen=True)
class Job:
    """A scene to run. known: laws that it misses today, each with the cause."""

    seed: int
    scene: int | str
    known: dict[str, str] = dataclasses.field(default_factory=dict, compare=False)

    @property
    def command(self) -> str:
        """What repeats it alone."""
        return f"./eulerfsi bench random --seed {self.seed} --scene {self.scene}"


@dataclasses.dataclass
class Outcome:
    """A scene that was run and what the laws say of it; skipped: why it was not run."""

    job: Job
    result: Result | None = None
    lines: list[Line] = dataclasses.field(default_factory=list)
    skipped: str = ""

    @property
    def missed(self) -> list[Line]:
        return [line for line in self.lines if line.verdict == "MISSED"]

    @property
    def unexpected(self) -> list[Line]:
        return [line for line in self.missed if line.law not in self.job.known]

    @property
    def mended(self) -> list[str]:
        """Known misses that passed."""
        passed = {line.law for line in self.lines if line.verdict == "pass"}
        return [name for name in self.job.known if name in passed]


def read_list(path: Path) -> list[Job]:
    """The scenes of a list: tables [[scene]] with seed, scene, known = {law = "cause"}. Raises ValueError."""
    jobs = []
    for entry in tomllib.loads(path.read_text())["scene"]:
        known = entry.get("known", {})
        unknown = set(known) - set(judge.LAWS)
        if unknown:
            raise ValueError(f"{path}: no such law: {', '.join(sorted(unknown))}")
        jobs.append(Job(entry["seed"], entry["scene"], known))
    return jobs


def drawn(seed: int, number: int | str) -> Scene:
    """A scene of a seed: 0, 1, ... with one solid, "c0", ... with contact, "e0", ... with everything, "t0", ... of thin
    bodies, "b0", ... of compact ones. Raises Absent."""
    if not isinstance(number, str):
        return make_scene(seed, number)
    make = {"c": make_contact_scene, "e": make_everything_scene, "t": make_thin_scene, "b": make_compact_scene}
    return make[number[0]](seed, number)


def run_job(job: Job, ends: float) -> Outcome:
    """Runs a scene in a process of its own, until `ends` at most (time.monotonic)."""
    try:
        scene = drawn(job.seed, job.scene)
    except Absent as reason:
        return Outcome(job, skipped=str(reason))
    limit = min(ONE_SCENE, max(LEAST, ends - time.monotonic()))
    command = [sys.executable, str(Path(__file__).resolve()), "--child", "--seed", str(job.seed)]
    command += ["--scene", str(job.scene), "--limit", str(limit)]
    result = run_process(scene, command)
    return Outcome(job, result, judge.judge(result))


def child(options: argparse.Namespace) -> int:
    """Runs one scene and writes what it measured to standard output."""
    scene = dataclasses.replace(drawn(options.seed, options.scene), limit=options.limit)
    json.dump(simulate(scene), sys.stdout)
    return 0


def run_all(jobs: Iterator[Job], minutes: float, at_once: int) -> list[Outcome]:
    """Runs jobs until there are no more or the minutes are over; says how far it is. Ends at an interrupt."""
    ends = time.monotonic() + 60 * minutes
    outcomes: list[Outcome] = []
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        waiting: set[concurrent.futures.Future[Outcome]] = set()
        try:
            while True:
                while len(waiting) < at_once and time.monotonic() < ends and (job := next(jobs, None)):
                    waiting.add(pool.submit(run_job, job, ends))
                if not waiting:
                    break
                done, waiting = concurrent.futures.wait(waiting, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in done:
                    outcomes.append(future.result())
                    say_outcome(outcomes[-1])
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            print("interrupted", file=sys.stderr)
    return sorted(outcomes, key=lambda outcome: (outcome.job.seed, number_of(outcome.job.scene)))


def say_outcome(outcome: Outcome) -> None:
    """One line a scene, and what it missed."""
    job, result = outcome.job, outcome.result
    if result is None:
        print(f"{job.seed}/{job.scene} skipped: {outcome.skipped}", flush=True)
        return
    seconds = f"{result['seconds'].sum():.0f} s, {len(result['dt'])} steps, to {result.times[-1]:.2f} s"
    state = ", ".join(line.law for line in outcome.missed)
    print(
        f"{job.seed}/{job.scene} {'MISSED ' + state if state else 'passed'} | {result.run.words} | {seconds}",
        flush=True,
    )
    for line in outcome.missed:
        cause = f" | known: {job.known[line.law]}" if line.law in job.known else ""
        print(f"  {line.law}: {line.bar}: {line.measured:.4g} | {line.conditions}{cause}", flush=True)
    if outcome.unexpected:
        print(f"  repeat: {job.command}", flush=True)


def tally(outcomes: Sequence[Outcome]) -> list[dict[str, str]]:
    """For every law: in how many scenes it was judged, missed, and where."""
    rows = []
    for name, (bar, _) in judge.LAWS.items():
        of_law = [(outcome, line) for outcome in outcomes for line in outcome.lines if line.law == name]
        judged = [(outcome, line) for outcome, line in of_law if line.verdict != "not judged"]
        missed = [outcome.job for outcome, line in judged if line.verdict == "MISSED"]
        rows.append(
            {
                "law": name,
                "bar": bar,
                "judged": str(len(judged)),
                "missed": str(len(missed)),
                "scenes": " ".join(f"{job.seed}/{job.scene}" for job in missed),
            }
        )
    return rows


def miss_rows(outcomes: Sequence[Outcome]) -> list[dict[str, str]]:
    """One row for every bar that was missed."""
    return [
        {
            "scene": f"{outcome.job.seed}/{outcome.job.scene}",
            "law": line.law,
            "bar": line.bar,
            "measured": f"{line.measured:.4g}",
            "conditions": line.conditions,
            "known": outcome.job.known.get(line.law, ""),
            "drawn": outcome.result.run.words if outcome.result else "",
        }
        for outcome in outcomes
        for line in outcome.missed
    ]


def summary(outcomes: Sequence[Outcome]) -> str:
    """Scenes, misses and what is known of them, in a line."""
    run = [outcome for outcome in outcomes if outcome.result]
    missed, unexpected = (sum(bool(getattr(o, kind)) for o in run) for kind in ("missed", "unexpected"))
    cut = sum(line.verdict == "not judged" for o in run for line in o.lines if line.law == "finished")
    return (
        f"{len(run)} scenes, {missed} miss a law ({unexpected} of them one that is not known), "
        f"{cut} ended early, {len(outcomes) - len(run)} skipped"
    )


def write(path: Path, title: str, where: str, outcomes: Sequence[Outcome]) -> None:
    """Laws, misses and all scenes as Markdown."""
    misses = miss_rows(outcomes)
    scenes = [
        {
            "scene": o.result.run.scene,
            "drawn": o.result.run.words,
            "misses": ", ".join(line.law for line in o.missed),
            "steps": str(len(o.result["dt"])),
            "seconds": f"{o.result['seconds'].sum():.1f}",
        }
        for o in outcomes
        if o.result
    ]
    parts = [f"# {title}", where, summary(outcomes) + ".", "## Laws", table.markdown(tally(outcomes), tally([])[0])]
    parts += ["## Misses", table.markdown(misses, misses[0])] if misses else []
    parts += ["## Scenes", table.markdown(scenes, scenes[0])] if scenes else []
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n\n".join(parts) + "\n")


def whole(text: str) -> int:
    """A seed: a whole number, or "today" for the day's date."""
    return int(f"{datetime.date.today():%Y%m%d}") if text == "today" else int(text)


def scene_name(text: str) -> int | str:
    """A scene of a seed: a number, or a letter and a number."""
    letter = text[:1] if text[:1] in KINDS.values() else ""
    number = int(text.removeprefix(letter))
    return f"{letter}{number}" if letter else number


def number_of(scene: int | str) -> tuple[int, str]:
    """What sorts the scenes of a seed: 0, c0, e0, 1, c1, e1, ..."""
    return (int(scene[1:]), scene[0]) if isinstance(scene, str) else (scene, "")


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="eulerfsi bench random", description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=whole, default="today", metavar="N", help='default "today": 20261231 and so on')
    parser.add_argument("--minutes", type=float, metavar="M", help="no scene goes on after that (default 10)")
    parser.add_argument("--scene", type=scene_name, metavar="K", help="this scene of the seed alone, with all its laws")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="start with scenes K, cK, eK, tK and bK")
    parser.add_argument("--only", metavar="KIND,..", help=f"some of {', '.join(KINDS)}; default the first three")
    parser.add_argument("--count", type=int, metavar="N", help="at most so many scenes")
    parser.add_argument("--seeds-file", type=Path, metavar="FILE", help="the scenes of a list (fixed.toml)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="scenes at a time")
    parser.add_argument("--output", type=Path, metavar="FILE", help="also write a .md; without folder: to results")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--limit", type=float, default=ONE_SCENE, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.jobs < 1:
        parser.error("--jobs: must be >= 1")
    if options.child and options.scene is None:
        parser.error("--child: needs --scene")
    options.only = USUAL if options.only is None else tuple(options.only.split(","))
    if unknown := [kind for kind in options.only if kind not in KINDS]:
        parser.error(f"--only {','.join(unknown)}: must be some of {', '.join(KINDS)}")
    if options.minutes is None:
        options.minutes = 10.0 if options.scene is None and options.seeds_file is None else float("inf")
    if options.output and options.output.parent == Path("."):
        options.output = Path(__file__).resolve().parent / "results" / options.output
    return options


def chosen(options: argparse.Namespace) -> Iterable[Job]:
    """The scenes that were asked for."""
    if options.seeds_file:
        return read_list(options.seeds_file)
    if options.scene is not None:
        return [Job(options.seed, options.scene)]
    letters = [letter for kind, letter in KINDS.items() if kind in options.only]
    names = (f"{letter}{k}" if letter else k for k in itertools.count(options.first) for letter in letters)
    return (Job(options.seed, name) for name in itertools.islice(names, options.count))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    options = parse(arguments)
    if options.child:
        return child(options)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    begun, where = time.monotonic(), machine()
    outcomes = run_all(iter(chosen(options)), options.minutes, options.jobs)
    if options.scene is not None:
        for line in outcomes[0].lines if outcomes else []:
            print(f"{line.law}: {line.bar}: {line.measured:.4g} | {line.verdict} | {line.conditions}")
    else:
        print(table.text([{k: v for k, v in row.items() if k != "bar"} for row in tally(outcomes)]))
    for outcome in outcomes:
        for name in outcome.mended:
            print(f"{outcome.job.seed}/{outcome.job.scene}: {name} is kept now; take it off the list of known misses")
    print(f"{summary(outcomes)}, in {(time.monotonic() - begun) / 60:.1f} minutes | {where}")
    if options.output:
        title = "bench random " + (
            f"--seeds-file {options.seeds_file.name}" if options.seeds_file else f"--seed {options.seed}"
        )
        write(options.output, title, where, outcomes)
    unexpected = any(outcome.unexpected for outcome in outcomes)
    return int(unexpected and (options.seeds_file is not None or os.environ.get("CI") != "true"))


if __name__ == "__main__":
    sys.exit(main())
