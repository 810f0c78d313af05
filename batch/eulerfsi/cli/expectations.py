"""What to expect of a scene at its voxel size, from measured curves of error over voxels across a body.

`expectations.json` holds the curves: `./eulerfsi bench accuracy --expectations` writes it from runs whose table is
tests/bench/results/expectations.md, and tries what is said here on random scenes.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..parameters import table
from ..run.estimate import shear_modulus
from ..scene.parts import Scene
from ..solver import binding

CURVES = Path(__file__).with_name("expectations.json")
_FINEST = 8.0  # times as many voxels across: an error that they do not halve is not one of the voxel size
_STEEPEST = 2.0  # order that is believed beyond the coarsest run
_SLAB = 2.0  # voxels: an edge of the domain that is no longer is no length of a body
_AS_LIGHT = 3.0  # times its density: a fluid lighter than that takes no part in a swing
_RESOLVED_PACE = 1.25  # voxels that waves cross in a step: longer steps damp what vibrates in flight


@dataclasses.dataclass(frozen=True)
class Curve:
    """Errors of runs by voxels across, coarse ones first, none smaller than a finer one's. order: that of the error in
    the voxel size, 0 for none; cost: processor time grows with one over the voxel size to this power."""

    cells: tuple[float, ...]
    errors: tuple[float, ...]
    order: float
    cost: float

    def at(self, across: float) -> float:
        """Between runs by logarithms, beyond the finest by the order, beyond the coarsest as from it to the next."""
        cells, errors = np.log(self.cells), np.log(self.errors)
        coarse = min(_STEEPEST, (errors[0] - errors[1]) / (cells[1] - cells[0]))
        nearest = min(max(across, self.cells[0]), self.cells[-1])
        order = coarse if across < nearest else self.order
        return float(math.exp(np.interp(math.log(nearest), cells, errors)) * (nearest / across) ** order)

    def halved(self, across: float) -> tuple[float, float] | None:
        """(voxels across with half of the error, processor time over that now); None where voxels do not help."""
        for finer in np.geomspace(1, _FINEST, 200):
            if self.at(across * finer) <= self.at(across) / 2:
                return float(across * finer), float(finer**self.cost)
        return None


@functools.cache
def curves() -> Mapping[str, Curve]:
    """By name: rebound, volume, swing, swing in fluid, sliding, vortex."""
    read = json.loads(CURVES.read_text())
    return {k: Curve(tuple(v["cells"]), tuple(v["errors"]), v["order"], v["cost"]) for k, v in read.items()}


def no_rebound(domain: Mapping[str, Any]) -> str:
    """Why the curve of rebounds, which is that of production, says nothing of a scene; "" where it does. domain: fields
    of EfsiSimulationDef."""
    if domain["preset"] == binding.PRESETS["fast"] and not domain["step_tolerance"]:
        return "no rebound is promised: in air, 6 voxels across, fast keeps 0.28 of the speed, production 0.52"
    if domain["step_tolerance"] > _normal():
        return f"no rebound is promised: stepTolerance is above normal, {_normal():g}"
    return ""


def _normal() -> float:
    return table()["domain"]["stepTolerance"].names["normal"]


def pace(values: Mapping[str, Any], voxel: float, step: float) -> float:
    """Voxels that the elastic waves of a solid cross in a step. values: fields of EfsiSolidDef; in m and s."""
    mu, ratio = shear_modulus(values), values["poissons_ratio"]
    lame = 2 * mu * ratio / (1 - 2 * ratio) if values["compressible"] else 0.0
    return step * float(np.sqrt(max(mu, lame) / values["density"])) / voxel


def of_solid(
    values: Mapping[str, Any], across: float, fluid: float, rebounds: bool = True, swings: bool = True
) -> dict[str, float]:
    """Errors by name of its curve. values: fields of EfsiSolidDef; fluid: its density, 0 for none [kg/m^3]."""
    names = (["rebound"] if rebounds else []) + ([] if values["compressible"] else ["volume"])
    if swings:
        names.append("swing in fluid" if fluid * _AS_LIGHT > values["density"] else "swing")
    names += ["sliding"] if values["friction"] > 0 else []
    return {name: curves()[name].at(across) for name in names}


_WORDS = {
    "rebound": "a rebound within {}",
    "volume": "volume within {}",
    "swing": "{} of a swing's energy lost in ten periods",
    "swing in fluid": "{} of a swing's energy lost in ten periods",
    "sliding": "a way slid within {}",
    "vortex": "{} of the energy of vortices of that size lost in a turn",
}


def describe(scene: Scene) -> list[str]:
    """A line for each solid and one for the fluid."""
    domain = scene.domain
    if domain["preset"] == binding.PRESETS["paper2016"]:
        return [f"{scene.domain_path}: the preset paper2016 promises no errors; docs/accuracy.md compares it"]
    voxel, density = domain["voxel_size"], domain["fluid_density"] if domain["ambient_fluid"] else 0.0
    step = min(1 / scene.fps, domain["max_time_step"] or np.inf)
    deep = np.array(domain["domain_size"], float) > _SLAB * voxel
    lines, sizes, without = [], [], no_rebound(domain)
    for solid in scene.solids:
        report = (solid.start or solid.surface).report
        size = smallest(np.subtract(report["extent_max"], report["extent_min"]), deep)
        sizes.append(size)
        swings = pace(solid.values, voxel, step) <= _RESOLVED_PACE
        errors = of_solid(solid.values, size / voxel, density, not without, swings)
        texts = [line(solid.path, size, voxel, errors, next(iter(errors)))] if errors else []
        if not swings and not 0 < domain["step_tolerance"] < _normal():
            texts.append(f"steps of {step:.2g} s damp its vibrations in flight: stepTolerance fine keeps them")
        texts += [without] if without else []
        lines.append("; ".join(texts) if errors else f"{solid.path}: {'; '.join(texts)}")
    if density:
        sizes += [smallest(np.subtract(*reversed(emitter.extent())), deep) for emitter in scene.emitters]
        size = min([*sizes, smallest(np.array(domain["domain_size"]) / 4, deep)])
        lines.append(line("fluid", size, voxel, {"vortex": curves()["vortex"].at(size / voxel)}, "vortex"))
    return lines


def smallest(extent: np.ndarray, deep: np.ndarray) -> float:
    """Of the edges of a box, without those across a slab."""
    return float(min(extent[deep], default=float(max(extent))))


def line(name: str, size: float, voxel: float, errors: Mapping[str, float], halved: str) -> str:
    """halved: which of the errors the last words are about."""
    told = ", ".join(_WORDS[which].format(_percent(error)) for which, error in errors.items())
    text = f"{name}: {size / voxel:.3g} voxels across; expect {told}"
    finer, whose = curves()[halved].halved(size / voxel), "that" if len(errors) == 1 else f"the {halved}'s"
    if not finer:
        return f"{text}; less of {whose} with smaller steps, not with smaller voxels"
    return f"{text}; half of {whose} at voxel {size / finer[0]:.2g}, {finer[1]:.2g} times the time"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else "all"
