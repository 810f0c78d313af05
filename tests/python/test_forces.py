"""Forces in a region, from a stage to the numbers of a run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import author, box, make_scene
from eulerfsi.run.simulate import Options, simulate


def test_a_force_with_samples_gives_a_solid_its_momentum(tmp_path: Path) -> None:
    """On for the first of two frames, on a ball in vacuum; gravity acts beside it."""
    stage = make_scene(tmp_path / "scene.usda", voxel=0.05, frames=(1, 3), velocity=(0, 0, 0), smoke=False)
    author(stage.GetPrimAtPath("/World/Domain"), ambientFluid=False)
    region = box(stage, "/World/Push", (0, 0, 0), (2, 2, 2), 1.0, "EulerFsiForceAPI")
    author(region, kind="constant", acceleration=(4.0, 0.0, -2.0))
    for time, on in ((1, True), (2, False)):
        region.GetAttribute("eulerfsi:enabled").Set(on, time)
    stage.GetRootLayer().Save()
    folder = simulate(tmp_path / "scene.usda", Options(output=tmp_path / "cache", progress="none")).folder
    events = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
    frames = {event["frame"]: event["solids"]["/World/Ball"] for event in events if "solids" in event}
    for frame in (2, 3):
        velocity = np.array(frames[frame]["momentum"]) / frames[frame]["mass"]
        np.testing.assert_allclose(velocity[[0, 2]], np.array([4.0, -2.0]) / 24, rtol=1e-3)
        assert velocity[1] == pytest.approx(-9.8 * (frame - 1) / 24, rel=1e-3)
