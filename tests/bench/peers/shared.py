"""What the scripts of all solvers share: the cases, what is measured of a run, and how it becomes an error.

Needs numpy alone: every solver has an environment of its own.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import time
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import lamb
import numpy as np

CASES_FILE = Path(__file__).resolve().parent / "cases.toml"
CASES = ("oscillation", "bounce", "cantilever")
MARK = "PEER "  # begins the line of a run's result
SAMPLES = 40  # of the motion in a period


@dataclasses.dataclass(frozen=True)
class Case:
    """One case at one resolution. across: elements or grid cells over the diameter or the height."""

    name: str
    across: int
    material: dict[str, float]
    values: dict[str, Any]
    options: dict[str, Any] = dataclasses.field(default_factory=dict)  # of the solver

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name not in self.values:
            raise AttributeError(name)
        return self.values[name]

    @property
    def density(self) -> float:
        return self.material["density"]

    @property
    def mu(self) -> float:
        return self.material["youngs_modulus"] / (2 * (1 + self.material["poissons_ratio"]))

    @property
    def lam(self) -> float:
        nu = self.material["poissons_ratio"]
        return self.material["youngs_modulus"] * nu / ((1 + nu) * (1 - 2 * nu))

    @property
    def pressure_speed(self) -> float:
        """Of waves of pressure [m/s]."""
        return float(np.sqrt((self.lam + 2 * self.mu) / self.density))

    @property
    def size(self) -> float:
        """What `across` divides [m]."""
        return self.height if self.name == "cantilever" else 2 * self.radius

    @property
    def spacing(self) -> float:
        return self.size / self.across

    @property
    def period(self) -> float:
        """Of the mode of the oscillation, or of the beam's first one by Euler and Bernoulli [s]."""
        if self.name == "cantilever":
            bending = np.sqrt(self.material["youngs_modulus"] / self.density / 12) * self.height
            return float(2 * np.pi / (1.8751041**2 * bending / self.length**2))
        return float(2 * np.pi * self.radius / (self.reference * np.sqrt(self.mu / self.density)))

    @property
    def damping(self) -> float:
        """Rate of the drag that lets the beam come to rest, critical for its first mode [1/s]."""
        return 4 * np.pi / self.period

    @property
    def end(self) -> float:
        """Time simulated [s]; the beam's is what the drag needs to leave less than a thousandth."""
        if self.name == "oscillation":
            return self.periods * self.period
        return self.duration if self.name == "bounce" else 1.5 * self.period

    def mode(self, points: np.ndarray) -> np.ndarray:
        """Displacement of the oscillation at the start at points about the centre [m]."""
        unit = lamb.displacement(points, self.radius, self.material["poissons_ratio"])
        return self.amplitude * self.radius * unit

    def mode_strain(self, points: np.ndarray) -> np.ndarray:
        """F of the same, (n, 3, 3)."""
        return np.eye(3) + self.amplitude * lamb.gradient(points, self.radius, self.material["poissons_ratio"])


def read_cases(path: Path = CASES_FILE) -> dict[str, Any]:
    """The table of cases. Raises SystemExit for a file that is none."""
    try:
        table = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise SystemExit(f"{path}: {error}") from None
    if missing := [name for name in ("material", *CASES) if name not in table]:
        raise SystemExit(f"{path}: no table [{missing[0]}]")
    return table


def case_of(name: str, across: int, options: dict[str, Any] | None = None) -> Case:
    table = read_cases()
    return Case(name, across, table["material"], table[name], options or {})


# --- energy and motion -----------------------------------------------------------------------------------------------


def elastic_density(case: Case, f: np.ndarray) -> np.ndarray:
    """Of St. Venant-Kirchhoff [J/m^3]; f: (..., 3, 3)."""
    strain = (np.swapaxes(f, -1, -2) @ f - np.eye(3)) / 2
    trace = np.trace(strain, axis1=-2, axis2=-1)
    return case.mu * (strain**2).sum(axis=(-1, -2)) + case.lam / 2 * trace**2


def ellipticity(points: np.ndarray, masses: np.ndarray) -> float:
    """Second moment along x less the mean of the others [m^2]; points: (n, 3)."""
    share = masses / masses.sum()
    xx, yy, zz = share @ (points - share @ points) ** 2
    return float(xx - (yy + zz) / 2)


def swing(times: Sequence[float], values: Sequence[float], period: float) -> tuple[float, float]:
    """Angular frequency and rate of decay [1/s] of A exp(-rate t) cos(omega t + phase) + c, by least squares.

    The best pair is looked for within a factor 2 of the period, on grids that shrink.
    """
    t, y = np.asarray(times, float), np.asarray(values, float)
    if len(t) < 8 or not np.isfinite(y).all():
        return float("nan"), float("nan")

    def misfit(omega: float, rate: float) -> float:
        fade = np.exp(-rate * t)
        basis = np.stack([fade * np.cos(omega * t), fade * np.sin(omega * t), np.ones_like(t)], axis=1)
        left = np.linalg.lstsq(basis, y, rcond=None)[0]
        return float(((basis @ left - y) ** 2).sum())

    omega, rate = 2 * np.pi / period, 0.0
    for width in 0.5 ** np.arange(0, 14):
        span, fade = 0.5 * omega * width, 2.0 * width / t[-1]
        pairs = [(omega + a * span, rate + b * fade) for a in np.linspace(-1, 1, 17) for b in np.linspace(-1, 1, 5)]
        omega, rate = min(pairs, key=lambda pair: misfit(*pair))
    return float(omega), float(rate)


def end_face(points: np.ndarray, sags: np.ndarray, case: Case) -> float:
    """Mean sag of the end face by the trapezoidal rule over its nodes, which form a grid [m]."""
    end = np.abs(points[:, 0] - case.length) < 1e-9
    on_edge = np.isclose(np.abs(points[end][:, 1:]), case.height / 2)
    weights = np.where(on_edge, 0.5, 1.0).prod(axis=1)
    return float(weights @ sags[end] / weights.sum())


def extrapolated_end(along: np.ndarray, sags: np.ndarray, length: float, depth: float) -> float:
    """Mean sag at the end from that of material points in the last `depth` of the beam, by a straight line [m]."""
    near = along > length - depth
    slope, value = np.polyfit(along[near] - length, sags[near], 1)
    return float(value) if np.isfinite(slope) else float("nan")


# --- one run ---------------------------------------------------------------------------------------------------------


class Stopwatch:
    """Wall-clock and processor seconds, of all threads, spent within `with` blocks."""

    def __init__(self) -> None:
        self.wall = self.core = 0.0
        self.before: float | None = None  # processor seconds of the process until the first block

    def __enter__(self) -> Stopwatch:
        self._begun = time.perf_counter(), time.process_time()
        self.before = self._begun[1] if self.before is None else self.before
        return self

    def __exit__(self, *_exc: object) -> None:
        self.wall += time.perf_counter() - self._begun[0]
        self.core += time.process_time() - self._begun[1]

    def found(self) -> dict[str, float]:
        """Of an outcome: what the steps took, and what came before them, compiling included."""
        return {"wall": self.wall, "core": self.core, "setup": self.before or 0.0}


Outcome = dict[str, Any]  # "steps", those of Stopwatch.found, and what judge reads


def sampled_swing(
    case: Case, dt: float, steps: int, every: int, step: Callable[[], None], look: Callable[[], tuple[float, float]]
) -> Outcome:
    """Steps of dt, of which one in `every` is looked at. look: ellipticity and energy of the body now."""
    times, seen, used = [0.0], [look()], Stopwatch()
    for number in range(1, steps + 1):
        with used:
            step()
        if number % every == 0:
            times.append(number * dt)
            seen.append(look())
    ellipticity, energies = (list(column) for column in zip(*seen, strict=True))
    kept = energy_kept(times, energies, case.period)
    return {"times": times, "ellipticity": ellipticity, "energy_kept": kept, "steps": steps} | used.found()


def judge(case: Case, found: Outcome) -> list[dict[str, Any]]:
    """Errors of a run: {"measure", "value", "reference", "error"}."""
    if case.name == "oscillation":
        omega, _ = swing(found["times"], found["ellipticity"], case.period)
        root = omega * case.radius / np.sqrt(case.mu / case.density)
        lines = [("frequency", root, case.reference), ("energy", found["energy_kept"], 1.0)]
    elif case.name == "bounce":
        lines = [("restitution", found["restitution"], case.reference)]
    else:
        lines = [("sag", found["sag"], case.reference)]
    return [
        {"measure": name, "value": float(value), "reference": exact, "error": abs(float(value) / exact - 1)}
        for name, value, exact in lines
    ]


def energy_kept(times: Sequence[float], energies: Sequence[float], period: float) -> float:
    """Mean energy over the last period, relative to the first value."""
    last = np.asarray(times) > times[-1] - period
    return float(np.asarray(energies)[last].mean() / energies[0])


def run_script(solve: Callable[[Case], Outcome]) -> None:
    """`SCRIPT CASE ACROSS [--options JSON]`: runs the case and prints its result behind MARK."""
    parser = argparse.ArgumentParser()
    parser.add_argument("case", choices=CASES)
    parser.add_argument("across", type=int)
    parser.add_argument("--options", type=json.loads, default={})
    chosen = parser.parse_args()
    case = case_of(chosen.case, chosen.across, chosen.options)
    found = solve(case)
    found["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(MARK + json.dumps(found), flush=True)
