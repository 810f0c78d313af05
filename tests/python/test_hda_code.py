"""The Python code of the Houdini asset, against a substitute for `hou`; USD, the checks and the solver are real."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import substitute_hou
from dialog_script import FOLDER, PARMS, section
from eulerfsi_usd import checks
from eulerfsi_usd.given import targets
from eulerfsi_usd.parameters import load
from eulerfsi_usd.presets import values_of
from pxr import Gf, Usd, UsdGeom, UsdPhysics
from substitute_hou import Geometry, ObjNode, ParmTuple, Polygon, Prim, SopNode

ROOT = FOLDER.parent
TETRAHEDRON = np.array([(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)])
CLOCKWISE = ((1, 2, 0), (3, 1, 0), (2, 3, 0), (3, 2, 1))  # as Houdini's polygons turn


def test_the_substitute_has_the_names_and_arguments_of_the_stubs() -> None:
    count = 0
    for cls in substitute_hou.CLASSES:
        assert substitute_hou.stub_class(cls.__name__), cls
        for name, member in vars(cls).items():
            if name.startswith("_") or not callable(getattr(cls, name)):
                continue
            stub = substitute_hou.stub_of(f"{cls.__name__}.{name}")
            assert stub is not None, (cls, name)
            function = member.__func__ if isinstance(member, staticmethod) else member
            theirs = [argument.arg for argument in stub.args.args]
            assert [word for word in inspect.signature(function).parameters if word not in theirs] == [], (cls, name)
            count += 1
    assert count > 30
    for name, function in substitute_hou.FUNCTIONS.items():
        stub = substitute_hou.stub_of(name)
        assert (
            list(inspect.signature(function).parameters)
            == [argument.arg for argument in stub.args.args][: len(inspect.signature(function).parameters)]
        )


def test_a_result_of_another_kind_is_refused() -> None:
    """As in the days when the substitute gave a tuple for vertices, whose real iterator cannot be reversed."""
    assert substitute_hou.fits(iter(()), "Iterator[Vertex]") and not substitute_hou.fits((), "Iterator[Vertex]")
    with pytest.raises(TypeError):
        reversed(Polygon(0, (1, 2)).vertices())
    wrong = substitute_hou.checked("Prim.vertices", lambda prim: ())
    with pytest.raises(TypeError, match=r"hou\.Prim\.vertices returned tuple, the stub says Iterator\[Vertex\]"):
        wrong(None)
    with pytest.raises(TypeError, match="the stub says nothing"):
        substitute_hou.checked("Prim.nothing", lambda: None)()


@pytest.mark.slow
def test_mypy_finds_nothing_and_finds_what_is_put_in(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(tmp_path)]
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import hou\n\n\ndef turned(prim: hou.Prim) -> object:\n    return reversed(prim.vertices())\n")
    run = subprocess.run([*words, "houdini_hda/python", str(wrong)], cwd=ROOT, capture_output=True, text=True)
    lines = [line for line in run.stdout.splitlines() if "error:" in line]
    assert [line for line in lines if "wrong.py" not in line] == [], run.stderr
    assert lines and all("reversed" in line for line in lines), run.stdout + run.stderr


# ------------------------------------------------------------------------------------------------------------- nodes


def shape(*shifts: tuple[float, float, float], groups: dict | None = None, **attributes: list[str]) -> Geometry:
    """A tetrahedron at each place; attributes: a value for each of them."""
    points = np.concatenate([TETRAHEDRON + np.array(shift) for shift in shifts])
    prims = [[4 * k + number for number in face] for k in range(len(shifts)) for face in CLOCKWISE]
    spread = {name: [value for value in values for _ in CLOCKWISE] for name, values in attributes.items()}
    return Geometry(points, [Polygon(n, face) for n, face in enumerate(prims)], groups or {}, **spread)


class Setup:
    """A solver node in an object that stands 0.1 m high, after OnCreated, with one emitter and one force."""

    def __init__(self, folder: Path, counts: dict[str, int] | None = None) -> None:
        self.object = ObjNode("/obj/geo1", lambda _time: (0.0, 0.1, 0.0))
        self.node = SopNode("/obj/geo1/solver1", self.object)
        self.counts = {"solids": 1, "emitters": 1, "forces": 1, "colliders": 1} | (counts or {})
        for name, (multiparm, parm) in PARMS.items():
            kind = parm["type"][0]
            convert = {"float": float, "vector": float, "integer": int, "toggle": int, "multiparm": int}.get(kind, str)
            for number in range(1, self.counts[multiparm] + 1) if multiparm else (0,):
                values = [convert(word) for word in parm["default"]]
                self.node._parms[name.replace("#", str(number))] = ParmTuple(values)
        for name, count in self.counts.items():
            self.put(name, count)
        exec(compile(section("OnCreated"), "OnCreated", "exec"), {"kwargs": {"node": self.node}})
        self.put("scene", str(folder / "sub" / "scene.usda"))
        self.put("output", str(folder / "cache"))
        self.connect(0, shape((0, 0, 0)))

    def put(self, name: str, *values: object) -> None:
        self.node._parms[name].set(values)

    def key(self, name: str, keys: dict[int, tuple]) -> None:
        self.node._parms[name]._keys = keys

    def connect(self, index: int, geometry) -> None:
        """Geometry, or a function of the frame."""
        cook = geometry if callable(geometry) else lambda _frame: geometry
        self.node._inputs[index] = SopNode(f"/obj/geo1/in{index}", self.object, cook)

    def sop(self, path: str, geometry) -> str:
        """Another SOP, in the same object."""
        cook = geometry if callable(geometry) else lambda _frame: geometry
        self.node._nodes[path] = SopNode(path, self.object, cook)
        return path

    def value(self, name: str):
        return self.node._parms[name].eval()[0]

    @property
    def kwargs(self) -> dict:
        return {"node": self.node}


@pytest.fixture
def hou(monkeypatch) -> types.ModuleType:
    made = substitute_hou.module()
    monkeypatch.setitem(sys.modules, "hou", made)
    monkeypatch.syspath_prepend(str(FOLDER / "python"))
    for name in [name for name in sys.modules if name.split(".")[0] == "eulerfsi_houdini"]:
        monkeypatch.delitem(sys.modules, name)
    return made


@pytest.fixture
def asset(hou) -> types.ModuleType:
    """PythonModule of the asset."""
    code = types.ModuleType("PythonModule")
    exec(compile(section("PythonModule"), "PythonModule", "exec"), code.__dict__)
    return code


@pytest.fixture
def stage_of(asset):
    return lambda setup: importlib.import_module("eulerfsi_houdini.scene").make_stage(setup.node)


@pytest.fixture
def setup(tmp_path: Path, asset) -> Setup:
    return Setup(tmp_path)


def points_of(stage: Usd.Stage, path: str, frame: float) -> np.ndarray:
    """World space."""
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(path))
    matrix = mesh.ComputeLocalToWorldTransform(frame)
    return np.array([matrix.Transform(Gf.Vec3d(point)) for point in mesh.GetPointsAttr().Get(frame)])


# ------------------------------------------------------------------------------------------------------------- scenes


def test_a_new_node_makes_a_valid_scene_with_every_parameter(asset, setup: Setup) -> None:
    setup.connect(2, shape((0.2, -0.3, 0)))
    setup.put("solid1_velocity", 1.0, -2.0, 3.0)
    setup.put("solid1_density", 700.0)
    stage = Usd.Stage.Open(asset.save_scene(setup.kwargs))
    assert checks.check_stage(stage) == []
    names = {"domain": "Domain", "solid": "Solid1", "emitter": "Emitter1", "force": "Force1", "collider": "Collider1"}
    prims = {scope: stage.GetPrimAtPath(f"/World/{name}") for scope, name in names.items()}
    for scope, prim in prims.items():
        for row in load()[scope].values():
            assert prim.GetAttribute(row.attribute).HasAuthoredValue() == (row.type != "asset"), row.name
    assert prims["solid"].GetAttribute("eulerfsi:velocity").Get() == Gf.Vec3d(1, -2, 3)
    assert prims["solid"].GetAttribute("physics:density").Get() == 700.0
    assert prims["domain"].GetAttribute("eulerfsi:voxelSize").Get() == load()["domain"]["voxelSize"].default
    gravity = UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene")).GetGravityMagnitudeAttr().Get()
    assert gravity == pytest.approx(9.81, rel=1e-6)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (1, 48, 24)


def test_mesh_turns_outwards_and_lies_where_the_object_is(stage_of, setup: Setup) -> None:
    stage = stage_of(setup)
    mesh, points = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Solid1")), points_of(stage, "/World/Solid1", 1)
    indices = list(mesh.GetFaceVertexIndicesAttr().Get())
    faces = [points[indices[k : k + 3]] for k in range(0, len(indices), 3)]
    assert sum(np.dot(a, np.cross(b, c)) for a, b, c in faces) / 6 == pytest.approx(0.2**3 / 6.0, rel=1e-6)
    assert np.allclose(points, TETRAHEDRON + [0, 0.1, 0], atol=1e-7)


def test_pieces_have_names_or_are_connected_polygons(stage_of, tmp_path: Path) -> None:
    setup = Setup(tmp_path, {"solids": 2})
    setup.connect(0, shape((0, 0, 0), (0.3, 0, 0), (0, 0.3, 0), name=["jelly cube", "left", "right"]))
    setup.put("solid1_name", "l* r*")
    setup.put("solid1_youngsModulus", 5000.0)
    stage = stage_of(setup)
    moduli = {
        prim.GetName(): prim.GetAttribute("eulerfsi:youngsModulus").Get()
        for prim in stage.GetPrimAtPath("/World").GetChildren()
        if prim.HasAPI("EulerFsiSolidAPI")
    }
    assert moduli == {"left": 5000.0, "right": 5000.0, "jelly_cube": load()["solid"]["youngsModulus"].default}
    setup.connect(0, shape((0, 0, 0), (0.3, 0, 0)))
    setup.put("solid1_name", "*")
    setup.put("solid2_path", setup.sop("/obj/geo1/other", shape((0, 0.3, 0))))
    stage = stage_of(setup)
    names = [prim.GetName() for prim in stage.Traverse() if prim.HasAPI("EulerFsiSolidAPI")]
    assert names == ["Solid1_1", "Solid1_2", "Solid2"]
    assert np.allclose(points_of(stage, "/World/Solid1_2", 1)[0], (0.3, 0.1, 0), atol=1e-7)


def test_velocity_from_animation(stage_of, setup: Setup) -> None:
    setup.connect(0, lambda frame: shape((0.05 * (frame - 1), 0, 0)))
    setup.put("solid1_inherit", 1)
    stage = stage_of(setup)
    prim = stage.GetPrimAtPath("/World/Solid1")
    moved = points_of(stage, "/World/Solid1", 1) - points_of(stage, "/World/Solid1", 0)
    assert np.allclose(moved, (0.05, 0, 0), atol=1e-6)
    assert not any(prim.GetAttribute(f"eulerfsi:{name}").HasAuthoredValue() for name in ("velocity", "angularVelocity"))


def turned(frame: float) -> np.ndarray:
    angle = 0.1 * (frame - 1)
    return np.array([(np.cos(angle), np.sin(angle), 0), (-np.sin(angle), np.cos(angle), 0), (0, 0, 1)])


def spun(frame: float) -> Geometry:
    """Turns about z and moves along x."""
    points = TETRAHEDRON @ turned(frame) + (0.2 + 0.01 * frame, 0, 0)
    return Geometry(points, [Polygon(n, face) for n, face in enumerate(CLOCKWISE)], {})


def test_a_collider_that_moves_rigidly_has_a_transform_one_that_bends_has_points(stage_of, setup: Setup) -> None:
    setup.connect(2, spun)
    stage = stage_of(setup)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Collider1"))
    assert not mesh.GetPointsAttr().ValueMightBeTimeVarying()
    for frame in (1, 7, 48):
        there = TETRAHEDRON @ turned(frame) + (0.2 + 0.01 * frame, 0.1, 0)
        assert np.abs(points_of(stage, "/World/Collider1", frame) - there).max() < 1e-6
    prims = [Polygon(n, face) for n, face in enumerate(CLOCKWISE)]
    setup.connect(2, lambda frame: Geometry(TETRAHEDRON * (1 + 0.01 * (frame - 1)) + (0.3, 0, 0), prims, {}))
    stage = stage_of(setup)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Collider1"))
    assert mesh.GetPointsAttr().GetNumTimeSamples() == 48 and not mesh.GetOrderedXformOps()
    assert np.allclose(points_of(stage, "/World/Collider1", 11)[1], (0.52, 0.1, 0), atol=1e-6)


def test_pins_by_points_and_by_the_second_input(asset, stage_of, setup: Setup) -> None:
    setup.connect(0, shape((0, 0, 0), (0.3, 0, 0), groups={"pin": [0, 2]}, name=["a", "b"]))
    hand = ObjNode("/obj/hand", lambda time: (24.0 * time, 0.0, 0.0))
    setup.node._nodes["/obj/hand"] = hand
    setup.put("solid1_pinTo", "/obj/hand")
    setup.connect(1, shape((0.32, -0.02, 0.02)))
    stage = stage_of(setup)
    a, b = (stage.GetPrimAtPath(f"/World/{name}") for name in "ab")
    assert list(UsdGeom.PrimvarsAPI(a).GetPrimvar("eulerfsi:pin").Get()) == [1, 0, 1, 0]
    assert not UsdGeom.PrimvarsAPI(b).GetPrimvar("eulerfsi:pin")
    (path,) = targets(a, "eulerfsi:pinTo")
    place = UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(5).ExtractTranslation()
    assert place == Gf.Vec3d(4, 0, 0)
    assert targets(a, "eulerfsi:pins") == [] and [p.name for p in targets(b, "eulerfsi:pins")] == ["Pin"]
    setup.connect(1, shape((0.32, -0.02, 0.02), solid=["a b"]))
    stage = stage_of(setup)
    assert [len(targets(stage.GetPrimAtPath(f"/World/{name}"), "eulerfsi:pins")) for name in "ab"] == [1, 1]


def test_passengers_ride_on_a_solid_and_on_a_collider(stage_of, setup: Setup) -> None:
    setup.put("solid1_passengers", setup.sop("/obj/geo1/eyes", shape((0, 0, 0), (0.1, 0, 0), name=["left", "right"])))
    setup.connect(2, shape((0.3, 0, 0)))
    setup.put("collider1_passengers", setup.sop("/obj/geo1/knob", shape((0.3, 0, 0))))
    stage = stage_of(setup)
    named = {
        prim: targets(stage.GetPrimAtPath(f"/World/{prim}"), "eulerfsi:passengers") for prim in ("Solid1", "Collider1")
    }
    assert {prim: [path.name for path in paths] for prim, paths in named.items()} == {
        "Solid1": ["left", "right"],
        "Collider1": ["Collider1_Passenger"],
    }
    assert checks.check_stage(stage) == []


def test_surface_file_and_emitters_of_other_shapes(asset, tmp_path: Path) -> None:
    setup = Setup(tmp_path, {"emitters": 2})
    setup.node._inputs.clear()
    setup.put("solid1_surfaceFile", __file__)
    setup.put("emitter1_shape", "Sphere")
    setup.put("emitter2_shape", "Mesh")
    setup.put("emitter2_path", setup.sop("/obj/geo1/smoke", shape((-0.2, 0, 0), (0.1, 0, 0))))
    stage = Usd.Stage.Open(asset.save_scene(setup.kwargs))
    kinds = [stage.GetPrimAtPath(f"/World/{name}").GetTypeName() for name in ("Solid1", "Emitter1", "Emitter2")]
    assert kinds == ["Xform", "Sphere", "Mesh"]
    assert len(points_of(stage, "/World/Emitter2", 1)) == 8 and checks.check_stage(stage) == []


def test_keyframes_of_values_that_may_have_them(stage_of, setup: Setup) -> None:
    setup.key("emitter1_enabled", {frame: (int(frame < 10),) for frame in range(1, 49)})
    setup.key("emitter1_center", {frame: (0.01 * frame, 0.0, 0.0) for frame in range(1, 49)})
    setup.key("solid1_youngsModulus", {frame: (1000.0 * frame,) for frame in range(2, 49)})
    stage = stage_of(setup)
    emitter = stage.GetPrimAtPath("/World/Emitter1")
    enabled = emitter.GetAttribute("eulerfsi:enabled")
    assert [enabled.Get(frame) for frame in (1, 9, 10, 48)] == [True, True, False, False]
    place = UsdGeom.Xformable(emitter).ComputeLocalToWorldTransform(20).ExtractTranslation()
    assert place == Gf.Vec3d(0.2, 0, 0)
    assert stage.GetPrimAtPath("/World/Solid1").GetAttribute("eulerfsi:youngsModulus").GetNumTimeSamples() == 0


def test_a_name_in_the_menu_of_a_number_takes_its_place(stage_of, setup: Setup) -> None:
    def tolerance() -> float:
        stage = stage_of(setup)
        return stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:stepTolerance").Get()

    setup.put("stepTolerance", 0.3)
    assert setup.value("stepToleranceName") == "custom" and tolerance() == 0.3
    for name, value in load()["domain"]["stepTolerance"].names.items():
        setup.put("stepToleranceName", name)
        assert tolerance() == value


def test_a_preset_sets_values_for_the_size_of_the_solid(asset, setup: Setup) -> None:
    setup.connect(0, lambda _frame: Geometry(TETRAHEDRON * 3, [Polygon(0, face) for face in CLOCKWISE], {}))
    setup.put("solid1_velocity", 1.0, 0.0, 0.0)
    setup.put("solid1_plasticYieldStress", 7.0)
    setup.put("solid1_preset", "rubber")
    asset.take_preset(setup.kwargs | {"parm_name": "solid1_preset"})
    values = values_of("rubber", 0.6)
    assert values["youngsModulus"] == 240000.0 and values["plasticYieldStress"] == 0.0
    assert {name: setup.value(f"solid1_{name}") for name in values} == values
    assert setup.value("solid1_velocity") == 1.0
    setup.put("solid1_preset", "custom")
    setup.put("solid1_density", 5.0)
    asset.take_preset(setup.kwargs | {"parm_name": "solid1_preset"})
    assert setup.value("solid1_density") == 5.0


# -------------------------------------------------------------------------------------------------------------- faults

OPEN = Geometry(TETRAHEDRON, [Polygon(0, CLOCKWISE[0]), Prim(1, ())], {})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.put("size", 0.0, 1.0, 1.0), "/World/Domain.eulerfsi:size = (0, 1, 1): must be > 0 in every"),
        (lambda s: s.put("solid1_youngsModulus", -1.0), "/World/Solid1.eulerfsi:youngsModulus = -1: must be > 0"),
        (lambda s: s.put("solid1_path", "/obj/nothing"), "solver1.solid1_path = /obj/nothing: is no SOP"),
        (lambda s: s.node._inputs.clear(), "solver1.solid1_path: no polygons: connect input 1, or name a SOP"),
        (lambda s: s.connect(0, OPEN), "solver1, input 1: primitive 1 is no closed polygon"),
        (lambda s: s.connect(0, lambda _frame: None), "solver1, input 1: does not cook at frame 1"),
        (lambda s: s.put("solid1_name", "x*"), "no entry of the tab Solids takes: without a name"),
        (lambda s: s.put("framerange", 5, 5), "solver1.framerange: the last frame must be after the first"),
        (lambda s: s.connect(1, shape((2, 2, 2))), "input 2: the pin without a name: meets no solid"),
        (lambda s: s.connect(1, shape((0, 0, 0), solid=["b*"])), "input 2: the pin without a name: no solid is b*"),
        (
            lambda s: s.connect(1, lambda f: Geometry(TETRAHEDRON * f, shape((0, 0, 0)).prims(), {})),
            "the pin without a name bends in frame 2: pins must move rigidly",
        ),
        (
            lambda s: s.connect(2, lambda f: shape((0, 0, 0)) if f > 2 else shape((0, 0, 0), (0.4, 0, 0))),
            "input 3: has 4 points at frame 3: its points must not change",
        ),
        (lambda s: s.put("emitter1_shape", "Mesh"), "solver1.emitter1_path: name a SOP with closed polygons"),
        (lambda s: s.put("solid1_passengers", "/obj/no"), "solver1.solid1_passengers = /obj/no: is no SOP"),
    ],
)
def test_faulty_scene_is_reported_and_not_written(asset, hou, setup: Setup, change, message: str) -> None:
    change(setup)
    with pytest.raises(hou.NodeError, match=re.escape(message)):
        asset.save_scene(setup.kwargs)
    assert not Path(setup.value("scene")).exists()
    hou.isUIAvailable = lambda: True
    assert asset.save_scene(setup.kwargs) is None and message in hou.ui._shown[-1]


# ---------------------------------------------------------------------------------------------------------------- runs


def tool(folder: Path, script: str) -> str:
    """A command that does what the script says."""
    path = folder / "tool"
    path.write_text(f"#!{sys.executable}\nimport json, os, signal, sys, time\n{script}", encoding="utf-8")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(
    ("mode", "options"),
    [("new", []), ("overwrite", ["--overwrite"]), ("resume", ["--resume"]), ("rebake", ["--rebake-from", "12"])],
)
def test_background_starts_the_command_with_its_arguments(
    asset, setup: Setup, tmp_path: Path, monkeypatch, mode: str, options: list[str]
) -> None:
    monkeypatch.setenv("PYTHONPATH", "/houdini/python")
    setup.put("command", tool(tmp_path, "print(json.dumps(sys.argv[1:] + [os.environ.get('PYTHONPATH')]))"))
    setup.put("threads", 3)
    setup.put("mode", mode)
    setup.put("rebakefrom", 12)
    setup.put("options", "--half --path-map 'a b=c'")
    assert asset.execute_in_background(setup.kwargs).wait(timeout=60) == 0
    scene = setup.value("scene")
    told = json.loads(Path(scene).with_suffix(".events").read_text())
    expected = [
        "simulate",
        scene,
        "-o",
        setup.value("output"),
        "--frames",
        "1-48",
        "--progress",
        "json",
        "--threads",
        "3",
    ]
    assert told == [*expected, *options, "--half", "--path-map", "a b=c", None]


def test_a_missing_command_is_named(asset, hou, setup: Setup) -> None:
    setup.put("command", "/nowhere/eulerfsi")
    for run in (asset.execute, asset.execute_in_background, asset.validate):
        with pytest.raises(
            hou.NodeError, match=r"solver1\.command = /nowhere/eulerfsi: /nowhere/eulerfsi: No such file"
        ):
            run(setup.kwargs)


def solver(folder: Path) -> str:
    """The command line tool of this checkout."""
    code = f"sys.path[:0] = [{str(ROOT / 'batch')!r}, {str(ROOT / 'usd_plugin')!r}]\n"
    return tool(folder, f"{code}from eulerfsi.cli.main import main\nsys.exit(main(sys.argv[1:]))")


def small(folder: Path) -> Setup:
    """A tetrahedron that falls in smoke for two frames, on a coarse grid."""
    setup = Setup(folder, {"forces": 0})
    setup.put("command", solver(folder))
    setup.put("voxelSize", 0.05)
    setup.put("framerange", 1, 3)
    setup.put("threads", 1)
    return setup


def test_foreground_makes_a_cache_and_tells_tops_of_its_files(asset, hou, tmp_path: Path, capfd) -> None:
    setup = small(tmp_path)
    setup.put("pdg_logoutput", 1)
    asset.execute(setup.kwargs)
    lines = capfd.readouterr().out.splitlines()
    assert all(re.fullmatch(r"OUTPUT_FILE:.+;", line) for line in lines)
    files = [Path(line.removeprefix("OUTPUT_FILE:")[:-1]) for line in lines]
    assert files[0] == tmp_path / "cache" / "scene.usda" and all(file.is_file() for file in files)
    assert len([file for file in files if file.suffix == ".vdb"]) == 3
    assert hou.InterruptableOperation._seen[-1] == 1.0 == max(hou.InterruptableOperation._seen)
    setup.put("mode", "rebake")
    setup.put("rebakefrom", 1)
    setup.put("pdg_logoutput", 0)
    setup.put("solid1_youngsModulus", 9000.0)
    asset.execute(setup.kwargs)
    assert capfd.readouterr().out == ""
    assert Usd.Stage.Open(str(files[0])).GetEndTimeCode() == 3
    setup.put("mode", "resume")
    setup.put("framerange", 1, 4)
    asset.execute(setup.kwargs)
    manifest = json.loads((tmp_path / "cache" / "manifest.json").read_text())
    assert sorted(manifest["frames"]) == ["1", "2", "3", "4"]
    assert [stretch["last"] for stretch in manifest["stretches"]] == [1], "frame 1 is that of the first run"


def test_faults_of_the_solver_are_shown(asset, hou, tmp_path: Path) -> None:
    setup = small(tmp_path)
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "manifest.json").write_text("{}")
    with pytest.raises(hou.NodeError, match="cache"):
        asset.execute(setup.kwargs)
    setup.put("command", tool(tmp_path, "sys.exit(9)"))
    with pytest.raises(hou.NodeError, match=r"solver1: the solver ended with code 9: .*scene\.log"):
        asset.execute(setup.kwargs)


ENDLESS = """
def stop(*_):
    print(json.dumps({"event": "end", "status": "interrupted", "error": "stopped"}), flush=True)
    sys.exit(130)
signal.signal(signal.SIGINT, stop)
print("a line that is no event")
print(json.dumps({"event": "start", "first": 1, "last": 4}), flush=True)
print(json.dumps({"event": "step", "frame": 3, "fraction": 0.0}), flush=True)
time.sleep(60)
"""


def test_escape_stops_the_run(asset, hou, setup: Setup, tmp_path: Path) -> None:
    setup.put("command", tool(tmp_path, ENDLESS))
    hou.InterruptableOperation._stop_at = 0.5
    with pytest.raises(hou.OperationInterrupted):
        asset.execute(setup.kwargs)
    assert hou.InterruptableOperation._seen[-1] == 0.5


def test_background_shows_progress_and_can_be_cancelled(asset, hou, setup: Setup, tmp_path: Path, capsys) -> None:
    setup.put("command", tool(tmp_path, ENDLESS))
    hou.isUIAvailable = lambda: True
    process = asset.execute_in_background(setup.kwargs)
    (look,) = hou.ui._loop
    while "frame 3, 50 %" not in "".join(hou.ui._shown):
        assert process.poll() is None
        look()
    assert asset.execute_in_background(setup.kwargs) is None and "a run of this session writes" in hou.ui._shown[-1]
    asset.cancel(setup.kwargs)
    assert "stops with a checkpoint" in hou.ui._shown[-1] and process.wait(timeout=60) == 130
    look()
    assert hou.ui._loop == [] and hou.ui._shown[-1] == "/obj/geo1/solver1: stopped"
    hou.isUIAvailable = lambda: False
    asset.cancel(setup.kwargs)
    assert "no run of this machine" in capsys.readouterr().out


def test_a_run_of_another_session_is_cancelled_by_its_lock(asset, setup: Setup, tmp_path: Path, capsys) -> None:
    hold = "import fcntl\nfile = open(sys.argv[1], 'w')\nfcntl.flock(file, fcntl.LOCK_EX)\n"
    hold += "file.write(f'process {os.getpid()} on {os.uname().nodename}')\nfile.flush()\n"
    (tmp_path / "cache").mkdir()
    command = [tool(tmp_path, hold + ENDLESS), str(tmp_path / "cache" / ".lock")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for _ in range(3):
            process.stdout.readline()
        asset.cancel(setup.kwargs)
        assert f"process {process.pid} stops" in capsys.readouterr().out and process.wait(timeout=60) == 130


def test_validate_shows_what_the_solver_says(asset, hou, setup: Setup, tmp_path: Path, capsys) -> None:
    report = {"errors": [], "warnings": [{"message": "a thin feature"}], "notes": ["for layout"]}
    setup.put(
        "command", tool(tmp_path, f"assert sys.argv[1::2] == ['validate', '--json']\nprint({json.dumps(report)!r})")
    )
    asset.validate(setup.kwargs)
    assert capsys.readouterr().out == "The scene can be simulated.\nWarning: a thin feature\nNote: for layout\n"
    report["errors"] = [{"message": "two domains"}]
    setup.put("command", tool(tmp_path, f"print({json.dumps(report)!r})\nsys.exit(3)"))
    with pytest.raises(hou.NodeError, match="^two domains$"):
        asset.validate(setup.kwargs)


def test_show_in_solaris_makes_a_layer_of_the_cache(asset, hou, setup: Setup, tmp_path: Path) -> None:
    stage = substitute_hou.OpNode("/stage")
    hou.node = {"/stage": stage}.get
    with pytest.raises(hou.NodeError, match="there is no cache yet"):
        asset.show_in_solaris(setup.kwargs)
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "scene.usda").write_text("#usda 1.0\n")
    made = stage.createNode
    stage.createNode = lambda *words: _with_file(made(*words))
    asset.show_in_solaris(setup.kwargs)
    (layer,) = stage._made
    assert layer._type == "sublayer" and layer.parmTuple("filepath1").eval() == (
        str(tmp_path / "cache" / "scene.usda"),
    )


def _with_file(node: substitute_hou.OpNode) -> substitute_hou.OpNode:
    node._parms["filepath1"] = ParmTuple([""])
    return node
