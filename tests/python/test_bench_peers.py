"""The peers' benchmark: bodies, Lamb's mode, what is read of a run, refusals, and our solver from end to end."""

from __future__ import annotations

import dataclasses
import json
import signal
import sys

import numpy as np
import pytest
from conftest import ROOT

PEERS = ROOT / "tests" / "bench" / "peers"
for folder in (PEERS.parent, PEERS):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import accuracy_peers  # noqa: E402
import bodies  # noqa: E402
import lamb  # noqa: E402
import plot  # noqa: E402
import run  # noqa: E402
import shared  # noqa: E402
from accuracy import table  # noqa: E402

FOUND = {"restitution": 0.5, "clear": True, "steps": 12, "wall": 0.3, "core": 0.2, "setup": 0.1, "memory": 2**20}


def bounce(name: str = "taichi-mls-mpm") -> run.Run:
    return run.Run(run.solvers()[name], "bounce", 8, {"steps": 5})


# --- cases -----------------------------------------------------------------------------------------------------------


def test_lamb_s_mode_has_no_traction_and_keeps_the_equation_of_motion():
    nu, mu, lam = 0.25, 1.0, 1.0
    assert lamb.root(nu) == pytest.approx(shared.case_of("oscillation", 8).reference, abs=1e-6)
    assert lamb.root(0.3) == pytest.approx(2.646217, abs=1e-6)

    def stress(points):
        slope = lamb.gradient(points, 1.0, nu)
        strain = (slope + np.swapaxes(slope, 1, 2)) / 2
        return 2 * mu * strain + lam * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)

    normals = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0.48, 0.6, 0.64]])
    assert np.abs(np.einsum("nij,nj->ni", stress(normals), normals)).max() < 1e-6
    x, h = np.array([[0.3, 0.2, 0.1], [0.1, 0.5, -0.4]]), 1e-3
    steps = h * np.eye(3)
    pull = sum((stress(x + steps[k]) - stress(x - steps[k]))[:, :, k] / (2 * h) for k in range(3))
    assert pull == pytest.approx(-(lamb.root(nu) ** 2) * lamb.displacement(x, 1.0, nu), abs=1e-4)


@pytest.mark.parametrize("across", [8, 12])
def test_tetrahedra_of_a_ball_conform_and_have_its_volume(across):
    points, cells, tets = bodies.ball(0.1, across)
    assert bodies.volume(points, tets) == pytest.approx(4 / 3 * np.pi * 1e-3) and len(tets) == 6 * len(cells)
    assert (np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]]) > 0).all()
    faces = np.sort(np.concatenate([np.delete(tets, k, axis=1) for k in range(4)]), axis=1)
    outer, count = np.unique(faces, axis=0, return_counts=True)
    assert count.max() == 2
    radii = np.linalg.norm(points[np.unique(outer[count == 1])], axis=1)
    assert np.ptp(radii) < 1e-12  # nothing but the sphere is outside
    share = len(bodies.ball_points(0.1, 0.2 / across)) * (0.1 / across) ** 3 / (4 / 3 * np.pi * 1e-3)
    assert share == pytest.approx(1, abs=0.03)


def test_frequency_and_decay_of_a_swing_are_found():
    t = np.linspace(0, 10, 400)
    omega, rate = shared.swing(t, 3 * np.exp(-0.03 * t) * np.cos(6.1 * t + 0.3) + 1, 1.0)
    assert omega == pytest.approx(6.1, rel=1e-4) and rate == pytest.approx(0.03, abs=1e-3)
    assert np.isnan(shared.swing(t, np.full(400, np.nan), 1.0)[0])


def test_mean_sag_of_the_end_face():
    case = shared.case_of("cantilever", 4)
    points, _, _ = bodies.beam(case.length, case.height, case.across)
    assert shared.end_face(points, 2 + points[:, 1], case) == pytest.approx(2)
    inside = points[points[:, 0] < 0.95 * case.length]
    assert shared.extrapolated_end(inside[:, 0], 3 * inside[:, 0], case.length, 0.04) == pytest.approx(0.6)


# --- what is read ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("output", "errors", "code", "failure"),
    [
        ("[Taichi] version\n" + shared.MARK + json.dumps(FOUND), "", 0, None),
        (shared.MARK + '{"steps": 1', "", 0, "its result is damaged"),
        (
            "[Taichi] version",
            "Traceback\nValueError: no such basis\n",
            1,
            "ended with code 1: ValueError: no such basis",
        ),
        ("", "", -signal.SIGXCPU, "over 120 processor seconds"),
    ],
)
def test_a_result_or_one_line_why_not(output, errors, code, failure):
    found = run.read(output, errors, code)
    assert found == FOUND if failure is None else found["failure"].startswith(failure)
    assert "\n" not in found.get("failure", "")


def test_rows_of_a_result_pass_the_table(tmp_path):
    path = tmp_path / "peers.csv"
    bad = [FOUND | {"clear": False}, FOUND | {"restitution": float("nan")}, {"failure": "ended with code 1: why"}]
    for found in (FOUND, *bad):
        for row in run.measured(bounce(), found):
            table.append(path, row)
    good, *failed = table.read(path)
    assert (good.solver, good.case, good.sweep) == ("taichi-mls-mpm 1.7.4", "peer_restitution", "peer")
    assert good.error == pytest.approx(1 - 0.5 / good.reference, rel=1e-5) and json.loads(good.parameters) == {
        "steps": 5
    }
    assert [row.failure for row in failed] == [
        "still on the floor after 0.06 s",
        "not a number",
        "ended with code 1: why",
    ]
    assert all(row.value is None and row.error is None for row in failed)


def test_every_solver_has_a_script_pinned_requirements_and_known_cases():
    for solver in run.solvers().values():
        assert (PEERS / solver.script).is_file()
        if solver.environment:
            assert all("==" in line for line in solver.requirements.read_text().split())
        for case, options in solver.runs.items():
            assert options and case in shared.CASES
    assert run.solvers()[run.OURS].version == ""
    quick = run.planned(list(run.solvers().values()), shared.CASES, True)
    assert len(quick) == len(run.solvers()) * len(shared.CASES)


# --- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--peer", "nobody"], "--peer nobody: must be one of eulerfsi, taichi-mls-mpm"),
        (["--case", "bounce,fall"], "--case fall: must be one of oscillation, bounce, cantilever"),
    ],
)
def test_unknown_names_are_refused_in_one_line(capsys, arguments, message):
    assert run.main(arguments) == 2
    said = capsys.readouterr()
    assert said.err.startswith(message) and said.err.count("\n") == 1 and not said.out


def test_an_absent_peer_is_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "ENVIRONMENTS", run.ROOT / ".eulerfsi" / "no-peers")
    output = tmp_path / "peers.csv"
    assert run.main(["--peer", "scikit-fem", "--no-install", "--output", str(output)]) == 1
    assert capsys.readouterr().out == "scikit-fem: absent: no environment .eulerfsi/no-peers/skfem; left out\n"
    assert not output.exists()


def test_pip_s_refusal_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "ENVIRONMENTS", tmp_path)
    monkeypatch.setattr(run, "HERE", tmp_path)
    monkeypatch.setattr(run, "ROOT", tmp_path)

    def create(place, **_options):  # this Python, whose pip refuses what is not there
        python = place / "bin" / "python"
        python.parent.mkdir(parents=True)
        python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
        python.chmod(0o755)

    monkeypatch.setattr(run.venv, "create", create)
    (tmp_path / "requirements-skfem.txt").write_text(f"{tmp_path}/missing.whl\n")
    with pytest.raises(
        run.Absent, match=r"^scikit-fem: absent: pip cannot install requirements-skfem.txt: .*missing.whl.*out$"
    ):
        run.interpreter(run.solvers(PEERS / "solvers.toml")["scikit-fem"], install=True)


def test_a_foreign_table_and_a_damaged_case_file_are_refused(capsys, tmp_path):
    foreign = tmp_path / "peers.csv"
    foreign.write_text("a,b\n1,2\n")
    assert run.main(["--peer", run.OURS, "--output", str(foreign)]) == 2
    assert "no table of `bench accuracy`" in capsys.readouterr().err and foreign.read_text() == "a,b\n1,2\n"
    damaged = tmp_path / "cases.toml"
    damaged.write_text("[material]\n")
    with pytest.raises(SystemExit, match=r"no table \[oscillation\]"):
        shared.read_cases(damaged)


# --- from end to end -------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("library")
def test_our_solver_s_bounce_is_run_once_and_drawn(capsys, tmp_path):
    output = tmp_path / "peers.csv"
    arguments = ["--peer", run.OURS, "--case", "bounce", "--quick", "--output", str(output)]
    assert run.main(arguments) == 0
    (row,) = table.read(output)
    assert (
        0 < row.value < 1
        and row.steps > 0
        and row.core_s > 0
        and row.error == pytest.approx(abs(row.value / row.reference - 1), rel=1e-4)
    )
    assert capsys.readouterr().out.startswith("restitution eulerfsi")
    assert run.main(arguments) == 0 and capsys.readouterr().out == ""
    pytest.importorskip("matplotlib")
    peer = dataclasses.replace(row, solver="taichi-mls-mpm 1.7.4", error=0.0)
    table.append(output, peer)
    plot.draw(output, tmp_path / "peers.png")
    assert (tmp_path / "peers.png").read_bytes().startswith(b"\x89PNG")


def test_bench_accuracy_asks_for_the_cases_that_are_alike(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(run, "make", lambda *given: asked.append(given))
    assert accuracy_peers.main(tmp_path / "accuracy.csv", ["cavity_100"], False) == 0 and not asked
    assert accuracy_peers.main(tmp_path / "accuracy.csv", ["elastica", "swing_vacuum"], True) == 0
    assert asked[0][1:] == (["oscillation", "cantilever"], tmp_path / "peers.csv", True)
