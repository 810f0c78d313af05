"""The paper's scenes: what its figures show, as numbers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from eulerfsi.simulate import Options, simulate
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
