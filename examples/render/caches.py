"""Runs behind pictures: an example scene is simulated where no complete cache of it lies in a folder of build/."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def complete(cache: Path, last: int) -> bool:
    """Whether a cache has all frames to the last one that is shown."""
    try:
        manifest = json.loads((cache / "manifest.json").read_text(encoding="utf-8"))
    except OSError:
        return False
    return manifest["status"] == "complete" and manifest["last"] >= last


def simulate(scene: str, cache: Path, last: int, options: list[str], threads: int | None) -> None:
    """A scene of examples/scenes, with these options. Raises subprocess.CalledProcessError."""
    if complete(cache, last):
        return
    words = [sys.executable, "-m", "eulerfsi", "simulate", f"examples/scenes/{scene}.usda", "-o", str(cache)]
    words += ["--overwrite", *options, *(["--threads", str(threads)] if threads else [])]
    packages = os.pathsep.join(str(ROOT / folder) for folder in ("batch", "usd_plugin"))
    subprocess.run(words, cwd=ROOT, check=True, env={**os.environ, "PYTHONPATH": packages})
