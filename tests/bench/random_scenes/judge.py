"""The judgement of one run by all laws."""

from __future__ import annotations

from loop.laws import Line
from loop.measure import Result

from . import general_laws, given_laws, thin_laws
from .law import LAWS, Moot
from .record import Record

__all__ = ["LAWS", "general_laws", "given_laws", "judge", "thin_laws"]


def judge(result: Result) -> list[Line]:
    """One line a law, in the order of LAWS."""
    record, lines = Record.of_all(result), []
    for name, (bar, look) in LAWS.items():
        try:
            if name not in ("finished", "finite") and not record.whole[1:].any():
                raise Moot("no step in which the solid was whole")
            measured, low, high, more = look(record)
            lines.append(Line(name, bar, float(measured), "", low, high, more))
        except Moot as reason:
            lines.append(Line(name, bar, float("nan"), conditions=str(reason)))
    return lines
