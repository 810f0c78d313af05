"""An example scene, simulated: what it wrote."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from eulerfsi.run.simulate import Options, simulate
from pxr import Usd, UsdGeom

SCENES = Path(__file__).resolve().parents[2] / "examples" / "scenes"


class Run:
    """A scene simulated into a folder: its statistics and its points. Its meshes are whole in every frame: no edge that
    the solid does not explain, no warning of one."""

    def __init__(self, scene: str | Path, folder: Path, *settings: str, **options: str | None):
        options = Options(output=folder, settings=settings, progress="none", **options)
        self.folder = simulate(SCENES / scene, options).folder
        self.stage = Usd.Stage.Open(str(self.folder / Path(scene).name))
        self.events = [json.loads(line) for line in (self.folder / "stats.jsonl").read_text().splitlines()]
        self.steps = [event for event in self.events if event["event"] == "step"]
        self.frames = {event["frame"]: event for event in self.events if event["event"] == "frame"}
        torn = {
            f"{path}, frame {number}": facts["false_edges"]
            for number, frame in self.frames.items()
            for path, facts in frame.get("solids", {}).items()
            if facts["false_edges"]
        }
        assert not torn, f"{scene}: edges that the largest stretch does not explain: {torn}"
        assert "points of it have moved to another part" not in (self.folder / "log").read_text()

    def solid(self, path: str, frame: int) -> dict:
        """Diagnostics of a solid at the end of a frame."""
        return self.frames[frame]["solids"][path]

    def volume_errors(self, path: str, first: int = 1) -> np.ndarray:
        """(frames, 2) by how much its volume differs from that at rest, relative to it, by mesh and by cells."""
        solids = [line["solids"][path] for frame, line in self.frames.items() if frame >= first]
        measures = (("volume_mesh", "rest_volume"), ("volume_cells", "rest_volume_cells"))
        return np.abs([[solid[name] / solid[rest] - 1.0 for name, rest in measures] for solid in solids])

    def points(self, path: str, frame: int) -> np.ndarray:
        """World positions (n, 3) [m] of the Mesh at a path."""
        prim = self.stage.GetPrimAtPath(path)
        place = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(prim))
        return np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(frame), float) @ place[:3, :3] + place[3, :3]
