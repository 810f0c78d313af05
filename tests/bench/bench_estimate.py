"""What `validate` predicts against the run: `./eulerfsi bench estimate [--count 20] [--seed S] [FILE...]`.

Scenes are drawn by a seed, as those of `bench random`, or the files given. Each is validated and simulated in processes
of its own. Bars: memory within 30 % of the peak of the process; the time in the range that was told on 9 of 10 scenes,
the range at most a factor of 4 wide; the time that is left, told at half-way, within 25 % on 4 of 5.

--processor: both sides in seconds of processor time, on one thread, which other work on the machine does not change.
A run takes up the table in --output again; rows of it are not measured twice. Exit code 1 where a bar is missed, unless
CI=true or --quick (frames 1-4 of three scenes, not judged).
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / place) for place in ("tests/bench", "batch", "usd_plugin")]

MEMORY, WIDTH, ETA = 0.30, 4.0, 0.25
TIMES_INSIDE, ETAS_INSIDE = 0.9, 0.8  # of the scenes
_FINENESS = (0.8, 2.0)  # cells for each of the drawn scene's, along an edge
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_LINE = re.compile(r"about (\S+ \w+) \((\S+ \w+) to (\S+ \w+)\)")
_AS_PROCESSOR = "import sys, time; time.monotonic = time.process_time; sys.argv[0] = 'eulerfsi'; "
_MAIN = "from eulerfsi.cli.main import main; sys.exit(main())"
# Of the program alone [KiB]: what the kernel keeps of a child contains the process that it was made from.
_TELLS_PEAK = """import atexit, os
def tell():
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    open(os.environ["PEAK"], "w").write(status["VmHWM"].split()[0])
atexit.register(tell)
"""


@dataclasses.dataclass
class Row:
    """One scene: bytes predicted and at the peak; seconds low, likely, high and real; at half-way the seconds that were
    said to be left and those that were. eta, left: 0 where the run is too short to tell."""

    scene: str
    cells: int
    memory: int
    peak: int
    low: float
    likely: float
    high: float
    real: float
    eta: float
    left: float

    @property
    def good_memory(self) -> bool:
        return abs(self.memory - self.peak) <= MEMORY * self.peak

    @property
    def good_time(self) -> bool:
        return self.low <= self.real <= self.high

    @property
    def good_eta(self) -> bool:
        return abs(self.eta - self.left) <= ETA * self.left

    @property
    def words(self) -> str:
        signs = [name for name, good in zip(("memory", "time", "eta"), self.verdicts, strict=True) if not good]
        return (
            f"{self.scene}: {self.cells:,} cells; memory {self.memory / 2**20:.0f} of {self.peak / 2**20:.0f} MiB; "
            f"time {self.low:.3g} to {self.high:.3g} s, real {self.real:.3g} s; left at half-way {self.eta:.3g} s, "
            f"real {self.left:.3g} s | {'missed: ' + ', '.join(signs) if signs else 'pass'}"
        )

    @property
    def verdicts(self) -> tuple[bool, bool, bool]:
        return self.good_memory, self.good_time, self.good_eta


def read_time(text: str) -> tuple[float, float, float]:
    """(likely, low, high) seconds in what `validate` says. Raises ValueError where there is no time."""
    found = _LINE.search(text)
    if not found:
        raise ValueError(f"validate gave no time: {text}")
    likely, low, high = (float(number) * _UNITS[unit] for number, unit in map(str.split, found.groups()))
    return likely, low, high


def run(words: Sequence[str], processor: bool) -> tuple[int, str, str, int, float]:
    """One command of the program: (exit code, output, errors, bytes at the peak, seconds)."""
    code = (_AS_PROCESSOR if processor else "import sys; ") + "\n" + _TELLS_PEAK + _MAIN
    path = os.pathsep.join([str(ROOT / "batch"), str(ROOT / "usd_plugin")])
    with (
        tempfile.TemporaryFile("w+") as out,
        tempfile.TemporaryFile("w+") as err,
        tempfile.NamedTemporaryFile("r") as top,
    ):
        begun = time.monotonic()
        child = subprocess.Popen(
            [sys.executable, "-c", code, *words],
            stdout=out,
            stderr=err,
            env={**os.environ, "PYTHONPATH": path, "PEAK": top.name},
        )
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        seconds = usage.ru_utime + usage.ru_stime if processor else time.monotonic() - begun
        out.seek(0)
        err.seek(0)
        return child.returncode, out.read(), err.read(), int(top.read() or 0) * 1024, seconds


def at_half_way(output: str) -> tuple[float, float]:
    """(seconds said to be left, seconds that passed until the end) at the first frame with half of the run done, by
    the events of the run; zeros: it has no half."""
    events = [json.loads(line) for line in output.splitlines()]
    frames = [e for e in events if e["event"] == "frame" and e["eta"] is not None]
    if len(frames) < 2:
        return 0.0, 0.0
    half = frames[(len(frames) + 1) // 2 - 1]
    return half["eta"], events[-1]["elapsed"] - half["elapsed"]


def measure(name: str, scene: Path, folder: Path, options: Sequence[str], processor: bool) -> Row | str:
    """The row of a scene, or why it has none."""
    threads = ["--threads", "1"] if processor else []
    code, out, err, _, _ = run(["validate", str(scene), "--json", *threads, *options], processor)
    if code:
        return f"{name}: validate refuses it: {err.strip()}"
    report = json.loads(out)
    likely, low, high = read_time(report["time"])
    words = ["simulate", str(scene), "-o", str(folder), "--progress", "json", "--overwrite", *threads, *options]
    code, out, err, peak, seconds = run(words, processor)
    if code:
        return f"{name}: simulate ended with exit code {code}: {err.strip()}"
    return Row(name, report["cells"], report["process_memory"], peak, low, likely, high, seconds, *at_half_way(out))


def drawn(seed: int, frames: int, folder: Path) -> Iterator[tuple[str, Path]]:
    """(name, USD file) of scene after scene of a seed, without end: every second one with contact."""
    from random_scenes.contact import make_contact_scene
    from random_scenes.draw import Draw
    from random_scenes.scenes import make_scene
    from random_scenes.solids import Absent
    from random_scenes.to_usd import write_scene

    number = 0
    while True:
        name = f"c{number // 2}" if number % 2 else str(number // 2)
        number += 1
        draw = Draw(seed, f"estimate {name}")
        try:
            scene = make_contact_scene(seed, name) if name[0] == "c" else make_scene(seed, int(name))
        except Absent:
            continue
        path = folder / f"{seed}_{name}.usda"
        low, high = map(math.log, _FINENESS)
        fineness = math.exp(low + (high - low) * draw.evenly("fineness"))
        write_scene(scene, path, frames, fineness, draw.evenly("smoke") < 0.5)
        yield f"{seed}/{name}", path


def load_rows(path: Path) -> dict[str, Row]:
    """Rows of a table, by scene; of a value that is no number none of its line."""
    if not path.is_file():
        return {}
    kinds = {field.name: {"str": str, "int": int, "float": float}[field.type] for field in dataclasses.fields(Row)}
    with open(path, encoding="utf-8", newline="") as file:
        return {line["scene"]: Row(**{key: kinds[key](line[key]) for key in kinds}) for line in csv.DictReader(file)}


def save_rows(path: Path, rows: Sequence[Row]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, [field.name for field in dataclasses.fields(Row)])
        table.writeheader()
        table.writerows(dataclasses.asdict(row) for row in rows)


def verdict(rows: Sequence[Row]) -> tuple[list[str], bool]:
    """Lines, one a bar, and whether all are met."""
    count = len(rows)
    told = [row for row in rows if row.left > 0]
    widest = max((row.high / row.low for row in rows), default=1.0)
    bars = [
        ("memory within 30 % of the peak", sum(row.good_memory for row in rows), count, count),
        ("time in the range", sum(row.good_time for row in rows), count, math.ceil(TIMES_INSIDE * count - 1e-9)),
        (
            f"range at most 4 wide (widest {widest:.2f})",
            sum(r.high <= 1.05 * WIDTH * r.low for r in rows),
            count,
            count,
        ),
        (
            "left at half-way within 25 %",
            sum(r.good_eta for r in told),
            len(told),
            math.ceil(ETAS_INSIDE * len(told) - 1e-9),
        ),
    ]
    lines = [
        f"{name}: {met} of {of}, at least {bar}: {'pass' if met >= bar else 'MISSED'}" for name, met, of, bar in bars
    ]
    return lines, all(met >= bar for _, met, _, bar in bars)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures all; returns the exit code."""
    parser = argparse.ArgumentParser(prog="eulerfsi bench estimate", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20, metavar="N", help="scenes; default: 20")
    parser.add_argument("--seed", type=int, default=54, metavar="S", help="default: 54")
    parser.add_argument("--frames", type=int, default=12, metavar="N", help="of drawn scenes; default: 12")
    parser.add_argument("--processor", action="store_true", help="processor seconds on one thread: beside other work")
    parser.add_argument("--output", type=Path, metavar="FILE", help="table; default: build/estimate.csv")
    parser.add_argument("--quick", action="store_true", help="frames 1-4 of three scenes: checks the benchmark itself")
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="scenes in place of drawn ones")
    options = parser.parse_args(arguments)
    frames, count = (4, 3) if options.quick else (options.frames, options.count)
    given = ["--frames", f"1-{frames}"] if options.files and options.quick else []
    output = options.output or ROOT / "build" / ("estimate-processor.csv" if options.processor else "estimate.csv")
    known = {} if options.quick else load_rows(output)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenes = ((str(f), f) for f in options.files) if options.files else drawn(options.seed, frames, folder)
        for scene, path in scenes:
            row = known.get(scene) or measure(scene, path, folder / "cache", given, options.processor)
            if isinstance(row, str):
                print(row, flush=True)
                continue
            rows.append(row)
            print(row.words, flush=True)
            if not options.quick:
                save_rows(
                    output, [*rows, *(other for key, other in known.items() if key not in {r.scene for r in rows})]
                )
            if not options.files and len(rows) == count:
                break
    lines, good = verdict(rows)
    print("\n".join([*lines, f"load {os.getloadavg()[0]:.1f}"]))
    return 1 if not good and not options.quick and os.environ.get("CI") != "true" else 0


if __name__ == "__main__":
    sys.exit(main())
