"""What `validate` says to expect of a scene, the curves behind it, and how random scenes try it."""

from __future__ import annotations

import dataclasses
import json
import sys

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

from accuracy import expectations, fit, front, table  # noqa: E402
from accuracy.table import Row  # noqa: E402
from eulerfsi.cli import expectations as told  # noqa: E402
from eulerfsi.cli.report import validate  # noqa: E402
from loop.measure import Result  # noqa: E402

RESULTS = table.RESULTS.with_name("expectations.csv")


def rows_of(values: list[float], reference: float | None = None) -> list[Row]:
    common = {"case": "a", "preset": "production", "reference": reference, "commit": "c", "machine": "m"}
    return fit.with_errors(
        [
            Row(cells=n, value=v, error=reference and abs(v / reference - 1), core_s=1e-3 * n**3, **common)
            for n, v in zip((8, 12, 24), values, strict=True)
        ]
    )


def test_the_curves_are_those_of_the_committed_table() -> None:
    rows = fit.with_errors(front.newest(table.read(RESULTS)))
    assert json.loads(told.CURVES.read_text()) == expectations.curves(rows)
    assert set(told.curves()) == set(expectations.SOURCES) == set(told._WORDS)


def test_a_curve_is_interpolated_and_goes_on_with_its_order() -> None:
    found = expectations.curve(rows_of([0.5, 2 / 3, 5 / 6], 1.0), "")
    assert found["errors"] == [0.5, 0.333, 0.167]
    assert found["order"] == pytest.approx(1, abs=0.01) and found["cost"] == pytest.approx(3, abs=0.01)
    curve = told.Curve(tuple(found["cells"]), (0.4, 0.3, 0.1), 1.0, 3.0)
    assert curve.at(12) == pytest.approx(0.3) and 0.3 < curve.at(10) < 0.4
    assert curve.at(4) == pytest.approx(0.4 * 2 ** (np.log(4 / 3) / np.log(3 / 2))) and curve.at(48) == pytest.approx(
        0.05
    )
    assert curve.halved(24) == pytest.approx((48, 8.0), rel=0.05)
    across, time = curve.halved(12)
    assert curve.at(across) == pytest.approx(0.15, rel=0.03) and time == pytest.approx((across / 12) ** 3)
    assert dataclasses.replace(curve, order=0.1).halved(24) is None


def test_resolutions_that_agree_by_chance_are_not_believed() -> None:
    found = expectations.curve(rows_of([0.9, 1.0, 1.0]), "")
    assert found["errors"] == [0.1, 0.0667, 0.0333] and found["order"] == pytest.approx(1, abs=0.01)
    with pytest.raises(ValueError, match="2 resolutions, must be 3"):
        expectations.curve(rows_of([0.9, 1.0, 1.1])[:2], "")
    with pytest.raises(ValueError, match="bounce_vacuum: 0 resolutions"):
        expectations.curves([])


def test_errors_that_grow_on_finer_grids_are_not_halved_by_them() -> None:
    found = expectations.curve(rows_of([0.9, 0.99, 0.97], 1.0), "")
    assert found["order"] == 0 and found["errors"] == [0.1, 0.03, 0.03]
    text = told.line("fluid", 0.2, 0.02, {"vortex": 0.03}, "vortex")
    assert text.startswith("fluid: 10 voxels across; expect 3 % of the energy") and "half of that at voxel" in text
    text = told.line("/Ball", 0.2, 0.0002, {"volume": 0.1, "vortex": 0.03}, "vortex")
    assert text.endswith("less of the vortex's with smaller steps, not with smaller voxels")


def test_what_is_said_depends_on_the_material_and_the_fluid() -> None:
    values = {"compressible": 0, "density": 1000.0, "friction": 0.0}
    assert list(told.of_solid(values, 10, 1.2)) == ["rebound", "volume", "swing"]
    assert list(told.of_solid(values, 10, 1000.0)) == ["rebound", "volume", "swing in fluid"]
    assert list(told.of_solid(values | {"friction": 0.1, "compressible": 1}, 10, 0)) == ["rebound", "swing", "sliding"]
    slab = told.smallest(np.array([0.4, 0.2, 0.01]), np.array([True, True, False]))
    assert slab == 0.2


def test_swings_are_promised_where_steps_resolve_them(library) -> None:
    stiff = {"youngs_modulus": 1e4, "poissons_ratio": 0.25, "compressible": 0, "density": 1000.0}
    assert told.pace(stiff, 0.02, 0.01) == pytest.approx(1.0)
    assert told.pace(stiff | {"compressible": 1, "poissons_ratio": 1 / 3}, 0.02, 0.01) == pytest.approx(1.369, rel=1e-3)
    scene = ROOT / "examples" / "scenes" / "meeting_balls.usda"

    def said(*settings: str) -> list[str]:
        chosen = ["voxelSize=0.04", "preset=production", *settings]
        return validate(scene, "1-2", None, [f"/World/Domain.{setting}" for setting in chosen], 1).expected[:-1]

    damped = "damp its vibrations in flight: stepTolerance fine keeps them"
    assert all("of a swing's energy" not in line and line.endswith(damped) for line in said())
    assert all("swing" not in line and damped not in line for line in said("stepTolerance=fine"))
    assert all("of a swing's energy" in line and damped not in line for line in said("maxTimeStep=0.001"))


def test_paper2016_promises_nothing_and_has_no_tolerance(library) -> None:
    scene = ROOT / "examples" / "scenes" / "meeting_balls.usda"
    settings = [f"/World/Domain.{setting}" for setting in ("voxelSize=0.04", "preset=paper2016", "stepTolerance=fine")]
    report = validate(scene, "1-2", None, settings, 1)
    assert report.expected == ["/World/Domain: the preset paper2016 promises no errors; docs/accuracy.md compares it"]
    assert report.notes == ["/World/Domain: eulerfsi:stepTolerance has no effect with the preset paper2016"]


def test_validate_has_a_line_a_solid_and_one_for_the_fluid(library) -> None:
    scene, usual = ROOT / "examples" / "scenes" / "meeting_balls.usda", "/World/Domain.preset=production"
    report = validate(scene, "1-2", None, [usual], 1)
    solids = [solid.path for solid in report.scene.solids]
    assert [line.partition(":")[0] for line in report.expected] == [*solids, "fluid"]
    assert all("voxels across; expect" in line for line in report.expected)
    assert set(report.expected) <= set(report.lines()) and report.facts()["expected"] == report.expected
    finer = validate(scene, "1-2", None, [usual, "/World/Domain.voxelSize=0.01"], 1)
    assert finer.expected != report.expected


def test_a_rebound_is_promised_for_the_steps_of_production_alone(library) -> None:
    scene, voxel = ROOT / "examples" / "scenes" / "meeting_balls.usda", "/World/Domain.voxelSize=0.04"

    def said(*settings: str) -> list[str]:
        settings = settings if "preset=fast" in settings else ("preset=production", *settings)
        report = validate(scene, "1-2", None, [voxel, *(f"/World/Domain.{setting}" for setting in settings)], 1)
        fast = "preset=fast" in settings
        assert [note for note in report.notes if "preset fast is for layout" in note] == report.notes
        assert len(report.notes) == fast == len([line for line in report.lines() if line.startswith("note: ")])
        assert report.facts()["notes"] == report.notes
        return report.expected[:-1]

    usual = said()
    assert said("stepTolerance=normal") == usual
    assert all("a rebound within" in line and "no rebound" not in line for line in usual)
    loose, fast = said("stepTolerance=loose"), said("preset=fast")
    assert all(line.endswith("no rebound is promised: stepTolerance is above normal, 0.15") for line in loose)
    assert all("fast keeps 0.28 of the speed, production 0.52" in line for line in fast)
    assert not any("a rebound within" in line or "the rebound's" in line for line in loose + fast)
    assert all("volume within" in line and "half of the volume's at voxel" in line for line in loose + fast)


# --- random scenes ---------------------------------------------------------------------------------------------------


def thrown(scene, speeds: list[float], gaps: list[float]) -> Result:
    """A record of a body that moves along y, its lower end so far from the floor."""
    n = len(speeds) - 1
    low = [[0.1, gap, 0.1] for gap in gaps]
    columns = {
        "time": np.arange(1, n + 1) * 0.01,
        "momentum": np.array([[0, v, 0] for v in speeds[1:]]),
        "mass": np.ones(n),
        "extent_min": np.array(low[1:]),
        "extent_max": np.array(low[1:]) + 0.2,
        "volume_mesh": np.linspace(1.0, 1.01, n),
    }
    start = {"momentum": [0, speeds[0], 0], "mass": 1.0, "extent_min": low[0]}
    start |= {"extent_max": [v + 0.2 for v in low[0]], "volume_mesh": 1.0}
    return Result(scene, "", start, columns)


def test_a_rebound_is_found_at_a_face_and_nowhere_else() -> None:
    coarse, fine = next(expectations.scenes(5))
    assert fine.spacing == pytest.approx(coarse.spacing / 3) and fine.box == coarse.box
    assert np.allclose(np.array(coarse.box) / coarse.spacing, np.rint(np.array(coarse.box) / coarse.spacing))
    h = coarse.spacing
    speeds, near = [-2.0, -2.0, -1.0, 0.5, 1.2, 1.0], [5 * h, 3 * h, h, 0.1 * h, h, 2 * h]
    assert expectations.rebound(thrown(coarse, speeds, near)) == pytest.approx(0.6)
    assert expectations.rebound(thrown(coarse, speeds, [gap + 5 * h for gap in near])) is None
    assert expectations.off(thrown(coarse, speeds, near)) == pytest.approx(0.01)


def test_a_scene_passes_within_twice_of_what_was_said(monkeypatch, capsys) -> None:
    bounces = lambda scene: thrown(scene, [-2.0, -2.0, 1.0], [scene.spacing * 3, scene.spacing, 0.0])  # noqa: E731
    monkeypatch.setattr(expectations, "run", bounces)
    monkeypatch.setattr(told, "of_solid", lambda *_: {"rebound": 0.01, "volume": 0.006})
    assert expectations.check(5, 2)
    assert "2 of 2 scenes of seed 5" in capsys.readouterr().out
    monkeypatch.setattr(told, "of_solid", lambda *_: {"rebound": 0.01, "volume": 0.004})
    assert not expectations.check(5, 2) and "volume 1 % (0.4 % said), rebound 0 %" in capsys.readouterr().out
    monkeypatch.setattr(expectations, "run", lambda scene: Result(scene, "diverged", {}, {}))
    assert not expectations.check(5, 1) and "diverged | MISSED" in capsys.readouterr().out
