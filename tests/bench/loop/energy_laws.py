"""The laws of the energy ledger, of repairs and of what the transport loses: on the runs of the other laws."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from eulerfsi.solver import binding

from . import contact_laws, elastic_laws, laws, mirror_law
from .experiment import Experiment, of
from .laws import Line, Results, conditions, found, out_of_bounds, resolved
from .measure import FORMS, Result, Rise, half_steps, largest_rise, ledger, total_energy

MOST_RISE = 0.02  # of the largest energy so far
CLOSES = 1e-3  # of the largest energy so far

# What belongs together: (stage, form) pairs whose sum is what a mechanism makes of energy. The stress moves energy from
# one form to the other and back, and so does weight. A solid that lies on a floor gives the pressure what the stress
# takes, and the coupling step mixes both.
MECHANISMS: Mapping[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "weight": (("weight", tuple(FORMS)), ("solid_transport", ("potential",)), ("remap", ("potential",))),
    "elasticity and pressure": (
        ("velocity", tuple(FORMS)),
        ("pressure", tuple(FORMS)),
        ("solid_transport", ("elastic",)),
    ),
    "transport of v": (("solid_transport", ("solid_kinetic",)),),
    "remapping": (("remap", ("solid_kinetic", "elastic", "fluid_kinetic")),),
} | {
    stage.replace("_", " "): ((stage, tuple(FORMS)),)
    for stage in ("mixing", "external", "walls", "fluid_transport", "repair", "momentum", "plastic_flow", "viscosity")
}


def by_mechanism(changes: np.ndarray) -> dict[str, float]:
    """What each mechanism makes [J]. changes: (stages, forms), summed over the steps."""
    at = {stage: row for stage, row in zip(binding.ENERGY_STAGES, changes, strict=True)}
    return {
        name: float(sum(at[stage][FORMS.index(form)] for stage, forms in parts for form in forms))
        for name, parts in MECHANISMS.items()
    }


def energy_runs(tier: str) -> list[Experiment]:
    return [
        *laws.bounce_runs(tier),
        *laws.spin_runs(tier),
        *elastic_laws.oscillation_runs(tier),
        *elastic_laws.squash_runs(tier),
        *laws.momentum_runs(tier),
        *laws.rest_runs(tier),
    ]


def recorded_runs(tier: str) -> list[Experiment]:
    """The same and all other runs but those under the load, which the laboratory pushes between two steps. Survival and
    walls judge their own."""
    return [
        *energy_runs(tier),
        *laws.release_runs(tier),
        *mirror_law.mirror_runs(tier),
        *contact_laws.stack_runs(tier),
        *contact_laws.hertz_runs(tier),
    ]


def largest_so_far(energy: np.ndarray) -> np.ndarray:
    return np.maximum.accumulate(np.abs(energy))


def judge_energy(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, recorded_runs(tier)):
        run, energy = result.run, total_energy(result)
        share = result.numbers["energy made"] = share_of_rise(result)
        largest, made = largest_so_far(energy)[-1], made_by(result, largest_rise(energy))
        at = conditions(result, f"{run.scene}, largest energy {largest:.3g} J, {made}")
        bar = f"rise above its running minimum <= {MOST_RISE:g} of the largest so far"
        lines.append(Line("energy", bar, share, "", 0, MOST_RISE, at))
        at = conditions(result, f"{run.scene}, worst step")
        bar = f"columns join the diagnostics, of all forms, within {CLOSES:g} of the largest so far"
        lines.append(Line("energy", bar, share_of_gap(result), "", 0, CLOSES, at))
        lines.append(
            Line("energy", "work of the volume source", float(result["source_work"].sum()), "J", conditions=at)
        )
    return lines


def made_by(result: Result, rise: Rise) -> str:
    """In words, what makes the largest rise; nothing of less than a tenth of it."""
    if rise.size <= 0:
        return "never rises"
    parts = by_mechanism(ledger(result)[rise.begin : rise.end].sum(axis=0))
    parts["half steps"] = float(half_steps(result)[rise.end] - half_steps(result)[rise.begin])
    when = f"from {result.times[rise.begin]:.3g} to {result.times[rise.end]:.3g} s"
    return f"rises by {rise.size:.3g} J {when}: {in_words(parts, rise.size)}"


def in_words(parts: Mapping[str, float], rise: float) -> str:
    """Mechanisms and what they make [J], nothing from outside and nothing of less than a tenth of a rise [J]."""
    large = [(name, value) for name, value in parts.items() if abs(value) > 0.1 * rise and name != "external"]
    return ", ".join(f"{name} {value:+.2g}" for name, value in sorted(large, key=lambda item: -item[1]))


def told(result: Result) -> np.ndarray:
    """By the diagnostics of all solids but colliders and of the fluid, from the start on, (steps + 1, forms) [J]."""
    scene, energies = result.run.simulation(), dict.fromkeys(FORMS, 0.0)
    fluid, pull = scene["ambient_fluid"] * scene["fluid_density"], np.array(scene["gravity"])
    energies["fluid_kinetic"] = result.with_start("fluid_energy") + result.with_start("fluid_carried")
    for number, (_, values) in enumerate(result.run.bodies(), 1):
        seen = lambda name, k=number: result.with_start(of(name, k))  # noqa: E731
        energies["solid_kinetic"] += seen("kinetic_energy")
        energies["elastic"] += seen("elastic_energy")
        displaced = fluid * seen("mass") / values["density"]
        energies["potential"] -= (seen("mass") - displaced) * (seen("center") @ pull)
    return np.stack([energies[form] for form in FORMS], axis=1)


def gap(result: Result) -> np.ndarray:
    """Between sums of the columns and what the diagnostics changed by since the start, per step, of all forms [J]."""
    changes, seen = ledger(result).sum(axis=1), told(result)
    return np.abs(np.cumsum(changes, axis=0) - (seen[1:] - seen[0])).sum(axis=1)


def share_of_gap(result: Result) -> float:
    """The largest gap over the largest energy so far."""
    return float((gap(result) / np.maximum(largest_so_far(total_energy(result)), 1e-12)).max())


def share_of_rise(result: Result) -> float:
    """The largest rise above the running minimum over the largest energy, or work of what is given, so far."""
    energy = total_energy(result)
    largest = largest_so_far(energy)
    if "prescribed_work" in result.columns:
        largest = np.maximum(largest, largest_so_far(np.cumsum(result["prescribed_work"])))
    return float(((energy - np.minimum.accumulate(energy)) / np.maximum(largest, 1e-12)).max())


# --- repairs ---------------------------------------------------------------------------------------------------------


def judge_repairs(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, energy_runs(tier)):
        run = result.run
        at = conditions(result, run.scene)
        counts = out_of_bounds(result)
        result.numbers |= {name.replace("_", " "): float(count) for name, count in counts.items() if count}
        judged = resolved(run)
        low, high = float(result["det_f_before"][:, 0].min()), float(result["det_f_before"][:, 1].max())
        words = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items())
        zero = (0, 0) if judged else (None, None)
        lines.append(Line("repairs", "cells out of bounds = 0", sum(counts.values()), "cells", *zero, f"{at}, {words}"))
        least, most = (0.5, 2.0) if judged else (None, None)
        above, below = (np.inf, 0.0) if judged else (None, None)
        lines.append(Line("repairs", "lowest det F before repair >= 0.5", low, "", least, above, at))
        lines.append(Line("repairs", "highest det F before repair <= 2", high, "", below, most, at))
    return lines


# --- what the transport loses ----------------------------------------------------------------------------------------

# Per second: sums of the magnitudes of what the steps' transports change before anything restores it. Volumes over that
# at rest; momentum over sqrt(2 M E) for the largest kinetic energy E of the run, angular momentum over that times R.
LOSSES = ("volume_mesh", "volume_cells", "momentum", "angular_momentum")
# What it was when the bars were set.
LOSS_BARS: Mapping[tuple[str, int], tuple[float, float, float, float]] = {  # a tenth more, at least 1e-3
    ("bounce, ball, 1000:1", 10): (0.4, 0.43, 0.13, 0.001),
    ("bounce, ball, 1000:1", 20): (0.24, 0.25, 0.064, 0.001),
    ("spin, ball, 1000:1", 20): (0.0083, 0.013, 0.001, 0.17),
    ("oscillation, ball, vacuum", 20): (0.045, 0.053, 0.0039, 0.0012),
    ("oscillation, ball, 1:1", 20): (0.037, 0.05, 0.0028, 0.001),
    ("squash a, half size, compressible, ball, vacuum", 10): (0.001, 0.001, 0.001, 0.001),
    ("squash b, half height, ball, 1000:1", 10): (0.37, 0.36, 0.001, 0.001),
    ("squash c, constant volume, ball, 1000:1", 10): (0.0058, 0.0087, 0.001, 0.001),
    ("drift in a periodic box, ball, 1000:1", 10): (0.001, 0.29, 0.001, 0.001),
    ("drift in a periodic box, ball, 5:1", 10): (0.019, 0.21, 0.031, 0.014),
    ("drift in a periodic box, ball, 1.3:1", 10): (0.032, 0.18, 0.049, 0.019),
    ("rest, ball, 1000:1", 10): (0.012, 0.015, 0.0027, 0.001),
    ("rest, bunny, 1000:1", 10): (0.13, 0.38, 1, 0.99),
}


MOST_MASS = 0.01  # that cells count too much or too little, of the solid's


def judge_mass(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, energy_runs(tier)):
        off = float(np.abs(result["transport_mass"]).max())
        result.numbers["mass counted"] = off
        bar = f"|mass before it is scaled / mass - 1| <= {MOST_MASS:g}"
        lines.append(Line("mass", bar, off, "", 0, MOST_MASS, conditions(result, f"{result.run.scene}, worst step")))
    return lines


def losses(result: Result) -> dict[str, float]:
    """Of LOSSES, per second."""
    seconds = float(result["dt"].sum())
    momentum = max(float(np.sqrt(2 * result.start["mass"] * result.with_start("kinetic_energy").max())), 1e-9)
    scale = dict.fromkeys(LOSSES, 1.0) | {"momentum": momentum, "angular_momentum": momentum * laws.RADIUS}
    sums = {name: np.linalg.norm(np.atleast_2d(result[f"transport_{name}"].T), axis=0).sum() for name in LOSSES}
    return {name: float(sums[name] / scale[name] / seconds) for name in LOSSES}


def judge_transport(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, energy_runs(tier)):
        run = result.run
        at = conditions(result, run.scene)
        bars = LOSS_BARS.get((loss_key(run), run.across), (None,) * len(LOSSES))
        for (name, value), bar in zip(losses(result).items(), bars, strict=True):
            result.numbers[f"transport {name.replace('_', ' ')} [1/s]"] = value
            text = f"{name.replace('_', ' ')} changed by the transport" + ("" if bar is None else f" <= {bar:g}")
            lines.append(Line("transport", text, value, "1/s", None if bar is None else 0, bar, at))
    return lines


def loss_key(run: Experiment) -> str:
    """Name of a run in LOSS_BARS: scene, shape and density ratio."""
    return f"{run.scene}, {run.shape}, {'vacuum' if run.density_ratio is None else f'{run.density_ratio:g}:1'}"
