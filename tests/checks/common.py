"""Shared by the checks: the tree to look at, C and C++ text without comments and strings, and how a check ends."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

# EFSI_CHECK_ROOT lets check_self.py point the checks at a copy with planted faults.
ROOT = Path(os.environ.get("EFSI_CHECK_ROOT") or Path(__file__).resolve().parents[2])
SRC = ROOT / "libeulerfsi" / "src"
INCLUDE = ROOT / "libeulerfsi" / "include" / "eulerfsi"

_TOKEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'', re.S)
_DIGIT_SEPARATOR = re.compile(r"(?<=\d)'(?=\d)")


def code_only(text: str) -> str:
    """The text with comments and literals blanked; line numbers stay."""

    def blank(match: re.Match[str]) -> str:
        token = match.group()
        newlines = "\n" * token.count("\n")
        return '""' if token[0] == '"' else "' '" if token[0] == "'" else newlines or " "

    return _TOKEN.sub(blank, _DIGIT_SEPARATOR.sub("", text))


def sources(folder: Path = SRC) -> list[Path]:
    """All C++ files below a folder, sorted; an empty answer is an error of the check itself."""
    files = sorted(p for p in folder.rglob("*") if p.suffix in {".cpp", ".hpp", ".inc", ".h"})
    if not files:
        sys.exit(f"{folder}: no source files; the check would prove nothing")
    return files


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def finish(problems: list[str], looked_at: str) -> None:
    """Ends the check: prints each problem, or what was looked at. Exit code 1 on problems."""
    for problem in problems:
        print(problem)
    if problems:
        sys.exit(f"{len(problems)} problem(s)")
    print(f"ok: {looked_at}")
