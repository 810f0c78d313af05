"""Reads mesh files, two at a time, and tells how each one ended.

python mesh_trial.py MEBIBYTES FILE_OR_FOLDER...     a folder gives all its files with a suffix that the program reads

One line of JSON a file: {"file", "seconds", "points", "faces"} or {"file", "seconds", "status", "error"}; the last line
is {"files", "peak"}: the largest memory [bytes] that a child process held.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "batch"))

from eulerfsi.errors import LibraryError  # noqa: E402
from eulerfsi.solver import mesh_file  # noqa: E402
from eulerfsi.solver import simulation as solver


def trial(path: Path, memory: int) -> dict:
    """What became of one file; an error that is not the library's ends the program."""
    start = time.perf_counter()
    try:
        mesh = solver.load_mesh(path, memory)
        outcome = {"points": len(mesh.points), "faces": len(mesh.counts)}
    except LibraryError as error:
        outcome = {"status": error.status, "error": str(error)}
    return {"file": str(path), "seconds": round(time.perf_counter() - start, 3), **outcome}


def main(mebibytes: str, *places: str) -> None:
    paths = []
    for place in map(Path, places):
        found = sorted(place.rglob("*")) if place.is_dir() else [place]
        paths += [path for path in found if not place.is_dir() or path.suffix.lower()[1:] in mesh_file.FORMATS]
    with ThreadPoolExecutor(2) as pool:
        for line in pool.map(lambda path: trial(path, int(mebibytes) << 20), paths):
            print(json.dumps(line), flush=True)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    print(json.dumps({"files": len(paths), "peak": peak}))


if __name__ == "__main__":
    main(*sys.argv[1:])
