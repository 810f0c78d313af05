"""What a job for a farm is, whatever the engine: scene, frames, values of its tasks, memory."""

from __future__ import annotations

import dataclasses
import re
import shlex
from collections.abc import Sequence
from pathlib import Path

from pxr import Ar, UsdUtils

from ..errors import UsageError
from ..frames import FrameRange, parse_frames
from ..log import Log
from ..run.simulate import Options, load_scene
from ..scene.read import open_stage
from .variations import Axis, Job, check, plan
from .wedge import largest_need


@dataclasses.dataclass
class Submission:
    """One job. axes: of a wedge, joined to one where they go side by side; jobs: its tasks, none for a single run.

    memory: bytes of the largest task; files: what the scene refers to, itself first; missing: what was not found.
    """

    scene: Path
    folder: Path
    options: Options
    frames: FrameRange
    axes: list[Axis]
    jobs: list[Job]
    attributes: dict[str, str]
    memory: int
    files: list[Path]
    missing: list[str]

    @property
    def name(self) -> str:
        """For the engine's list of jobs."""
        return re.sub(r"[^\w.+-]", "_", self.scene.stem)[:64]

    def fixed(self) -> list[str]:
        """Options that every run of the scene gets as they are."""
        start = [f"--start-frame={self.options.start}"] if self.options.start is not None else []
        return [*start, *(["--confine"] if self.options.confine else [])]

    def settings(self) -> list[str]:
        """What all tasks set, as options."""
        return [word for setting in self.options.settings for word in ("--set", setting)]


def prepare(scene: Path, folder: Path, options: Options, axes: Sequence[Axis], together: bool) -> Submission:
    """Reads the scene as a run would. Raises SceneError, UsageError: what cannot run is not submitted."""
    jobs = plan(axes, together) if axes else []
    joined = [_join(axes)] if axes and together else list(axes)
    attributes = check(scene, axes, options.path_map, options.confine)
    trial = dataclasses.replace(options, settings=(*options.settings, *(jobs[0].settings() if jobs else ())))
    read, _ = load_scene(scene, trial, Log(), 0)
    wanted = parse_frames(options.frames) if options.frames else read.frames
    need = largest_need(scene, options, jobs or [Job("", {})], attributes)
    found, missing = references(scene, options.path_map)
    return Submission(
        scene.resolve(), folder.resolve(), options, wanted, joined, jobs, attributes, need, found, missing
    )


def references(scene: Path, path_map: Sequence[str] = ()) -> tuple[list[Path], list[str]]:
    """(files that a scene consists of, itself first; references that lead nowhere)."""
    stage = open_stage(scene, path_map)  # held: its layers are mapped in memory
    layers, assets, unresolved = UsdUtils.ComputeAllDependencies(str(scene.resolve()))
    names = [layer.realPath for layer in layers if layer.realPath and not layer.anonymous]
    found = {Path(Ar.SplitPackageRelativePathOuter(name)[0]) for name in [*names, *assets]}
    found.discard(scene.resolve())
    del stage
    return [scene.resolve(), *sorted(found)], sorted(unresolved)


def _join(axes: Sequence[Axis]) -> Axis:
    steps = zip(*(axis.choices for axis in axes), strict=True)
    return Axis(axes[0].where, tuple({n: v for choice in step for n, v in choice.items()} for step in steps))


def parse_program(text: str) -> list[str]:
    """The words of the command on a node, as a shell splits them. Raises UsageError."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise UsageError(f"--program {text}: is no command: {str(error).lower()}") from error
    if not words or not words[0]:
        raise UsageError(f"--program {text!r}: must name a command")
    return words


def parse_seconds(option: str, text: str | None) -> int | None:
    """A whole number of seconds >= 1. Raises UsageError."""
    if text is None:
        return None
    if not text.isdecimal() or int(text) < 1:
        raise UsageError(f"{option} {text}: must be a whole number of seconds >= 1")
    return int(text)
