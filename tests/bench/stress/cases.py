"""Stress cases S1 to S24: experiments of `bench loop`, runs of `bench accuracy` and calls that have to be refused.

Laws, shapes, groups and cases of both are called. A case is a name and its runs; what is judged is in `judge.py`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from accuracy import sweep
from eulerfsi.errors import LibraryError
from eulerfsi.solver.simulation import Mesh, Simulation
from loop import contact_laws, elastic_laws, laws, meeting_laws, survival, thin_laws
from loop.experiment import FRAME, GRAVITY, SHEAR_MODULUS, YOUNGS_MODULUS, Experiment
from loop.measure import Result
from loop.shapes import SIZE, make_shape

THROWN = Experiment(
    "thrown", across=8, box=(0.4, 0.4, 0.4), floor=0.03, duration=0.3, gravity=GRAVITY, velocity=(0.0, -2.0, 0.0)
)
FREE = Experiment("let go", across=8, box=(0.5, 0.5, 0.5), density_ratio=None, duration=0.5, limit=120.0)


@dataclasses.dataclass(frozen=True)
class Bar:
    """A figure of a case beside those of all: its name and the range in which it passes.

    of: how it is found in an experiment; a run of `bench accuracy` has it as its error or among its numbers.
    """

    name: str
    most: float = np.inf
    least: float = -np.inf
    of: Callable[[Result], float] | None = None


@dataclasses.dataclass(frozen=True)
class Case:
    """runs: experiments; measured: of `bench accuracy`; refused: calls by name that must raise LibraryError and nothing
    else; bars: what runs or measured have to keep beside the figures of every experiment."""

    number: str
    name: str
    runs: tuple[Experiment, ...] = ()
    measured: tuple[sweep.Run, ...] = ()
    bars: tuple[Bar, ...] = ()
    refused: tuple[tuple[str, Callable[[], object]], ...] = ()
    volume: bool = True  # the solids start at their rest volume, which they keep
    energy: bool = True  # closed: the law of energy holds


def each(base: Experiment, **values: tuple) -> tuple[Experiment, ...]:
    """The experiment with each value of one field."""
    ((name, some),) = values.items()
    return tuple(dataclasses.replace(base, scene=f"{base.scene}, {name} {value}", **{name: value}) for value in some)


def with_settings(base: Experiment, name: str, some: tuple) -> tuple[Experiment, ...]:
    return tuple(dataclasses.replace(base, scene=f"{base.scene}, {name} {v:g}", settings=((name, v),)) for v in some)


def stretched(factors: tuple[float, ...]) -> tuple[Experiment, ...]:
    """Along x at constant volume, in a box with room for it."""
    runs = each(FREE, stretch=tuple((f, f**-0.5, f**-0.5) for f in factors))
    return tuple(dataclasses.replace(run, box=(max(0.5, 1.5 * SIZE * run.stretch[0]), *run.box[1:])) for run in runs)


def twisted(degrees: tuple[float, ...]) -> tuple[Experiment, ...]:
    """A bar, about its length."""
    bar = dataclasses.replace(FREE, shape="box")
    return tuple(
        dataclasses.replace(bar, scene=f"twisted by {d:g} degrees", twist=float(np.deg2rad(d))) for d in degrees
    )


def impacts() -> tuple[Experiment, ...]:
    """So many cells a step at the floor, the limits of the step off."""
    h = SIZE / THROWN.across
    return tuple(
        dataclasses.replace(
            THROWN,
            scene=f"{cells:g} cells a step",
            cfl=elastic_laws.NO_CFL,
            dt=0.005,
            velocity=(0.0, -cells * h / 0.005, 0.0),
            floor=0.1,
            box=(0.4, 0.5, 0.4),
            duration=0.1,
            youngs_modulus=YOUNGS_MODULUS * max(1.0, cells) ** 2,
        )
        for cells in (0.1, 1.0, 5.0)
    )


def loop_runs(runs: list[Experiment], limit: float = 600.0) -> tuple[Experiment, ...]:
    return tuple(dataclasses.replace(run, limit=limit) for run in runs)


def accuracy_runs(name: str, limit: float, *choices: dict[str, Any], **parameters: float) -> tuple[sweep.Run, ...]:
    """A case of `bench accuracy`. choices: fields of its Run, one each; limit: processor seconds."""
    case = sweep.load()[1][name]
    first = sweep.runs(case)[0]
    own = tuple((dict(first.parameters) | parameters).items())
    return tuple(dataclasses.replace(first, limit=limit, parameters=own, **choice) for choice in choices)


def scrambled(full: bool) -> tuple[Experiment, ...]:
    """Nothing is left of the shape at the start; soft and stiff, in steps of a frame."""
    seeds = tuple(range(1, 6 if full else 3))
    soft, stiff = (
        each(dataclasses.replace(FREE, scene=f"scrambled, E {e:g} Pa", dt=FRAME, youngs_modulus=e), scramble=seeds)
        for e in (YOUNGS_MODULUS, 100 * YOUNGS_MODULUS)
    )
    return soft + stiff


def head_on() -> tuple[Experiment, ...]:
    """Two balls until they have parted, in air and vacuum."""
    met = (meeting_laws.meeting("meet head on", 10, ratio, False) for ratio in (1000.0, None))
    return tuple(dataclasses.replace(run, box=(0.8, 0.5, 0.5), duration=0.2) for run in met)


# --- calls that have to be refused -----------------------------------------------------------------------------------

BOX = {"domain_size": (0.4, 0.4, 0.4), "voxel_size": 0.05, "threads": 1}


def solid_of(mesh: Mesh | None = None, **values: float) -> None:
    """Adds a ball with these values and makes a step."""
    with Simulation(BOX) as simulation:
        placed = mesh or make_shape("ball", 4)
        simulation.add_solid(Mesh(placed.points + 0.2, placed.counts, placed.indices), **values)
        simulation.step(FRAME)


def box_of(**values: object) -> None:
    with Simulation(BOX | values) as simulation:
        simulation.step(FRAME)


def flat() -> Mesh:
    ball = make_shape("ball", 4)
    return Mesh(ball.points * [1, 1, 0], ball.counts, ball.indices)


def twice() -> None:
    with Simulation(BOX) as simulation:
        ball = make_shape("ball", 4)
        for _ in range(2):
            simulation.add_solid(Mesh(ball.points + 0.2, ball.counts, ball.indices))


def poisoned() -> None:
    with Simulation(BOX) as simulation:
        field = simulation.field("velocity")[0]
        field[0, 1, 1, 1] = np.nan
        simulation.set_field("velocity", field)


def long_ago() -> None:
    with Simulation(BOX) as simulation:
        simulation.step(-1.0)


REFUSED_SHAPES = (("a flat mesh", lambda: solid_of(flat())), ("two solids in one place", twice))
REFUSED_VALUES = (
    ("density 0", lambda: solid_of(density=0.0)),
    ("density nan", lambda: solid_of(density=float("nan"))),
    ("Poisson's ratio 0.5", lambda: solid_of(poissons_ratio=0.5)),
    ("speed inf", lambda: solid_of(velocity=(float("inf"), 0.0, 0.0))),
    ("voxel size -1", lambda: box_of(voxel_size=-1.0)),
    ("gravity nan", lambda: box_of(gravity=(float("nan"), 0.0, 0.0))),
    ("nan in a field", poisoned),
    ("a step of -1 s", long_ago),
)


def refusal(call: Callable[[], object]) -> str:
    """ "" where it is refused, else what happened."""
    try:
        call()
    except LibraryError:
        return ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "it was accepted"


OVERLAP = Bar("deepest overlap [h]", 1.0, of=lambda r: float(deepest(r).max()))
VORTEX_STEPS = (0.01, FRAME)  # s


def deepest(result: Result) -> np.ndarray:
    """Of a vertex of one solid in another or in a collider, after every step [cells]."""
    depths = [result[name] for name in ("overlap", "collider_overlap") if name in result.columns]
    return np.max(depths, axis=0) / result.run.spacing


# --- the list --------------------------------------------------------------------------------------------------------


def cases(full: bool) -> tuple[Case, ...]:
    """All of them; full: also the whole matrix of survival and finer grids."""
    tier, turns = ("full", 1000) if full else ("quick", 20)
    plastic = dataclasses.replace(FREE, stretch=(2**0.5, 0.5, 2**0.5))
    lost = dataclasses.replace(FREE, scene="turned inside out", stretch=(1.0, 1.0, -1.0))
    tight = dataclasses.replace(THROWN, box=(0.21, 0.35, 0.23), across=8)
    squashes = loop_runs(elastic_laws.squash_runs(tier), 300.0)
    return (
        Case("S1", "scrambled start", scrambled(full), volume=False),
        Case("S2", "collapsed or inverted start", (*each(FREE, stretch=((0.3,) * 3, (1, 1, 0.2))), lost), volume=False),
        Case(
            "S3",
            "stretched 2 to 5 times, pressed to a third, twisted by 90 to 360 degrees",
            stretched((2.0, 5.0, 1 / 3)) + twisted((90.0, 180.0, 360.0)),
            volume=False,
        ),
        Case("S4", "squash (`bench loop`)", squashes, volume=False),
        Case("S5", "density ratio", each(THROWN, density_ratio=(0.1, 0.9, 1.0, 1.1, 500.0, 1e4))),
        Case("S6", "Young's modulus", each(dataclasses.replace(THROWN, dt=FRAME), youngs_modulus=(1e3, 1e5, 1e7, 1e9))),
        Case("S7", "Poisson's ratio", each(THROWN, poissons_ratio=(-0.5, 0.0, 0.45, 0.499))),
        Case("S8", "survival (`bench loop`): step, CFL, walls", loop_runs(survival.survival_runs(tier))),
        Case("S9", "tolerances of both solves", tolerances()),
        Case("S10", "a hundred times heavier on soft (`bench loop`)", loop_runs(contact_laws.stack_runs("quick")[1:])),
        Case(
            "S11",
            "pressed through a slit, pressed flat",
            tuple(thin_laws.watched_run(name, 1000.0) for name in ("funnel", "press")),
            bars=(Bar("sides exchanged", 0, of=lambda r: float(thin_laws.changed_sides(r).max())), OVERLAP),
        ),
        Case("S12", "stack (`bench loop`)", loop_runs(contact_laws.stack_runs("quick")[:1])),
        Case("S13", "parts of one to two cells", each(dataclasses.replace(THROWN, across=6), shape=("torus", "u"))),
        Case("S14", "0.1 to 5 cells a step at the floor", impacts(), volume=False),
        Case(
            "S15",
            "two balls head on, until they part",
            head_on(),
            bars=(OVERLAP, Bar("rows in contact at the end", 0, of=lambda r: float(r["active_rows"][-1]))),
        ),
        Case(
            "S16",
            "soft disc past the lid of a cavity (`bench accuracy`)",
            measured=accuracy_runs("soft_disc", 120.0, {"cells": 48}, {"cells": 64}, duration=6.0),
            bars=(Bar("area off", 0.05), Bar("largest distance", 0.1)),
        ),
        Case(
            "S17",
            "soft disc in a vortex without viscosity (`bench accuracy`)",
            measured=accuracy_runs("oscillating_disc", 120.0, *({"cells": 64, "max_step": t} for t in VORTEX_STEPS)),
            bars=(Bar("energy kept", 1.02, 0.64), Bar("lowest det F", least=0.5), Bar("highest det F", 2.0)),
        ),
        Case("S18", "a box that fits, of odd sizes", (tight,)),
        Case("S19", "shapes that are none", refused=REFUSED_SHAPES),
        Case("S20", "rest (`bench loop`)", loop_runs(laws.rest_runs(tier)[:1])),
        Case(
            "S21",
            f"a box tumbles, {turns} turns (`bench accuracy`)",
            measured=accuracy_runs("tumbling", 20.0 * turns, {"cells": 6}, turns=turns),
            bars=(Bar("angular momentum kept", 1.02, 0.95), Bar("misfit over the edge", 0.05)),
        ),
        Case("S22", "yield stress", with_settings(plastic, "plastic_yield_stress", (1.0, 0.1 * SHEAR_MODULUS, 1e12))),
        Case(
            "S23",
            "liquid in a closed collider, in a hollow solid",
            tuple(thin_laws.watched_run(name, 1.3) for name in ("sealed", "pocket")),
        ),
        Case("S24", "values that are none", refused=REFUSED_VALUES),
    )


def tolerances() -> tuple[Experiment, ...]:
    return tuple(
        dataclasses.replace(
            THROWN, scene=f"tolerance {t:g}", settings=(("velocity_tolerance", t), ("pressure_tolerance", t))
        )
        for t in (0.5, 0.1, 0.02, 1e-3, 1e-6)
    )
