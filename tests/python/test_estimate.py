"""The time estimate: its arithmetic, and that it stays short and honest."""

from __future__ import annotations

import dataclasses
import math
import runpy
import sys

import pytest
from conftest import ROOT, make_scene, without_progress
from eulerfsi.cli import report
from eulerfsi.errors import LibraryError
from eulerfsi.run import estimate
from eulerfsi.run.estimate import Body, Plan, Trial
from eulerfsi.scene.read import open_stage, read_scene
from eulerfsi.solver import binding

BALL = Body(speed=0.0, fall=9.81, meets=0.2, wave=3.0, size=0.2)
LIMITS = {"contact_reach": 2.0, "contact_cfl": 0.4, "contact_pace": 0.7, "flight_cfl": 1.8, "contact_share": 1 / 24}
PLAN = Plan(voxel=0.01, frame=1 / 24, frames=24, bodies=[BALL], limits=LIMITS)
UNRESOLVED = {**LIMITS, "contact_pace": 0.0}


def changed(body: dict | None = None, **plan: object) -> Plan:
    return dataclasses.replace(PLAN, bodies=[dataclasses.replace(BALL, **(body or {}))], **plan)


def more_steps(larger: Plan, smaller: Plan) -> bool:
    """No bound is lower, and the upper one is higher."""
    low, high = zip(estimate.steps(smaller), estimate.steps(larger), strict=True)
    return low[0] <= low[1] and high[0] < high[1]


@pytest.mark.parametrize(
    ("larger", "smaller"),
    [
        (changed(frames=48), PLAN),
        (changed(voxel=0.005), PLAN),
        (changed({"speed": 4.0}), PLAN),
        (changed({"wave": 20.0}), changed({"wave": 20.0}, limits=UNRESOLVED)),
        (changed(longest_step=1e-4), PLAN),
        (changed(fluid_speed=20.0), PLAN),
        (PLAN, changed(fluid=False, cfl_solid=4.0, limits={**UNRESOLVED, "flight_cfl": 4.0})),
    ],
)
def test_steps_grow_with_what_makes_them_short(larger, smaller):
    assert more_steps(larger, smaller)


def test_bounds_are_in_order_at_any_stiffness():
    for k in range(20):
        low, high = estimate.steps(changed({"wave": 0.3 * 1.3**k, "speed": 2.0}))
        assert PLAN.frames <= low <= high


def test_range_holds_the_steps_of_a_free_fall_and_of_contact():
    free = changed({"meets": math.inf}, fluid=False, frames=12)
    low, high = estimate.steps(free)
    assert low == high  # nothing is unknown
    # dt (v + g dt) = 1.8 h at the end of each frame, and more in long steps of flight
    for cells in (1.8, 2.7, 3.95):
        plan = dataclasses.replace(free, limits={**LIMITS, "flight_cfl": cells})
        exact = sum(
            math.ceil(free.frame / estimate.time_to_move(9.81 * (k + 1) / 24, 9.81, cells * 0.01) - 1e-6)
            for k in range(12)
        )
        assert estimate.steps(plan)[0] == exact
    for size, way in ((0.1, 0.7 * 0.01), (0.48, 0.48 / 24)):  # that a wave passes in a step
        contact = changed({"meets": 0.0, "wave": 20.0, "size": size}, fluid=False, frames=1)
        assert estimate.steps(contact) == (1, math.ceil(contact.frame / (way / 20.0)))


def test_one_step_a_frame_at_least():
    assert estimate.steps(Plan(voxel=1.0, frame=1e-3, frames=7, bodies=[], limits=LIMITS)) == (7, 7)


def test_seconds_are_proportional_to_steps_and_to_their_cost():
    free = changed({"meets": math.inf}, fluid=False)  # nothing is unknown but what a step takes
    one, two, three = (estimate.seconds(free, Trial(), 10.0 * n, 3.0)[1] for n in (1, 2, 3))
    assert two - one == pytest.approx(three - two, rel=0.02)
    count = estimate.steps(free)[0]
    assert two - one == pytest.approx(10.0 * count * math.sqrt(0.5 * 1.2), rel=0.02)


def test_the_range_is_told_around_the_likely_time_and_no_wider_than_four():
    for each in (0.0, 0.01, 1.0):
        for body in ({}, {"meets": 0.0, "wave": 30.0}, {"meets": math.inf}):
            low, likely, high = estimate.seconds(changed(body, frames=240), Trial(), each)
            assert low < likely < high and 1.5 < high / low < 4.001


def test_what_was_tried_is_known():
    """A trial that has come to the end leaves only what is around it."""
    whole = Trial([0.2] * 30, PLAN.frames * PLAN.frame)
    low, likely, high = estimate.seconds(PLAN, whole, 5.0)
    assert likely == pytest.approx(30 * 0.2 + PLAN.frames * 0.03 + 1.3) and high / low == pytest.approx(3.0)
    half = estimate.steps(PLAN, PLAN.frames / 2)
    assert sum(estimate.steps(PLAN, 6.5)) == pytest.approx(
        sum(estimate.steps(PLAN, 7)) + sum(estimate.steps(PLAN, 6)) - sum(estimate.steps(PLAN, 6.5))
    )
    assert half[0] < estimate.steps(PLAN)[0] and half[1] < estimate.steps(PLAN)[1]
    assert estimate.per_step(Trial([9.0, 1.0, 1.0, 2.0, 2.0]), 2, 1e5) == 2.0


def test_time_to_meet_a_wall():
    assert estimate.seconds_to_meet(1.0, 0.0, 2.0) == pytest.approx(1.0)
    assert estimate.seconds_to_meet(1.0, 2.0, 0.0) == pytest.approx(0.5)
    assert estimate.seconds_to_meet(-0.1, 0.0, 0.0) == 0.0
    assert estimate.seconds_to_meet(1.0, 0.0, 0.0) == math.inf
    assert estimate.seconds_to_meet(1.0, 1.0, -1.0) == math.inf  # turns back before it gets there
    assert estimate.seconds_to_meet(0.25, 1.0, -1.0) == pytest.approx(1 - math.sqrt(0.5))
    assert estimate.seconds_to_meet(1.0, -1.0, 2.0) == pytest.approx((1 + math.sqrt(5)) / 2)


def test_plan_of_a_scene(library, tmp_path):
    make_scene(tmp_path / "small.usda", frames=(1, 11), velocity=(0.0, -2.0, 0.0))
    scene = read_scene(open_stage(tmp_path / "small.usda"), tmp_path / "small.usda")
    plan = estimate.plan_of(scene)
    (ball,) = plan.bodies
    assert (plan.frames, plan.voxel, plan.frame) == (10, pytest.approx(0.05), pytest.approx(1 / 24))
    assert ball.speed == pytest.approx(2.0) and ball.size == pytest.approx(0.3, rel=0.02)
    assert ball.wave == pytest.approx(math.sqrt(23333 / 2 / (1 + 1 / 6) / 1000), rel=1e-3)
    # 0.5 m from centre to floor, less the radius and two voxels of 0.05 m; the lid above is nearer and of no account
    assert ball.meets == pytest.approx(estimate.seconds_to_meet(0.5 - 0.15 - 0.1, 2.0, 9.8), abs=0.001)
    assert plan.limits["flight_cfl"] == pytest.approx(1.5 * 1.8)
    for settings, cells in (({"fluid_density": 100.0}, 1.8), ({"ambient_fluid": 0}, 3.95), ({"preset": 1}, 1.8)):
        other = dataclasses.replace(scene, domain={**scene.domain, **settings})
        assert estimate.plan_of(other).limits["flight_cfl"] == pytest.approx(cells)
    floating = read_scene(open_stage(tmp_path / "small.usda"), tmp_path / "small.usda")
    floating.domain["fluid_density"] = 3000.0
    floating.solids[0].values["velocity"] = [0.0, 0.0, 0.0]
    assert estimate.plan_of(floating).bodies[0].meets < math.inf  # rises to the lid
    floating.domain["gravity"] = [0.0, 0.0, 0.0]
    assert estimate.plan_of(floating).bodies[0].meets == math.inf
    for face in range(6):
        scene.domain[f"wall[{face}]"] = binding.WALLS["periodic"]
    assert estimate.plan_of(scene).bodies[0].meets == math.inf


def test_real_steps_are_few_and_a_long_one_is_not_begun(library, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda")
    scene = read_scene(open_stage(tmp_path / "small.usda"), tmp_path / "small.usda")
    tried = estimate.try_steps(scene, 1, 0)
    assert tried.seconds and all(t > 0 for t in tried.seconds) and 0 < tried.time < 2.01 / 24
    assert "trial steps" in estimate.describe(estimate.plan_of(scene), tried, 1, 1e4)
    fine = dataclasses.replace(scene, domain={**scene.domain, "voxel_size": 1e-4})
    monkeypatch.setattr(estimate, "build_simulation", lambda *_: pytest.fail("would take minutes"))
    assert estimate.try_steps(fine, 1, 0) == Trial()
    assert "estimated from the number of cells" in estimate.describe(estimate.plan_of(fine), Trial(), 1, 1e10)


def test_what_rounding_leaves_of_a_frame_is_no_step(library, tmp_path):
    make_scene(tmp_path / "small.usda", frames=(1, 31), velocity=(0.0, 0.0, 0.0))
    scene = read_scene(open_stage(tmp_path / "small.usda"), tmp_path / "small.usda")
    scene.domain["gravity"] = [0.0, 0.0, 0.0]
    tried = estimate.try_steps(scene, 1, 0)
    assert len(tried.seconds) == pytest.approx(tried.time * 24, abs=1e-3)  # one a frame


def test_time_runs_out_between_steps(library, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda")
    scene = read_scene(open_stage(tmp_path / "small.usda"), tmp_path / "small.usda")
    clock = iter(range(0, 1000, 1))
    monkeypatch.setattr(estimate.time, "monotonic", lambda: float(next(clock)))
    assert len(estimate.try_steps(scene, 1, 0).seconds) == 1


def test_validate_tells_of_first_steps_that_fail_and_refuses_what_cannot_start(cli, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda")

    def fail(status: int):
        def build(*_arguments: object):
            raise LibraryError(status, "too bad")

        monkeypatch.setattr(estimate, "try_steps", build)
        return cli("validate", "small.usda")

    done = fail(binding.ERROR_DIVERGED)
    assert done.returncode == 0 and "time: not estimated, the first steps fail: too bad" in done.stdout
    done = fail(binding.ERROR_MESH)
    assert done.returncode == 3 and without_progress(done.stderr) == "error: too bad\n"


def test_ctrl_c_ends_the_estimate(cli, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda")

    def interrupted(*_arguments: object):
        raise KeyboardInterrupt

    monkeypatch.setattr(report.estimate, "build_simulation", interrupted)
    assert cli("validate", "small.usda").returncode == 130


@pytest.fixture
def bench(library):
    before = list(sys.path)
    loaded = runpy.run_path(str(ROOT / "tests" / "bench" / "bench_estimate.py"))
    yield loaded
    sys.path[:] = before


def test_bench_reads_what_validate_prints(bench):
    plan, trial = changed(frames=2400), Trial([0.3, 0.1, 0.2], 0.01)
    line = estimate.describe(plan, trial, 2, 1e5)
    low, likely, high = estimate.seconds(plan, trial, estimate.per_step(trial, 2, 1e5))
    assert bench["read_time"](line) == pytest.approx((likely, low, high), rel=0.05)
    with pytest.raises(ValueError, match="no time"):
        bench["read_time"]("nothing")


def test_bench_judges_every_bar(bench, tmp_path):
    good = bench["Row"]("1/0", 1000, 100, 110, 1.0, 2.0, 4.0, 3.0, 1.2, 1.0)
    lines, all_met = bench["verdict"]([good] * 20)
    assert all_met and all(line.endswith("pass") for line in lines)
    for changes, bar in (
        ({"peak": 150}, 0),
        ({"real": 5.0}, 1),
        ({"low": 0.5}, 2),
        ({"eta": 1.3}, 3),
    ):
        bad = dataclasses.replace(good, **changes)
        lines, all_met = bench["verdict"]([good] * 15 + [bad] * 5)
        assert not all_met and [line.endswith("MISSED") for line in lines] == [n == bar for n in range(4)]
        assert "missed: " in bad.words or bar == 2
    bench["save_rows"](tmp_path / "rows.csv", [good])
    assert bench["load_rows"](tmp_path / "rows.csv") == {"1/0": good}


def test_bench_compares_a_scene_with_its_run(bench, tmp_path):
    """A table that is there is not measured again."""
    make_scene(tmp_path / "small.usda", frames=(1, 4))
    row = bench["measure"]("small", tmp_path / "small.usda", tmp_path / "cache", [], True)
    assert row.scene == "small" and row.cells == 12 * 14 * 12 and row.left > 0 and row.eta > 0
    assert row.good_memory and row.low < row.likely < row.high
    (tmp_path / "rows.csv").write_text("")
    bench["save_rows"](tmp_path / "rows.csv", [dataclasses.replace(row, scene=str(tmp_path / "none.usda"))])
    arguments = ["--output", str(tmp_path / "rows.csv"), "--processor", str(tmp_path / "none.usda")]
    assert bench["main"](arguments) in (0, 1)


def test_drawn_scenes_can_be_simulated(bench, tmp_path, cli):
    scenes = bench["drawn"](54, 4, tmp_path)
    for _ in range(4):
        _, path = next(scenes)
        scene = read_scene(open_stage(path), path)
        assert len(scene.frames) == 4 and scene.solids
