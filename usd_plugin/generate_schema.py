"""Generates the codeless USD schema from eulerfsi_schema/schema.usda with usdGenSchema.

    python usd_plugin/generate_schema.py [FOLDER]

Writes generatedSchema.usda and plugInfo.json into FOLDER (default: eulerfsi_usd/schema, whose files are committed).
Needs usd-core and jinja2.
"""

from __future__ import annotations

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


if __name__ == "__main__":
    generate(Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET)
