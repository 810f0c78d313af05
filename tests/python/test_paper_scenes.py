"""The paper's scenes: what its figures show, as numbers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from eulerfsi.log import Log
from eulerfsi.scene import open_stage, read_scene
from eulerfsi.simulate import Options, build_simulation, simulate
from pxr import Usd, UsdGeom

SCENES = Path(__file__).resolve().parents[2] / "examples" / "scenes"


class Run:
    """A scene simulated into a folder: its statistics and its points."""

    def __init__(self, name: str, folder: Path, *settings: str, preset: str | None = None, frames: str | None = None):
        options = Options(output=folder, settings=settings, preset=preset, frames=frames, progress="none")
        self.folder = simulate(SCENES / name, options).folder
        self.stage = Usd.Stage.Open(str(self.folder / name))
        lines = [json.loads(line) for line in (self.folder / "stats.jsonl").read_text().splitlines()]
        self.steps = [line for line in lines if line["event"] == "step"]
        self.frames = {line["frame"]: line for line in lines if line["event"] == "frame"}

    def solid(self, path: str, frame: int) -> dict:
        """Diagnostics of a solid at the end of a frame."""
        return self.frames[frame]["solids"][path]

    def points(self, path: str, frame: int) -> np.ndarray:
        """World positions (n, 3) [m] of the Mesh at a path."""
        prim = self.stage.GetPrimAtPath(path)
        place = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(prim))
        return np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(frame), float) @ place[:3, :3] + place[3, :3]


def beside_rigid(rest: np.ndarray, now: np.ndarray) -> float:
    """Largest distance of a shape from the rigid motion of another that fits it best, over the latter's size."""
    a, b = rest - rest.mean(axis=0), now - now.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    return float(np.linalg.norm(b - a @ (u @ vt).T, axis=1).max() / np.ptp(rest, axis=0).max())


@pytest.mark.parametrize("preset", ["production", "paper2016"])
@pytest.mark.parametrize("name", ["half", "height", "flat"])
@pytest.mark.slow
def test_squashed_bunny_takes_its_shape_again(name: str, preset: str, tmp_path: Path) -> None:
    """Fig. 3, in steps of a frame: no inverted cell after frame 3, in the end 1e-2 of its size beside its shape."""
    run = Run(f"squash_{name}.usda", tmp_path / "cache", preset=preset)
    [path] = run.frames[1]["solids"]
    assert len(run.steps) == 47 and all(step["retries"] == 0 for step in run.steps)
    domain = run.stage.GetPrimAtPath("/World/Domain")
    assert domain.GetAttribute("eulerfsi:cflSolid").Get() > 100.0
    stretch = np.array(run.stage.GetPrimAtPath("/World/Bunny").GetAttribute("eulerfsi:stretch").Get())
    first = run.points(f"{path}/surface", 1)
    assert run.solid(path, 1)["volume_mesh"] / run.solid(path, 1)["rest_volume"] == pytest.approx(stretch.prod(), 0.01)
    for frame in range(4, 49):
        assert run.solid(path, frame)["min_det_f"] > 0.3, f"frame {frame}"
    last = run.points(f"{path}/surface", 48)
    assert beside_rigid(first / stretch, first) > 0.1
    assert beside_rigid(first / stretch, last) < 1e-2
    assert run.solid(path, 48)["volume_mesh"] == pytest.approx(run.solid(path, 48)["rest_volume"], rel=1e-2)


@pytest.mark.slow
def test_party_piles_up_clay_keeps_dents_and_the_others_do_not(tmp_path: Path) -> None:
    """Figs. 1, 8, 9: contact and yield happen; volumes; final shapes, pressed by their weight; rest."""
    voxel = 0.02
    run = Run("party.usda", tmp_path / "cache", f"/World/Domain.voxelSize={voxel}", frames="1-60")
    elastic, clay = ("Cheb", "Whale", "Octopus"), ("Duck", "Penguin")
    pairs = [frame["contacts"]["pairs"] for frame in run.frames.values() if "contacts" in frame]
    assert max(len(found) for found in pairs) >= 4, "they have not met"
    assert max(pair["surface_overlap"] for found in pairs for pair in found) < 1.0, "one is in another"
    for name in elastic + clay:
        path = f"/World/{name}/Body"
        for frame in run.frames:
            solid = run.solid(path, frame)
            assert solid["volume_mesh"] == pytest.approx(solid["rest_volume"], rel=0.01), f"{name}, frame {frame}"
            assert solid["volume_cells"] == pytest.approx(solid["rest_volume_cells"], rel=0.02), (
                f"{name}, frame {frame}"
            )
    first, last = 1, max(run.frames)
    dents = {
        name: beside_rigid(*(run.points(f"/World/{name}/Body", at) for at in (first, last))) for name in elastic + clay
    }
    strains = {name: run.solid(f"/World/{name}/Body", last)["max_plastic_strain"] for name in elastic + clay}
    assert all(strains[name] == 0.0 for name in elastic) and all(strains[name] > 0.3 for name in clay), strains
    assert max(dents[name] for name in elastic) < 0.12 < min(dents[name] for name in clay), dents
    for name in elastic + clay:  # eyes stay where they sit
        body, eye = f"/World/{name}/Body", f"/World/{name}/Eyes/EyeLeft"
        apart = [
            np.linalg.norm(run.points(body, at) - run.points(eye, at).mean(axis=0), axis=1).min()
            for at in (first, last)
        ]
        assert abs(apart[1] - apart[0]) < 0.5 * voxel, name
    kinetic = [sum(solid["kinetic_energy"] for solid in run.frames[at]["solids"].values()) for at in (first, last)]
    assert kinetic[1] < 1e-3 * kinetic[0], "they have not come to rest"


@pytest.mark.slow
def test_heavy_bunny_falls_as_in_vacuum(tmp_path: Path) -> None:
    """Fig. 6: until it meets the floor, within 2 % of free fall."""
    run = Run("bunny_heavy.usda", tmp_path / "cache", "/World/Domain.voxelSize=0.02", frames="1-6")
    heights = np.array([run.solid("/World/Bunny", frame)["center"][1] for frame in (1, 3, 4, 5, 6)])
    time = np.array([2, 3, 4, 5]) / 24
    assert np.allclose(heights[0] - heights[1:], 0.5 * 9.8 * time**2, rtol=0.02)


def sectors(field: np.ndarray, place: dict) -> np.ndarray:
    """Integral of curl_y over the eight sectors of 45 degrees around the middle of the x-z plane [m^3/s].

    Mirror images have the other sign: in a square box each quadrant holds two sectors that cancel.
    """
    h = place["spacing"]
    curl = (np.gradient(field[0], h, axis=2) - np.gradient(field[2], h, axis=0)).sum(axis=1) * h**3
    x, z = (np.arange(n) - 0.5 * (n - 1) for n in curl.shape)
    x, z = np.meshgrid(x, z, indexing="ij")
    inside = (np.abs(x) > 1e-9) & (np.abs(z) > 1e-9) & (np.abs(np.abs(x) - np.abs(z)) > 1e-9)
    sector = np.floor(np.arctan2(z, x) / (np.pi / 4)).astype(int) % 8
    return np.array([curl[inside & (sector == number)].sum() for number in range(8)])


@pytest.mark.slow
def test_ball_rebounds_draws_smoke_up_and_leaves_vortices_in_the_quadrants() -> None:
    """Fig. 5: the apex, curl about y around the axis, smoke above the ball's widest height."""
    path = SCENES / "ball.usda"
    scene = read_scene(open_stage(path), path)
    simulation, ids = build_simulation(scene, 0, 0, Log())
    heights, vortices, smoke = [], [], []
    with simulation:
        for frame in range(1, 16):
            if frame > 1:
                simulation.advance(1 / scene.fps)
            heights.append(simulation.solid_diagnostics(ids.solids[0])["center"][1])
            vortices.append(sectors(*simulation.field("velocity")))
            density, place = simulation.field("smoke_density")
            level = place["origin"][1] + place["spacing"] * (np.arange(density.shape[2]) + 0.5)
            smoke.append(float(density[0][:, level > heights[-1]].sum()))
    lowest = int(np.argmin(heights))
    apex = lowest + int(np.argmax(heights[lowest:]))
    assert max(heights[lowest:]) - heights[lowest] > 0.2 * (heights[0] - heights[lowest])
    for turning in vortices[lowest + 2 : apex - 1]:
        assert np.array_equal(np.sign(turning), np.sign(turning[0]) * np.array([1, -1] * 4))
        assert np.allclose(np.abs(turning), np.abs(turning).mean(), rtol=0.1)
    assert max(smoke[apex:]) > 5 * max(smoke[lowest + 2 : apex])
