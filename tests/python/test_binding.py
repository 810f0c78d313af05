"""The ctypes binding: same structures as C, every function, values there and back, errors, callbacks."""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
from pathlib import Path

import eulerfsi
import numpy as np
import pytest
from conftest import ROOT, environment, sphere, write_obj
from eulerfsi.errors import EXIT_SCENE, EulerFsiError, LibraryError
from eulerfsi.parameters import table
from eulerfsi.solver import binding, c_api
from eulerfsi.solver import simulation as solver

HEADERS = ROOT / "libeulerfsi" / "include"
BOX = {"domain_min": (-0.3, -0.5, -0.3), "domain_size": (0.6, 0.7, 0.6), "voxel_size": 0.05, "gravity": (0, -9.8, 0)}
MATERIAL = {"density": 1000.0, "youngs_modulus": 23333.0, "poissons_ratio": 1 / 6}


def ball(radius: float = 0.15) -> solver.Mesh:
    points, counts, indices = sphere(radius)
    return solver.Mesh(points, counts, indices)


@pytest.fixture
def simulation(library):
    with solver.Simulation({**BOX, "threads": 2}) as sim:
        sim.add_solid(ball(), velocity=(0, -2, 0), **MATERIAL)
        yield sim


def c_numbers(tmp_path: Path) -> dict[str, int]:
    """sizeof and offsetof as the C compiler sees them: {"EfsiVec3": 24, "EfsiVec3.x": 0, ...}."""
    lines = []
    for name, struct in c_api.STRUCTURES.items():
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        for field, *_ in struct._fields_:
            lines.append(f'printf("{name}.{field} %zu\\n", offsetof({name}, {field}));')
    program = (
        "#include <stdio.h>\n#include <eulerfsi/eulerfsi.h>\nint main(void) {" + "\n".join(lines) + "return 0; }\n"
    )
    (tmp_path / "sizes.c").write_text(program)
    # -Wpadded: a hidden gap at a struct's end would become part of the member that is added there.
    command = ["cc", "-std=c11", "-Wpadded", "-Werror", f"-I{HEADERS}", "sizes.c", "-o", "sizes"]
    subprocess.run(command, cwd=tmp_path, check=True)
    text = subprocess.run([tmp_path / "sizes"], text=True, capture_output=True, check=True).stdout
    return {name: int(number) for name, number in (line.split() for line in text.splitlines())}


def test_structures_have_the_sizes_and_offsets_of_c_and_no_gap(tmp_path):
    expected = c_numbers(tmp_path)
    found = {}
    for name, struct in c_api.STRUCTURES.items():
        found[name] = ctypes.sizeof(struct)
        for field, *_ in struct._fields_:
            found[f"{name}.{field}"] = getattr(struct, field).offset
    assert found == expected


def test_every_function_and_structure_of_the_headers_is_bound():
    text = re.sub(r"/\*.*?\*/", "", "".join(p.read_text() for p in HEADERS.rglob("*.h")), flags=re.S)
    assert set(re.findall(r"EFSI_API[^;]*?\b(efsi_\w+)\(", text)) == set(c_api.FUNCTIONS)
    assert set(re.findall(r"^typedef struct (Efsi\w+) {", text, flags=re.M)) == set(c_api.STRUCTURES)
    for name, (_, arguments) in c_api.FUNCTIONS.items():
        declared = re.search(rf"\b{name}\(([^)]*)\)", text).group(1)
        assert len(arguments) == declared.count(",") + 1, name


def test_tokens_are_the_words_of_the_enums():
    assert binding.WALLS == {"slip": 0, "noSlip": 1, "open": 2, "periodic": 3}
    assert binding.MATERIALS["stVenantKirchhoff"] == 2 and binding.PRESETS["paper2016"] == 1
    assert binding.STAGES[0] == "time_step" and binding.STAGES[-1] == "other" and "count" not in binding.STAGES
    assert (binding.OK, binding.ERROR_CHECKPOINT, binding.LOG_WARNING) == (0, 8, 1)


def test_tokens_of_the_parameter_table_are_known_to_the_binding():
    rows = table()
    assert set(rows["domain"]["preset"].tokens) == set(binding.PRESETS)
    assert set(rows["domain"]["wallXMin"].tokens) == set(binding.WALLS)
    assert set(rows["solid"]["material"].tokens) == set(binding.MATERIALS)
    assert set(rows["emitter"]["mode"].tokens) == set(binding.EMITTER_MODES)


def test_public_names_are_where_the_package_says() -> None:
    from eulerfsi import simulate as run
    from eulerfsi import solver as public

    assert {"Options", "Result", "load_scene", "simulate"} <= set(run.__all__)
    for module in (eulerfsi, public):
        for name in module.__all__:
            assert getattr(module, name) is getattr(solver, name)
        with pytest.raises(AttributeError, match="no attribute 'Simulator'"):
            _ = module.Simulator
    assert {"Mesh", "Simulation", "Surface", "load_mesh"} == set(eulerfsi.__all__) < set(public.__all__)


def test_import_of_the_package_loads_neither_solver_nor_library():
    program = "import sys, eulerfsi; print([m for m in sys.modules if m.startswith(('eulerfsi.', 'numpy', 'pxr'))])"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**environment(), "EULERFSI_LIBRARY": "/nowhere.so"},
        text=True,
        capture_output=True,
        check=True,
    )
    assert done.stdout.strip() == "['eulerfsi.paths']"


def test_version_is_the_packages(library):
    assert binding.library_version() == eulerfsi.__version__


def test_missing_library_names_the_places(monkeypatch, tmp_path):
    monkeypatch.setenv("EULERFSI_LIBRARY", str(tmp_path / "nowhere.so"))
    binding.library.cache_clear()
    try:
        with pytest.raises(EulerFsiError, match="nowhere.so"):
            binding.library()
    finally:
        binding.library.cache_clear()


def test_defaults_of_the_definitions_are_the_tables(library):
    definition, solid = binding.define(c_api.SimulationDef), binding.define(c_api.SolidDef)
    for scope, struct in (("domain", definition), ("solid", solid)):
        for row in table()[scope].values():
            if row.type == "double" and row.field:
                assert getattr(struct, row.field) == row.default, row.name
    assert definition.struct_size == ctypes.sizeof(definition)


def test_uninitialised_definition_is_refused(library):
    handle, error = ctypes.c_void_p(), c_api.Error()
    status = library.efsi_simulation_create(
        ctypes.byref(c_api.SimulationDef()), ctypes.byref(handle), ctypes.byref(error)
    )
    assert status == binding.ERROR_ARGUMENT
    assert b"efsi_simulation_def_init" in error.message


def test_message_of_a_bad_value_names_field_and_value(library):
    with pytest.raises(LibraryError, match=r"voxel_size.*-1") as caught:
        solver.Simulation({**BOX, "voxel_size": -1.0})
    assert caught.value.status == binding.ERROR_ARGUMENT
    assert caught.value.exit_code == EXIT_SCENE


def test_unknown_field_name_is_refused(library):
    with pytest.raises(KeyError, match="voxelsize"):
        solver.Simulation({"voxelsize": 1.0})


def test_mesh_file_has_the_points_of_the_array(library, tmp_path):
    mesh = solver.load_mesh(write_obj(tmp_path / "ball.obj", 0.15))
    assert len(mesh.triangles()) == len(ball().triangles())
    np.testing.assert_allclose(mesh.points.min(axis=0), ball().points.min(axis=0), atol=1e-6)
    report = solver.Surface(mesh, 0.05).report
    exact = 4 / 3 * np.pi * 0.15**3
    assert report["closed"] == 1 and report["holes"] == 0
    assert 0.93 * exact < report["solid_volume"] < exact


def test_missing_mesh_file_is_an_error_with_its_name(library, tmp_path):
    with pytest.raises(LibraryError, match=r"none\.obj"):
        solver.load_mesh(tmp_path / "none.obj")


def test_polygons_become_fans_and_flipping_turns_the_volume():
    mesh = ball()
    assert len(mesh.triangles()) == sum(count - 2 for count in mesh.counts)

    def volume(m: solver.Mesh) -> float:
        a, b, c = (m.points[m.triangles()[:, k]].astype(float) for k in range(3))
        return float((np.cross(a, b) * c).sum() / 6)

    assert volume(mesh) > 0
    assert volume(mesh.flipped()) == pytest.approx(-volume(mesh))
    np.testing.assert_array_equal(mesh.flipped().flipped().indices, mesh.indices)


def test_advance_lands_on_the_end_and_moves_the_solid_down(simulation):
    start, _ = simulation.surface(1)
    np.testing.assert_allclose(start, ball().points, atol=1e-6)
    info = simulation.advance(1 / 24)
    assert simulation.time == pytest.approx(1 / 24, abs=1e-15)
    assert info["steps"] == simulation.steps >= 1
    after, velocities = simulation.surface(1)
    fallen = (after - start)[:, 1].mean()
    assert -2 / 24 - 9.8 / 24**2 - 1e-3 < fallen < -2 / 24 - 4.9 / 24**2 + 1e-3  # first order in time at worst
    assert velocities[:, 1].mean() == pytest.approx(-2 - 9.8 / 24, rel=0.02)


def test_progress_is_called_between_steps_and_cancels(simulation):
    calls: list[tuple[float, float]] = []

    def progress(fraction: float, step: dict) -> bool:
        calls.append((fraction, step["time"]))
        return True

    with pytest.raises(LibraryError) as caught:
        simulation.advance(0.25, progress)
    assert caught.value.status == binding.ERROR_CANCELLED
    assert len(calls) == 1 and 0 < calls[0][0] < 1
    assert simulation.time == pytest.approx(calls[0][1]) and simulation.steps == 1
    simulation.advance(0.01)  # the state is sound


def test_exception_in_the_progress_function_comes_out(simulation):
    def progress(_fraction: float, _step: dict) -> bool:
        raise RuntimeError("from inside")

    with pytest.raises(RuntimeError, match="from inside"):
        simulation.advance(0.25, progress)


def test_checkpoint_continues_to_the_same_hash(library, tmp_path):
    def make() -> solver.Simulation:
        sim = solver.Simulation({**BOX, "threads": 1})
        sim.add_solid(ball(), velocity=(0, -2, 0), **MATERIAL)
        return sim

    with make() as one, make() as two:
        one.advance(1 / 24)
        one.save_checkpoint(tmp_path / "state")
        one.advance(1 / 24)
        two.restore_checkpoint(tmp_path / "state")
        two.advance(1 / 24)
        assert one.state_hash() == two.state_hash()
        assert len(one.state_hash()) == 16


def test_checkpoint_of_another_scene_is_refused(simulation, tmp_path):
    simulation.save_checkpoint(tmp_path / "state")
    with solver.Simulation({**BOX, "voxel_size": 0.1}) as other, pytest.raises(LibraryError) as caught:
        other.restore_checkpoint(tmp_path / "state")
    assert caught.value.status == binding.ERROR_CHECKPOINT


def test_field_comes_back_as_it_was_set(library):
    with solver.Simulation(BOX) as sim:
        sim.add_emitter(density=1.0, mode=0, transform=np.diag([0.2, 0.2, 0.2, 1.0]))
        old, place = sim.field("smoke_density")
        assert old.shape == (1, 12, 14, 12) and place["cell_centered"]
        assert place["spacing"] == pytest.approx(0.05)
        np.testing.assert_allclose(place["origin"], (-0.275, -0.475, -0.275), atol=1e-9)
        new = np.arange(old.size, dtype=np.float32).reshape(old.shape)
        sim.set_field("smoke_density", new)
        np.testing.assert_array_equal(sim.field("smoke_density")[0], new)


def test_field_view_is_the_library_s_memory_and_read_only(simulation):
    simulation.advance(1 / 24)
    for name, solid in (("velocity", 0), ("pressure", 0), ("solid_displacement", 1)):
        views, place = simulation.field_view(name, solid)
        copy, same_place = simulation.field(name, solid)
        assert len(views) == len(copy) and place == same_place
        for view, values, again in zip(views, copy, simulation.field_view(name, solid)[0], strict=True):
            np.testing.assert_array_equal(view, values)
            assert view.dtype == np.float32 and view.any() and not view.flags.owndata
            assert view.ctypes.data == again.ctypes.data != values.ctypes.data
            with pytest.raises(ValueError, match="read-only"):
                view[0, 0, 0] = 1.0
            values[0, 0, 0] = 1.0  # a copy is the caller's


def test_field_view_of_what_the_scene_lacks_is_empty(simulation):
    views, place = simulation.field_view("smoke_temperature")
    assert [view.shape for view in views] == [(0, 0, 0)] and not views[0].flags.writeable
    assert simulation.field("smoke_temperature")[0].shape == (1, 0, 0, 0) and place["cell_centered"]
    with pytest.raises(KeyError, match="smoke_colour"):
        simulation.field_view("smoke_colour")
    with pytest.raises(LibraryError) as caught:
        simulation.field_view("solid_velocity", 2)
    assert caught.value.status == binding.ERROR_ARGUMENT


def test_surfaces_and_passengers_have_the_points_that_were_added(library):
    points = ball().points[:5] * 0.5
    with solver.Simulation(BOX) as sim:
        solid, _ = sim.add_solid(solver.Surface(ball(), BOX["voxel_size"]), **MATERIAL)
        stone = solver.Mesh(*sphere(0.1, rows=6))
        stone.points += np.array((0.0, -0.4, 0.0), np.float32)
        collider, _ = sim.add_collider(stone)
        passenger = sim.add_passenger(solid, points)
        assert [sim.surface(k)[1].shape for k in (solid, collider)] == [ball().points.shape, stone.points.shape]
        np.testing.assert_allclose(sim.passenger(passenger)[0], points, atol=1e-4)
        for call in (sim.surface, sim.passenger):
            with pytest.raises(LibraryError) as caught:
                call(7)
            assert caught.value.status == binding.ERROR_ARGUMENT


def test_example_falls_as_in_free_fall_and_writes_its_smoke(library, tmp_path):
    path = ROOT / "examples" / "python" / "drop_ball.py"
    assert len(path.read_text().splitlines()) <= 40
    command = [sys.executable, path, tmp_path / "smoke.vdb"]
    done = subprocess.run(command, env=environment(), text=True, capture_output=True, check=True)
    rows = re.findall(r"^(\S+) s: height (\S+) m, smoke (\S+) m\^3$", done.stdout, re.M)
    assert len(rows) == len(done.stdout.splitlines()) == 6
    for time, height, smoke in (map(float, row) for row in rows):
        fall = 4.9 * time**2  # in vacuum; air takes a thousandth of it
        assert -1e-4 < height - (0.7 - fall) < 0.01 * fall + 1e-3
        assert smoke == pytest.approx(0.9 * 0.4 * 0.9, rel=0.01)
    assert (tmp_path / "smoke.vdb").stat().st_size > 10_000


def test_field_of_wrong_size_is_refused(library):
    with solver.Simulation(BOX) as sim, pytest.raises(LibraryError):
        sim.set_field("velocity", np.zeros((3, 2, 2, 2), np.float32))


def test_profile_and_diagnostics_add_up(simulation):
    simulation.advance(1 / 24)
    profile = simulation.profile()
    assert set(profile["seconds"]) == set(binding.STAGES)
    assert sum(profile["seconds"].values()) == pytest.approx(profile["total_seconds"], rel=0.01)
    assert profile["tiles"]["contact"] == 0 and profile["tiles"]["velocity_solve"] > 0
    solid = simulation.solid_diagnostics(1)
    assert solid["mass"] == pytest.approx(1000 * solid["rest_volume"], rel=0.06)  # 6 cells across
    assert solid["momentum"][1] == pytest.approx(solid["mass"] * (-2 - 9.8 / 24), rel=0.03)
    assert simulation.fluid_diagnostics()["kinetic_energy"] > 0
    simulation.reset_profile()
    assert simulation.profile()["steps"] == 0


def test_warnings_reach_the_log_function(library, tmp_path):
    messages: list[tuple[int, str]] = []
    points, counts, indices = sphere(0.15)
    opened = solver.Mesh(points, counts[1:], indices[counts[0] :])
    with solver.Simulation(BOX, lambda level, text: messages.append((level, text))) as sim:
        _, report = sim.add_solid(opened, **MATERIAL)
    assert report["holes"] == 1 and report["repaired"] == 1
    assert any(level == binding.LOG_WARNING and "hole" in text for level, text in messages)


def test_memory_estimate_grows_with_the_grid_and_names_a_fitting_voxel(library):
    coarse, none = solver.estimate_memory(BOX, 0.027)
    fine, fitting = solver.estimate_memory({**BOX, "voxel_size": 0.0125, "memory_limit": coarse}, 0.027)
    assert none == 0 and fine > 10 * coarse
    again, _ = solver.estimate_memory({**BOX, "voxel_size": fitting * 1.001}, 0.027)
    assert again <= coarse * 1.001


def test_planning_asks_the_library(library):
    assert solver.slab_axis(BOX) is None
    assert solver.slab_axis({**BOX, "domain_size": (0.6, 0.7, 0.05)}) == 2
    assert solver.slab_axis({**BOX, "voxel_size": -1.0}) is None  # refused where the scene is checked
    limits = solver.step_limits(BOX, 1000.0)
    assert set(limits) == {"contact_reach", "contact_cfl", "contact_pace", "flight_cfl", "contact_share"}
    assert 0 < limits["contact_share"] < 1
    assert solver.step_limits({**BOX, "preset": binding.PRESETS["paper2016"]}, 1000.0)["contact_share"] == 0
    with pytest.raises(LibraryError, match="lightest_density = 0"):
        solver.step_limits(BOX, 0.0)
