"""What a run costs: processor and wall seconds of its steps, their number, iterations; what it measured."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

from eulerfsi.solver.simulation import Simulation
from loop.measure import Result
from speed.child import peak_memory


class Failed(Exception):
    """A run ended before it had what it was for; the text says why."""


@dataclasses.dataclass
class Measured:
    """value; reference: the exact one, None without a closed form; error: by default |value / reference - 1|.

    others: by name of a case, what cases measure that share this run.
    """

    value: float
    reference: float | None
    norm: str
    window: str
    error: float | None = None
    numbers: dict[str, Any] = dataclasses.field(default_factory=dict)
    others: dict[str, Measured] = dataclasses.field(default_factory=dict)

    def columns(self) -> dict[str, Any]:
        """value, reference, error, norm, window, numbers."""
        error = self.error
        if error is None and self.reference is not None:
            error = abs(self.value / self.reference - 1)
        return {**{k: getattr(self, k) for k in ("value", "reference", "norm", "window", "numbers")}, "error": error}


class Meter:
    """Adds up what steps cost; ends a run that costs more than `limit` processor seconds."""

    def __init__(self, limit: float) -> None:
        self.limit, self.core, self.wall = limit, 0.0, 0.0
        self.steps, self.velocity, self.pressure = 0, 0, 0

    def step(self, simulation: Simulation, largest: float) -> dict[str, Any]:
        """One step; returns the fields of EfsiStepInfo."""
        wall, core = time.perf_counter(), time.process_time()
        info = simulation.step(largest)
        self.core += time.process_time() - core
        self.wall += time.perf_counter() - wall
        self.count(1, info["velocity_iterations"], info["pressure_iterations"])
        if self.core > self.limit:
            raise Failed(f"over {self.limit:g} processor seconds at {simulation.time:.3g} s")
        return info

    def advance(
        self,
        simulation: Simulation,
        end: float,
        largest: float,
        after: Callable[[dict[str, Any]], None] | None = None,
        before: Callable[[float], None] | None = None,
    ) -> None:
        """Steps until a time [s]. before(step's largest size), after(EfsiStepInfo): what is done around each."""
        while end - simulation.time > 1e-9:
            size = min(largest, end - simulation.time)
            if before:
                before(size)
            info = self.step(simulation, size)
            if after:
                after(info)

    def count(self, steps: int, velocity: int, pressure: int) -> None:
        self.steps, self.velocity, self.pressure = (
            self.steps + steps,
            self.velocity + velocity,
            self.pressure + pressure,
        )

    def add(self, result: Result) -> None:
        """The steps of an experiment of `bench loop`. Raises Failed where it did not finish."""
        self.core += float(result["processor"].sum())
        self.wall += float(result["seconds"].sum())
        iterations = (int(result[name].sum()) for name in ("velocity_iterations", "pressure_iterations"))
        self.count(len(result["dt"]), *iterations)
        if result.failure:
            raise Failed(result.failure)

    def columns(self) -> dict[str, Any]:
        """core_s, wall_s, steps, iterations, peak_mb."""
        return {
            "core_s": self.core,
            "wall_s": self.wall,
            "steps": self.steps,
            "velocity_iterations": self.velocity,
            "pressure_iterations": self.pressure,
            "peak_mb": peak_memory() / 2**20,
        }
