"""Values of a changed scene that cannot act on the frames after one of a cache, since they act before it alone."""

from __future__ import annotations

import bisect
from typing import Any, NoReturn

from ..errors import MismatchError
from ..parameters import table
from ..scene.parts import Scene
from .manifest import Change, Manifest, changes

Parameters = dict[str, dict[str, Any]]

_START = "it acts at the start alone"


def demand_effect(what: str, manifest: Manifest, made: Parameters, scene: Scene, frame: int) -> None:
    """Raises MismatchError where a value differs from that of the cache and later frames would not show it.

    made: the parameters that the frame was made with.
    """
    now, time = scene.parameters(), (frame - scene.frames.first) / scene.fps
    solids = [solid.path for solid in scene.solids]
    starts = scene.starts()
    before = manifest.data.get("starts", starts)
    for path in sorted({*before, *starts}):
        becomes_continuous = path in now and path not in starts
        if before.get(path) == starts.get(path) or becomes_continuous:
            continue
        if path in solids:
            _refuse(what, Change(path, "", "", "where its points start, or how they move then, has changed"), _START)
        _refuse(what, _first_change(path, made, now) or Change(path, "", "", "its region has changed"), _START)
    initial = {row.field for row in table()["solid"].values() if row.initial}
    for path in solids:
        for change in changes({path: made.get(path, {})}, {path: now[path]}):
            if change.field in initial:
                _refuse(what, change, _START)
    for path in sorted({*made, *now} - {*starts}):
        old, new = made.get(path, {}), now.get(path, {})
        if old != new and "end_time" in old | new and _after(old, time) == _after(new, time):
            _refuse(what, _first_change(path, made, now), f"it acts up to frame {frame} alone")


def _after(values: dict[str, Any], time: float) -> dict[str, Any]:
    """What of an emitter or a force acts after a time [s]; {}: nothing."""
    if not values or values["end_time"] <= time:
        return {}
    late = {**values, "start_time": max(values["start_time"], time)}
    times = late.get("key_time")
    if not times:
        return late
    passed = max(bisect.bisect_right(times, time) - 1, 0)  # the last one before the time counts after it
    keys = {field: late.pop(field) for field in values if field.startswith("key_")}
    for field, numbers in keys.items():
        late[field] = numbers[passed * (len(numbers) // len(times)) :]
    if len(late["key_time"]) > 1:
        return late
    on, _ = late.pop("key_on"), late.pop("key_time")  # it has one value from now on, as an emitter without keys has
    for field in [field for field in late if field.startswith("key_")]:
        numbers = late.pop(field)
        late[field.removeprefix("key_")] = numbers if field == "key_velocity" else numbers[0]
    return late if on[0] else {}


def _first_change(path: str, made: Parameters, now: Parameters) -> Change | None:
    """The first value of a prim that differs."""
    found = changes(*({path: of[path]} if path in of else {} for of in (made, now)))
    if found and found[0].field.startswith("key_"):
        return Change(path, "", "", "its time samples have changed")
    return found[0] if found else None


def _refuse(what: str, change: Change, why: str) -> NoReturn:
    text = f"{what}: {change.prim}: {change.text}: {why}; --overwrite makes the whole cache anew"
    raise MismatchError(text, prim=change.prim, field=change.attribute)
