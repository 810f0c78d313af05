"""Where the parts of the program lie: beside the package (installed) or in the checkout around it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
_LIBRARY_NAMES = {"darwin": "libeulerfsi.dylib", "win32": "eulerfsi.dll"}
LIBRARY_NAME = _LIBRARY_NAMES.get(sys.platform, "libeulerfsi.so")


def checkout() -> Path | None:
    """Root of the checkout that holds this package, or None for an installed package."""
    root = PACKAGE.parents[1]
    return root if (root / "libeulerfsi" / "parameters.toml").is_file() else None


def library_candidates() -> list[Path]:
    """Places of the shared library, in order of preference."""
    override = os.environ.get("EULERFSI_LIBRARY")
    if override:
        return [Path(override)]
    places = [PACKAGE / "_lib" / LIBRARY_NAME]
    root = checkout()
    if root:
        places.append(root / "build" / "release" / "libeulerfsi" / LIBRARY_NAME)
    return places


def parameter_table() -> Path:
    """parameters.toml: package data of a wheel, the library's own file in a checkout."""
    root = checkout()
    return root / "libeulerfsi" / "parameters.toml" if root else PACKAGE / "parameters.toml"


def make_usd_plugin_importable() -> None:
    """In a checkout the schema package lies in usd_plugin/, which need not be on the path."""
    root = checkout()
    folder = str(root / "usd_plugin") if root else ""
    if root and folder not in sys.path:
        sys.path.insert(0, folder)
