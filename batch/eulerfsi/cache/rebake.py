"""`--rebake-from N`: frames up to N stay, later ones are made anew, with other parameters if wanted."""

from __future__ import annotations

from typing import Any

from ..errors import CacheIOError, LibraryError, MismatchError, UsageError
from ..scene.parts import Scene
from ..solver import binding
from ..solver.simulation import Simulation
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
    now, before = scene.poses(frame), found[-1].get("poses", {})
    moved = [path for path in now if path in before and now[path] != before[path]]
    if moved:
        raise MismatchError(
            f"{what}: {moved[0]}: its pose in frame {frame} is another one; animation may differ after that frame only",
            prim=moved[0],
        )
    return found[-1]


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


def try_restore(manifest: Manifest, checkpoint: dict[str, Any], simulation: Simulation) -> None:
    """Raises MismatchError where the simulation has no place for the checkpoint."""
    try:
        simulation.restore_state(manifest.folder / checkpoint["file"])
    except LibraryError as error:
        if error.status != binding.ERROR_CHECKPOINT:
            raise
        raise MismatchError(f"{manifest.folder}: --rebake-from {checkpoint['frame']}: {error}") from error


def begin_stretch(manifest: Manifest, frame: int, recipe: dict[str, Any]) -> None:
    """Frames after `frame` are made with another recipe: the keys of _RECIPE in the manifest, and `stretches`.

    data["stretches"]: what the frames before those of the manifest's own recipe were made with, in their order; "last"
    is the last frame of each.
    """
    data = manifest.data
    earlier = data.get("stretches", [])
    kept = [stretch for stretch in earlier if stretch["last"] < frame]
    made = next((stretch for stretch in earlier if stretch["last"] >= frame), data)
    if made["scene_hash"] != recipe["scene_hash"] or made.get("output") != recipe.get("output"):
        kept.append({"last": frame, **{key: made[key] for key in _RECIPE if key in made}})
    data["stretches"] = kept
    data.update({key: recipe[key] for key in _RECIPE if key in recipe})


def foreign_until(manifest: Manifest, first: int) -> int:
    """The last frame that was made with another recipe than the manifest's own; first - 1: none."""
    return max((stretch["last"] for stretch in manifest.data.get("stretches", [])), default=first - 1)
