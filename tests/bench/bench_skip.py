"""What a scene pays for features that it lacks: `./eulerfsi bench skip [--against DIR]`.

A small scene is run for three steps without a feature and with it. The stages of a feature must visit no tile and no
byte without it by the profile, and some with it. Of a feature that the profile does not count (plasticity, pins,
ledger, passengers, outputs) it is shown how much memory it adds, which a scene without it does not have. --against DIR
compares ball and smoke with another checkout, from before the newest features, five rounds in turns (`bench speed
--against`): within 3 %. Exit code 1 where a bar is missed, unless CI=true.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", ROOT / "tests" / "bench"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from eulerfsi.errors import UsageError  # noqa: E402
from eulerfsi.solver import binding  # noqa: E402
from eulerfsi.solver.simulation import Mesh, Simulation  # noqa: E402
from loop.shapes import make_shape  # noqa: E402
from loop.table import text  # noqa: E402
from speed import groups  # noqa: E402
from speed.groups import MISSING  # noqa: E402

STEPS, STEP = 3, 1 / 240  # s
SLOWER, ROUNDS = 1.03, 5
BOX = {"domain_size": (0.4, 0.4, 0.4), "voxel_size": 0.02, "gravity": (0.0, -9.8, 0.0), "threads": 1}
IDENTITY = [0.4, 0, 0, 0.2, 0, 0.4, 0, 0.2, 0, 0, 0.4, 0.2, 0, 0, 0, 1]
Adds = Callable[[Simulation, int], object]


@dataclasses.dataclass(frozen=True)
class Feature:
    """What turns it on in a scene with a ball in fluid. stages: which nothing else in that scene uses."""

    name: str
    domain: dict[str, Any] = dataclasses.field(default_factory=dict)
    solid: dict[str, Any] = dataclasses.field(default_factory=dict)
    adds: Adds | None = None
    after: Adds | None = None  # once the steps are made
    without: dict[str, Any] = dataclasses.field(default_factory=dict)  # of the scene that lacks it
    stages: tuple[str, ...] = ()
    ball: bool = True  # the scene that lacks it has a ball


def smoke(simulation: Simulation, _solid: int, **more: float) -> None:
    simulation.add_emitter(transform=IDENTITY, density=1.0, **more)


def jet(simulation: Simulation, _solid: int) -> None:
    mode = binding.EMITTER_MODES["continuous"]
    place = [0.1, 0, 0, 0.08, 0, 0.1, 0, 0.08, 0, 0, 0.1, 0.08, 0, 0, 0, 1]
    simulation.add_emitter(transform=place, mode=mode, velocity=(1.0, 0.0, 0.0), has_velocity=1, end_time=1e6)


def force(simulation: Simulation, _solid: int) -> None:
    kind = binding.FORCE_KINDS["constant"]
    simulation.add_force(kind=kind, transform=IDENTITY, acceleration=(1.0, 0.0, 0.0), end_time=1e6)


def pin(simulation: Simulation, solid: int) -> None:
    simulation.add_pin(solid, ball().points[:, 1] > 0.28)


def passenger(simulation: Simulation, solid: int) -> None:
    simulation.add_passenger(solid, np.array([[0.2, 0.2, 0.2], [0.22, 0.2, 0.2]]))


def near(simulation: Simulation, _solid: int) -> None:
    other = make_shape("ball", 10)
    simulation.add_solid(Mesh(other.points * 0.3 + [0.2, 0.07, 0.2], other.counts, other.indices))


def buoyancy(simulation: Simulation, solid: int) -> None:
    smoke(simulation, solid, temperature=50.0)


FEATURES = (
    Feature("fluid", without={"ambient_fluid": 0}, stages=MISSING["fluid"][1]),
    Feature("solids", stages=MISSING["solids"][1], ball=False),
    Feature("smoke", adds=smoke, stages=MISSING["smoke"][1]),
    Feature("temperature", adds=buoyancy, stages=("smoke",)),
    Feature("buoyancy", {"temperature_buoyancy": 0.02}, adds=buoyancy, stages=("fluid_forces",)),
    Feature("plasticity", solid={"plastic_yield_stress": 1.0}),
    Feature("contact near", adds=near, stages=("contact",)),
    Feature("viscosity", {"fluid_viscosity": 0.01}, stages=("fluid_forces",)),
    Feature("confinement", {"vorticity_confinement": 0.5}, stages=("fluid_forces",)),
    Feature("forces", adds=force, stages=("fluid_forces",)),
    Feature("pins", adds=pin),
    Feature("jets", adds=jet, stages=("smoke",)),
    Feature("ledger", {"energy_ledger": 1}),
    Feature("passengers", adds=passenger),
)


def ball() -> Mesh:
    """In the middle of the box, 0.2 m across."""
    mesh = make_shape("ball", 10)
    return Mesh(mesh.points + 0.2, mesh.counts, mesh.indices)


def profile(feature: Feature | None, on: bool) -> dict[str, Any]:
    """The profile of three steps of the scene with the feature or, `on` false, without it."""
    domain = BOX | ((feature.domain if on else feature.without) if feature else {})
    with Simulation(domain) as simulation:
        solid = 0
        if feature is None or on or feature.ball:
            solid, _ = simulation.add_solid(ball(), **(feature.solid if feature and on else {}))
        if feature and on and feature.adds:
            feature.adds(simulation, solid)
        for _ in range(STEPS):
            simulation.step(STEP)
        return simulation.profile()


def outputs() -> dict[str, Any]:
    """The profile where every field is read after each step: what is not asked for is not made."""
    with Simulation(BOX) as simulation:
        solid, _ = simulation.add_solid(ball())
        for _ in range(STEPS):
            simulation.step(STEP)
            for name in binding.FIELDS:
                simulation.field(name, solid if name.startswith("solid_") and name != "solid_fraction" else 0)
            simulation.surface(solid)
        return simulation.profile()


def total(measured: dict[str, Any], kind: str, stages: Sequence[str] = ()) -> int:
    return sum(value for stage, value in measured[kind].items() if not stages or stage in stages)


def row(name: str, off: dict[str, Any], on: dict[str, Any], stages: Sequence[str] = ()) -> dict[str, str]:
    """A feature's line; judged where it has stages of its own."""
    own = [total(off, kind, stages) for kind in ("tiles", "bytes")] if stages else None
    used = [total(on, kind, stages) for kind in ("tiles", "bytes")]
    added = [total(on, kind) - total(off, kind) for kind in ("tiles", "bytes")]
    verdict = "not judged" if own is None else "pass" if own == [0, 0] and min(used) > 0 else "MISSED"
    return {
        "feature": name,
        "stages of its own": ", ".join(stages) or "-",
        "their tiles, bytes without it": "-" if own is None else f"{own[0]}, {own[1]}",
        "it adds tiles, bytes": f"{added[0]}, {added[1]}",
        "memory [kB], without, with": f"{off['memory_bytes'] // 1000}, {on['memory_bytes'] // 1000}",
        "verdict": verdict,
    }


def compared(checkout: Path) -> list[dict[str, str]]:
    """Lines of `bench speed --against`, five rounds, those of the core time judged."""
    lines = []
    for line in groups.against(groups.Sizes(), checkout, ROUNDS).lines:
        judged = "core time" in line.bar
        verdict = "not judged" if not judged else "pass" if line.measured <= SLOWER else "MISSED"
        lines.append(
            {"line": line.bar, "now / then": f"{line.measured:.4g}", "verdict": verdict, "at": line.conditions}
        )
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what was asked for; returns the exit code."""
    parser = argparse.ArgumentParser(prog="eulerfsi bench skip", description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, metavar="DIR", help="another checkout, set up by its ./eulerfsi setup")
    options = parser.parse_args(arguments)
    if options.against and not options.against.is_dir():
        raise UsageError(f"--against {options.against}: there is no such folder")
    rows = [row(f.name, profile(f, False), profile(f, True), f.stages) for f in FEATURES]
    rows.append(row("outputs not asked for", profile(None, False), outputs()))
    print(text(rows))
    lines = compared(options.against.resolve()) if options.against else []
    if lines:
        print(f"\n{text(lines)}")
    missed = sum(line["verdict"] == "MISSED" for line in (*rows, *lines))
    print(f"{missed} bars missed")
    return 1 if missed and os.environ.get("CI") != "true" else 0


if __name__ == "__main__":
    sys.exit(main())
