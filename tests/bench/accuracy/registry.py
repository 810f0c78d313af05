"""All cases by name, and one run of any of them in this process."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from typing import Any

from eulerfsi.errors import LibraryError

from . import cases_contact, cases_coupled, cases_fluid, cases_scenes, cases_solid, cases_transport
from .meter import Failed, Measured, Meter
from .sweep import Run

MEASURES: dict[str, Callable[[Run, Meter], Measured]] = {
    **cases_transport.CASES,
    **cases_fluid.CASES,
    **cases_coupled.CASES,
    **cases_solid.CASES,
    **cases_contact.CASES,
    **cases_scenes.CASES,
}


def to_text(run: Run) -> str:
    """For `from_text` in another process."""
    return json.dumps(dataclasses.asdict(run))


def from_text(text: str) -> Run:
    values = json.loads(text)
    values["parameters"] = tuple((name, value) for name, value in values["parameters"])
    return Run(**values)


def carry_out(run: Run) -> dict[str, Any]:
    """{"cost": columns, "measured": columns by case, "failure": text}."""
    meter = Meter(run.limit)
    try:
        measured = MEASURES[run.case](run, meter)
    except (Failed, LibraryError) as error:
        return {"cost": meter.columns(), "measured": {}, "failure": str(error).splitlines()[0]}
    by_case = {run.case: measured, **measured.others}
    return {
        "cost": meter.columns(),
        "measured": {name: one.columns() for name, one in by_case.items()},
        "failure": "",
    }
