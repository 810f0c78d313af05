"""Makes the pictures of the README and of docs/ anew: runs, renders, plots. Half an hour of one core.

    .venv/bin/python examples/render/make_pictures.py [PART...]     # default: all, in the order of PARTS

After ./eulerfsi setup; needs Chromium (the page) and fetches bpy (370 MB, once).
That of the extension's window needs root rights and a download: tests/blender/window.sh.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
IMAGES = ROOT / "docs" / "images"
PYTHON = sys.executable
EULERFSI = [PYTHON, "-m", "eulerfsi"]

# Commands by part. Later ones use the caches of earlier ones.
PARTS: dict[str, list[list[str | Path]]] = {
    "effects": [[PYTHON, HERE / "make_effects.py"]],
    "blender": [[PYTHON, ROOT / "tests/blender/run.py", "picture"]],  # makes the environment of the renderings, too
    "readme": [[PYTHON, HERE / "make_readme.py"]],
    "plots": [
        [*EULERFSI, "plot", "step", ROOT / "build/readme/party", "-o", IMAGES / "party_step.png"],
        [*EULERFSI, "plot", "accuracy"],
        [PYTHON, ROOT / "tests/bench/peers/plot.py"],
    ],
    "page": [[PYTHON, HERE / "make_page.py"]],
    "gallery": [[PYTHON, HERE / "make_gallery.py"]],
}


def main(names: list[str]) -> int:
    if unknown := [name for name in names if name not in PARTS]:
        sys.exit(f"{', '.join(unknown)}: no such part; there are {', '.join(PARTS)}")
    packages = os.pathsep.join(str(ROOT / folder) for folder in ("batch", "usd_plugin"))
    environment = {**os.environ, "PYTHONPATH": packages, "EULERFSI_PICTURE": str(IMAGES / "blender.png")}
    failed = []
    for name in names or PARTS:
        for command in PARTS[name]:
            print("=== " + " ".join(map(str, command)), flush=True)
            if subprocess.run(list(map(str, command)), cwd=ROOT, env=environment).returncode:
                failed.append(name)
                break
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
