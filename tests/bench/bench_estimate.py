"""The time that `validate` predicts against the time that a run takes: `./eulerfsi bench estimate [--quick] [FILE...]`.

Scenes are the examples, or the files given: USD scenes, and mesh files, around which `new` writes a scene. Each is
estimated and simulated in processes of its own. A prediction passes when the real wall-clock time lies in its range or
within a factor of 3 of its middle. Wall-clock times mean little on a machine that does other work: the processor
seconds stand beside them. Exit code 1 if one is missed, unless CI=true or --quick (few frames, not judged).
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FACTOR = 3.0
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_LINE = re.compile(r"time: about (\S+ \w+) \((\S+ \w+) to (\S+ \w+)\).*; (?:([\d,]+) to )?([\d,]+) steps")


@dataclasses.dataclass
class Prediction:
    """What `validate` said: middle, low, high [s], fewest and most steps."""

    middle: float
    low: float
    high: float
    fewest: int
    most: int


def read_prediction(report: str) -> Prediction:
    """The prediction in the text of `validate`. Raises ValueError where there is none."""
    found = _LINE.search(report)
    if not found:
        raise ValueError("validate gave no time")
    times = [float(number) * _UNITS[unit] for number, unit in (text.split() for text in found.groups()[:3])]
    most = int(found[5].replace(",", ""))
    return Prediction(*times, int((found[4] or found[5]).replace(",", "")), most)


def verdict(prediction: Prediction, seconds: float) -> bool:
    """Whether the real seconds lie in the range, or within a factor of 3 of the middle."""
    inside = prediction.low <= seconds <= prediction.high
    return inside or prediction.middle / FACTOR <= seconds <= prediction.middle * FACTOR


def run(*arguments: str | Path, folder: Path) -> tuple[subprocess.CompletedProcess, float, float]:
    """One command of the program; returns it with its wall-clock and processor seconds."""
    path = os.pathsep.join([str(ROOT / "batch"), str(ROOT / "usd_plugin")])
    command = [sys.executable, "-m", "eulerfsi", *map(str, arguments)]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, "PYTHONPATH": path}, text=True, capture_output=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done, time.monotonic() - begun, processor


def compare(file: Path, folder: Path, options: Sequence[str]) -> tuple[str, bool]:
    """(a line of the result, passed) for one scene or mesh file."""
    scene = file
    if file.suffix not in (".usda", ".usd", ".usdc", ".usdz"):
        scene = folder / f"{file.stem}.usda"
        made, *_ = run("new", scene, "--solid", file, folder=folder)
        if made.returncode:
            return f"{file.name}: new refuses it: {made.stderr.strip()}", True
    told, validating, _ = run("validate", scene, *options, folder=folder)
    if told.returncode:
        return f"{file.name}: validate refuses it: {told.stderr.strip()}", True
    prediction = read_prediction(told.stdout)
    cache = folder / f"{scene.stem}_cache"
    done, seconds, processor = run(
        "simulate", scene, "-o", cache, "--overwrite", "--progress", "none", *options, folder=folder
    )
    if done.returncode:
        return f"{file.name}: simulate ended with exit code {done.returncode}: {done.stderr.strip()}", False
    steps = sum('"event": "step"' in line for line in (cache / "stats.jsonl").read_text().splitlines())
    passed = verdict(prediction, seconds)
    line = (
        f"{file.name}: predicted {prediction.middle:.3g} s ({prediction.low:.3g} to {prediction.high:.3g}), real "
        f"{seconds:.3g} s, {processor:.3g} processor seconds, ratio {prediction.middle / seconds:.2f} | "
        f"{prediction.fewest} to {prediction.most} steps, real {steps} | validate took {validating:.2g} s"
    )
    return line, passed


def main(arguments: Sequence[str] | None = None) -> int:
    """Compares all; returns the exit code."""
    parser = argparse.ArgumentParser(prog="eulerfsi bench estimate", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="frames 1-4 only: checks the benchmark itself")
    parser.add_argument("--threads", default="2", help="default: 2")
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="default: the example scenes")
    options = parser.parse_args(arguments)
    files = [file.resolve() for file in options.files] or sorted((ROOT / "examples" / "scenes").glob("*.usda"))
    settings = ["--threads", options.threads, *(["--frames", "1-4"] if options.quick else [])]
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        for file in files:
            line, passed = compare(file, Path(folder), settings)
            missed += not passed
            print(f"{line} | {'not judged' if options.quick else 'pass' if passed else 'MISSED'}", flush=True)
    print(f"{len(files) - missed} of {len(files)} predictions, load {os.getloadavg()[0]:.1f}")
    return 1 if missed and not options.quick and os.environ.get("CI") != "true" else 0


if __name__ == "__main__":
    sys.exit(main())
