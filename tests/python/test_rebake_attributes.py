"""Another value of each attribute of the schema: a rebake shows it in later frames, or refuses it by name."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from conftest import author, box, content_hashes, make_scene, write_obj
from eulerfsi.errors import EulerFsiError
from eulerfsi.log import Log
from eulerfsi.parameters import table
from eulerfsi.run.simulate import Options, simulate
from pxr import Gf, UsdGeom

pytestmark = pytest.mark.usefixtures("library")

LAST, CHANGE = 6, 3
ACTS, IGNORED = "acts", "has no part in the result"
START, UNTIL = "acts at the start alone", "acts up to frame 3 alone"
PRIMS = {"domain": "Domain", "solid": "Ball", "emitter": "Jet", "force": "Wind", "collider": "Lift"}
WALLS = ("XMin", "XMax", "YMin", "YMax", "ZMin", "ZMax")
# scope.name -> another value and what becomes of it; a name with "/" is of that prim.
CHANGES: dict[str, tuple[str, str]] = {
    "domain.preset": ("fast", ACTS),
    "domain.voxelSize": ("0.05", "voxel_size = 0.05: must be 0.06"),
    "domain.size": ("(1,1,1)", IGNORED),  # of a Cube, which has its own
    "domain.ambientFluid": ("false", "ambient_fluid = 0: must be 1"),
    "domain.fluidDensity": ("2", ACTS),
    "domain.fluidViscosity": ("0.1", ACTS),
    "domain.vorticityConfinement": ("0.5", ACTS),
    "domain.smokeBuoyancy": ("3", ACTS),
    "domain.temperatureBuoyancy": ("0.5", ACTS),
    "domain.cflSolid": ("0.05", ACTS),
    "domain.cflFluid": ("0.2", ACTS),
    "domain.maxTimeStep": ("0.004", ACTS),
    "domain.stepTolerance": ("0.001", ACTS),
    "domain.velocityTolerance": ("0.4", ACTS),
    "domain.pressureTolerance": ("0.4", ACTS),
    "domain.energyLedger": ("true", IGNORED),  # but for stats.jsonl
    "domain.volumeSource": ("false", ACTS),
    **{f"domain.wall{face}": ("open", ACTS) for face in WALLS},
    **{f"domain.wallVelocity{face}": ("(0.1,0,0)" if face[0] != "X" else "(0,0.1,0)", ACTS) for face in WALLS},
    "solid.enabled": ("false", "is gone: bodies cannot come or go"),
    "solid.surfaceFile": ("ball.obj", "its mesh is another one"),
    "solid.density": ("500", ACTS),
    "solid.material": ("stableNeoHookean", ACTS),
    "solid.youngsModulus": ("9000", ACTS),
    "solid.poissonsRatio": ("0.1", ACTS),
    "solid.compressible": ("true", ACTS),
    "solid.rayleighAlpha": ("5", ACTS),
    "solid.rayleighBeta": ("0.01", ACTS),
    "solid.friction": ("0.9", ACTS),
    "solid.contactStiffness": ("1e5", IGNORED),  # but for paper2016
    "solid.plasticYieldStress": ("900", ACTS),
    "solid.plasticFlowRate": ("10", ACTS),
    "solid.plasticHardening": ("5000", ACTS),
    "solid.velocity": ("(0,0,1)", START),
    "solid.angularVelocity": ("(0,300,0)", START),
    "solid.stretch": ("(1,1.2,1)", START),
    "emitter.enabled": ("false", ACTS),
    "emitter.mode": ("initial", START),
    "emitter.smokeDensity": ("0.2", ACTS),
    "emitter.smokeTemperature": ("60", ACTS),
    "emitter.emitVelocity": ("false", ACTS),
    "emitter.velocity": ("(0,1,0)", ACTS),
    "emitter.addMotion": ("true", ACTS),
    "emitter.startTime": ("0.05", UNTIL),
    "emitter.endTime": ("0.15", ACTS),
    "Carpet/mode": ("continuous", ACTS),
    "Carpet/smokeDensity": ("0.2", START),
    "Carpet/smokeTemperature": ("60", START),
    "Carpet/enabled": ("false", START),
    "force.enabled": ("false", ACTS),
    "force.kind": ("radial", ACTS),
    "force.actsOn": ("fluid", ACTS),
    "force.windVelocity": ("(0,1,0)", ACTS),
    "force.windDrag": ("5", ACTS),
    "force.noiseSpeed": ("1", ACTS),
    "force.noiseSize": ("0.05", ACTS),
    "force.noiseFrequency": ("10", ACTS),
    "force.startTime": ("0.05", UNTIL),
    "force.endTime": ("0.15", ACTS),
    "force.acceleration": ("(0,0,-3)", ACTS),
    "force.radialAcceleration": ("-2", ACTS),
    "collider.enabled": ("false", "is gone: bodies cannot come or go"),
    "collider.friction": ("0.1", ACTS),
}
OTHERS = {"force.acceleration": "Push", "force.radialAcceleration": "Radial"}


def test_every_attribute_of_the_schema_has_a_row() -> None:
    of_table = {f"{scope}.{name}" for scope, rows in table().items() for name in rows}
    assert of_table == {name for name in CHANGES if "/" not in name}


def run(scene: Path, folder: Path, **options) -> None:
    every = {"checkpoint_every": "1", "keep_checkpoints": "all"}
    simulate(scene, Options(output=folder, progress="none", **every, **options), Log())


@pytest.fixture(scope="module")
def baked(tmp_path_factory, library) -> tuple[Path, Path]:
    """Scene and cache: a plastic ball with friction, a moving jet, a carpet of smoke, three forces, a collider."""
    folder = tmp_path_factory.mktemp("attributes")
    stage = make_scene(folder / "all.usda", frames=(1, LAST), voxel=0.06)
    author(stage.GetPrimAtPath("/World/Domain"), smokeBuoyancy=1.0, temperatureBuoyancy=0.1, fluidViscosity=0.01)
    ball = stage.GetPrimAtPath("/World/Ball")
    author(ball, plasticYieldStress=300.0, friction=0.3, stretch=Gf.Vec3d(1.1, 1, 1), rayleighBeta=0.001)
    lift = box(stage, "/World/Lift", (0.0, -0.4, 0.0), (0.5, 0.14, 0.5), 1.0, "EulerFsiColliderAPI")
    author(lift, friction=0.5)
    jet = box(stage, "/World/Jet", (0.2, 0.0, 0.2), (0.15, 0.15, 0.15), 1.0, "EulerFsiEmitterAPI")
    author(jet, mode="continuous", emitVelocity=True, velocity=Gf.Vec3d(0, 0.5, 0), smokeTemperature=20.0)
    for frame in range(1, LAST + 1):
        UsdGeom.XformCommonAPI(UsdGeom.Xformable(jet)).SetTranslate(Gf.Vec3d(0.2, 0.01 * frame, 0.2), frame)
    for name, values in (
        ("Push", {"kind": "constant", "acceleration": Gf.Vec3d(0, 0, 3)}),
        ("Radial", {"kind": "radial", "radialAcceleration": 2.0}),
        ("Wind", {"kind": "wind", "windVelocity": Gf.Vec3d(1, 0, 0), "windDrag": 2.0, "noiseSpeed": 0.3}),
    ):
        author(box(stage, f"/World/{name}", (0, 0, 0), (0.5, 0.5, 0.5), 1.0, "EulerFsiForceAPI"), **values)
    stage.GetRootLayer().Save()
    run(folder / "all.usda", folder / "cache")
    return folder / "all.usda", folder / "cache"


@pytest.mark.nightly
@pytest.mark.parametrize("name", CHANGES)
def test_another_value_is_seen_in_later_frames_or_refused_by_name(
    baked: tuple[Path, Path], tmp_path: Path, name: str
) -> None:
    scene, cache = baked
    value, outcome = CHANGES[name]
    prim, _, attribute = name.partition("/") if "/" in name else name.partition(".")
    prim = OTHERS.get(name, PRIMS.get(prim, prim))
    namespace = "physics" if attribute == "density" else "eulerfsi"
    if attribute == "surfaceFile":
        write_obj(scene.parent / "ball.obj", 0.15)
    folder = Path(shutil.copytree(cache, tmp_path / "cache"))
    options = {"rebake_from": CHANGE, "settings": (f"/World/{prim}.{namespace}:{attribute}={value}",)}
    if outcome not in (ACTS, IGNORED):
        with pytest.raises(EulerFsiError) as caught:
            run(scene, folder, **options)
        assert caught.value.exit_code == 7 and outcome in str(caught.value)
        assert content_hashes(folder) == content_hashes(cache)
        return
    run(scene, folder, **options)
    before, now = content_hashes(cache), content_hashes(folder)
    assert {n: now[n] for n in now if int(n) <= CHANGE} == {n: before[n] for n in before if int(n) <= CHANGE}
    assert (now == before) == (outcome == IGNORED)
