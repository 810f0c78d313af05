"""`--rebake-from N`: frames up to N stay, later ones are made anew, with other parameters if wanted."""

from __future__ import annotations

from typing import Any

from ..errors import CacheIOError, LibraryError, MismatchError, UsageError
from ..scene.parts import Scene
from ..solver import binding
from ..solver.simulation import Simulation
from . import late_changes
from .manifest import Manifest

# What the manifest says of how frames were made.
_RECIPE = ("program", "scene_hash", "parameters", "overrides", "output")


def find_checkpoint(manifest: Manifest, frame: int, scene: Scene) -> dict[str, Any]:
    """The checkpoint of the frame from which a cache is made anew. Raises MismatchError, UsageError, CacheIOError."""
    data, what = manifest.data, f"{manifest.folder}: --rebake-from {frame}"
    if not data["first"] <= frame < scene.frames.last:
        raise UsageError(f"{what}: must be from {data['first']} to {scene.frames.last - 1}, before the last frame")
    _check_same_bodies(what, manifest, scene)
    found = manifest.whole_checkpoints(frame)
    if not found:
        there = ", ".join(str(checkpoint["frame"]) for checkpoint in manifest.whole_checkpoints()) or "none"
        raise MismatchError(
            f"{what}: there is no checkpoint of that frame; frames with one: {there} (--checkpoint-every, "
            "--keep-checkpoints all)"
        )
    damaged = [f"frame {k}" for k in range(data["first"], frame + 1) if manifest.damaged_files(k)]
    damaged += [] if manifest.intact(found[-1]["file"], found[-1]) else [f"the checkpoint of frame {frame}"]
    if damaged:
        raise CacheIOError(f"{what}: {damaged[0]} is missing or damaged")
    for checkpoint in manifest.data["checkpoints"]:
        if checkpoint["frame"] <= frame:
            _check_same_poses(what, checkpoint, scene)
    return found[-1]


def _check_same_poses(what: str, checkpoint: dict[str, Any], scene: Scene) -> None:
    frame, before = checkpoint["frame"], checkpoint.get("poses", {})
    for path, pose in scene.poses(frame).items():
        if before.get(path, pose) != pose:
            raise MismatchError(
                f"{what}: {path}: its pose in frame {frame} is another one; animation may differ after that frame only",
                prim=path,
            )


def _check_same_bodies(what: str, manifest: Manifest, scene: Scene) -> None:
    before, now = manifest.data.get("bodies"), scene.bodies()
    for name, old, new in (
        ("first frame", manifest.data["first"], scene.frames.first),
        ("frame rate", manifest.data["fps"], scene.fps),
    ):
        if old != new:
            raise MismatchError(f"{what}: the {name} was {old:g}, is {new:g}: it cannot change")
    if before is None:
        return
    for path in [*before, *now]:
        if path not in now or path not in before:
            how = "new" if path in now else "gone"
            raise MismatchError(f"{what}: {path} is {how}: bodies cannot come or go", prim=path)
        if before[path] != now[path]:
            raise MismatchError(f"{what}: {path}: its mesh is another one than the cache was made with", prim=path)
    if list(before) != list(now):
        raise MismatchError(f"{what}: the bodies stand in another order in the scene")


def restore(manifest: Manifest, checkpoint: dict[str, Any], simulation: Simulation, scene: Scene) -> None:
    """Raises MismatchError where the simulation has no place for the checkpoint, or a change would have no effect."""
    frame = checkpoint["frame"]
    what = f"{manifest.folder}: --rebake-from {frame}"
    try:
        simulation.restore_state(manifest.folder / checkpoint["file"])
    except LibraryError as error:
        if error.status != binding.ERROR_CHECKPOINT:
            raise
        raise MismatchError(f"{what}: {error}", prim=error.prim) from error
    late_changes.demand_effect(what, manifest, made_with(manifest, frame)["parameters"], scene, frame)


def begin_stretch(manifest: Manifest, frame: int, recipe: dict[str, Any]) -> None:
    """Frames after `frame` are made with another recipe: the keys of _RECIPE in the manifest, and `stretches`.

    data["stretches"]: what the frames before those of the manifest's own recipe were made with, in their order; "last"
    is the last frame of each.
    """
    data = manifest.data
    kept = [stretch for stretch in data.get("stretches", []) if stretch["last"] < frame]
    made = made_with(manifest, frame)
    if made["scene_hash"] != recipe["scene_hash"] or made.get("output") != recipe.get("output"):
        kept.append({"last": frame, **{key: made[key] for key in _RECIPE if key in made}})
    data["stretches"] = kept
    data.update({key: recipe[key] for key in _RECIPE if key in recipe})


def made_with(manifest: Manifest, frame: int) -> dict[str, Any]:
    """What a frame was made with: the keys of _RECIPE."""
    stretches = manifest.data.get("stretches", [])
    return next((stretch for stretch in stretches if stretch["last"] >= frame), manifest.data)


def foreign_until(manifest: Manifest, first: int) -> int:
    """The last frame that was made with another recipe than the manifest's own; first - 1: none."""
    return max((stretch["last"] for stretch in manifest.data.get("stretches", [])), default=first - 1)
