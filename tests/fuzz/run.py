"""Fuzzing: builds the programs of this folder by clang and runs them: run.py [--seconds 60] [--only NAME] [--planted].

Each starts from the inputs in corpus/NAME, in a tree build/fuzz/NAME that keeps what it finds. --planted: looks that
each finds the bug that was put into its twin, in place of the search. What is missing of clang 14 is installed where
apt and root rights are there. Exit code 1 where an input breaks a program, whose file is named.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
NAMES = ("checkpoint", "mesh", "vdb", "capi")
_PACKAGES = ("clang", "libclang-rt-14-dev")
_SLOWEST, _MEGABYTES = 25, 2048  # seconds and memory of one input
# OpenVDB allocates what a length in a file says. The checksum guards against damage, not against forgers: without what
# comparisons tell, no forged file is found.
_MORE = {"vdb": ["-use_cmp=0"]}
_PLANTED_SECONDS = 300


def install() -> None:
    """clang and its runtime. Raises SystemExit where they cannot be installed."""
    if shutil.which("clang++") and list(Path("/usr/lib").glob("llvm-*/lib/clang/*/lib/linux/libclang_rt.fuzzer-*.a")):
        return
    if os.geteuid() or not shutil.which("apt-get"):
        sys.exit(f"fuzzing needs clang and its runtime: {' '.join(_PACKAGES)}")
    apt = ["apt-get", "-o", "Acquire::Retries=3"]
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    subprocess.run([*apt, "update", "-qq"], check=True)
    subprocess.run([*apt, "install", "-y", "-qq", "--no-install-recommends", *_PACKAGES], check=True, env=environment)


def build(folder: Path, targets: list[str], jobs: int) -> None:
    """Configures and builds."""
    compilers = ["-DCMAKE_C_COMPILER=clang", "-DCMAKE_CXX_COMPILER=clang++"]
    subprocess.run(["cmake", "-S", HERE, "-B", folder, "-G", "Ninja", *compilers], check=True)
    subprocess.run(["cmake", "--build", folder, "--parallel", str(jobs), "--target", *targets], check=True)


def fuzz(folder: Path, name: str, target: str, seconds: int) -> tuple[int, str]:
    """Runs a program; returns its exit code and the end of what it said."""
    place = folder / "found" / target
    place.mkdir(parents=True, exist_ok=True)
    options = [
        f"-max_total_time={seconds}",
        f"-timeout={_SLOWEST}",
        f"-rss_limit_mb={_MEGABYTES}",
        "-print_final_stats=1",
        *_MORE.get(name, ()),
    ]
    # Want of memory is an answer; what assimp and OpenVDB keep at the end is no leak of ours.
    environment = {**os.environ, "ASAN_OPTIONS": "allocator_may_return_null=1:detect_leaks=0"}
    command = [folder / target, *options, f"-artifact_prefix={place}/", place, HERE / "corpus" / name]
    done = subprocess.run(command, text=True, capture_output=True, errors="replace", env=environment, cwd=place)
    return done.returncode, (done.stdout + done.stderr)[-4000:]


def main() -> int:
    """Builds and runs all; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60, help="of each program; default: 60")
    parser.add_argument("--only", choices=NAMES, action="append", help="may be repeated; default: all")
    parser.add_argument("--planted", action="store_true", help="whether each finds the bug that was put in")
    parser.add_argument(
        "--build", type=Path, default=ROOT / "build" / "fuzz", metavar="DIR", help="default: build/fuzz"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    names = options.only or list(NAMES)
    targets = {name: f"fuzz_{name}" + "_planted" * options.planted for name in names}
    install()
    build(options.build, list(targets.values()), options.jobs)
    problems = []
    for name, target in targets.items():
        code, said = fuzz(options.build, name, target, _PLANTED_SECONDS if options.planted else options.seconds)
        if options.planted == (code == 0):
            what = (
                f"did not find the bug that was put in, in {_PLANTED_SECONDS} s" if options.planted else f"code {code}"
            )
            problems.append(f"{target}: {what}")
            print(said)
        else:
            runs = next((line for line in said.splitlines() if "number_of_executed_units" in line), "")
            print(f"{target}: {'finds it' if options.planted else 'nothing found'} {runs}", flush=True)
    print("\n".join(problems))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
