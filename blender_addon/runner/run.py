# SPDX-License-Identifier: Apache-2.0
"""Runs in the solver's Python: makes the stage of what Blender has exported, then runs one command line on it."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path


def tell(event: str, **facts: object) -> None:
    """One event in the style of `--progress json`."""
    print(json.dumps({"event": event, **facts}), flush=True)


def fail(code: str, message: str, exit_code: int, prim: str | None = None, field: str | None = None) -> int:
    tell("error", code=code, prim=prim, field=field, message=message)
    tell("end", status="failed", exit_code=exit_code, last_frame=None, error=message)
    return exit_code


def main() -> int:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a parent without a terminal may have it ignored
    task = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    try:
        import eulerfsi
    except ImportError as error:
        return fail("packages", f"the solver cannot be loaded: {error}: install the extension again", 2)
    if eulerfsi.__version__ != task["version"]:
        message = f"the solver is version {eulerfsi.__version__}, the extension {task['version']}"
        return fail("version", f"{message}: install the extension again and restart Blender", 2)
    try:
        from stage import write_stage

        write_stage(Path(task["export"]), Path(task["stage"]))
    except OSError as error:
        return fail("io", f"{error.filename or task['stage']}: {error.strerror}", 5)
    from eulerfsi.cli.main import main as command_line

    return command_line(task["arguments"])


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        tell("end", status="interrupted", exit_code=130, last_frame=None, error="stopped")
        sys.exit(130)
