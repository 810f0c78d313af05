"""Another value of each attribute of the schema: a rebake shows it in later frames, or refuses it by name."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import pytest
from conftest import author, box, content_hashes, make_scene, write_obj
from eulerfsi.errors import EulerFsiError
from eulerfsi.log import Log
from eulerfsi.parameters import table
from eulerfsi.paths import parameter_table
from eulerfsi.run.simulate import Options, simulate
from pxr import Gf, UsdGeom

pytestmark = pytest.mark.usefixtures("library")

LAST, CHANGE = 6, 3
ACTS, IGNORED = "acts", "ignored"
START, UNTIL = "acts at the start alone", "acts up to frame 3 alone"
PRIMS = {"domain": "Domain", "solid": "Ball", "emitter": "Jet", "force": "Wind", "collider": "Lift"}
OTHERS = {"force.acceleration": "Push", "force.radialAcceleration": "Radial"}


def changes() -> dict[str, tuple[str, str]]:
    """scope.name -> another value and what becomes of it, by the table; a name with "/" is of that prim."""
    result = {}
    for scope, section in tomllib.loads(parameter_table().read_text(encoding="utf-8")).items():
        for row in section["parameter"]:
            outcome = row.get("rebake", START if row.get("initial") else ACTS)
            result[f"{scope}.{row['name']}"] = (row["another"], outcome)
    return result | {
        "Carpet/mode": ("continuous", ACTS),
        "Carpet/smokeDensity": ("0.2", START),
        "Carpet/smokeTemperature": ("60", START),
        "Carpet/enabled": ("false", START),
    }


CHANGES = changes()


def test_every_attribute_has_another_value_within_its_limits() -> None:
    for scope, rows in table().items():
        for name, row in rows.items():
            value, outcome = CHANGES[f"{scope}.{name}"]
            assert outcome in (ACTS, IGNORED, START, UNTIL) or ":" in outcome or " is " in outcome, name
            if row.type == "token":
                assert value in row.tokens and value != row.default, name
            elif row.type == "bool":
                assert value in ("true", "false"), name
            elif row.type == "double":
                low, high = row.hard
                assert low <= float(value) <= high, name


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
