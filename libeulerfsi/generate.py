"""Writes what follows from the parameter table parameters.toml and from the C headers; the build runs it.

    python libeulerfsi/generate.py --sources FOLDER    # C++ that the library includes, as in libeulerfsi/src
    python libeulerfsi/generate.py --tree ROOT         # what Python, Houdini and the reference read, each at its place

Nothing of it is committed. A file that is up to date is left alone. Needs Python 3.11 and nothing else.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from faces import binding, cpp, houdini, reference, usd
from faces.headers import Header, HeaderError, read_headers
from faces.table import Table, TableError, load_table

ASSET = "houdini_hda/otls/eulerfsi_solver.hda/eulerfsi_8_8Sop_1solver_8_81.0"
Render = Callable[[Table, Header], str]
SOURCES: dict[str, Render] = {
    "frame/parameter_table.inc": lambda table, header: cpp.render_parameters(table),
    "capi/struct_fields.inc": lambda table, header: cpp.render_struct_fields(header),
}
TREE: dict[str, Render] = {  # .gitignore, and BYPRODUCTS of cmake/EfsiGenerate.cmake, have the same files
    "batch/eulerfsi/solver/c_api.py": lambda table, header: binding.render(header),
    "usd_plugin/eulerfsi_usd/parameters.json": lambda table, header: usd.render_json(table),
    "usd_plugin/eulerfsi_usd/schema/generatedSchema.usda": lambda table, header: usd.render_schema(table),
    "usd_plugin/eulerfsi_usd/schema/plugInfo.json": lambda table, header: usd.render_plug_info(table),
    f"{ASSET}/DialogScript": lambda table, header: houdini.render_dialog(table),
    f"{ASSET}/Help": lambda table, header: houdini.render_help(table),
    "docs/reference/parameters.rst": lambda table, header: reference.render(table),
}


def write(folder: Path, outputs: dict[str, Render], table: Table, header: Header) -> None:
    """Writes the files below a folder; one that another program reads meanwhile is whole at any time."""
    for name, render in outputs.items():
        path, text = folder / name, render(table, header)
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_name(f".{path.name}.{os.getpid()}")
        new.write_text(text, encoding="utf-8")
        new.replace(path)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sources", type=Path, metavar="FOLDER", help="writes the C++ files there")
    parser.add_argument("--tree", type=Path, metavar="ROOT", help="writes all others there")
    options = parser.parse_args(arguments)
    try:
        table, header = load_table(), read_headers()
        for folder, outputs in ((options.sources, SOURCES), (options.tree, TREE)):
            if folder:
                write(folder, outputs, table, header)
    except (TableError, HeaderError, OSError) as error:
        print(f"{Path(__file__).name}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
