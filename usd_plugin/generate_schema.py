"""Generates the codeless USD schema from eulerfsi_schema/schema.usda with usdGenSchema.

    python usd_plugin/generate_schema.py [FOLDER] [--check]

Writes generatedSchema.usda and plugInfo.json into FOLDER (default: eulerfsi_usd/schema, whose files are committed);
with --check it writes nothing and tells whether they are up to date.
Needs usd-core and jinja2.
"""

from __future__ import annotations

import argparse
import filecmp
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from pxr import Usd

HERE = Path(__file__).resolve().parent
SOURCE = HERE / "eulerfsi_schema" / "schema.usda"
TARGET = HERE / "eulerfsi_usd" / "schema"
# What usdGenSchema leaves for a build system to fill in; a codeless schema has no library.
PLUG_INFO_PATHS = {
    "@PLUG_INFO_ROOT@": ".",
    "@PLUG_INFO_RESOURCE_PATH@": ".",
    "@PLUG_INFO_LIBRARY_PATH@": "",
}


def generate(target: Path) -> None:
    """Writes generatedSchema.usda and plugInfo.json into `target`; raises RuntimeError with usdGenSchema's output."""
    tool = Path(Usd.__file__).with_name("usdGenSchema.py")
    with tempfile.TemporaryDirectory() as folder:
        # The schema being generated must not be loaded already.
        environment = {key: value for key, value in os.environ.items() if key != "PXR_PLUGINPATH_NAME"}
        command = [sys.executable, str(tool), str(SOURCE), folder]
        result = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        schema = Path(folder) / "generatedSchema.usda"
        if result.returncode != 0 or not schema.exists():
            raise RuntimeError(f"usdGenSchema failed:\n{result.stdout}{result.stderr}")
        target.mkdir(parents=True, exist_ok=True)
        (target / schema.name).write_text(schema.read_text(encoding="utf-8"), encoding="utf-8")
        lines = (Path(folder) / "plugInfo.json").read_text(encoding="utf-8").splitlines()
        text = "\n".join(line for line in lines if not line.startswith("#"))
        for variable, value in PLUG_INFO_PATHS.items():
            text = text.replace(variable, value)
        plug_info = json.dumps(json.loads(text), indent=4, sort_keys=True)
        (target / "plugInfo.json").write_text(plug_info + "\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description="Writes the codeless schema from schema.usda, by usdGenSchema.")
    parser.add_argument("folder", nargs="?", type=Path, default=TARGET, help=f"default: {TARGET}")
    parser.add_argument("--check", action="store_true", help="write nothing, tell whether the folder is up to date")
    options = parser.parse_args()
    if not options.check:
        generate(options.folder)
        return 0
    with tempfile.TemporaryDirectory() as made:
        generate(Path(made))
        names = [path.name for path in sorted(Path(made).iterdir())]
        _, different, missing = filecmp.cmpfiles(made, options.folder, names, shallow=False)
    for name in (*different, *missing):
        print(f"{options.folder / name}: not what {SOURCE.name} gives: run {Path(__file__).name}", file=sys.stderr)
    return 1 if different or missing else 0


if __name__ == "__main__":
    sys.exit(main())
