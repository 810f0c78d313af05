"""Lines for people and programs that may have stopped listening: a closed pipe never ends a run."""

from __future__ import annotations

import os
from typing import TextIO


def say(line: str, stream: TextIO) -> bool:
    """Writes one line and flushes it. False once nobody reads the stream; from then on it leads nowhere."""
    try:
        print(line, file=stream, flush=True)
    except BrokenPipeError:
        # What is still in the buffer would fail again when the interpreter closes the stream.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
        return False
    return True
