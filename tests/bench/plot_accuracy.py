"""`./eulerfsi plot accuracy`: the pictures of `bench accuracy`, from its table."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", ROOT / "tests" / "bench"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from accuracy import draw  # noqa: E402


def main(folder: Path | None = None) -> list[Path]:
    """Draws them into a folder, by default docs/images; returns the files."""
    return draw.draw(folder=folder)
