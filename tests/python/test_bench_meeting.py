"""Laws of `bench loop` about what meets: made-up records that keep or break them, and one short run of a thin case."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_loop  # noqa: E402
from loop import given_laws, meeting_laws, thin_laws  # noqa: E402
from loop.laws import Line  # noqa: E402
from loop.measure import Result  # noqa: E402

DT, MASS = 0.01, 4.0


def verdicts(lines: list[Line]) -> list[str]:
    return [line.verdict for line in lines]


def pushed(normal: list[float], along: list[float]) -> Result:
    """A ball that the floor gives these impulses, its weight beside them [N s]."""
    run = meeting_laws.friction_runs("quick")[0]
    weight = MASS * run.gravity * DT
    changes = np.stack([-np.array(along), np.array(normal) - weight, np.zeros(len(normal))], axis=1)
    first = MASS * np.array(run.velocity)
    columns = {"momentum": first + np.cumsum(changes, axis=0), "dt": np.full(len(normal), DT)}
    return Result(run, "", {"momentum": first, "mass": MASS}, columns)


def test_friction_is_judged_in_every_step() -> None:
    mu = meeting_laws.FRICTION
    judge = lambda result: meeting_laws.judge_friction({result.run: result}, "quick")  # noqa: E731
    kept = judge(pushed([0, 2.0, 3.0, 1.0, 0], [0, 2 * mu, 3 * mu, 0.1, 0]))
    assert kept[0].measured == pytest.approx(1.0) and verdicts(kept) == ["pass", "not judged"]
    broken = judge(pushed([0, 2.0, 3.0, 1.0, 0], [0, mu, 3 * mu, 1.2 * mu, 0]))
    assert broken[0].measured == pytest.approx(1.2) and broken[0].verdict == "MISSED"
    free = judge(pushed([0, 2.0, 0.0], [0, mu, 0.5]))  # friction without any normal impulse
    assert free[0].verdict == "MISSED"


def met(spin: float) -> Result:
    """Two balls that exchange their momenta and gain an angular momentum of their own each [N m s]."""
    run = meeting_laws.spin_runs("quick")[0]
    steps = np.arange(1, 11)
    speed, start, columns = np.where(steps <= 5, 1.0, -1.0), {}, {"active_rows": (steps == 6).astype(int)}
    travelled = np.cumsum(speed) * DT
    for k, side in ((1, -1.0), (2, 1.0)):
        place = np.stack([side * (0.2 - travelled), np.full(10, side * 0.05), 0 * speed], axis=1)
        momentum = MASS * np.stack([-side * speed, 0 * speed, 0 * speed], axis=1)
        own = np.outer(steps > 5, [0.0, 0.0, spin])
        names = {"center": place, "momentum": momentum, "angular_momentum": own}
        first = {
            "center": [side * 0.2, side * 0.05, 0],
            "momentum": [-side * MASS, 0, 0],
            "angular_momentum": [0.0] * 3,
        }
        columns |= {meeting_laws.of(name, k): values for name, values in names.items()}
        start |= {meeting_laws.of(name, k): np.array(value) for name, value in first.items()}
        start[meeting_laws.of("mass", k)] = MASS
    return Result(run, "", start, columns | {"dt": np.full(10, DT)})


def test_angular_momentum_counts_places_and_own_spin() -> None:
    before = 2 * MASS * 0.05  # about the middle
    turned = met(spin=before)  # head-on impulses turn the sum around: own spins make up for it
    assert np.abs(meeting_laws.whole_spin(turned)[:, 2] - before).max() == pytest.approx(0, abs=1e-12)
    assert verdicts(meeting_laws.judge_spin({turned.run: turned}, "quick")) == ["pass"]
    lost = met(spin=0.999 * before)
    assert verdicts(meeting_laws.judge_spin({lost.run: lost}, "quick")) == ["MISSED"]


def test_closed_forms_of_a_plate_agree_where_it_is_heavy_and_stop_it_where_it_is_light() -> None:
    given, light, _ = given_laws.plate_runs("quick")
    times = np.array([0.008, 0.08])
    heavy = dataclasses.replace(light, load=1e4)
    assert given_laws.stokes_drag(heavy, times) == pytest.approx(given_laws.stokes_drag(given, times), rel=2e-3)
    momentum = given_laws.probes.PLATE_SPEED * 4 * light.spacing * light.box[0] * light.box[2]
    assert 0.9 * momentum < given_laws.stokes_drag(light, times)[1] < momentum


def test_a_thin_case_tells_of_sides_depth_and_friction(library) -> None:
    run = next(run for run in thin_laws.thin_runs("quick") if run.group == "ring" and run.density_ratio is None)
    result = bench_loop.run_child(dataclasses.replace(run, duration=0.01, dt=0.005))
    assert result.finished and len(result["dt"]) == 2
    assert result["prescribed_work"].any() and np.abs(result["held_impulse"]).max() > 0
    judge = lambda: thin_laws.judge_thin({run: dataclasses.replace(result, run=run)}, "quick")  # noqa: E731
    assert verdicts(judge()) == ["pass"] * 4 + ["not judged"]
    result.columns["passed_vertices"][1] = 3
    result.columns["overlap"] = np.array([0.0, 1.2 * run.spacing])
    missed = judge()
    assert verdicts(missed) == ["MISSED", "pass", "MISSED", "pass", "not judged"]
    assert "first passed" in missed[0].conditions and missed[0].measured == 3
