"""The command as the user called it, for lines that can be pasted into a shell."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path


def command_line(*arguments: str | Path) -> str:
    """The program with arguments, quoted for a POSIX shell. Paths that begin with "-" become "./-..."."""
    return shlex.join([*_program(), *(_argument(argument) for argument in arguments)])


def _program() -> list[str]:
    launcher = os.environ.get("EULERFSI_COMMAND")  # set by the checkout's launcher
    if launcher:
        return [launcher]
    if Path(sys.argv[0]).name == "__main__.py":
        return ["python", "-m", "eulerfsi"]
    return ["eulerfsi"]


def _argument(argument: str | Path) -> str:
    text = str(argument)
    return f"./{text}" if isinstance(argument, Path) and text.startswith("-") else text
