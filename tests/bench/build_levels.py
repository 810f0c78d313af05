"""The same scenes with builds of different optimisation: `tests/bench/build_levels.py`, with the Python of `.venv`.

Builds the library once for every level under --folder, runs the golden scenes of tests/regression and example scenes on
coarse grids, and prints per level: seconds of all runs, golden hashes and frame hashes that equal those of the first
level, and the largest relative difference of volume, centre, momentum and energy after one frame and after the last.
The last level contracts a*b+c to one rounding, which no build of the project does: it shows what rounding changes.
Exit code 1 if another level differs.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
# Name, flags in place of the release build's, flags after all others.
LEVELS = (
    ("-O2", "-O2", ""),
    ("-O3 -march=native", "-O3 -march=native", ""),
    ("-O3 -march=native, 512 bits", "-O3 -march=native -mprefer-vector-width=512", ""),
    ("-O2 -march=native", "-O2 -march=native", ""),
    ("-O3", "-O3", ""),
    ("-O1", "-O1", ""),
    ("-O0", "-O0", ""),
    ("-O3 -march=native, contracted", "-O3 -march=native", "-ffp-contract=fast"),
)
SCENES = (  # name, frames, settings
    ("ball", "1-25", ("Domain.voxelSize=0.02",)),
    ("ball", "1-13", ("Domain.voxelSize=0.02", "Domain.preset=paper2016")),
    ("smoke_only", "1-49", ("Domain.voxelSize=0.03",)),
    ("jelly_drop_no_fluid", "1-25", ("Domain.voxelSize=0.02",)),
)
QUANTITIES = ("volume_mesh", "volume_cells", "center", "momentum", "kinetic_energy", "elastic_energy")


@dataclasses.dataclass
class Outcome:
    """What one level gave. golden: hash per golden scene; frames: per scene the states; ends: diagnostics per scene."""

    golden: dict[str, str]
    frames: list[list[str]]
    ends: list[tuple[dict[str, Any], dict[str, Any]]]
    seconds: float


def build(folder: Path, flags: str, last: str, jobs: int) -> None:
    """Library and regression test in `folder`."""
    launcher = f'-DCMAKE_CXX_COMPILER_LAUNCHER=sh;-c;exec "$@" {last};sh' if last else "-DCMAKE_CXX_COMPILER_LAUNCHER="
    configure = ["cmake", "-S", str(ROOT), "-B", str(folder), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Level", launcher]
    for command in (
        [*configure, f"-DCMAKE_CXX_FLAGS_LEVEL={flags} -DNDEBUG", "-DCMAKE_C_FLAGS_LEVEL=-O2"],
        ["cmake", "--build", str(folder), "-j", str(jobs), "--target", "eulerfsi", "efsi_tests_regression"],
    ):
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode:
            sys.exit(f"{' '.join(command)}\n{done.stdout[-4000:]}")


def run(folder: Path) -> Outcome:
    """All scenes with the build in `folder`."""
    begun = time.monotonic()
    golden_file = folder / "golden.txt"
    subprocess.run(  # fails where a hash differs, which is compared here
        [str(folder / "tests" / "efsi_tests_regression")],
        env={**os.environ, "EFSI_UPDATE_GOLDEN": str(golden_file)},
        stdout=subprocess.DEVNULL,
        check=False,
    )
    golden = dict(line.rsplit(" ", 1) for line in golden_file.read_text().splitlines())
    environment = {
        **os.environ,
        "EULERFSI_LIBRARY": str(folder / "libeulerfsi" / "libeulerfsi.so"),
        "PYTHONPATH": os.pathsep.join((str(ROOT / "batch"), str(ROOT / "usd_plugin"))),
    }
    frames, ends = [], []
    for number, (name, span, settings) in enumerate(SCENES):
        cache = folder / f"cache{number}"
        command = [sys.executable, "-m", "eulerfsi", "simulate", str(ROOT / "examples" / "scenes" / f"{name}.usda")]
        command += ["-o", str(cache), "--frames", span, "--overwrite", "--progress", "none"]
        command += [word for setting in settings for word in ("--set", setting)]
        subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
        manifest = json.loads((cache / "manifest.json").read_text())
        frames.append([frame["state"] for frame in manifest["frames"].values()])
        lines = [json.loads(line) for line in (cache / "stats.jsonl").read_text().splitlines()]
        lines = [line for line in lines if line["event"] == "frame"]
        ends.append((lines[1], lines[-1]))
    return Outcome(golden, frames, ends, time.monotonic() - begun)


def difference(a: dict[str, Any], b: dict[str, Any]) -> tuple[float, str]:
    """Largest relative difference of the diagnostics of one frame, and which."""
    pairs = [(f"fluid {name}", a["fluid"][name], b["fluid"][name]) for name in ("kinetic_energy", "smoke")]
    for path, solid in b["solids"].items():
        pairs += [(name, a["solids"][path][name], solid[name]) for name in QUANTITIES]
    worst = (0.0, "")
    for name, x, y in pairs:
        x, y = (value if isinstance(value, list) else [value] for value in (x, y))
        size = sum(v * v for v in y) ** 0.5
        if size > 0:
            worst = max(worst, (sum((u - v) ** 2 for u, v in zip(x, y, strict=True)) ** 0.5 / size, name))
    return worst


def main() -> int:
    """Runs all levels; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "levels", help="default: build/levels")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    print(
        "| build | seconds | golden hashes equal | frames equal | differs after 1 frame | after the last |", flush=True
    )
    print("|---|---|---|---|---|---|")
    first, failed = None, False
    for number, (name, flags, last) in enumerate(LEVELS):
        folder = options.folder.resolve() / str(number)
        build(folder, flags, last, options.jobs)
        now = run(folder)
        first = first or now
        golden = sum(now.golden[scene] == value for scene, value in first.golden.items())
        count = sum(len(states) for states in first.frames)
        same = sum(a == b for x, y in zip(now.frames, first.frames, strict=True) for a, b in zip(x, y, strict=True))
        few, many = (
            max(difference(a[end], b[end]) for a, b in zip(now.ends, first.ends, strict=True)) for end in (0, 1)
        )
        texts = [f"{value:.1g} ({what})" if value else "0" for value, what in (few, many)]
        hashes = f"{golden} of {len(first.golden)} | {same} of {count}"
        print(f"| {name} | {now.seconds:.0f} | {hashes} | {texts[0]} | {texts[1]} |", flush=True)
        failed = failed or (not last and (golden < len(first.golden) or same < count))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
