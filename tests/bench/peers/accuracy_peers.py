"""What `bench accuracy --peers` calls: the peers' cases, in peers.csv beside the table, and their picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import plot
import run
import shared

LIKE = {"swing_vacuum": "oscillation", "bounce_vacuum": "bounce", "elastica": "cantilever"}  # of the solver's own cases


def main(output: Path, cases: Sequence[str], quick: bool) -> int:
    """Runs the peers' cases that are like those named; returns the exit code. An absent peer is named and left out."""
    wanted = [name for name in shared.CASES if name in {LIKE.get(case) for case in cases}]
    target = output.with_name("peers.csv")
    if wanted:
        run.make(list(run.solvers().values()), wanted, target, quick)
        if target == run.OUTPUT:
            plot.draw(target, plot.PICTURE)
    return 0
