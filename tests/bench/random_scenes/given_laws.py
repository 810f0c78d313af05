"""Laws of solids that yield, of what moves as given, and of jets."""

from __future__ import annotations

from typing import Any

import numpy as np
from eulerfsi.solver import binding
from loop.measure import ledger

from .law import DEPTH, DEPTH_AT_REST, REST_TIME, TOUCHING, Moot, Verdict, law, of_each, rest
from .record import Record

FLOW = 1e-6  # of the largest energy so far
PINNED = 1e-6  # of the size
FLUX = 0.02


def part(record: Record, name: str) -> Any:
    """The pin, collider or jet of the scene. Raises Moot where it has none."""
    found = getattr(record.scene, name, None)
    if not found:
        raise Moot(f"no {name}")
    return found


def yields(record: Record) -> list[bool]:
    """Of every solid."""
    parts = getattr(record.scene, "parts", ())
    return [bool(body.plastic) for body in parts] or [False]


@law("plastic strain", "falls never, and is 0 where a solid cannot yield: largest fall, or strain, = 0")
def plastic_strain(record: Record) -> Verdict:
    if "max_plastic_strain" not in record.result.columns:
        raise Moot("no plastic strain in the record")
    can, series = yields(record), [solid.series("max_plastic_strain")[record.whole] for solid in record.solids]
    wrong = [
        float(np.maximum(0, -np.diff(strain)).max()) if plastic else float(strain.max())
        for plastic, strain in zip(can, series, strict=True)
    ]
    largest = max(float(strain.max()) for strain in series)
    return max(wrong), 0, 0, f"{sum(can)} of {len(can)} can yield, largest {largest:.3g}"


@law("plastic flow", f"makes no energy: most in a step, over the largest so far, <= {FLOW:g}")
def plastic_flow(record: Record) -> Verdict:
    if not any(yields(record)):
        raise Moot("no solid yields")
    if not record.has_ledger or not max(record.energy_scale) > 0:
        raise Moot("no energy to look at")
    made = ledger(record.result)[:, binding.ENERGY_STAGES.index("plastic_flow")].sum(axis=1)[record.whole[1:]]
    share = made / np.maximum(record.energy_scale[1:][record.whole[1:]], np.finfo(float).tiny)
    at = int(share.argmax())
    return share[at], -np.inf, FLOW, f"at {record.times[at + 1]:.3g} s, {made.sum():.3g} J in all"


@law("pin", f"vertices in it are where its pose puts them: farthest, over the size, <= {PINNED:g}")
def pin(record: Record) -> Verdict:
    held = part(record, "pin")
    gaps = record.column("pin_gap") / record.scene.size
    at = int(gaps.argmax())
    return gaps[at], 0, PINNED, f"at {record.times[at + 1]:.3g} s, {held.words}"


def collider_depths(record: Record) -> np.ndarray:
    """Of the deepest vertex in the collider, 0 for none (n - 1,) [cells]."""
    return np.maximum(0, -record.column("collider_gap")) / record.scene.spacing


@law("collider", f"cells that the deepest vertex is in it <= {DEPTH:g}")
@of_each
def collider(record: Record) -> Verdict:
    held = part(record, "collider")
    depths = collider_depths(record)
    if not (record.column("collider_gap") < record.scene.spacing).any():
        raise Moot("they do not meet")
    at = int(depths.argmax())
    return depths[at], 0, DEPTH, f"at {record.times[at + 1]:.3g} s, {held.words}"


@law("collider at rest", f"cells that the deepest vertex is in it at rest <= {DEPTH_AT_REST:g}")
@of_each
def collider_at_rest(record: Record) -> Verdict:
    held = part(record, "collider")
    late = rest(record)
    if held.path.until > record.times[-1] - REST_TIME:
        raise Moot("the collider is not at rest in the end")
    if not (record.column("collider_gap")[late] < TOUCHING * record.scene.spacing).any():
        raise Moot("at rest away from it")
    return collider_depths(record)[late].max(), 0, DEPTH_AT_REST, f"last {REST_TIME:g} s"


@law("jet", f"flux over its area times its speed, where nothing covers it, within {FLUX:g}")
def jet(record: Record) -> Verdict:
    blows = part(record, "jet")
    on = record.column("jet_on")
    free = (on > 0) & (record.column("jet_covered") == 0)
    if not free.any():
        raise Moot("solids cover its region as long as it is on")
    ratio = record.column("jet_flux")[free] / (blows.flux * on[free])
    at = int(np.abs(ratio - 1).argmax())
    where = f"at {record.times[1:][: len(on)][free][at]:.3g} s, {int(free.sum())} of {int((on > 0).sum())} steps free"
    return ratio[at], 1 - FLUX, 1 + FLUX, where
