"""Scene in, cache out."""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path

from ..cache import cache as cache_module
from ..cache.cache import Cache
from ..cache.lock import FolderLock
from ..cache.manifest import Manifest
from ..cache.output import Output
from ..cache.rebake import find_checkpoint, try_restore
from ..cache.start_from import find_start, take_over
from ..frames import demand_start, parse_frames
from ..log import Log
from ..progress import Progress, make_progress
from ..scene import checks
from ..scene.instancers import expand_instancers
from ..scene.overrides import apply_overrides, set_domain_parameter
from ..scene.parts import Scene
from ..scene.read import open_stage, read_scene, set_frames
from ..system import available_memory, available_threads
from ..usd_messages import usd_messages
from .build import build_simulation
from .checkpoints import Checkpoints
from .run import Result, Run


@dataclasses.dataclass
class Options:
    """What `simulate` on the command line sets.

    start None: the scene's first frame; start_from: "CACHE" or "CACHE:FRAME", whose solids are taken over; threads
    None: all that the cgroup allows; checkpoint_every, keep_checkpoints: as Checkpoints takes them; allow_restart: a
    resumed run may drop finished frames where others are damaged; rebake_from: frames after this one of an existing
    cache are made anew; written: what is written of the smoke; strict: a condition of docs/warnings.md stops the
    run.
    """

    output: Path | None = None
    frames: str | None = None
    start: int | None = None
    start_from: str | None = None
    threads: int | None = None
    preset: str | None = None
    settings: tuple[str, ...] = ()
    path_map: tuple[str, ...] = ()
    progress: str = "auto"
    overwrite: bool = False
    resume: bool = False
    rebake_from: int | None = None
    allow_restart: bool = False
    checkpoint_every: str = "10"
    keep_checkpoints: str = "2"
    strict: bool = False
    written: Output = Output()


def load_scene(
    path: Path, options: Options, log: Log, memory_limit: int, progress: Progress | None = None
) -> tuple[Scene, dict[str, str]]:
    """Opens, overrides, checks and reads a scene; warnings go to the log. Returns it with the overrides applied.

    Raises UsageError for options, SceneError with every fault of the scene.
    """
    stage = open_stage(path, options.path_map)
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
    with make_progress(options.progress).told() as progress:
        log.tell = progress.warning
        return _simulate(path, options, log, progress)


def _simulate(path: Path, options: Options, log: Log, progress: Progress) -> Result:
    checkpoints = Checkpoints(options.checkpoint_every, options.keep_checkpoints)
    threads, memory_limit = options.threads or available_threads(), available_memory()
    folder = options.output or Path.cwd() / f"{path.stem}_cache"
    start = find_start(options.start_from) if options.start_from else None
    with usd_messages(log.info):
        scene, overrides = load_scene(path, options, log, memory_limit, progress)
    mode = cache_module.prepare(folder, options.overwrite, options.resume, options.rebake_from)
    wanted = parse_frames(options.frames) if options.frames else scene.frames
    if wanted.first > scene.frames.first:
        demand_start(wanted, scene.frames.first, _last_checkpoint(folder, mode))
    checks.check_output(folder)
    checkpoint = find_checkpoint(Manifest.load(folder), options.rebake_from, scene) if mode == "rebake" else None
    build = build_simulation(scene, threads, memory_limit, log)
    with build.simulation:
        if start:
            take_over(start, build.simulation, scene)
        if checkpoint:
            try_restore(Manifest.load(folder), checkpoint, build.simulation)
        folder.mkdir(parents=True, exist_ok=True)
        with FolderLock(folder), contextlib.closing(log), usd_messages(log.info):
            if mode == "resume":
                cache = Cache.resume(folder, scene, options.written, start, options.allow_restart)
            elif checkpoint:
                cache = Cache.rebake(folder, scene, overrides, options.written, checkpoint)
            else:
                cache_module.remove_old(folder)
                cache = Cache.create(folder, scene, overrides, options.written, start)
            log.open(folder / "log")
            run = Run(scene, cache, build, log, progress, checkpoints, options.strict)
            return run.execute(mode != "new")


def _last_checkpoint(folder: Path, mode: str) -> int | None:
    """Frame from which a resumed run would go on; None where it begins anew."""
    checkpoint = Manifest.load(folder).usable_checkpoint() if mode == "resume" else None
    return checkpoint["frame"] if checkpoint else None
