# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the solver, which advise options of its command line, in the words of the panels."""

from __future__ import annotations

import re

# What a message says, and what an artist sees instead; the first that fits.
_WORDS = (
    (", write less (--half, --no-velocity, --keep-checkpoints), or go on with --force",
     ", or write less (Advanced: Half Floats, a higher Smoke Threshold, Keep All Checkpoints off)"),
    ("another folder with -o", "another folder in Cache"),
    ("choose another with -o", "choose another in Cache"),
    (" (--checkpoint-every, --keep-checkpoints all)", " (Advanced: Checkpoint Every, Keep All Checkpoints)"),
    ("; --wait SECONDS waits for it", ": wait for it, or cancel it"),
    ("--resume --allow-restart", "Resume"),
    ("--allow-restart accepts that", "Bake Anew makes all of it again"),
    ("--resume", "Resume"),
    ("--overwrite", "Bake Anew"),
    ("cannot resume, the scene has changed since the cache was started",
     "Resume needs the scene as it was. Set the value back, or keep earlier frames by Bake from Frame, or Bake Anew"),
    ("Open a face of the domain (wallYMax = open), or disable the fluid (ambientFluid = false)",
     "Set Domain > Walls > Wall Z Max to open, or Domain > Ambient Fluid off"),
    ("compressible = true: should be false in", "Compressible should be off in"),
)  # fmt: skip
_TABLE = dict(_WORDS)
_OPTIONS = re.compile("|".join(re.escape(words) for words, _ in _WORDS))
_REBAKE = re.compile(r"--rebake-from (\d+)")


def in_blender(message: str) -> str:
    """The message with buttons and settings in place of options."""
    message = _REBAKE.sub(lambda found: f"Bake from Frame {int(found[1]) + 1}", message)
    return _OPTIONS.sub(lambda found: _TABLE[found[0]], message)
