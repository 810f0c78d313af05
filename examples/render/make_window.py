"""Makes the picture of docs/blender.md anew that shows the panel Bake, from the pictures of tests/blender/window.sh.

.venv/bin/python examples/render/make_window.py     # window.sh calls it
"""

from __future__ import annotations

import sys
from pathlib import Path

from make_readme import PICTURES, put_together
from PIL import Image

SHOTS = Path(__file__).resolve().parents[2] / "build" / "window"
STATES = ("2_ready", "3_baking", "4_cancelled", "5_resumed")
BOX = (775, 84, 1029, 394)  # left, top, right, bottom of the panel on the screen of window.sh


def main() -> int:
    panels = []
    for state in STATES:
        with Image.open(SHOTS / f"{state}.png") as shot:
            panels.append(shot.convert("RGB").crop(BOX))
    path = PICTURES / "blender_window.png"
    put_together(panels, BOX[3] - BOX[1], len(panels)).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
