"""The warnings of a run: each condition, once a prim, when it first holds, and once more at the end with its worst."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..log import Log
from .conditions import CONDITIONS
from .measures import Finding, Measures, Watched

Key = tuple[str, str, str]  # code, prim, other


class Watch:
    """Looks at a run through the lines of its stats.jsonl, so that one that is resumed sees what the whole one saw.

    warnings: as manifest.json has them, in the order in which they came: "code", "prim", "other" (the second solid, a
    collider or a wall, "" for none), "frame" and "value" when it came, "limit", "worst", "worst_frame", and "place" in
    the world where one is known.
    """

    def __init__(self, watched: Watched, log: Log) -> None:
        self._measures, self._log = Measures(watched), log
        self._held: dict[Key, int] = {}  # frames in a row
        self._known: dict[Key, dict[str, Any]] = {}

    @property
    def warnings(self) -> list[dict[str, Any]]:
        """A copy."""
        return [dict(warning) for warning in self._known.values()]

    def replay(self, lines: Iterable[dict[str, Any]]) -> None:
        """Lines of a run that is resumed; nothing is told again."""
        for line in lines:
            if line["event"] == "step":
                self.step(line)
            elif line["event"] == "frame":
                self.frame(line, tell=False)

    def step(self, line: dict[str, Any]) -> None:
        """A step of the next frame."""
        self._measures.step(line)

    def frame(self, line: dict[str, Any], tell: bool = True) -> bool:
        """A frame, after its steps. Returns whether there is a new warning."""
        before, held = len(self._known), self._held
        self._held = {}
        for finding in self._measures.frame(line):
            row, key = CONDITIONS[finding.code], (finding.code, finding.prim, finding.other)
            limit = row.limit if finding.limit is None else finding.limit
            if finding.value >= limit:
                self._held[key] = held.get(key, 0) + 1
                if self._held[key] >= row.frames:
                    self._note(key, finding, limit, line["frame"], tell)
        return len(self._known) > before

    def _note(self, key: Key, finding: Finding, limit: float, frame: int, tell: bool) -> None:
        if key not in self._known:
            facts = {"code": finding.code, "prim": finding.prim, "other": finding.other, "frame": frame}
            worst = {"worst": finding.value, "worst_frame": frame}
            where = {"place": list(finding.place)} if finding.place else {}
            self._known[key] = {**facts, "value": finding.value, "limit": limit, **worst, **where}
            if tell:
                self._tell(first_text(self._known[key]), self._known[key], finding.value, frame)
        elif finding.value > self._known[key]["worst"]:
            self._known[key] |= {"worst": finding.value, "worst_frame": frame}

    def sum_up(self) -> None:
        """At the end: every warning with its worst value."""
        for warning in self._known.values():
            self._tell(last_text(warning), warning, warning["worst"], warning["worst_frame"])

    def _tell(self, text: str, warning: dict[str, Any], value: float, frame: int) -> None:
        facts = {"value": value, "limit": warning["limit"], "frame": frame}
        self._log.warning(text, warning["code"], warning["prim"], **facts)


def first_text(warning: dict[str, Any]) -> str:
    """What is told of an entry of `warnings` when it comes."""
    row = CONDITIONS[warning["code"]]
    message = row.message(warning["value"], warning["limit"], warning["other"], warning.get("place", ()))
    return f"{warning['prim']}: frame {warning['frame']}: {message}"


def last_text(warning: dict[str, Any]) -> str:
    """What is told of it at the end, and by `info`."""
    row = CONDITIONS[warning["code"]]
    other = f" ({warning['other']})" if warning["other"] else ""
    return (
        f"{warning['prim']}: since frame {warning['frame']}: {warning['code']}{other}: at worst "
        f"{row.show(warning['worst'])}, limit {row.show(warning['limit'])}, in frame {warning['worst_frame']}"
    )
