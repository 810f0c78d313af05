"""`new`: layouts that a short run can afford, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import sphere, without_progress, write_obj
from eulerfsi.cli import new_layout, new_pieces
from eulerfsi.scene.read import EARTH_GRAVITY
from eulerfsi.solver.simulation import Mesh
from pxr import Usd, UsdGeom
from standard_stages import add_body, new_stage

BAR_OBJ = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "".join(
    f"f {f}\n" for f in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
)


def write_box(path, x: float, y: float, z: float):
    """A box with these edges as an obj file."""
    lines = []
    for line in BAR_OBJ.splitlines():
        word, *numbers = line.split()
        scaled = [f"{float(n) * e:.9g}" for n, e in zip(numbers, (x, y, z), strict=False)] if word == "v" else numbers
        lines.append(" ".join([word, *scaled]))
    path.write_text("\n".join(lines) + "\n")
    return path


SHAPES = {
    "cube": [[1, 1, 1]],
    "tiny": [[0.001, 0.001, 0.001]],
    "huge": [[1000, 1000, 1000]],
    "rod": [[2, 0.05, 0.05]],
    "upright rod": [[0.05, 2, 0.05]],
    "ten": [[0.2, 0.2, 0.2]] * 10,
    "large and small": [[4, 4, 4], [0.4, 0.4, 0.4]],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_layout_is_affordable_and_holds_the_solids_apart(shape):
    edges = np.array(SHAPES[shape], float)
    layout = new_layout.lay_out(edges)
    assert layout.cells <= 1.1 * new_layout.MAX_CELLS
    assert 48 <= layout.frames <= 480
    low, high = layout.centers - edges / 2, layout.centers + edges / 2
    assert (low[:, 1] > 0).all() and (high[:, 1] < layout.size[1]).all()
    for axis in (0, 2):
        assert (low[:, axis] > -layout.size[axis] / 2).all() and (high[:, axis] < layout.size[axis] / 2).all()
    assert (low[1:, 0] > high[:-1, 0]).all()
    # The fall from rest to the floor is seen.
    drop = float(low[:, 1].min())
    assert (2 * drop / EARTH_GRAVITY) ** 0.5 < layout.frames / layout.fps


def test_layout_does_not_depend_on_the_size_but_for_its_clock():
    small, large = (new_layout.lay_out(np.full((1, 3), size)) for size in (0.004, 0.4))
    assert small.cells == pytest.approx(large.cells, rel=0.2)
    assert small.size / 0.004 == pytest.approx(large.size / 0.4, rel=0.05)
    assert small.fps > large.fps == 24
    assert small.moduli[0] == pytest.approx(large.moduli[0] / 100, rel=0.05)  # as heavy for their stiffness


def test_finer_where_thin_and_coarser_where_there_is_much():
    cube, rod, ten = (new_layout.lay_out(np.array(SHAPES[name], float)) for name in ("cube", "rod", "ten"))
    assert rod.voxel < 2 / 24 and rod.voxel < cube.voxel
    assert ten.voxel > new_layout.lay_out(np.array(SHAPES["ten"][:1], float)).voxel


@pytest.mark.parametrize(
    ("edges", "words"),
    [
        ((1, 0, 1), "the mesh is flat, without extent along y: a solid needs a volume"),
        ((1, 0, 0), "the mesh is flat, without extent along y and z"),
        ((1, 0.001, 1), "cannot be simulated at voxel size"),
        ((12, 0.05, 0.05), "too thin for this voxel size"),
    ],
)
def test_new_refuses_what_simulate_refuses_and_leaves_nothing(cli, tmp_path, edges, words):
    write_box(tmp_path / "box.obj", *edges)
    done = cli("new", "shot.usda", "--solid", "box.obj")
    assert done.returncode == 3, done.stdout
    error = without_progress(done.stderr)
    assert error.startswith("error: box.obj: ") and words in error and error.count("box.obj") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["box.obj"]


def test_new_refuses_a_solid_too_small_beside_another(cli, tmp_path):
    write_box(tmp_path / "speck.obj", 0.001, 0.001, 0.001)
    write_box(tmp_path / "house.obj", 10, 10, 10)
    done = cli("new", "shot.usda", "--solid", "house.obj", "--solid", "speck.obj")
    error = without_progress(done.stderr)
    assert done.returncode == 3 and error.startswith("error: speck.obj: cannot be simulated"), done.stderr


def test_new_says_what_simulate_will_warn_of(cli, tmp_path):
    write_box(tmp_path / "rod.obj", 3, 0.05, 0.05)
    done = cli("new", "shot.usda", "--solid", "rod.obj")
    assert done.returncode == 0 and "warning: /World/Rod (rod.obj): the thinnest feature" in done.stderr, done.stderr


def test_new_for_a_tiny_thing_is_slow_motion(cli, tmp_path):
    write_obj(tmp_path / "ball.obj", 0.0005)
    done = cli("new", "shot.usda", "--solid", "ball.obj")
    assert done.returncode == 0 and "slow motion, 1:" in done.stdout, done.stderr
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() > 24
    run = cli("simulate", "shot.usda", "--frames", "1-2", "--progress", "none")
    assert run.returncode == 0, run.stderr


def write_boxes(path, *boxes: tuple[str, float, float]):
    """An obj file with cubes: (line before each, where it begins along x, its edge)."""
    lines = []
    for number, (head, low, edge) in enumerate(boxes):
        lines += [head] if head else []
        for line in BAR_OBJ.splitlines():
            word, *numbers = line.split()
            if word == "v":
                numbers = [f"{float(n) * edge + (low if axis == 0 else 0):.6g}" for axis, n in enumerate(numbers)]
            else:
                numbers = [str(int(n) + 8 * number) for n in numbers]
            lines.append(" ".join([word, *numbers]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def solids_of(scene) -> dict[str, int]:
    """{path: number of points} of the solids that are Meshes."""
    stage = Usd.Stage.Open(str(scene))
    solids = [prim for prim in stage.Traverse() if "EulerFsiSolidAPI" in prim.GetAppliedSchemas()]
    return {str(p.GetPath()): len(UsdGeom.Mesh(p).GetPointsAttr().Get() or ()) for p in solids}


def test_solids_have_the_names_of_the_objects_and_run(cli, tmp_path):
    """Names that USD does not take are shown; those that come again are told apart; shells of an object are one."""
    write_boxes(
        tmp_path / "toys.obj",
        ("o Big ball", 0.0, 0.2),
        ("o Big_ball", 0.5, 0.2),
        ("o 3. Würfel", 1.0, 0.2),
        ("", 1.05, 0.05),  # another shell of the same object
        ("o Big ball", 1.5, 0.2),
        ("o Domain", 2.0, 0.2),
    )
    done = cli("new", "shot.usda", "--solid", "toys.obj", "--smoke", "none")
    assert done.returncode == 0 and "5 solid(s)" in done.stdout, done.stderr
    names = ["Big_ball", "Big_ball2", "_3__W_rfel", "Big_ball3", "Domain2"]  # the box is the only Domain
    assert list(solids_of(tmp_path / "shot.usda").items()) == [
        (f"/World/Toys/{name}", 16 if name.startswith("_3") else 8) for name in names
    ]
    scene = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    shown = [child.GetDisplayName() for child in scene.GetPrimAtPath("/World/Toys").GetChildren()]
    assert shown == ["Big ball", "Big_ball", "3. Würfel", "Big ball", "Domain"]
    run = cli("simulate", "shot.usda", "--frames", "1-2", "--set", "Domain.voxelSize=0.05", "--progress", "none")
    assert run.returncode == 0, run.stderr
    cache = Usd.Stage.Open(str(tmp_path / "shot_cache" / "shot.usda"))
    points = UsdGeom.Mesh(cache.GetPrimAtPath("/World/Toys/Big_ball3")).GetPointsAttr()
    assert len(points.Get(2)) == 8 and points.Get(2) != points.Get(1)


def test_groups_are_objects_where_a_file_has_no_others_and_halves_of_one_surface_are_one(cli, tmp_path):
    half = "usemtl metal\ng ball_bottom\n"
    lines = write_boxes(tmp_path / "maya.obj", ("g pCube1", 0.0, 0.2), ("g pCube2", 0.5, 0.2)).read_text().splitlines()
    lines.insert(lines.index("f 1 3 7 5"), half.strip())  # a group within the first cube: two open halves
    (tmp_path / "maya.obj").write_text("\n".join(lines) + "\n")
    assert cli("new", "maya.usda", "--solid", "maya.obj").returncode == 0
    assert solids_of(tmp_path / "maya.usda") == {"/World/Maya/pCube1": 8, "/World/Maya/pCube2": 8}


def test_an_object_that_cannot_be_simulated_is_refused_by_its_name(cli, tmp_path):
    write_boxes(tmp_path / "duck.obj", ("o body", 0.0, 0.4), ("o left eye", 0.3, 0.3))
    done = cli("new", "duck.usda", "--solid", "duck.obj")
    assert done.returncode == 3 and not (tmp_path / "duck.usda").exists()
    error = without_progress(done.stderr)
    assert error.startswith('error: duck.obj: object "body" and duck.obj: object "left eye": the solids overlap by 0.1')
    assert "move them apart, or make one solid of a file with --join" in error
    done = cli("new", "duck.usda", "--solid", "duck.obj", "--join")
    assert done.returncode == 0 and solids_of(tmp_path / "duck.usda") == {"/World/Duck": 0}  # it refers to the file
    assert cli("new", "other.usda", "--from-usd", "duck.usda", "--join").returncode == 2
    write_boxes(tmp_path / "crumb.obj", ("o house", 0.0, 10.0), ("o speck", 12.0, 0.001))
    done = cli("new", "crumb.usda", "--solid", "crumb.obj")
    assert done.returncode == 3 and 'error: crumb.obj: object "speck": cannot be simulated at' in done.stderr


def test_more_objects_than_a_scene_takes_are_refused(cli, tmp_path):
    write_boxes(tmp_path / "many.obj", *((f"o s{n}", 0.2 * n, 0.1) for n in range(256)))
    done = cli("new", "many.usda", "--solid", "many.obj")
    assert done.returncode == 3 and "many.obj: 256 objects: must be at most 255; --join makes one" in done.stderr


def test_flat_objects_are_left_out_with_a_warning(cli, tmp_path):
    path = write_boxes(tmp_path / "room.obj", ("o Ball", 0.0, 0.2))
    path.write_text(path.read_text() + "o Ground\nv -1 -1 0\nv 1 -1 0\nv 0 -1 1\nf 9 10 11\n")
    done = cli("new", "room.usda", "--solid", "room.obj")
    assert done.returncode == 0, done.stderr
    assert 'warning: room.obj: object "Ground" is flat, without extent along y: it is left out' in done.stderr
    assert solids_of(tmp_path / "room.usda") == {"/World/Room/Ball": 8}


def test_pieces_are_solids_where_a_file_names_no_object_and_stay_where_they_are(cli, tmp_path):
    write_boxes(tmp_path / "two.obj", ("", 0.0, 0.2), ("", 0.5, 0.3), ("", 0.6, 0.05))
    done = cli("new", "shot.usda", "--solid", "two.obj", "--smoke", "none")
    assert done.returncode == 0 and "2 solid(s)" in done.stdout, done.stderr
    assert "SeparatePieces" not in done.stderr and "do not touch" not in done.stderr
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    parts = stage.GetPrimAtPath("/World/Two").GetChildren()
    assert [len(UsdGeom.Mesh(part).GetPointsAttr().Get()) for part in parts] == [8, 16]
    boxes = [np.array(UsdGeom.Mesh(part).GetExtentAttr().Get()) for part in parts]
    assert boxes[0][:, 0] == pytest.approx([0.0, 0.2]) and boxes[1][:, 0] == pytest.approx([0.5, 0.8])
    moduli = [part.GetAttribute("eulerfsi:youngsModulus").Get() for part in parts]
    assert moduli[1] == pytest.approx(1.5 * moduli[0], rel=0.05)


def test_crumbs_stay_with_the_nearest_object():
    meshes = []
    for place, edge in ((0.0, 1.0), (3.0, 1.0), (4.5, 0.02)):
        corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * edge
        meshes.append(corners + [place, 0, 0])
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    indices = np.concatenate([faces.ravel() + 8 * number for number in range(3)])
    parts = new_pieces.split(Mesh(np.concatenate(meshes), np.full(18, 4), indices))
    assert [len(part.points) for part in parts] == [8, 16]
    assert parts[1].points[:, 0].min() == 3.0 and parts[1].points[:, 0].max() == pytest.approx(4.52)


def test_units_and_up_axis_are_those_of_file_and_scene(cli, tmp_path):
    write_box(tmp_path / "small.obj", 0.1, 0.32, 0.2)  # metres, y up
    write_box(tmp_path / "large.obj", 10, 20, 32)  # centimetres, z up
    options = ("--smoke", "carpet")
    assert cli("new", "m.usda", "--solid", "small.obj", *options).returncode == 0
    done = cli("new", "cm.usda", "--solid", "large.obj", "--units", "cm", "--up-axis", "z", *options)
    assert done.returncode == 0, done.stderr
    metres, centimetres = (Usd.Stage.Open(str(tmp_path / f"{name}.usda")) for name in ("m", "cm"))
    assert UsdGeom.GetStageMetersPerUnit(centimetres) == 0.01 and UsdGeom.GetStageUpAxis(centimetres) == "Z"
    boxes = []
    for stage, unit, axes in ((metres, 1.0, [0, 1, 2]), (centimetres, 0.01, [0, 2, 1])):
        purposes = ["default", "guide"]
        cache = UsdGeom.BBoxCache(1, purposes)
        domain, carpet = (
            cache.ComputeWorldBound(stage.GetPrimAtPath(f"/World/{name}")).ComputeAlignedRange()
            for name in ("Domain", "Carpet")
        )
        boxes.append([np.array(end)[axes] * unit for r in (domain, carpet) for end in (r.GetSize(), r.GetMidpoint())])
        gravity = stage.GetPrimAtPath("/World/PhysicsScene")
        assert gravity.GetAttribute("physics:gravityMagnitude").Get() * unit == pytest.approx(9.81)
        assert gravity.GetAttribute("physics:gravityDirection").Get()[axes[1]] == -1
    for a, b in zip(*boxes, strict=True):
        assert a == pytest.approx(b, abs=1e-6)
    first, second = (cli("validate", f"{name}.usda", "--json") for name in ("m", "cm"))
    first, second = (json.loads(done.stdout)["parameters"] for done in (first, second))
    assert first["/World/Domain"]["voxel_size"] == pytest.approx(second["/World/Domain"]["voxel_size"])
    assert first["/World/Small"]["youngs_modulus"] == pytest.approx(second["/World/Large"]["youngs_modulus"])


def test_values_have_comments_that_say_what_they_do(cli, tmp_path):
    write_obj(tmp_path / "ball.obj", 0.2)
    assert cli("new", "shot.usda", "--solid", "ball.obj").returncode == 0
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    for prim in stage.Traverse():
        for attribute in prim.GetAuthoredPropertiesInNamespace("eulerfsi"):
            assert attribute.GetMetadata("comment"), attribute.GetPath()
    assert "Young's modulus, always in pascal" in (tmp_path / "shot.usda").read_text()


def test_a_usd_file_gets_a_domain_and_its_meshes_become_solids(cli, tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "asset.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, "Z")
    points, counts, indices = sphere(10.0)
    for name, x in (("A", 0), ("B", 30)):
        mesh = UsdGeom.Mesh.Define(stage, f"/Things/{name}")
        mesh.CreatePointsAttr(points)
        mesh.CreateFaceVertexCountsAttr(counts)
        mesh.CreateFaceVertexIndicesAttr(indices)
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.AddTranslateOp().Set((x, 0, 50))
    flat = UsdGeom.Mesh.Define(stage, "/Things/Ground")
    flat.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    stage.SetDefaultPrim(stage.GetPrimAtPath("/Things"))
    stage.Save()
    done = cli("new", "shots/shot.usda", "--from-usd", "asset.usda")
    assert done.returncode == 0 and "2 solid(s)" in done.stdout, done.stderr
    facts = json.loads(cli("validate", "shots/shot.usda", "--json").stdout)
    assert {"/Things/A", "/Things/B"} <= facts["parameters"].keys() and "/Things/Ground" not in facts["parameters"]
    assert facts["meters_per_unit"] == 0.01 and facts["parameters"]["/EulerFsi/Domain"]["gravity"][2] == pytest.approx(
        -9.81
    )
    run = cli("simulate", "shots/shot.usda", "--frames", "1-2", "--set", "Domain.voxelSize=3", "--progress", "none")
    assert run.returncode == 0, run.stderr
    again = cli("new", "other.usda", "--from-usd", "shots/shot.usda")
    assert again.returncode == 3 and "has a domain, /EulerFsi/Domain" in again.stderr
    both = cli("new", "other.usda", "--from-usd", "asset.usda", "--units", "cm")
    assert both.returncode == 2 and not (tmp_path / "other.usda").exists()
    assert "metersPerUnit" not in done.stderr
    stage.ClearMetadata("metersPerUnit")
    stage.Save()
    shared = Usd.Stage.CreateNew(str(tmp_path / "shared.usda"))
    shared.DefinePrim("/Copy").GetReferences().AddReference("./asset.usda")
    shared.GetPrimAtPath("/Copy").SetInstanceable(True)
    shared.Save()
    inside = cli("new", "other.usda", "--from-usd", "shared.usda")
    assert inside.returncode == 3 and "lies in an instance: /Copy needs instanceable = false" in inside.stderr
    silent = cli("new", "other.usda", "--from-usd", "asset.usda")
    assert silent.returncode == 0 and "metersPerUnit is not authored: a unit counts as 0.01 m" in silent.stderr


def test_a_usd_file_of_the_standard_keeps_its_bodies(cli, tmp_path):
    stage = new_stage(tmp_path / "asset.usda")
    add_body(stage)
    stage.RemovePrim("/World/Domain")
    stage.Save()
    refused = cli("simulate", "asset.usda")
    assert refused.returncode == 3
    line = refused.stderr.split("to add one: ")[1].strip().split()
    done = cli(*line[line.index("new") :])
    assert done.returncode == 0 and "1 solid(s)" in done.stdout, done.stderr
    facts = json.loads(cli("validate", "asset_fsi.usda", "--json").stdout)
    assert facts["parameters"]["/World/Jelly"]["youngs_modulus"] == 1e6 and facts["last"] == 3


def test_a_usd_file_with_instances_gets_a_box_around_them(cli, tmp_path):
    stage = new_stage(tmp_path / "asset.usda")
    add_body(stage, "/World/Library/Block")
    UsdGeom.Xform.Define(stage, "/World/Library").CreateVisibilityAttr("invisible")
    many = UsdGeom.PointInstancer.Define(stage, "/World/Many")
    many.CreatePrototypesRel().SetTargets(["/World/Library/Block"])
    many.CreateProtoIndicesAttr([0, 0])
    many.CreatePositionsAttr([(1, 0, 0), (2, 0, 0)])
    stage.RemovePrim("/World/Domain")
    stage.Save()
    done = cli("new", "shot.usda", "--from-usd", "asset.usda")
    assert done.returncode == 0 and "2 solid(s)" in done.stdout, done.stderr
    shot = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    bound = UsdGeom.BBoxCache(1, ["guide"]).ComputeWorldBound(shot.GetPrimAtPath("/EulerFsi/Domain"))
    low, high = bound.ComputeAlignedRange().GetMin()[0], bound.ComputeAlignedRange().GetMax()[0]
    assert 0 < low < 0.9 and 2.1 < high < 3
