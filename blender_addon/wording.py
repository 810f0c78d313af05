# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the solver, which name options of its command line and parameters, in the words of the panels."""

from __future__ import annotations

import re
from functools import cache

from . import table

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
    ("must be those of the checkpoint", "must be those of the checkpoint: Bake Anew takes other ones"),
    ("compressible = true: should be false in", "Compressible should be off in"),
)  # fmt: skip
_TABLE = dict(_WORDS)
_OPTIONS = re.compile("|".join(re.escape(words) for words, _ in _WORDS))
_NAME = re.compile(r"(?<![\w.:/])[a-z]+(?:_[a-z]+|[A-Z][a-z]*)+(?![\w/])")  # youngsModulus, youngs_modulus; no path
_REBAKE = re.compile(r"--rebake-from (\d+)")


def in_blender(message: str) -> str:
    """The message with buttons and settings in place of options and parameters."""
    message = _REBAKE.sub(lambda found: f"Bake from Frame {int(found[1]) + 1}", message.replace("eulerfsi:", ""))
    message = _OPTIONS.sub(lambda found: _TABLE[found[0]], message)
    return _NAME.sub(lambda found: _labels().get(found[0], found[0]), message)


@cache
def _labels() -> dict[str, str]:
    """{name of a parameter on a stage or in the C API: name in a panel}; walls have the axes of the solver there."""
    rows = [row for scope in table.SCOPES for row in table.rows(scope).values() if not row["name"].startswith("wall")]
    return {name: row["label"] for row in reversed(rows) for name in (row["name"], table.snake(row["name"]))}
