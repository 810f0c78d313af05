"""Which runs a case makes: its parameters from cases.toml, one sweep at a time around the default."""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi.errors import UsageError
from eulerfsi.solver import binding

from . import table

FILE = Path(__file__).with_name("cases.toml")
# What every case says; everything else in its table is a parameter of its own.
_COMMON = {"group", "across", "cells", "max_step", "cfl", "length", "dimensions", "of", "sweeps", "limit", "quick"}


@dataclasses.dataclass(frozen=True)
class Case:
    """A table of cases.toml.

    across: what `cells` counts over; length: that [m]; dimensions: that the resolution refines; max_step: largest step
    [s] of the default; cfl: which limit the sweep over steps sets, "" without one; of: the case whose runs this is
    measured on, "" where they are its own; limit: processor seconds of a run; quick: what differs with --quick.
    """

    name: str
    group: str
    across: str = ""
    cells: tuple[float, ...] = ()
    length: float = 1.0
    dimensions: int = 3
    max_step: float = 0.0
    cfl: str = ""
    of: str = ""
    sweeps: tuple[str, ...] = table.SWEEPS[:4]
    limit: float = 60.0
    quick: tuple[tuple[str, Any], ...] = ()
    own: tuple[tuple[str, Any], ...] = ()  # parameters: a value, or {"value", "low", "high"}

    @property
    def touches(self) -> bool:
        """Whether solids touch something, so that what steps may take of their energy matters."""
        return self.group in ("contact", "scenes")

    def parameters(self, seed: int) -> dict[str, Any]:
        """Values of the parameters: those of the file for seed 0, others drawn between low and high."""
        draw = np.random.default_rng([seed, *self.name.encode()])
        out = {}
        for name, given in self.own:
            if not isinstance(given, dict):
                out[name] = given
                continue
            drawn = float(np.exp(draw.uniform(np.log(given["low"]), np.log(given["high"]))))
            out[name] = given["value"] if seed == 0 else float(f"{drawn:.4g}")
        return out


@dataclasses.dataclass(frozen=True)
class Protocol:
    """What all sweeps share."""

    cfl: tuple[float, ...]
    divisors: tuple[int, ...]
    losses: tuple[float, ...]
    tolerances: tuple[float, ...]
    loosest: float  # largest step [s] where the CFL limit or the loss is swept


@dataclasses.dataclass(frozen=True)
class Run:
    """One run of a case: a resolution, a step, a tolerance, a preset."""

    case: str
    cells: float
    preset: str = "production"
    step: str = "default"
    tolerance: float | None = None
    sweep: str = "resolution"
    seed: int = 0
    repeat: int = 1
    parameters: tuple[tuple[str, Any], ...] = ()
    max_step: float = 0.0
    cfl: str = ""
    length: float = 1.0
    limit: float = 60.0

    @property
    def of(self) -> dict[str, Any]:
        """The parameters by name."""
        return dict(self.parameters)

    @property
    def spacing(self) -> float:
        """Cell size [m]."""
        return self.length / self.cells

    @property
    def largest_step(self) -> float:
        """Of this run [s]."""
        word, _, number = self.step.replace("dt/", "divisor ").partition(" ")
        loosest = max(self.max_step, protocol().loosest)
        return {"divisor": self.max_step / float(number or 1), "cfl": loosest, "loss": loosest}.get(word, self.max_step)

    @property
    def settings(self) -> dict[str, Any]:
        """Fields of EfsiSimulationDef that the sweeps set; the preset as its name."""
        values: dict[str, Any] = {"preset": self.preset}
        if self.tolerance is not None:
            values |= {"velocity_tolerance": self.tolerance, "pressure_tolerance": self.tolerance}
        if self.step.startswith("cfl "):
            values[f"cfl_{self.cfl}"] = float(self.step[4:])
        if self.step.startswith("loss "):
            values["step_tolerance"] = float(self.step[5:])
        return values

    @property
    def definition(self) -> dict[str, Any]:
        """The same with the preset's number, for a simulation."""
        return self.settings | {"preset": binding.PRESETS[self.preset]}

    def row(self, **measured: Any) -> table.Row:
        """Its line of the table."""
        names = ("case", "preset", "sweep", "cells", "step", "tolerance", "seed", "repeat")
        values = {name: getattr(self, name) for name in names} | {"parameters": table.text_of(self.of)}
        return table.Row(**values | measured)


def load(path: Path = FILE) -> tuple[Protocol, dict[str, Case]]:
    """What the file of cases says. Raises UsageError."""
    try:
        data = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"{path}: cannot be read: {error}") from None
    shared, cases = data.pop("protocol"), {}
    for name, values in data.items():
        common = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items() if k in _COMMON}
        common["quick"] = tuple(common.get("quick", {}).items())
        own = tuple((k, v) for k, v in values.items() if k not in _COMMON)
        cases[name] = Case(name, **common, own=own)
    return Protocol(**{k: tuple(v) if isinstance(v, list) else v for k, v in shared.items()}), cases


@functools.cache
def protocol() -> Protocol:
    return load()[0]


def runs(case: Case, seed: int = 0, quick: bool = False) -> list[Run]:
    """All runs of a case, the default ones first; quick: one, at the coarsest resolution."""
    rules = protocol()
    values = {"max_step": case.max_step, "cfl": case.cfl, "length": case.length, "limit": case.limit}
    own = case.parameters(seed) | (dict(case.quick) if quick else {})
    base = Run(case.name, case.cells[0], seed=seed, parameters=tuple(own.items()), **values)
    if quick:
        return [base]
    middle = dataclasses.replace(base, cells=case.cells[len(case.cells) // 2])
    change = dataclasses.replace
    out = [change(base, cells=cells) for cells in case.cells]
    if "step" in case.sweeps:
        out += [change(middle, step=f"dt/{n}", sweep="step") for n in rules.divisors]
        out += [change(middle, step=f"cfl {c:g}", sweep="step") for c in rules.cfl if case.cfl]
        out += [change(middle, step=f"loss {t:g}", sweep="step") for t in rules.losses if case.cfl and case.touches]
    if "tolerance" in case.sweeps:
        out += [change(middle, tolerance=t, sweep="tolerance") for t in rules.tolerances]
    if "preset" in case.sweeps:
        others = [name for name in binding.PRESETS if name != base.preset]
        out += [change(base, cells=cells, preset=p, sweep="preset") for p in others for cells in case.cells]
    return out
