"""The laboratory's solids that lie on each other: how they start, and what the laws say of made-up records."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_loop  # noqa: E402, F401 - sets the paths
from eulerfsi.solver import binding  # noqa: E402
from loop import contact_laws, groups  # noqa: E402
from loop.experiment import GRAVITY, RADIUS, of, simulate  # noqa: E402
from loop.measure import Result, from_child  # noqa: E402
from loop.overlap import deepest_vertex  # noqa: E402

RUNS = [*contact_laws.stack_runs("full"), *contact_laws.hertz_runs("full")]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"{run.scene} {run.across} {run.load:g} {run.compressible}")
def test_solids_start_inside_their_box_and_apart(run) -> None:
    surfaces = [(mesh.points.astype(float), mesh.triangles()) for mesh, _ in run.bodies()]
    assert len(surfaces) == {"stack": 3, "heap": 20}.get(run.group, 2)
    assert deepest_vertex(surfaces) == 0
    for points, _ in surfaces:
        assert points.min() > -1e-6 and (points.max(axis=0) < np.array(run.box) + 1e-6).all()


def test_hertz_load_is_the_closed_form() -> None:
    modulus = groups.BLOCK_MODULUS / (1 - groups.BLOCK_POISSON**2) / (1 + 1 / groups.STIFFER)
    for approach, load in ((0.01, 1.3333e-3), (0.02, 3.7712e-3), (0.05, 1.4907e-2)):
        assert contact_laws.hertz_load(approach * RADIUS) / (modulus * RADIUS**2) == pytest.approx(load, rel=1e-4)
        assert contact_laws.hertz_load(approach * RADIUS, 1e6) == pytest.approx(load * modulus * RADIUS**2, rel=1e-4)
    assert contact_laws.hertz_load(0.05 * RADIUS, RADIUS) > 1.1 * contact_laws.hertz_load(0.05 * RADIUS)


def lying(creep: float = 0.0, growth: float = 0.0, sunk: float = 0.0, deep: float = 0.0) -> dict[str, str]:
    """What the laws say of boxes whose centres move by so many cells a frame, and so on."""
    run = contact_laws.stack_runs("quick")[0]
    times = np.arange(0.01, run.duration + 1e-9, 0.01)
    columns = {"time": times, "dt": np.full(len(times), 0.01), "contact": np.full(len(times), sunk)}
    columns["overlap"] = np.full(len(times), deep * run.spacing)
    columns["energy_at_start"] = np.zeros((len(times), 4))
    columns["energy_at_start"][-1, 1] = growth * 3 * GRAVITY * RADIUS
    columns["energy_change"] = np.zeros((len(times), len(binding.ENERGY_STAGES), 4))
    start = {}
    for k in (1, 2, 3):
        start |= {of("mass", k): 1.0, of("center", k): [0.0, 0.0, 0.0]}
        columns[of("center", k)] = np.outer(times * 24 * creep * run.spacing * (k == 3), [1.0, 0.0, 0.0])
    result = Result(run, "", start, columns)
    return {
        line.bar.partition(":")[0].partition(" ")[0]: line.verdict
        for line in contact_laws.judge_stack({run: result}, "quick")
    }


def test_boxes_at_rest_keep_the_laws_and_each_can_be_missed() -> None:
    assert set(lying().values()) == {"pass"}
    for broken, law in (("creep", "creep"), ("growth", "energy"), ("sunk", "none"), ("deep", "no")):
        value = {"creep": 2e-3, "growth": 2e-4, "sunk": 0.3, "deep": 0.3}[broken]
        assert [name for name, verdict in lying(**{broken: value}).items() if verdict == "MISSED"] == [law]


def test_a_stack_is_recorded_solid_by_solid(library) -> None:
    run = dataclasses.replace(contact_laws.stack_runs("quick")[0], duration=0.05)
    result = from_child(run, simulate(run))
    assert result.finished and result["active_rows"].max() > 50
    assert result.start["mass@3"] == pytest.approx(result.start["mass"], rel=0.01)
    assert result["center@3"][-1, 1] > result["center@2"][-1, 1] > result["center"][-1, 1]
