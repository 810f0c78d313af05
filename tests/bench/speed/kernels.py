"""The program efsi_bench_kernels (tests/bench/kernels.cpp): a triad and the solver's largest kernels."""

from __future__ import annotations

import functools
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

BUILD = Path(__file__).resolve().parents[3] / "build" / "release"
TRIAD_ROUNDS = 100
TRIAD = "triad"


@functools.cache
def program() -> Path:
    """The program, built where it is missing or older than its sources. Raises SystemExit where that fails."""
    command = ["cmake", "--build", str(BUILD), "--target", "efsi_bench_kernels"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise SystemExit("cmake is not installed; ./eulerfsi setup installs it") from None
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stdout[-4000:]}{done.stderr[-2000:]}")
    return BUILD / "tests" / "efsi_bench_kernels"


def measure(cells: Sequence[int], threads: int, rounds: int, *names: str) -> dict[str, Any]:
    """What the program prints: cells, threads, kernels with name, bytes per cell, median and best seconds."""
    command = [str(program()), *map(str, (*cells, threads, rounds)), *names]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr.strip() or f"{' '.join(command)} failed with exit code {done.returncode}")
    return json.loads(done.stdout)


def triad_seconds(cells: Sequence[int], threads: int) -> float:
    """Median of the triad over one field of so many cells."""
    return float(measure(cells, threads, TRIAD_ROUNDS, TRIAD)["kernels"][0]["median"])


def roofline(measured: dict[str, Any]) -> list[dict[str, Any]]:
    """Per kernel: bytes and ns per cell, GB/s of the bytes that must move, share of the triad's, triads; by medians."""
    cells = 1
    for count in measured["cells"]:
        cells *= count
    triad = next(kernel for kernel in measured["kernels"] if kernel["name"] == TRIAD)
    rows = []
    for kernel in measured["kernels"]:
        speed, limit = (cells * k["bytes"] / k["median"] / 1e9 for k in (kernel, triad))
        rows.append(
            {
                "kernel": kernel["name"],
                "threads": measured["threads"],
                "bytes per cell": kernel["bytes"],
                "ns per cell": 1e9 * kernel["median"] / cells,
                "GB/s": speed,
                "share of the triad": speed / limit,
                "triads": kernel["median"] / triad["median"],
            }
        )
    return rows
