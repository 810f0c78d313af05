"""Laws of what passes through what, and of friction between bodies."""

from __future__ import annotations

from loop.thin_laws import COULOMB

from .law import Moot, Verdict, law
from .record import Record


@law("sides", "vertices and lines that are on another side of a body than at the start = 0")
def sides(record: Record) -> Verdict:
    if "passed_lines" not in record.result.columns:
        raise Moot("sides are not followed")
    passed = record.result["passed_lines"] + record.result["passed_vertices"]
    if not passed.any():
        return 0, 0, 0, ""
    at = int((passed > 0).argmax())
    where = f"first at {record.times[at + 1]:.3g} s, between {record.result['passed_pairs'][at]}"
    return int(passed.max()), 0, 0, where


@law("coulomb", f"impulse between two bodies over the most that their friction allows <= {COULOMB:g}")
def coulomb(record: Record) -> Verdict:
    shares = record.result["coulomb"]
    if not shares.any():
        raise Moot("no contact between bodies that is followed")
    at = int(shares.argmax())
    return shares[at], 0, COULOMB, f"at {record.times[at + 1]:.3g} s"
