"""Laws of all scenes: each looks at one record alone, needs no reference, and says where it does not apply."""

from __future__ import annotations

import numpy as np
from loop.energy_laws import CLOSES, by_mechanism, gap, in_words
from loop.measure import half_steps, ledger

from .law import DEPTH, DEPTH_AT_REST, REST_TIME, TOUCHING, Moot, Verdict, law, of_each, of_one, rest
from .record import WALLS, Record

DET_F = 2.0  # and its inverse
SQUEEZED = 0.1  # rho v^2 / 2 over Young's modulus up to which a compressible solid keeps within DET_F
THICK = 4.0  # cells
ENERGY_RISE = 0.02
APEX = 0.05
OFF = 1.0  # cells
QUIET_STRAIN = 2e-3
SHAPE = 1e-2
VOLUME = 0.03
CLOSED = 0.01  # relative difference of the mesh's own volume and the solid's
FREE_MOMENTUM, FREE_SPIN = 1e-3, 1e-2
CLOSED_MOMENTUM = 1e-6  # a step
VACUUM_LIKE = 1000.0  # density ratio
OVERLAP, OVERLAP_AT_REST = 1.0, 0.25  # cells


@law("finished", "reaches its end")
def finished(record: Record) -> Verdict:
    if record.out_of_time:
        raise Moot(record.result.failure)
    if record.at_limit:
        raise Moot("ended at a periodic face, which solids cannot cross")
    return float(record.result.finished), 1, 1, record.result.failure


@law("finite", "every number of the record is finite: not finite = 0")
def finite(record: Record) -> Verdict:
    if not record.steps:
        raise Moot("no step was made")
    bad = [
        name
        for name, values in record.result.columns.items()
        if values.dtype.kind in "fiu" and not np.isfinite(values).all()
    ]
    return len(bad), 0, 0, " ".join(bad)


@law("det F", f"largest interior det F, or its inverse, <= {DET_F:g}")
def det_f(record: Record) -> Verdict:
    scene = record.scene
    if scene.compressible and scene.impact_pressure > SQUEEZED:
        raise Moot(f"compressible, and impacts of over {SQUEEZED:g} of its modulus")
    names = [name for name in ("det_f_interior", "det_f_before") if name in record.result.columns]
    low = min(float(record.column(name).min()) for name in names)
    high = max(float(record.column(name).max()) for name in names)
    worst = max(high, 1 / low) if low > 0 else np.inf
    return worst, 0, DET_F, f"{low:.3g}..{high:.3g}"


@law("repairs", "repaired cells = 0")
def repairs(record: Record) -> Verdict:
    thinnest = record.result.start["thinnest_feature"] / record.scene.spacing
    if not record.scene.folds_nowhere:
        raise Moot("a shape that may fold")
    if thinnest < THICK:
        raise Moot(f"its thinnest feature is {thinnest:.1f} cells")
    counts = record.column("degenerate_cells")
    first = float(record.times[1:][: counts.size][counts > 0][0]) if counts.any() else 0.0
    return int(counts.sum()), 0, 0, f"thinnest feature {thinnest:.1f} cells" + f", first at {first:.3g} s" * (first > 0)


@law("energy", f"rise above the lowest so far, over the largest so far, <= {ENERGY_RISE:g}")
def energy(record: Record) -> Verdict:
    if record.scene.density_ratio is not None and not record.has_ledger:
        raise Moot("with fluid: needs the energy ledger")
    if record.scene.density_ratio is not None and "open" in record.scene.faces and any(record.scene.pull):
        raise Moot("fluid that falls brings energy in through an open face")
    if record.whole.sum() < 2 or not max(record.energy_scale) > record.energy_noise:
        raise Moot("no energy to look at")
    rises = [energy_rise(values[record.whole], record.energy_scale[record.whole]) for values in record.energies]
    (rise, at), reading = min((rise, number) for number, rise in enumerate(rises))
    where = f"at {record.times[at]:.3g} s, largest {record.energy_scale[at]:.3g} J"
    if record.has_ledger:
        values = record.energies[reading]
        lowest = int(np.argmin(values[: at + 1]))
        made = by_mechanism(ledger(record.result)[lowest:at].sum(axis=0))
        if reading == 0:  # at one time
            halves = half_steps(record.result)
            made["half steps"] = float(halves[min(at, len(halves) - 1)] - halves[lowest])
        where += f", since {record.times[lowest]:.3g} s: {in_words(made, np.ptp(values[[lowest, at]]))}"
    return rise, -np.inf, ENERGY_RISE, where


def energy_rise(values: np.ndarray, largest: np.ndarray) -> tuple[float, int]:
    """Largest rise above the lowest so far over the largest so far, and the step."""
    rise = (values - np.minimum.accumulate(values)) / np.where(largest > 0, largest, np.inf)
    return float(rise.max()), int(rise.argmax())


@law("ledger", f"its columns join the diagnostics, of all forms: gap over the largest energy so far <= {CLOSES:g}")
def closes(record: Record) -> Verdict:
    if not record.has_ledger:
        raise Moot("no energy ledger")
    shares = gap(record.result) / np.maximum(record.energy_scale[1:], np.finfo(float).tiny)
    at = int(shares[record.whole[1:]].argmax())
    return shares[at], 0, CLOSES, f"at {record.times[at + 1]:.3g} s"


def rebounds(record: Record) -> None:
    """Raises Moot where no rebound can be judged."""
    others = [name for name in ("pin", "collider", "jet") if getattr(record.scene, name, None)]
    if others:
        raise Moot(f"with a {others[0]}")
    if any(body.friction > 0 for body in getattr(record.scene, "parts", ())):
        raise Moot("friction at another wall may brake it")
    ratio = record.scene.density_ratio
    if ratio is not None and ratio < VACUUM_LIKE:
        raise Moot(f"{ratio:.3g}:1, rebounds are judged in vacuum and from {VACUUM_LIKE:g}:1 on")
    if not record.rebounds:
        raise Moot("no rebound that can be judged")


@law("rebound", f"rise of the centre after a rebound over the ballistic one, within {APEX:g}")
@of_one
def rebound_rise(record: Record) -> Verdict:
    rebounds(record)
    most = lambda r: 1 + APEX + r.spring / r.expected  # noqa: E731
    worst = max(record.rebounds, key=lambda r: max(1 - APEX - r.rise / r.expected, r.rise / r.expected - most(r)))
    more = f"{worst.rise:.3g} of {worst.expected:.3g} cells, off face {worst.face} at {worst.time:.3g} s"
    more += f", elastic energy for {worst.spring:.2g}; {len(record.rebounds)} judged"
    return worst.rise / worst.expected, 1 - APEX, most(worst), more


@law("clear", f"cells between the wall and the nearest vertex then > {OFF:g}")
@of_one
def rebound_gap(record: Record) -> Verdict:
    rebounds(record)
    if "max_plastic_strain" in record.result.columns and record.column("max_plastic_strain").any():
        raise Moot("it has yielded")
    clear = [rebound for rebound in record.rebounds if rebound.is_clear]
    if not clear:
        raise Moot("no rebound takes the whole body far enough")
    worst = min(clear, key=lambda rebound: rebound.gap)
    return worst.gap, OFF, np.inf, f"off face {worst.face} at {worst.time:.3g} s"


def wall_depths(record: Record) -> np.ndarray:
    """Of the deepest vertex in any wall, 0 for none (n,) [cells]. The embedded surface is not cut at walls."""
    if not any(kind in WALLS for kind in record.scene.faces):
        raise Moot("no walls")
    if "wall_depth" in record.result.columns:
        return np.maximum(0, record.column("wall_depth")) / record.scene.spacing
    return np.maximum(0, -record.gaps[1:][record.whole[1:]].min(axis=1))


@law("depth", f"cells that the deepest vertex is in a wall <= {DEPTH:g}")
@of_each
def depth(record: Record) -> Verdict:
    depths = wall_depths(record)
    at = int(depths.argmax())
    return depths[at], 0, DEPTH, f"at {record.times[at + 1]:.3g} s, rho v^2/2 / E {record.scene.impact_pressure:.2g}"


@law("depth at rest", f"cells that the deepest vertex is in a wall at rest <= {DEPTH_AT_REST:g}")
@of_each
def depth_at_rest(record: Record) -> Verdict:
    depths = wall_depths(record)
    late = rest(record)
    if not (record.gaps[1:][late] < TOUCHING).any():
        raise Moot("at rest away from walls")
    return depths[late].max(), 0, DEPTH_AT_REST, f"last {REST_TIME:g} s"


@law("shape", f"largest distance of a vertex from the best fit of the rest shape, over the size, <= {SHAPE:g}")
@of_each
def shape(record: Record) -> Verdict:
    touched, quiet = record.whole & ~record.flight, record.strain <= QUIET_STRAIN
    pressed = np.flatnonzero(touched & ~quiet)  # near a wall it is quiet before it meets it, too
    calm = np.flatnonzero(quiet & (touched if touched.any() else record.whole))
    calm = calm[calm > (pressed[0] if pressed.size else 0)]
    where = "after contact" if touched.any() else "no contact"
    if not calm.size:
        raise Moot(f"its strain is above {QUIET_STRAIN:g} all the time" + " after contact" * bool(pressed.size))
    at = int(calm[-1])
    if "max_plastic_strain" in record.result.columns and record.series("max_plastic_strain")[at] > 0:
        raise Moot("it has yielded")
    return record.series("misfit")[at] / record.scene.size, 0, SHAPE, f"at {record.times[at]:.3g} s, {where}"


@law("mesh", "edges longer than 4 times what the largest stretch explains = 0")
@of_each
def mesh(record: Record) -> Verdict:
    edges = record.column("false_edges")
    first = float(record.times[1:][: edges.size][edges > 0][0]) if edges.any() else 0.0
    return int(edges.max()), 0, 0, f"first at {first:.3g} s" if edges.any() else ""


def volume(record: Record, kind: str) -> Verdict:
    if record.scene.compressible:
        raise Moot("compressible")
    ratio = (record.series(f"volume_{kind}") / record.result.start[f"volume_{kind}"])[record.whole]
    at = int(np.abs(ratio - 1).argmax())
    return ratio[at], 1 - VOLUME, 1 + VOLUME, f"at {record.times[at]:.3g} s"


@law("volume by mesh", f"V/V0 within {VOLUME:g}")
@of_each
def volume_by_mesh(record: Record) -> Verdict:
    start = record.result.start
    if abs(start["surface_volume"] / start["solid_volume"] - 1) > CLOSED:
        raise Moot("the mesh does not enclose the solid alone")
    return volume(record, "mesh")


@law("volume by cells", f"V/V0 within {VOLUME:g}")
@of_each
def volume_by_cells(record: Record) -> Verdict:
    return volume(record, "cells")


@law(
    "momentum", f"in flight through vacuum within {FREE_MOMENTUM:g}; between periodic faces {CLOSED_MOMENTUM:g} a step"
)
def momentum(record: Record) -> Verdict:
    if getattr(record.scene, "pin", None) or getattr(record.scene, "held", False):
        raise Moot("a pin holds it")
    if record.scene.density_ratio is None and len(record.solids) > 1:
        return sum_of_momenta(record)
    if record.scene.density_ratio is None:
        flight = record.flight
        if flight.sum() < 2:
            raise Moot("no flight")
        velocity, gained = record.velocity[flight], np.outer(record.times[flight], record.fall)
        scale = np.linalg.norm(velocity, axis=1).max()
        if not scale > 0:
            raise Moot("no momentum")
        lost = np.linalg.norm(velocity - velocity[0] - gained, axis=1).max() / scale
        return lost, 0, FREE_MOMENTUM, "in flight"
    if set(record.scene.faces) != {"periodic"}:
        raise Moot("fluid between walls")
    if len(record.solids) > 1:
        raise Moot("several solids in fluid")
    total = record.velocity * record.result.start["mass"] + record.series("fluid_momentum")
    mass = record.scene.fluid_density * (np.prod(record.scene.box) - record.result.start["solid_volume"])
    stirred = float(np.sqrt(2 * mass * record.series("fluid_energy").max()))  # what flows this way and that, at most
    scale = np.linalg.norm(total[0]) + stirred
    if not scale > 0:
        raise Moot("no momentum")
    return np.linalg.norm(np.diff(total, axis=0), axis=1).max() / scale, 0, CLOSED_MOMENTUM, "largest of a step"


def sum_of_momenta(record: Record) -> Verdict:
    """Of several solids in vacuum that push each other, until one of them comes to a wall."""
    flight = np.logical_and.reduce([solid.flight for solid in record.solids])
    if flight.sum() < 2:
        raise Moot("no flight")
    masses = [solid.result.start["mass"] for solid in record.solids]
    momenta = [m * solid.velocity[flight] for m, solid in zip(masses, record.solids, strict=True)]
    scale = sum(np.linalg.norm(p, axis=1) for p in momenta).max()
    if not scale > 0:
        raise Moot("no momentum")
    gained = sum(masses) * np.outer(record.times[flight], record.fall)
    lost = np.linalg.norm(sum(momenta) - sum(momenta)[0] - gained, axis=1).max() / scale
    pushed = int((record.result["active_rows"][flight[1:]] > 0).sum())
    return lost, 0, FREE_MOMENTUM, f"of {len(masses)} solids in flight, {pushed} steps with contact"


def overlaps(record: Record) -> np.ndarray:
    """Of the deepest vertex of any solid in another one after every step [cells]."""
    if len(record.solids) < 2:
        raise Moot("one solid")
    return record.column("overlap") / record.scene.spacing


@law("overlap", f"cells that the deepest vertex of a solid is in another one <= {OVERLAP:g}")
def overlap(record: Record) -> Verdict:
    depths, rows = overlaps(record), record.column("active_rows")
    if not (rows > 0).any() and not depths.any():
        raise Moot("they do not meet")
    at = int(depths.argmax())
    skin = f"skin pressed in by {record.column('contact').max():.2f} cells, {int((rows > 0).sum())} steps with contact"
    return depths[at], 0, OVERLAP, f"at {record.times[at + 1]:.3g} s, {skin}"


@law("overlap at rest", f"cells that the deepest vertex of a solid is in another one at rest <= {OVERLAP_AT_REST:g}")
def overlap_at_rest(record: Record) -> Verdict:
    depths = overlaps(record)
    late = rest(record, "one leaves through an open face")
    if not (record.result["active_rows"][late] > 0).any() and not depths[late].any():
        raise Moot("at rest away from each other")
    return depths[late].max(), 0, OVERLAP_AT_REST, f"last {REST_TIME:g} s"


@law("spin", f"angular momentum in flight through vacuum within {FREE_SPIN:g}")
@of_one
def spin(record: Record) -> Verdict:
    start = np.array(record.result.start["angular_momentum"])
    if record.scene.density_ratio is not None or not any(record.scene.spin):
        raise Moot("with fluid" if record.scene.density_ratio is not None else "no spin")
    if record.flight.sum() < 2:
        raise Moot("no flight")
    change = record.series("angular_momentum")[record.flight] - start
    return np.linalg.norm(change, axis=1).max() / np.linalg.norm(start), 0, FREE_SPIN, "in flight"
