"""The random scenes of `bench random`: what is drawn, what the laws say of made-up records, and the command line."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_random  # noqa: E402
from eulerfsi.solver import binding  # noqa: E402
from eulerfsi.solver.simulation import Simulation, Surface  # noqa: E402
from loop.experiment import OUT_OF_TIME  # noqa: E402
from loop.measure import Result  # noqa: E402
from loop.overlap import deepest_in, deepest_vertex  # noqa: E402
from loop.shapes import blocks, rigid_misfit  # noqa: E402
from random_scenes import judge, solids  # noqa: E402
from random_scenes.compact import make_compact_scene  # noqa: E402
from random_scenes.company import Held, Jet  # noqa: E402
from random_scenes.contact import Body, ContactScene, Plastic, make_contact_scene  # noqa: E402
from random_scenes.draw import Draw, constant, ranges  # noqa: E402
from random_scenes.everything import EverythingScene, make_everything_scene  # noqa: E402
from random_scenes.record import Record  # noqa: E402
from random_scenes.regions import Path, Region, place, rotation, taken_back  # noqa: E402
from random_scenes.scenes import Scene, make_scene  # noqa: E402
from random_scenes.thin import make_thin_scene  # noqa: E402

SEED = 5
FIXED = ROOT / "tests" / "bench" / "random_scenes" / "fixed.toml"


def scenes(count: int) -> list[Scene]:
    """The first scenes of a seed; those whose mesh file is not here are left out."""
    made = []
    for number in range(count):
        try:
            made.append(make_scene(SEED, number))
        except solids.Absent:
            continue
    return made


# --- what is drawn ---------------------------------------------------------------------------------------------------


def test_a_seed_draws_what_it_always_has() -> None:
    """What changes this gives every seed in the documents other scenes."""
    single, everything = make_scene(7, 4).words, make_everything_scene(7, "e8").words
    assert single == (
        "sphere, 10.9 cells of 0.0601 m, box 32x30x27, faces periodic periodic slip slip slip slip, vacuum, "
        "E 2.46e+04 Pa, nu 0.353, rho v^2/2 / E 0.84, v (1.42 0.742 5.96), spin (-0.299 -0.421 -0.62), g (0 -1.63 0), "
        "0.58 s, dt <= 0.0122 s, CFL default"
    )
    assert everything == (
        "jet: sphere 0.0766 m, 0.219 m/s for 0.562 s; thrown: torus, tube 0.16 of 0.162 m, 1e+03 kg/m^3, "
        "E 1.23e+05 Pa, nu 0.277, yields at 445 Pa, 673/s, hardening 0 Pa, friction 0.00; 11.3 cells of 0.0143 m, "
        "box 44x30x29, slip slip open slip noSlip noSlip, first 1.33:1, rho v^2/2 / E up to 0.043, g (6.63 4.4 -7.46), "
        "1.21 s, dt <= 0.0341 s, CFL 3.54"
    )


def test_a_scene_is_the_same_whenever_it_is_made() -> None:
    for scene in scenes(6):
        again = make_scene(SEED, scene.number)
        assert again == scene and (again.surface[0] == scene.surface[0]).all()
    assert len({scene.words for scene in scenes(6)}) == len(scenes(6))


def test_a_value_depends_on_its_own_name_alone() -> None:
    assert Draw(1, 2).evenly("size") == 0.5426847834977293  # on every machine, whatever else is drawn
    assert Draw(1, 2).number("room", "x") != Draw(1, 2).number("room", "y")
    assert Draw(1, 2).number("size") != Draw(1, 3).number("size") != Draw(2, 3).number("size")


def test_draws_fill_their_ranges() -> None:
    draws = [Draw(seed, 0) for seed in range(400)]
    ratio = np.array([draw.number("density_ratio") for draw in draws])
    assert ratio.min() >= 0.1 and ratio.max() <= 1e4
    assert np.median(np.log10(ratio)) == pytest.approx(1.5, abs=0.3)
    kinds = [draw.one_of("wall") for draw in draws]
    assert set(kinds) == {"slip", "noSlip", "open"} and kinds.count("slip") > kinds.count("open")
    mean = np.mean([draw.direction("heading") for draw in draws], axis=0)
    assert np.abs(mean).max() < 0.1
    turn = draws[0].rotation("turn")
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(turn) == pytest.approx(1)


def within(name: str, value: float) -> bool:
    table = ranges()[name]
    return table["low"] * (1 - 1e-9) <= value <= table["high"] * (1 + 1e-9)


def test_scenes_lie_within_the_ranges() -> None:
    made = scenes(120)
    assert {kind for scene in made for kind in scene.faces} == {"slip", "noSlip", "open", "periodic"}
    for scene in made:
        assert within("size", scene.size) and within("across", scene.across) and within("duration", scene.duration)
        assert within("step", scene.dt) and within("poissons_ratio", scene.poissons_ratio)
        assert scene.density_ratio is None or within("density_ratio", scene.density_ratio)
        assert scene.cfl is None or within("cfl", scene.cfl)
        assert 0 < scene.impact_pressure <= ranges()["impact_pressure"]["high"] * (1 + 1e-9)
        assert np.prod(scene.cells) <= constant("most_cells")
        assert np.array(scene.box) / scene.spacing == pytest.approx(np.array(scene.cells))
        points = scene.mesh().points / scene.spacing
        for axis in range(3):
            periodic = scene.faces[2 * axis] == "periodic"
            assert periodic == (scene.faces[2 * axis + 1] == "periodic")
            least = constant("drift_gap") if periodic else constant("gap")
            assert points[:, axis].min() > least - 1e-3
            assert points[:, axis].max() < scene.cells[axis] - least + 1e-3
            if periodic:  # the throw alone does not take it to the faces
                way = scene.velocity[axis] * scene.duration / scene.spacing
                assert scene.pull[axis] == 0
                assert points[:, axis].min() + way > 1 and points[:, axis].max() + way < scene.cells[axis] - 1


def test_every_scene_is_accepted_by_the_library(library) -> None:
    for scene in scenes(25):
        with Simulation(scene.simulation()) as simulation:
            report = simulation.add_solid(scene.mesh(), **scene.solid())[1]
        if scene.folds_nowhere:
            assert report["closed"] == 1 and report["repaired"] == 0


@pytest.mark.parametrize("kind", ["sphere", "box", "torus", "capsule", "cylinder", "superquadric"])
def test_shapes_are_closed_with_faces_outwards(library, kind: str) -> None:
    words, (points, triangles) = solids.MAKERS[kind](Draw(SEED, 0))
    mesh = solids.shapes.Mesh(points, np.full(len(triangles), 3), triangles.ravel())
    report = Surface(mesh, 0.1).report
    assert report["closed"] == 1 and report["repaired"] == 0 and report["surface_volume"] > 0
    assert solids.folds_nowhere(words)


def test_a_capsule_has_its_volume_and_its_centre() -> None:
    draw = Draw(SEED, 1)
    radius = draw.number("capsule_radius")
    _, (points, triangles) = solids.capsule(draw)
    exact = np.pi * radius**2 * (1 - 2 * radius) + 4 / 3 * np.pi * radius**3
    assert solids.shapes.volume(points, triangles) == pytest.approx(exact, rel=0.02)
    assert solids.center_of_volume(points + 3.0, triangles) == pytest.approx(np.full(3, 3.0), abs=1e-6)


def test_a_cylinder_has_its_volume_and_its_centre() -> None:
    draw = Draw(SEED, 1)
    _, (points, triangles) = solids.cylinder(draw)
    assert solids.shapes.volume(points, triangles) == pytest.approx(np.pi * draw.number("cylinder_radius") ** 2, 0.02)
    assert solids.center_of_volume(points + 3.0, triangles) == pytest.approx(np.full(3, 3.0), abs=1e-6)


def test_a_scene_whose_mesh_is_absent_is_skipped(monkeypatch, tmp_path) -> None:
    solids.loaded.cache_clear()
    monkeypatch.setattr(solids, "MESHES", tmp_path)
    number = next(n for n in range(100) if Draw(SEED, n).one_of("shape") == "mesh")
    outcome = bench_random.run_job(bench_random.Job(SEED, number), ends=0.0)
    assert outcome.result is None and "no such file" in outcome.skipped


# --- with contact ----------------------------------------------------------------------------------------------------


def contact_scenes(count: int) -> list[ContactScene]:
    """The first scenes of a seed with contact; those whose mesh file is not here are left out."""
    made = []
    for number in range(count):
        try:
            made.append(make_contact_scene(SEED, f"c{number}"))
        except solids.Absent:
            continue
    return made


def test_a_seeds_scenes_take_turns_and_those_with_one_solid_are_what_they_were() -> None:
    options = bench_random.parse(["--seed", str(SEED), "--first", "2", "--count", "5"])
    assert [job.scene for job in bench_random.chosen(options)] == [2, "c2", "e2", 3, "c3"]
    options = bench_random.parse(["--seed", str(SEED), "--count", "2", "--only", "contact"])
    assert [job.command[-3:].strip() for job in bench_random.chosen(options)] == ["c0", "c1"]
    options = bench_random.parse(["--seed", str(SEED), "--count", "3", "--only", "thin,single"])
    assert [job.scene for job in bench_random.chosen(options)] == [0, "t0", 1]
    options = bench_random.parse(["--seed", str(SEED), "--count", "2", "--only", "compact"])
    assert [job.scene for job in bench_random.chosen(options)] == ["b0", "b1"]
    assert bench_random.parse(["--scene", "b12"]).scene == "b12" and bench_random.parse(["--scene", "12"]).scene == 12
    with pytest.raises(SystemExit):
        bench_random.parse(["--only", "thin,thick"])
    scene = make_scene(7, 16)  # of the list of fixed scenes
    assert scene.words.startswith("sphere, 8.2 cells of 0.0612 m, box 32x37x15, faces noSlip noSlip periodic periodic")
    assert not isinstance(bench_random.drawn(SEED, 0), ContactScene)
    assert isinstance(bench_random.drawn(SEED, f"c{contact_scenes(9)[0].number[1:]}"), ContactScene)
    scene = make_contact_scene(2026, "c3")  # of the same list
    assert scene.words.startswith("thrown: superquadric 1 x 0.83 x 0.72, exponents 1.51 1.46 of 0.327 m, 1e+03 kg/m^3")
    assert "8.9 cells of 0.0365 m, box 38x14x25, slip slip open slip noSlip slip, vacuum" in scene.words


@pytest.mark.nightly
def test_scenes_with_contact_lie_within_their_ranges(library) -> None:
    made = contact_scenes(60)
    assert {len(scene.parts) for scene in made} == {2, 3} and {scene.pile for scene in made} == {False, True}
    for scene in made[:25]:
        assert scene == make_contact_scene(SEED, scene.number)
        assert np.prod(scene.cells) <= constant("contact_most_cells") and within("contact_across", scene.across)
        surfaces = [(mesh.points.astype(float), mesh.triangles()) for mesh, _ in scene.bodies()]
        assert deepest_vertex(surfaces) == 0
        for points, _ in surfaces:
            cells = points / scene.spacing
            assert cells.min() > constant("gap") - 1e-3 and (cells.max(axis=0) < np.array(scene.cells) - 0.499).all()
        with Simulation(scene.simulation()) as simulation:
            for mesh, values in scene.bodies():
                simulation.add_solid(mesh, **values)
        assert scene.pile or np.linalg.norm(np.subtract(scene.parts[1].velocity, scene.parts[0].velocity)) > 0


# --- thin bodies -----------------------------------------------------------------------------------------------------


def test_thin_scenes_are_accepted_by_the_library_and_no_body_touches_another(library) -> None:
    made = [make_thin_scene(SEED, f"t{number}") for number in (0, 1, 2, 4, 6, 17)]
    assert {scene.parts[0].shape for scene in made} == {"strap", "sheet", "rope", "ring", "link"}
    assert made[3] == make_thin_scene(SEED, "t4")
    for scene in made:
        assert within("thin_cells", scene.thick)
        surfaces = [(shape.points, shape.triangles) for shape in scene.shapes]
        assert deepest_vertex(surfaces) == 0
        for points, _ in surfaces:
            assert (points > 0).all() and (points < scene.box).all()
        with Simulation(scene.simulation()) as simulation:
            features = [simulation.add_solid(mesh, **values)[1]["thinnest_feature"] for mesh, values in scene.bodies()]
            seen = scene.company(simulation).observe()
        assert min(features) > 2.5 * scene.spacing
        assert seen["passed_lines"] == seen["passed_vertices"] == 0


# --- compact bodies --------------------------------------------------------------------------------------------------


def test_compact_scenes_lie_within_their_ranges_and_are_accepted_by_the_library(library) -> None:
    made = [make_compact_scene(SEED, f"b{number}") for number in range(40)]
    assert made[3] == make_compact_scene(SEED, "b3") == bench_random.drawn(SEED, "b3")
    assert {scene.target for scene in made} == {"wall", "floor", "collider", "body"}
    assert {scene.density_ratio is None for scene in made} == {"open" in scene.faces for scene in made} == {True, False}
    for scene in made:
        assert [len(scene.parts), bool(scene.collider)] == [1 + (scene.target == "body"), scene.target == "collider"]
        assert scene.target != "floor" or scene.pull[1] < 0
        for body in scene.parts:
            assert within("compact_poissons_ratio", body.poissons_ratio) and body.compressible
            assert within("compact_across", body.size / scene.spacing)
            assert 0 < body.impact_pressure <= ranges()["compact_pressure"]["high"]
            assert (body.mesh().points > 0).all() and (body.mesh().points < scene.box).all()
        points = scene.parts[0].mesh().points.astype(float)
        if scene.target in ("wall", "floor"):
            ahead = int(np.argmax(np.abs(scene.parts[0].velocity))) if scene.target == "wall" else 1
            gaps = points[:, ahead].min(), scene.box[ahead] - points[:, ahead].max()
            gap = gaps[int(scene.target == "wall" and scene.parts[0].velocity[ahead] > 0)]
            assert ranges()["apart"]["low"] * 0.99 < gap / scene.spacing < ranges()["apart"]["high"] * 1.01
        else:
            other = scene.collider.region.surface[0] if scene.collider else scene.parts[1].mesh().points
            assert (other.mean(axis=0) - points.mean(axis=0)) @ np.array(scene.parts[0].velocity) > 0
        assert np.linalg.norm(scene.parts[0].velocity) * scene.duration > scene.size
    for scene in made[:4]:
        with Simulation(scene.simulation()) as simulation:
            reports = [simulation.add_solid(mesh, **values)[1] for mesh, values in scene.bodies()]
            seen = scene.company(simulation).observe()
        assert all(report["closed"] and not report["repaired"] for report in reports)
        assert min(report["thinnest_feature"] for report in reports) > 4 * scene.spacing
        assert seen.get("collider_gap", 1.0) > 0


# --- laws of thin bodies ---------------------------------------------------------------------------------------------


def test_sides_and_friction_between_bodies_are_laws() -> None:
    result = two(lying(), lying())
    steps = len(result.columns["time"])
    result.columns |= {name: np.zeros(steps, int) for name in ("passed_lines", "passed_vertices")}
    result.columns |= {"passed_pairs": np.full(steps, "1-2"), "coulomb": np.full(steps, 0.9)}
    assert verdicts(result)["sides"] == verdicts(result)["coulomb"] == "pass"
    change("passed_vertices", 9, 2)(result)
    change("coulomb", 9, 1.1)(result)
    assert [name for name, verdict in verdicts(result).items() if verdict == "MISSED"] == ["sides", "coulomb"]


def test_depth_of_one_block_in_another() -> None:
    points, triangles = blocks(np.ones((10, 10, 10), bool), (0.1, 0.1, 0.1))
    other = points + [0.93, 0.02, 0.03]
    assert deepest_vertex([(points, triangles), (other, triangles)]) == pytest.approx(0.07, abs=1e-6)
    assert deepest_vertex([(points, triangles), (points + [1.01, 0, 0], triangles)]) == 0
    assert deepest_vertex([(0.1 * points + 0.45, triangles), (points, triangles)]) == pytest.approx(0.45)


# --- with everything -------------------------------------------------------------------------------------------------


def everything_scenes(count: int) -> list[EverythingScene]:
    """The first scenes of a seed with everything; those whose mesh file is not here are left out."""
    made = []
    for number in range(count):
        try:
            made.append(make_everything_scene(SEED, f"e{number}"))
        except solids.Absent:
            continue
    return made


@pytest.mark.nightly
def test_scenes_with_everything_have_all_of_it_and_are_accepted_by_the_library(library) -> None:
    made = everything_scenes(25)
    kinds = {len(scene.parts) for scene in made}
    assert kinds == {1, 2}
    for name in ("pin", "collider", "jet", "viscosity"):
        assert {bool(getattr(scene, name)) for scene in made} == {False, True}
    assert {bool(body.plastic) for scene in made for body in scene.parts} == {False, True}
    assert {(p.path.moves, p.path.turns) for p in (s.pin for s in made if s.pin)} == {
        (False, False),
        (True, False),
        (True, True),
    }
    assert made[0] == make_everything_scene(SEED, made[0].number)
    for scene in made[:12]:
        assert scene.jet is None or ("open" in scene.faces and scene.density_ratio is not None)
        assert scene.viscosity == 0 or scene.density_ratio is not None
        with Simulation(scene.simulation()) as simulation:
            for mesh, values in scene.bodies():
                simulation.add_solid(mesh, **values)
            seen = scene.company(simulation).observe()
        assert seen.get("pin_gap", 0.0) < 1e-6 * scene.size and seen["prescribed_work"] == 0.0
        for body, (mesh, _) in zip(scene.parts, scene.bodies(), strict=True):
            if body.plastic:
                assert within("flow_rate", body.plastic.flow_rate)
                assert within("yield_strain", body.plastic.yield_stress / body.youngs_modulus)
            if scene.collider:  # beside all solids, and its way ends not far in the first one's place
                assert scene.collider.region.distance(mesh.points).min() > 0
            if scene.jet:
                assert not seen["jet_covered"] and (scene.jet.region.surface[0] > 0).all()
                assert (scene.jet.region.surface[0] < scene.box).all()


@pytest.mark.parametrize("kind", ["sphere", "box"])
def test_distances_to_a_region_are_those_to_its_surface(kind: str) -> None:
    turn = tuple(tuple(row) for row in Draw(3, 3).rotation("turn"))
    region = Region(kind, (0.4,) * 3 if kind == "sphere" else (0.4, 0.3, 0.2), (1.0, 2.0, 3.0), turn)
    points, triangles = region.surface
    assert np.abs(region.distance(points)).max() < 1e-12
    assert region.volume == pytest.approx(solids.shapes.volume(points, triangles), rel=0.03)
    for way in np.eye(3):
        a, b, c = (points[triangles[:, k]] for k in range(3))
        assert region.across(way) == pytest.approx(np.abs(np.cross(b - a, c - a) @ way).sum() / 4, rel=0.03)
    inner = np.array(region.middle) + 0.9 * (points - region.middle)
    assert (region.distance(inner) < 0).all()
    assert -region.distance(inner).min() >= deepest_in(inner, points, triangles) * 0.9
    unit = (points - region.middle) @ region.axes / region.edges
    assert place(region.placed(), unit) == pytest.approx(points, abs=1e-12)


def test_a_path_goes_straight_and_turns_and_then_rests() -> None:
    path = Path((1.0, 0.0, 0.0), (0.0, 0.0, np.pi), (1.0, 1.0, 0.0), until=0.5)
    moved = place(path.pose(0.5), np.array([[2.0, 1.0, 0.0]]))
    assert moved == pytest.approx(np.array([[1.5, 2.0, 0.0]]))
    assert path.pose(2.0) == pytest.approx(path.pose(0.5))
    assert taken_back(path.pose(0.5), moved) == pytest.approx(np.array([[2.0, 1.0, 0.0]]))
    assert path.pose(0.0) == pytest.approx(np.eye(4)) and rotation(np.zeros(3)) == pytest.approx(np.eye(3))


def test_a_path_that_ends_within_a_frame_is_where_the_solver_has_it(library) -> None:
    region = Region("box", (0.3, 0.2, 0.16), (0.5, 0.5, 0.5))
    path, mesh = Path((1.0, 0.0, 0.2), (0.0, 2.0, 1.0), (0.4, 0.5, 0.6), until=0.05), region.mesh()
    box = {"domain_size": (1.0, 1.0, 1.0), "voxel_size": 0.05, "ambient_fluid": 0, "gravity": (0.0, 0.0, 0.0)}
    with Simulation(box) as simulation:
        solid, pin = simulation.add_collider(mesh)
        simulation.set_motion(pin, 0.0, 0.08, (path.pose(0.0), path.pose(0.08)))
        for _ in range(3):
            simulation.step(0.03)
            points = simulation.surface(solid)[0]
            pose = path.between(0.0, 0.08, simulation.time, np.array(region.middle))
            assert points == pytest.approx(place(pose, mesh.points.astype(float)), abs=1e-5)
            assert simulation.time >= 0.08 or np.abs(pose - path.pose(simulation.time)).max() > 1e-3
    assert path.between(0.0, 0.08, 0.08, np.zeros(3)) == pytest.approx(path.pose(0.08))


# --- the laws --------------------------------------------------------------------------------------------------------

RADIUS, FALL, G, DT = 0.1, 0.2, 9.8, 0.005
PUSH = 0.04  # s on the floor
FLOOR = 2  # the face -y
BALL = Scene(
    "made up",
    "sphere",
    across=10,
    box=(0.4, 0.8, 0.4),
    duration=0.6,
    density_ratio=None,
    spin=(0.0, 1.0, 0.0),
    size=2 * RADIUS,
    pull=(0.0, -G, 0.0),
    youngs_modulus=1e5,
    impact_pressure=0.02,
    fastest=2.0,
    reach=RADIUS,
)


def extrapolated(scene: Scene, times: np.ndarray, height: np.ndarray, speed: np.ndarray) -> Result:
    """The record of a ball whose centre has these heights and speeds [m, m/s], its energy kept by the elastic one."""
    count, mass = len(times), 4.0
    column = {
        name: np.zeros(count)
        for name in ("degenerate_cells", "false_edges", "misfit", "fluid_energy", "fluid_carried", "max_plastic_strain")
    }
    column |= {name: np.ones(count) for name in ("volume_mesh", "volume_cells")}
    center = np.stack([np.full(count, 0.2), height, np.full(count, 0.2)], axis=1)
    column |= {"mass": np.full(count, mass), "center": center, "extent_max": center + RADIUS}
    column["extent_min"] = np.where([False, True, False], np.maximum(0, center - RADIUS), center - RADIUS)
    column["momentum"] = mass * np.stack([0 * speed, speed, 0 * speed], axis=1)
    column["angular_momentum"] = np.tile([0.0, 0.02, 0.0], (count, 1))
    column["second_moments"] = np.full((count, 3), RADIUS**2 / 3)
    column["kinetic_energy"] = mass * speed**2 / 2
    own = column["kinetic_energy"] + mass * G * height
    column["elastic_energy"] = own[0] - own
    column["fluid_momentum"] = np.zeros((count, 3))
    start = {name: values[0] for name, values in column.items()}
    start |= {"thinnest_feature": 2 * RADIUS, "surface_volume": 0.0042, "solid_volume": 0.0042}
    columns = {name: values[1:] for name, values in column.items()}
    columns |= {"time": times[1:], "dt": np.diff(times), "det_f_interior": np.tile([0.9, 1.1], (count - 1, 1))}
    return Result(scene, "", start, columns)


def bounce() -> Result:
    """Falls, is pushed back within PUSH seconds, rises as high as it was."""
    impact, land = np.sqrt(2 * FALL / G), np.sqrt(2 * FALL * G)
    times = np.concatenate([np.arange(0, 0.6, DT)])
    since = times - impact
    pushed, risen = (since >= 0) & (since < PUSH), since - PUSH
    speed = np.where(since < 0, -G * times, np.where(pushed, land * (2 * since / PUSH - 1), land - G * risen))
    height = np.where(since < 0, RADIUS + FALL - G * times**2 / 2, RADIUS + land * risen - G * risen**2 / 2)
    height = np.where(pushed, RADIUS + land * (since**2 / PUSH - since), height)
    return extrapolated(BALL, times, height, speed)


def lying() -> Result:
    """On the floor all the time."""
    times = np.arange(0, 0.6, DT)
    return extrapolated(BALL, times, np.full(len(times), RADIUS), 0 * times)


def verdicts(result: Result) -> dict[str, str]:
    return {line.law: line.verdict for line in judge.judge(result)}


GIVEN = {"plastic flow", "pin", "collider", "collider at rest", "jet"}  # laws of what these scenes do not have
FOLLOWED = {"sides", "coulomb"}  # of thin scenes alone


def test_a_bounce_in_vacuum_keeps_every_law() -> None:
    judged = verdicts(bounce())
    assert {law for law, verdict in judged.items() if verdict != "pass"} == {
        "depth at rest",
        "ledger",
        "overlap",
        "overlap at rest",
        *GIVEN,
        *FOLLOWED,
    }
    assert verdicts(lying())["depth at rest"] == "pass"
    assert list(judged) == list(judge.LAWS)
    rebound = Record(bounce()).rebounds[0]
    assert rebound.face == FLOOR and rebound.is_clear
    assert rebound.expected == pytest.approx(10, rel=0.05) and rebound.gap == pytest.approx(10, rel=0.05)


PAIR = ContactScene(
    **{field.name: getattr(BALL, field.name) for field in dataclasses.fields(Scene)},
    parts=tuple(
        Body(
            shape="sphere",
            size=2 * RADIUS,
            place=(0.2, 0.2, 0.2),
            density=1000.0,
            youngs_modulus=1e5,
            poissons_ratio=0.3,
            compressible=compressible,
            material="corotational",
            friction=0.0,
            velocity=(0.0, 0.0, 0.0),
            spin=(0.0, 1.0, 0.0),
            impact_pressure=0.02,
            reach=RADIUS,
            surface=(np.zeros((0, 3)), np.zeros((0, 3), int)),
        )
        for compressible in (False, True)
    ),
)


def two(first: Result, second: Result) -> Result:
    """The record of two balls that lie, or fly, beside each other."""
    result = Result(PAIR, "", dict(first.start), dict(first.columns))
    result.start |= {f"{name}@2": value for name, value in second.start.items()}
    result.columns |= {f"{name}@2": value.copy() for name, value in second.columns.items()}
    steps = len(first.columns["time"])
    result.columns |= {"overlap": np.zeros(steps), "contact": np.zeros(steps), "active_rows": np.ones(steps, int)}
    return with_ledger(result)


def test_two_solids_keep_every_law_that_is_judged() -> None:
    judged = verdicts(two(lying(), lying()))
    moot = {law for law, verdict in judged.items() if verdict == "not judged"}
    assert moot == {"energy", "rebound", "clear", "momentum", "spin", *GIVEN, *FOLLOWED}
    assert {verdict for law, verdict in judged.items() if law not in moot} == {"pass"}


@pytest.mark.parametrize(
    ("name", "steps", "value", "law"),
    [
        ("overlap", 9, 1.1, "overlap"),
        ("overlap", -1, 0.3, "overlap at rest"),
        ("volume_cells", 9, 1.04, "volume by cells"),
        ("misfit@2", -1, 0.1, "shape"),
        ("false_edges@2", 7, 1, "mesh"),
        ("extent_min@2", (45, 1), -0.6, "depth"),
    ],
)
def test_a_law_that_one_of_two_solids_breaks_is_missed(name: str, steps: object, value: float, law: str) -> None:
    result = two(lying(), lying())
    result.columns[name] = result.columns[name].copy()
    cell = PAIR.spacing if name.startswith(("overlap", "extent")) else 1.0
    change(name, steps, value * cell)(result)
    assert [name for name, verdict in verdicts(result).items() if verdict == "MISSED"] == [law]
    result = two(lying(), lying())
    change("volume_cells@2", 9, 1.04)(result)  # the second one is compressible
    assert verdicts(result)["volume by cells"] == "pass"


def test_the_sum_of_momenta_counts_where_solids_push_each_other_in_vacuum() -> None:
    times = np.arange(0, 0.3, DT)
    speed = np.where(times < 0.15, 1.0, -1.0)
    one, other = (extrapolated(BALL, times, 0.4 + 0 * times, sign * speed) for sign in (1, -1))
    result = two(one, other)
    result.run = dataclasses.replace(PAIR, pull=(0.0, 0.0, 0.0))
    assert verdicts(result)["momentum"] == "pass"
    result.columns["momentum@2"] = result.columns["momentum@2"].copy()
    change("momentum@2", (40, 0), 0.02)(result)
    assert verdicts(result)["momentum"] == "MISSED"


REGION = Region("sphere", (0.1,) * 3, (0.2, 0.1, 0.2))
EVERYTHING = EverythingScene(
    **{field.name: getattr(PAIR, field.name) for field in dataclasses.fields(ContactScene) if field.name != "parts"},
    parts=(dataclasses.replace(PAIR.parts[0], plastic=Plastic(1e3, 1.0, 0.0)),),
    pin=Held(REGION, Path((0.0, 0.1, 0.0), until=0.3)),
    collider=Held(REGION, Path()),
    jet=Jet(REGION, (0.0, 0.0, 2.0), until=0.3),
)


def with_everything(result: Result) -> Result:
    """The record of a ball at rest with a pin, a collider on which it lies as well and a jet that blows for a while."""
    result = with_ledger(result)
    steps = len(result["time"])
    result.columns["energy_at_start"][:, 2] = 1.0  # of the fluid
    result.run = dataclasses.replace(EVERYTHING, density_ratio=50.0)
    still = ("pin_gap", "collider_gap", "prescribed_work", "jet_covered", "source_work")
    result.columns |= {name: np.zeros(steps) for name in still}
    result.columns["jet_on"] = np.where(result["time"] < 0.3, 1.0, 0.0)
    result.columns["jet_flux"] = EVERYTHING.jet.flux * result["jet_on"]
    result.start |= {name: 0.0 for name in still}
    result.columns["max_plastic_strain"] = np.linspace(0, 0.1, steps)
    return result


def test_what_is_given_and_yields_keeps_the_laws_that_apply() -> None:
    judged = verdicts(with_everything(lying()))
    assert {law for law, verdict in judged.items() if verdict == "MISSED"} == set()
    assert {judged[law] for law in GIVEN | {"plastic strain"}} == {"pass"}
    silent = {
        line.law: line.conditions for line in judge.judge(with_everything(lying())) if line.verdict == "not judged"
    }
    assert silent["shape"] == "it has yielded" and silent["momentum"] == "a pin holds it"
    assert silent["rebound"] == "with a pin"


@pytest.mark.parametrize(
    ("name", "steps", "value", "law"),
    [
        ("pin_gap", 7, 1.1e-6 * 2 * RADIUS, "pin"),
        ("collider_gap", 7, -0.51 * BALL.spacing, "collider"),
        ("collider_gap", -1, -0.26 * BALL.spacing, "collider at rest"),
        ("jet_flux", 7, 1.021 * EVERYTHING.jet.flux, "jet"),
        ("jet_flux", 7, 0.979 * EVERYTHING.jet.flux, "jet"),
        ("max_plastic_strain", 7, 0.2, "plastic strain"),
        ("energy_change", (7, binding.ENERGY_STAGES.index("plastic_flow"), 1), 1e-5, "plastic flow"),
    ],
)
def test_a_law_of_what_is_given_or_yields_is_missed(name: str, steps: object, value: float, law: str) -> None:
    result = with_everything(lying())
    change(name, steps, value)(result)
    assert [name for name, verdict in verdicts(result).items() if verdict == "MISSED"] == [law]


@pytest.mark.parametrize(
    ("name", "value", "law"),
    [
        ("pin_gap", 0.9e-6 * 2 * RADIUS, "pin"),
        ("collider_gap", -0.49 * BALL.spacing, "collider"),
        ("jet_flux", 1.019 * EVERYTHING.jet.flux, "jet"),
    ],
)
def test_a_law_of_what_is_given_is_kept_up_to_its_bar(name: str, value: float, law: str) -> None:
    result = with_everything(lying())
    change(name, 7, value)(result)
    assert verdicts(result)[law] == "pass"


def test_an_elastic_solid_has_no_plastic_strain_and_a_covered_jet_is_not_judged() -> None:
    result = with_everything(lying())
    result.run = dataclasses.replace(result.run, parts=PAIR.parts[:1])
    assert verdicts(result)["plastic strain"] == "MISSED"
    result.columns["jet_covered"][:] = 1
    assert verdicts(result)["jet"] == "not judged"


def test_work_of_what_is_given_and_of_jets_comes_from_outside() -> None:
    for name in ("prescribed_work", "source_work"):
        result = with_everything(lying())
        result.columns["energy_at_start"][30:, 0] += 0.25  # the mean of the velocities around
        result.columns["energy_at_start"][31:, 0] += 0.25
        result.columns["energy_end"][30:, 0] += 0.5
        change = result.columns["energy_change"][30]
        change[binding.ENERGY_STAGES.index("velocity"), 0] += 0.5
        assert verdicts(result)["energy"] == "MISSED"
        result.columns[name][30] = 0.5
        assert verdicts(result)["energy"] == "pass"


def test_an_impact_within_one_step_makes_no_energy() -> None:
    result = with_ledger(bounce())
    result.columns["energy_at_start"][60, 0] -= 0.5  # of the mean of a velocity down and one up
    assert verdicts(result)["energy"] == "pass"
    result.columns["energy_end"][59, 0] -= 0.5  # lost and made again
    assert verdicts(result)["energy"] == "MISSED"


def test_flight_ends_at_a_collider() -> None:
    times = np.arange(0, 0.6, DT)
    result = with_ledger(extrapolated(BALL, times, np.full(len(times), 0.4), 0 * times))
    assert Record(result).flight.all()
    result.columns["collider_gap"] = np.linspace(5, 0, len(times) - 1) * BALL.spacing
    result.start["collider_gap"] = 5 * BALL.spacing
    assert Record(result).flight.sum() == np.flatnonzero(result["collider_gap"] <= BALL.spacing)[0] + 1


def change(name: str, steps: object, value: Callable | float) -> Callable[[Result], None]:
    """Sets, or maps, some values of a column."""

    def apply(result: Result) -> None:
        old = result.columns[name][steps]
        result.columns[name][steps] = value(old) if callable(value) else value

    return apply


def fail(result: Result) -> None:
    result.failure = "blown up"


LATE = slice(60, None)  # after the rebound
BROKEN = {
    "finished": fail,
    "finite": change("elastic_energy", 5, np.nan),
    "det F": change("det_f_interior", (3, 0), 0.49),
    "repairs": change("degenerate_cells", 7, 1),
    "energy": change("elastic_energy", LATE, lambda old: old + 0.3),
    "rebound": change("center", (LATE, 1), lambda old: RADIUS + 0.93 * (old - RADIUS)),
    "clear": change("extent_min", (LATE, 1), 0.01),
    "depth": change("extent_min", (45, 1), -0.011),
    "shape": change("misfit", -1, 0.0021),
    "mesh": change("false_edges", 7, 1),
    "volume by mesh": change("volume_mesh", 9, 0.96),
    "volume by cells": change("volume_cells", 9, 1.04),
    "momentum": change("momentum", (20, 0), 0.02),
    "spin": change("angular_momentum", (20, 1), 0.0203),
}


@pytest.mark.parametrize("law", BROKEN)
def test_a_broken_law_is_missed(law: str) -> None:
    result = bounce()
    BROKEN[law](result)
    assert verdicts(result)[law] == "MISSED"


@pytest.mark.parametrize("law", ["det F", "repairs", "depth", "shape", "volume by cells"])
def test_a_law_is_kept_up_to_its_bar(law: str) -> None:
    result = bounce()
    {
        "det F": change("det_f_interior", (3, 0), 0.51),
        "repairs": change("degenerate_cells", 7, 0),
        "depth": change("extent_min", (45, 1), -0.009),
        "shape": change("misfit", -1, 0.0019),
        "volume by cells": change("volume_cells", 9, 1.02),
    }[law](result)
    assert verdicts(result)[law] == "pass"


def test_a_shape_is_judged_after_the_impact_and_not_while_it_comes_near() -> None:
    result = bounce()
    change("elastic_energy", slice(40, None), 50.0)(result)  # it swings from the impact on
    assert verdicts(result)["shape"] == "not judged"
    change("elastic_energy", -1, 0.0)(result)
    assert verdicts(result)["shape"] == "pass"
    change("misfit", -1, 0.0021)(result)
    assert verdicts(result)["shape"] == "MISSED"


def test_a_body_that_sinks_in_at_rest_is_seen() -> None:
    result = lying()
    change("extent_min", (slice(-5, None), 1), -0.006)(result)
    assert verdicts(result)["depth at rest"] == "MISSED" and verdicts(result)["depth"] == "pass"


def test_a_ball_that_stays_glued_misses_its_rise() -> None:
    """Its centre turns back early: the ballistic rise counts, not the time until then."""
    result = bounce()
    up = result.columns["time"] > 0.26
    result.columns["center"][up, 1] = RADIUS + 0.02
    result.columns["momentum"][up, 1] = -0.01
    assert verdicts(result)["rebound"] == "MISSED"


def test_a_rise_may_be_higher_by_what_elastic_energy_lifts() -> None:
    result = bounce()
    fastest = int(np.argmax(result.columns["momentum"][:, 1]))
    result.columns["center"][60:, 1] = RADIUS + 1.1 * (result.columns["center"][60:, 1] - RADIUS)
    result.columns["elastic_energy"][fastest] = 0.0
    assert verdicts(result)["rebound"] == "MISSED"
    result.columns["elastic_energy"][fastest] = 0.1 * 4.0 * G * FALL
    assert verdicts(result)["rebound"] == "pass"


def with_ledger(result: Result) -> Result:
    """The same record as the ledger tells it."""
    kinetic, elastic = result.with_start("kinetic_energy"), result.with_start("elastic_energy")
    potential = 4.0 * G * result.with_start("center")[:, 1]
    energies = np.stack([kinetic, elastic, 0 * kinetic, potential], axis=1)
    result.columns |= {"energy_at_start": energies[:-1].copy(), "energy_end": energies[1:]}
    result.columns["energy_change"] = np.zeros((len(energies) - 1, len(binding.ENERGY_STAGES), 4))
    result.columns["energy_change"][:, binding.ENERGY_STAGES.index("velocity")] = np.diff(energies, axis=0)
    return result


def test_columns_of_the_ledger_join_the_diagnostics_of_all_forms() -> None:
    names = {"kinetic_energy": 0.05, "elastic_energy": 0.05, "fluid_energy": 0.05, "center": 0.002}
    for name, wrong in names.items():
        result = with_ledger(bounce())
        assert verdicts(result)["ledger"] == "pass"
        result.columns[name] = result.columns[name].copy()
        change(name, slice(60, None), lambda old, wrong=wrong: old + wrong)(result)
        assert verdicts(result)["ledger"] == "MISSED", name
    result = with_everything(lying())
    assert verdicts(result)["ledger"] == "pass"
    result.columns["energy_change"][40, binding.ENERGY_STAGES.index("pressure"), 0] = 0.1
    assert verdicts(result)["ledger"] == "MISSED"


def test_the_ledger_judges_energy_in_fluid_less_what_came_from_outside() -> None:
    result = with_ledger(bounce())
    result.run = dataclasses.replace(BALL, density_ratio=50.0)
    assert verdicts(result)["energy"] == "pass"
    result.columns["energy_end"][70:, 2] = 0.5  # of the fluid
    result.columns["energy_at_start"][70:, 2] = 0.25
    result.columns["energy_at_start"][71:, 2] = 0.5
    change = result.columns["energy_change"][70]
    change[binding.ENERGY_STAGES.index("repair"), 2] = 0.5
    energy = next(line for line in judge.judge(result) if line.law == "energy")
    assert energy.verdict == "MISSED" and energy.conditions.endswith("repair +0.5")
    change[:] = np.roll(change, binding.ENERGY_STAGES.index("external") - binding.ENERGY_STAGES.index("repair"), axis=0)
    assert verdicts(result)["energy"] == "pass"


def test_det_f_before_the_repair_counts() -> None:
    result = bounce()
    result.columns["det_f_before"] = np.tile([0.3, 1.0], (len(result.columns["time"]), 1))
    assert verdicts(result)["det F"] == "MISSED"


@pytest.mark.parametrize(
    ("changes", "laws"),
    [
        ({"density_ratio": 50.0}, {"energy", "rebound", "clear", "momentum", "spin"}),
        ({"faces": ("open",) * 6}, {"depth", "depth at rest", "rebound", "clear"}),
        ({"density_ratio": 50.0, "faces": ("slip", "slip", "slip", "open", "slip", "slip")}, {"energy"}),
        ({"compressible": True, "impact_pressure": 0.5}, {"det F", "volume by mesh", "volume by cells"}),
        ({"folds_nowhere": False}, {"repairs"}),
        ({"spin": (0.0, 0.0, 0.0)}, {"spin"}),
    ],
)
def test_a_law_that_does_not_apply_says_why(changes: dict, laws: set[str]) -> None:
    result = bounce()
    result.run = dataclasses.replace(BALL, **changes)
    silent = {line.law: line.conditions for line in judge.judge(result) if line.verdict == "not judged"}
    assert laws <= set(silent) and all(silent.values())


def test_what_time_or_a_periodic_face_has_ended_is_judged_as_far_as_it_went() -> None:
    for failure in (
        f"{OUT_OF_TIME} after 3 s",
        "solid 1 has come within a cell of the periodic faces along x, which solids cannot cross",
    ):
        result = bounce()
        result.failure = failure
        assert verdicts(result)["finished"] == "not judged" and verdicts(result)["depth"] == "pass"
    nothing = Result(BALL, "voxel_size: refused", {}, {})
    assert [v for v in verdicts(nothing).values() if v != "not judged"] == ["MISSED"]


def test_nothing_counts_after_a_part_has_left_through_an_open_face() -> None:
    result = bounce()
    result.run = dataclasses.replace(BALL, faces=("slip", "open", "slip", "slip", "slip", "slip"))
    gone = slice(50, None)  # just after the floor's push
    change("extent_max", (gone, 0), 0.5)(result)
    change("volume_cells", gone, 0.5)(result)
    assert verdicts(result)["volume by cells"] == "pass" and verdicts(result)["rebound"] == "not judged"


def test_a_run_ends_when_half_the_solid_has_left_through_an_open_face() -> None:
    scene = dataclasses.replace(BALL, faces=("slip", "open", "slip", "slip", "slip", "slip"))
    assert not scene.ends({"extent_min": [0.29, 0.1, 0.1], "extent_max": [0.49, 0.3, 0.3]})
    assert scene.ends({"extent_min": [0.31, 0.1, 0.1], "extent_max": [0.51, 0.3, 0.3]})
    assert not scene.ends({"extent_min": [-0.15, 0.1, 0.1], "extent_max": [0.05, 0.3, 0.3]})


def test_momentum_between_periodic_faces_counts_the_fluid() -> None:
    result = bounce()
    result.run = dataclasses.replace(BALL, density_ratio=5.0, faces=("periodic",) * 6, pull=(0.0, 0.0, 0.0))
    result.columns["fluid_momentum"] = -result.columns["momentum"] + [4.0, 0.0, 0.0]
    result.start["fluid_momentum"] = [4.0, 0.0, 0.0]
    assert verdicts(result)["momentum"] == "pass"
    result.columns["fluid_momentum"][30:, 2] = 1e-3
    assert verdicts(result)["momentum"] == "MISSED"
    result.columns["fluid_energy"][30:] = 1e6  # a fluid that is stirred as much rounds by as much
    assert verdicts(result)["momentum"] == "pass"


def test_the_misfit_leaves_out_turns_and_sees_dents() -> None:
    points, _ = solids.shapes.ball()
    weights = np.full(len(points), 1 / len(points))
    turned = points @ Draw(3, 3).rotation("turn").T
    assert rigid_misfit(turned, points, weights) < 1e-12
    turned[0] *= 0.5
    assert rigid_misfit(turned, points, weights) == pytest.approx(0.05, rel=0.02)
    assert rigid_misfit(-points * [1, 1, 0.5], points, weights) > 0.04  # no mirror image fits


# --- the command -----------------------------------------------------------------------------------------------------


def test_a_list_names_scenes_and_known_misses(tmp_path) -> None:
    path = tmp_path / "list.toml"
    path.write_text('[[scene]]\nseed = 3\nscene = 4\nknown = { "depth" = "walls pull" }\n')
    assert bench_random.read_list(path) == [bench_random.Job(3, 4)]
    path.write_text('[[scene]]\nseed = 3\nscene = 4\nknown = { "deep" = "walls pull" }\n')
    with pytest.raises(ValueError, match="no such law: deep"):
        bench_random.read_list(path)


def test_an_unexpected_miss_fails_and_says_how_to_repeat_it(library, monkeypatch, capsys, tmp_path) -> None:
    def broken(job: bench_random.Job, ends: float) -> bench_random.Outcome:
        result = bounce()
        BROKEN["mesh"](result)
        return bench_random.Outcome(job, result, judge.judge(result))

    monkeypatch.setattr(bench_random, "run_job", broken)
    monkeypatch.delenv("CI", raising=False)
    report = tmp_path / "report.md"
    assert bench_random.main(["--seed", "3", "--first", "4", "--count", "1", "--output", str(report)]) == 1
    assert "repeat: ./eulerfsi bench random --seed 3 --scene 4" in capsys.readouterr().out
    assert "| 3/4 | mesh |" in report.read_text()
    path = tmp_path / "list.toml"
    path.write_text('[[scene]]\nseed = 3\nscene = 4\nknown = { mesh = "a cause", depth = "another" }\n')
    assert bench_random.main(["--seeds-file", str(path)]) == 0
    answer = capsys.readouterr().out
    assert "known: a cause" in answer and "depth is kept now" in answer
    path.write_text("[[scene]]\nseed = 3\nscene = 4\n")
    monkeypatch.setenv("CI", "true")
    assert bench_random.main(["--seeds-file", str(path)]) == 1
    assert bench_random.main(["--seed", "3", "--count", "1"]) == 0


def test_a_scene_runs_in_a_process_of_its_own(library) -> None:
    job = next(bench_random.Job(s.seed, s.number) for s in scenes(20) if s.density_ratio is None)
    outcome = bench_random.run_job(job, ends=0.0)  # a second is left to it
    assert outcome.result is not None and len(outcome.result["dt"]) > 0
    assert len(outcome.lines) == len(judge.LAWS)
    assert {line.law: line.verdict for line in outcome.lines}["finite"] == "pass"


@pytest.mark.nightly
@pytest.mark.parametrize("job", bench_random.read_list(FIXED), ids=lambda job: f"{job.seed}/{job.scene}")
def test_the_fixed_scenes_keep_the_laws_but_for_known_misses(library, job: bench_random.Job) -> None:
    outcome = bench_random.run_job(job, ends=float("inf"))
    assert outcome.result is not None, outcome.skipped
    text = [f"{line.law}: {line.bar}: {line.measured:.4g} ({line.conditions})" for line in outcome.unexpected]
    assert not text, f"{job.command}\n" + "\n".join(text)
