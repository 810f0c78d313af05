"""Scene in, cache out."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
from pathlib import Path

from .. import __version__, files
from ..cache import cache as cache_module
from ..cache.cache import Cache
from ..cache.lock import FolderLock
from ..cache.manifest import Manifest
from ..cache.output import Output
from ..cache.rebake import find_checkpoint, restore
from ..cache.start_from import find_start, take_over
from ..errors import Cancelled, UsageError
from ..frames import demand_start, parse_frames
from ..log import Log
from ..progress import Progress, make_progress
from ..say import say
from ..scene import checks
from ..scene.instancers import expand_instancers
from ..scene.overrides import apply_overrides, set_domain_parameter
from ..scene.parts import Scene
from ..scene.read import open_stage, read_scene, set_frames
from ..solver import binding
from ..system import available_memory, available_threads
from ..usd_messages import usd_messages
from . import disk
from .build import build_simulation
from .checkpoints import Checkpoints
from .run import Result, Run
from .stop import Stop


@dataclasses.dataclass
class Options:
    """What `simulate` on the command line sets.

    start None: the scene's first frame; start_from: "CACHE" or "CACHE:FRAME", whose solids are taken over; threads
    None: all that the cgroup allows; confine: nothing outside the scene's folder is read; force: begin with too little
    disk; checkpoint_every, keep_checkpoints: as Checkpoints takes them; allow_restart: a resumed run may drop finished
    frames where others are damaged; rebake_from: frames after this one of an existing cache are made anew; written:
    what is written of the smoke; strict: a condition of docs/warnings.md stops the run; max_wall_seconds,
    requeue_on_signal: as Stop takes them; wait: seconds for another run in the folder; command: for the log; flipbook:
    a picture of every frame.
    """

    output: Path | None = None
    frames: str | None = None
    start: int | None = None
    start_from: str | None = None
    threads: int | None = None
    preset: str | None = None
    settings: tuple[str, ...] = ()
    path_map: tuple[str, ...] = ()
    confine: bool = False
    force: bool = False
    progress: str = "auto"
    overwrite: bool = False
    resume: bool = False
    rebake_from: int | None = None
    allow_restart: bool = False
    checkpoint_every: str = "10"
    keep_checkpoints: str = "2"
    strict: bool = False
    max_wall_seconds: float | None = None
    requeue_on_signal: bool = False
    wait: float = 0.0
    command: str = ""
    written: Output = Output()
    flipbook: bool = False


def load_scene(
    path: Path, options: Options, log: Log, memory_limit: int, progress: Progress | None = None
) -> tuple[Scene, dict[str, str]]:
    """Opens, overrides, checks and reads a scene; warnings go to the log. Returns it with the overrides applied.

    Raises UsageError for options, SceneError with every fault of the scene.
    """
    stage = open_stage(path, options.path_map, options.confine)
    set_frames(stage, parse_frames(options.frames) if options.frames else None, options.start)
    expand_instancers(stage)
    overrides = apply_overrides(stage, options.settings)
    if options.preset:
        overrides |= set_domain_parameter(stage, "preset", options.preset)
    warnings = checks.raise_errors(checks.stage_issues(stage))
    scene = read_scene(stage, path, memory_limit, options.threads, progress)
    warnings += scene.warnings + checks.raise_errors(checks.check_scene(scene))
    for issue in {issue.message: issue for issue in warnings}.values():
        log.warning(issue.message, issue.code, issue.prim, issue.field)
    return scene, overrides


def simulate(path: Path, options: Options, log: Log | None = None) -> Result:
    """Simulates a scene into a cache. Raises EulerFsiError subclasses; Cancelled after a signal."""
    log = log or Log()
    stop = Stop(options.max_wall_seconds, options.requeue_on_signal)
    with make_progress(options.progress).told() as progress, contextlib.closing(log):
        log.tell = progress.warning
        try:
            return _simulate(path, options, log, progress, stop)
        except Cancelled as error:
            raise stop.of_signal(error) from error


def _simulate(path: Path, options: Options, log: Log, progress: Progress, stop: Stop) -> Result:
    if not 0 <= options.wait < math.inf:
        raise UsageError(f"--wait {options.wait:g}: must be a finite number >= 0")
    if options.start_from and options.rebake_from is not None:
        raise UsageError("--start-from: must not be given with --rebake-from: it acts at the start alone")
    checkpoints = Checkpoints(options.checkpoint_every, options.keep_checkpoints)
    threads, memory_limit = options.threads or available_threads(), available_memory()
    folder = options.output or Path.cwd() / f"{path.stem}_cache"
    start = find_start(options.start_from) if options.start_from else None
    with usd_messages(log.info):
        scene, overrides = load_scene(path, options, log, memory_limit, progress)
    options.written.check(scene.space, scene.domain)
    cache_module.check_ours(folder)
    checks.check_output(folder)

    def tell(text: str) -> None:
        log.info(text)
        say(text, progress.err)

    for note in checks.notes(scene):
        tell(f"note: {note}")
    with FolderLock(folder, options.wait, tell):
        mode = cache_module.prepare(folder, options.overwrite, options.resume, options.rebake_from)
        wanted = parse_frames(options.frames) if options.frames else scene.frames
        if wanted.first > scene.frames.first:
            last = options.rebake_from if mode == "rebake" else _last_checkpoint(folder, mode, options.allow_restart)
            demand_start(wanted, scene.frames.first, last)
        checkpoint = find_checkpoint(Manifest.load(folder), options.rebake_from, scene) if mode == "rebake" else None
        if not options.force:
            _demand_disk(folder, mode, scene, options, checkpoints)
        build = build_simulation(scene, threads, memory_limit, log)
        with build.simulation, usd_messages(log.info):
            if start:
                take_over(start, build.simulation, scene)
            if checkpoint:
                restore(Manifest.load(folder), checkpoint, build.simulation, scene)
            if mode == "resume":
                cache = Cache.resume(folder, scene, options.written, start, options.allow_restart, log.warning)
            elif checkpoint:
                cache = Cache.rebake(folder, scene, overrides, options.written, checkpoint)
            else:
                cache_module.remove_old(folder)
                files.remove_leftovers(folder)
                cache = Cache.create(folder, scene, overrides, options.written, start)
            log.open(folder / "log", *_heading(scene, options))
            run = Run(scene, cache, build, log, progress, checkpoints, stop, options.strict, options.flipbook)
            return run.execute(mode != "new")


def _demand_disk(folder: Path, mode: str, scene: Scene, options: Options, checkpoints: Checkpoints) -> None:
    """Raises CacheIOError where there is too little room for the frames that are still to be made."""
    there = set()
    if mode != "new":
        manifest = cache_module.open_manifest(folder, options.allow_restart)
        before = options.rebake_from if mode == "rebake" else scene.frames.last
        there = {frame for frame in map(int, manifest.frames) if frame <= before}
    frames = sum(1 for frame in scene.frames if frame not in there)
    if not frames:
        return
    output = Output.of(manifest.data.get("output")) if mode == "resume" else options.written
    needed = disk.need(scene, output, frames, checkpoints.most(frames), frames if options.flipbook else 0)
    replaced = cache_module.size(folder) if mode == "new" else 0
    disk.demand(folder, needed, disk.free(folder) + replaced)


def _heading(scene: Scene, options: Options) -> list[str]:
    """The first lines of the log of a run."""
    versions = f"eulerfsi {__version__}, library {binding.library_version()}"
    return [
        f"{versions}, host {os.uname().nodename}, process {os.getpid()}",
        f"command: {options.command or 'none: called from Python'}",
        f"scene: {scene.path}, scene hash {scene.hash()}",
    ]


def _last_checkpoint(folder: Path, mode: str, allow_restart: bool) -> int | None:
    """Frame from which a resumed run would go on; None where it begins anew."""
    manifest = cache_module.open_manifest(folder, allow_restart) if mode == "resume" else None
    checkpoint = manifest.usable_checkpoint() if manifest else None
    return checkpoint["frame"] if checkpoint else None
