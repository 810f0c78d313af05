"""Data races of the thread team: ThreadSanitizer on base/team and base/parallel, and races put in that it must find.

check_races.py [CXX]    CXX: GCC (default g++). Its OpenMP library is replaced by std::thread (tests/races).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from common import ROOT, SRC, finish

RACES = ROOT / "tests" / "races"
FLAGS = ["-std=c++20", "-O1", "-g", "-fopenmp", "-fsanitize=thread", "-pthread"]

# What is changed in a copy of base/team.cpp.
PLANTED = {
    "the leader reads results before they are there": (
        "open_.fetch_sub(1, std::memory_order_acq_rel)",
        "open_.fetch_sub(1, std::memory_order_relaxed)",
    ),
    "members read what the leader writes": (
        "omp_get_thread_num() != 0 || leader_busy_",
        "leader_busy_ || omp_get_thread_num() != 0",
    ),
    "a loop is offered before its work is there": (
        "std::memory_order_release);\n  loop_.store(loop, std::memory_order_release)",
        "std::memory_order_relaxed);\n  loop_.store(loop, std::memory_order_relaxed)",
    ),
}


def compiled(compiler: str, source: Path, folder: Path) -> str:
    """The object file of a source file."""
    target = str(folder / f"{source.stem}_{len(list(folder.iterdir()))}.o")
    subprocess.run([compiler, *FLAGS, f"-I{SRC}", "-c", str(source), "-o", target], check=True)
    return target


def run(compiler: str, objects: list[str], *arguments: str) -> tuple[bool, str]:
    """Whether a race is reported, and exit code and output of the program."""
    program = objects[0] + ".program"  # linked without -fopenmp, which would bring libgomp
    subprocess.run([compiler, "-fsanitize=thread", "-pthread", *objects, "-o", program], check=True)
    fixed = ["setarch", "-R"] if shutil.which("setarch") else []  # some kernels place memory where it does not look
    environment = {**os.environ, "TSAN_OPTIONS": "exitcode=66 halt_on_error=1"}
    done = subprocess.run([*fixed, program, *arguments], text=True, capture_output=True, env=environment)
    text = done.stdout + done.stderr
    return done.returncode == 66 and "data race" in text, f"exit code {done.returncode}\n{text}"


def main() -> None:
    compiler = sys.argv[1] if len(sys.argv) > 1 else "g++"
    problems = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        driver = [compiled(compiler, RACES / f"{part}.cpp", folder) for part in ("team", "start_threads")]
        team = SRC / "base" / "team.cpp"
        own = [*driver, compiled(compiler, team, folder)]
        text = run(compiler, own)[1]
        if not text.startswith("exit code 0\n"):
            problems.append(f"base/team as it is: {text}")
        found, text = run(compiler, own, "race")
        if not found:
            problems.append(f"no race is found in a loop whose iterations write one value: {text}")
        for what, (old, new) in PLANTED.items():
            if old not in team.read_text():
                sys.exit(f"base/team.cpp has no '{old}'; PLANTED has to follow it")
            changed = folder / "changed.cpp"
            changed.write_text(team.read_text().replace(old, new))
            found, text = run(compiler, [*driver, compiled(compiler, changed, folder)])
            if not found:
                problems.append(f"no race is found where {what}: {text}")
    finish(problems, f"the thread team has no race, and {len(PLANTED) + 1} races put in are found")


if __name__ == "__main__":
    main()
