"""./eulerfsi test --nightly: the parts of tests/nightly.toml, all or some; ends with code 1 when one has failed.

nightly.py [--list | --slice K[/N] | --only NAME,...]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "tests" / "nightly.toml"


def read_parts(path: Path = TABLE) -> list[dict]:
    """Rows of the table; an unknown key or kind, a missing one and a name that stands twice are errors."""
    parts = tomllib.loads(path.read_text())["part"]
    for part in parts:
        if set(part) != {"name", "kind", "seconds", "command"} or part["kind"] not in {"slice", "whole", "hand"}:
            raise ValueError(f"{path.name}: {part}")
    names = [part["name"] for part in parts]
    if len(set(names)) != len(names):
        raise ValueError(f"{path.name}: a name stands twice")
    return parts


def chosen(parts: list[dict], slice_: str | None, only: str | None) -> list[dict]:
    """What the options ask for; without any all parts but those by hand."""
    if only is not None:
        by_name = {part["name"]: part for part in parts}
        unknown = [name for name in only.split(",") if name not in by_name]
        if unknown:
            raise ValueError(f"no such part: {', '.join(unknown)}; there are {', '.join(by_name)}")
        return [by_name[name] for name in only.split(",")]
    slices = [part for part in parts if part["kind"] == "slice"]
    if slice_ is not None:
        number, _, count = slice_.partition("/")
        heaps = int(count) if count else len(slices)
        if not 1 <= heaps <= len(slices):
            raise ValueError(f"--slice {slice_}: there are 1 to {len(slices)} heaps of slices")
        return slices[int(number) % heaps :: heaps]
    return [part for part in parts if part["kind"] != "hand"]


def run(part: dict) -> tuple[bool, float]:
    start = time.monotonic()
    done = subprocess.run(["bash", "-eo", "pipefail", "-c", part["command"]], cwd=ROOT)
    return done.returncode == 0, time.monotonic() - start


def main() -> int:
    parser = argparse.ArgumentParser(prog="./eulerfsi test --nightly")
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument("--list", action="store_true", help="print the table")
    choice.add_argument(
        "--slice", metavar="K[/N]", help="slices K, K + N, ...; without N the one of this number, modulo"
    )
    choice.add_argument("--only", metavar="NAME,...", help="these parts")
    arguments = parser.parse_args()
    parts = read_parts()
    if arguments.list:
        for part in parts:
            command = "; ".join(part["command"].strip().splitlines())
            print(f"{part['name']:16} {part['kind']:6} {part['seconds']:5} s  {command}")
        return 0
    try:
        todo = chosen(parts, arguments.slice, arguments.only)
    except ValueError as error:
        parser.error(str(error))
    os.environ.setdefault("JOBS", str(os.cpu_count() or 1))
    lines, failed = [], 0
    for part in todo:
        print(f"=== nightly: {part['name']}", flush=True)
        good, seconds = run(part)
        failed += not good
        lines.append(f"nightly {part['name']}: {'passed' if good else 'FAILED'} in {seconds:.0f} s")
        print(f"=== {lines[-1]}", flush=True)
    print("\n" + "\n".join(lines))
    totals = ROOT / ".eulerfsi" / "totals"
    if totals.parent.is_dir():
        totals.write_text("\n".join(lines) + "\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
