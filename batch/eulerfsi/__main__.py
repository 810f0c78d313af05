"""`python -m eulerfsi` and the installed `eulerfsi`: the command line."""

import os
import signal
import sys
from typing import Any, NoReturn


def _leave(number: int, _frame: Any) -> NoReturn:
    os.write(2, f"stopped by signal {number}\n".encode())
    requeue = number == signal.SIGTERM and "--requeue-on-signal" in sys.argv
    os._exit(75 if requeue else 128 + number)


def start() -> int:
    """Runs the command line. While it is loaded, a signal ends the process without a traceback."""
    names = [name for name in ("SIGHUP", "SIGINT", "SIGTERM") if hasattr(signal, name)]
    numbers = [getattr(signal, name) for name in names]
    for number in numbers:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)  # the launcher holds them back until here

    from .cli.main import main

    return main()


if __name__ == "__main__":
    sys.exit(start())
