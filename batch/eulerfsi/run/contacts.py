"""What the statistics tell of solids that push each other, or exchange sides, in a frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

_SUMS = ("steps", "rows", "active_rows", "sticking_rows", "normal_impulse", "exchanged_vertices")
_LARGEST = ("row_overlap", "surface_overlap")


class FrameContacts:
    """Pairs of solids of one frame, added up over parts of it. A run that is stopped in a frame leaves its part."""

    def __init__(self) -> None:
        self._pairs: dict[tuple[int, int], dict[str, Any]] = {}
        self.velocity_iterations = 0

    def add(self, pairs: Iterable[dict[str, Any]], velocity_iterations: int) -> None:
        """Adds a part of the frame; pairs: fields of EfsiContactPair."""
        self.velocity_iterations += velocity_iterations
        for pair in pairs:
            key = tuple(pair["solid"])
            old = self._pairs.get(key)
            if old is None:
                self._pairs[key] = dict(pair)
                continue
            if not old["exchanged_vertices"]:
                old["exchanged_place"] = pair["exchanged_place"]
            old |= {name: old[name] + pair[name] for name in _SUMS}
            old |= {name: max(old[name], pair[name]) for name in _LARGEST}
            old["impulse"] = [a + b for a, b in zip(old["impulse"], pair["impulse"], strict=True)]

    def part(self) -> dict[str, Any]:
        """All that `add` needs to go on from here."""
        return {"pairs": self._in_order(), "velocity_iterations": self.velocity_iterations}

    def columns(self, names: dict[int, str]) -> dict[str, Any]:
        """The column `contacts` of a frame's line, solids by name; {} where nothing has touched."""
        if not self._pairs:
            return {}
        pairs = []
        for pair in self._in_order():
            share = pair["sticking_rows"] / max(pair["active_rows"], 1)
            solids = [names[identifier] for identifier in pair["solid"]]
            without = {"solid", "sticking_rows"} | ({"exchanged_place"} if not pair["exchanged_vertices"] else set())
            rest = {name: value for name, value in pair.items() if name not in without}
            pairs.append({"solids": solids, **rest, "sticking_share": share})
        return {"contacts": {"velocity_iterations": self.velocity_iterations, "pairs": pairs}}

    def _in_order(self) -> list[dict[str, Any]]:
        return [self._pairs[key] for key in sorted(self._pairs)]
