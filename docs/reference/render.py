"""Renders the reference of the C and the Python API: Doxygen reads the headers, Sphinx and breathe write HTML.

    python docs/reference/render.py [FOLDER]     # default: build/reference; open FOLDER/html/index.html

Every warning of either is an error, with exit code 1. Needs doxygen and requirements-dev.txt; `./eulerfsi reference`
installs both.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).resolve().parent
ROOT = SOURCE.parents[1]


def render(folder: Path) -> int:
    for part in ("xml", "doctrees", "html"):  # what was written before
        shutil.rmtree(folder / part, ignore_errors=True)
    (folder / "xml").mkdir(parents=True)
    settings = (SOURCE / "Doxyfile").read_text()
    settings += f'INPUT_FILTER = "\\"{sys.executable}\\" docs/reference/header_filter.py"\n'
    settings += f'OUTPUT_DIRECTORY = "{folder / "xml"}"\n'
    try:
        headers = subprocess.run(["doxygen", "-"], cwd=ROOT, input=settings, text=True)
    except FileNotFoundError:
        print("doxygen is not installed", file=sys.stderr)
        return 1
    if headers.returncode:
        return 1
    search = os.pathsep.join(str(ROOT / part) for part in ("batch", "usd_plugin"))
    sphinx = [sys.executable, "-m", "sphinx", "--quiet", "--nitpicky", "--fail-on-warning", "--builder", "html"]
    pages = [SOURCE, folder / "html", "--doctree-dir", folder / "doctrees"]
    project = ["--define", f"breathe_projects.eulerfsi={folder / 'xml'}"]
    pages = subprocess.run([*sphinx, *project, *pages], env={**os.environ, "PYTHONPATH": search})
    return int(pages.returncode != 0)


if __name__ == "__main__":
    output = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "build" / "reference"
    if code := render(output):
        sys.exit(code)
    print(f"written: {output / 'html' / 'index.html'}")
