# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes and checks of scenes: where they lie, how they stand, how they are started and followed."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import re
import time
import uuid
from pathlib import Path

import bpy

from . import job, load, preferences, scene_export, thickness, wording
from .scene_export import Finding

_jobs: dict[str, job.Job] = {}  # by folder: bakes that this Blender has started or found
_checks: dict[str, list[Finding]] = {}  # by the scene's identity: what the last check or start has found
_LONGEST = 240  # characters of an error in the line of the state; Messages has it whole
_PAUSE = 0.4  # seconds between two looks at a bake


@dataclasses.dataclass
class Status:
    """How the bake of a scene stands. kind: no_domain, unsaved, ready, preparing, running, complete, failed,
    interrupted, stopped, damaged, foreign; text: one line."""

    kind: str
    text: str
    cache: job.Cache = dataclasses.field(default_factory=job.Cache)
    job: job.Job | None = None
    folder: Path | None = None


def folder_of(scene: bpy.types.Scene) -> Path:
    """Where the scene's bake lies. Raises JobError for a file that was never saved."""
    if not bpy.data.filepath:
        raise job.JobError("save the .blend file first: the cache lies beside it")
    if scene.eulerfsi.folder:
        return Path(bpy.path.abspath(scene.eulerfsi.folder))
    file, root = Path(bpy.data.filepath), preferences.cache_root()
    base = Path(bpy.path.abspath(root)) if root else file.parent
    return base / f"{file.stem}_eulerfsi" / re.sub(r"[^\w\-. ]", "_", scene.name)


def job_of(folder: Path) -> job.Job:
    """The job of a folder; one that another Blender has started is found by its events."""
    key = str(folder)
    if key not in _jobs or (not _jobs[key].alive and job.baking(folder)):
        _jobs[key] = job.Job(folder)
        _jobs[key].read()
    return _jobs[key]


def is_foreign(scene: bpy.types.Scene, folder: Path) -> str:
    """Whose bake lies there, "" for ours or none."""
    owner = job.owner(folder)
    if owner and not _is_owner(scene, owner):
        return f"scene “{owner.get('scene')}” of {owner.get('file')}"
    if not owner and (folder / "cache" / "manifest.json").exists():
        return "a run outside Blender"
    return ""


def _is_owner(scene: bpy.types.Scene, owner: dict) -> bool:
    """A file that was closed without being saved after its first bake has no identity: its path says it."""
    if scene.eulerfsi.uid:
        return owner.get("uid") == scene.eulerfsi.uid
    return owner.get("file") == bpy.data.filepath and owner.get("scene") == scene.name


def status(scene: bpy.types.Scene) -> Status:
    """Read from the disk; the .blend file stores none of it."""
    if not scene_export.members(scene, "DOMAIN"):
        return Status("no_domain", "No domain yet")
    try:
        folder = folder_of(scene)
    except job.JobError:
        return Status("unsaved", "Save the file first: the cache lies beside it")
    if whose := is_foreign(scene, folder):
        return Status("foreign", f"The folder holds the bake of {whose}: choose another one", folder=folder)
    found, work = job.look(folder), job_of(folder)
    work.read()
    done = f"{len(found.frames)} of {found.last - found.first + 1} frames" if found.frames else "no frame yet"
    if work.alive and (work.process or job.baking(folder)):
        if work.told.start is None:
            return Status("preparing", work.told.waiting or "Reading the scene", found, work, folder)
        return Status("running", f"Frame {work.told.frame or found.first}, {_eta(work)}", found, work, folder)
    if job.lock_held(folder / "cache"):
        whose = job.lock_text(folder / "cache") or "another process"
        return Status("running", f"A run outside Blender ({whose}), {done}", found, job.Job(folder), folder)
    end = work.told.end
    if end and end["status"] == "failed":
        return Status("failed", f"Failed, {done}: {first_error(scene, work)}", found, work, folder)
    if work.process and end is None and (code := work.process.returncode) > 0:
        crashed = f"The solver ended with code {code}: {folder / job.MESSAGES} says why"
        return Status("failed", crashed, found, work, folder)
    if work.process and end is None:
        killed = f"The solver was killed, {done} kept: Resume continues"
        return Status("stopped", killed, found, work, folder)
    texts = {
        "complete": f"Done, {done}",
        "interrupted": f"Stopped, {done}: Resume continues",
        "stopped": f"The solver was killed, {done} kept: Resume continues",
        "failed": f"Failed, {done}: {first_error(scene, work)}",
        "strict": f"Stopped by a warning, {done}",
        "damaged": "The cache's manifest.json cannot be read: Free it",
    }
    if found.status == "damaged" and job.has_copy(folder):
        texts["damaged"] = "The cache's manifest.json cannot be read: Resume goes on at the last checkpoint"
    if found.status in texts:
        return Status(found.status, texts[found.status], found, work, folder)
    return Status("ready", "Ready to bake", found, work, folder)


def _eta(work: job.Job) -> str:
    eta = work.told.eta
    if eta is None:
        return f"{work.told.percent:.0f} %"
    minutes, seconds = divmod(round(eta), 60)
    hours, minutes = divmod(minutes, 60)
    left = f"{hours} h {minutes:02} min" if hours else f"{minutes} min {seconds:02} s" if minutes else f"{seconds} s"
    return f"{work.told.percent:.0f} %, {left} left"


def to_finding(scene: bpy.types.Scene, event: dict) -> Finding:
    """An event of the solver, with objects and settings by the names that Blender has for them."""
    message = event["message"]
    for obj in sorted(scene_export.members(scene), key=lambda o: -len(o.eulerfsi.prim)):
        if obj.eulerfsi.prim:
            path = re.escape(scene_export.path_of(obj))
            message = re.sub(rf"{path}(?!\w)", lambda _, name=obj.name: f"“{name}”", message)
    found = scene_export.object_of(scene, event.get("prim"))
    field = (event.get("field") or "").rpartition(":")[2]
    message = wording.in_blender(message)
    return Finding(event["level"], found.name if found else "", field, message)


def first_error(scene: bpy.types.Scene, work: job.Job) -> str:
    errors = [event for event in work.told.findings if event["level"] == "error"]
    text = to_finding(scene, errors[0]).message if errors else _end_error(work)
    if len(text) >= _LONGEST:  # the panel shows the folder by itself
        text = re.sub(rf"{re.escape(str(work.folder / 'cache'))}(?:/|: )", "", text)
    return text if len(text) < _LONGEST else f"{text[: text.rfind(' ', 0, _LONGEST)]} ..."


def _end_error(work: job.Job) -> str:
    return wording.in_blender((work.told.end or {}).get("error") or "unknown")


def findings(scene: bpy.types.Scene, now: Status) -> list[Finding]:
    """What the artist should see: of the check, and of the bake."""
    found = list(_checks.get(scene.eulerfsi.uid, ())) if scene.eulerfsi.uid else []
    if now.job:
        found += [to_finding(scene, event) for event in now.job.told.findings]
    return list({(f.object, f.message): f for f in found}.values())


def stale(scene: bpy.types.Scene, now: Status) -> list[str]:
    """What has changed since the bake."""
    if now.kind not in ("complete", "interrupted", "stopped", "failed") or now.folder is None or not now.cache.frames:
        return []
    before = job.made_with(now.folder, job_of(now.folder).told)
    return scene_export.changes(before, _json(scene_export.snapshot(scene))) if before else []


def _json(data: dict) -> dict:
    return json.loads(json.dumps(data))


def begin(scene: bpy.types.Scene, mode: str) -> job.Job:
    """Exports the scene and starts its bake. Raises JobError, ExportError, OSError."""
    folder = folder_of(scene)
    if whose := is_foreign(scene, folder):
        raise job.JobError(f"{folder} holds the bake of {whose}: choose another folder in Cache, or free that one")
    job.demand_ours(folder)
    now = status(scene)
    if now.kind in job.RUNNING:
        raise job.JobError(f"a bake runs already ({now.text}): cancel it first")
    arguments = _arguments(scene, folder, mode, now.cache)
    if mode == "NEW":
        load.remove(scene)
    _export(scene, folder)
    _checks.pop(scene.eulerfsi.uid, None)
    before = job.made_with(folder, job_of(folder).told)
    work = job.start(folder, preferences.version(), arguments, str(folder / "scene.usdc"))
    facts = {"uid": scene.eulerfsi.uid, "scene": scene.name, "file": bpy.data.filepath, "mode": mode}
    facts["settings"] = before
    facts["asked"] = before if before and mode == "RESUME" else scene_export.snapshot(scene)  # Resume refuses others
    (folder / job.OWNER).write_text(json.dumps(facts, indent=1))
    _jobs[str(folder)] = work
    follow()
    return work


def _export(scene: bpy.types.Scene, folder: Path) -> None:
    if not scene.eulerfsi.uid:
        scene.eulerfsi.uid = job.owner(folder).get("uid") or uuid.uuid4().hex
    folder.mkdir(parents=True, exist_ok=True)
    try:
        scene_export.Exporter(scene, folder / "export").write()
    except scene_export.ExportError as error:
        _checks[scene.eulerfsi.uid] = error.findings
        raise


def _arguments(scene: bpy.types.Scene, folder: Path, mode: str, found: job.Cache) -> list[str]:
    settings = scene.eulerfsi
    words = ["simulate", str(folder / "scene.usdc"), "-o", str(folder / "cache"), "--progress", "json"]
    words += ["--checkpoint-every", str(settings.checkpoint_every)]
    words += ["--keep-checkpoints", "all" if settings.keep_checkpoints else "2"]
    words += _threads(scene)
    if mode == "RESUME":
        return [*words, "--resume", *(["--allow-restart"] if found.status == "damaged" else [])]
    words += [*(["--half"] if settings.half else []), "--smoke-threshold", f"{settings.smoke_threshold:.7g}"]
    if mode == "NEW":
        return [*words, "--overwrite"]
    if why := why_no_rebake(scene, found):
        raise job.JobError(why)
    return [*words, "--rebake-from", str(rebake_frame(scene, found))]


def _threads(scene: bpy.types.Scene) -> list[str]:
    return ["--threads", str(scene.eulerfsi.threads)] if scene.eulerfsi.threads else []


def rebake_frame(scene: bpy.types.Scene, found: job.Cache) -> int | None:
    """The last checkpoint at or before the current frame from which something is left to bake."""
    usable = [frame for frame in found.checkpoints if frame <= scene.frame_current and frame < scene.frame_end]
    return max(usable, default=None)


def why_no_rebake(scene: bpy.types.Scene, found: job.Cache) -> str:
    """Why nothing can be baked anew from the current frame on, "" where it can."""
    if scene.frame_current <= found.first:
        return f"To bake from a frame on, go to one after {found.first}: frames up to its last checkpoint stay"
    if rebake_frame(scene, found) is None:
        there = ", ".join(map(str, found.checkpoints)) or "none"
        end = f" and before the end, {scene.frame_end}" if scene.frame_current >= scene.frame_end else ""
        return f"no checkpoint at or before frame {scene.frame_current}{end}; there are: {there}"
    return ""


def can_resume(scene: bpy.types.Scene, now: Status) -> bool:
    """Whether frames are missing that Resume could make, also after a start that was refused."""
    if now.kind == "damaged":
        return job.has_copy(now.folder)
    frames = now.cache.frames
    return bool(frames) and (now.cache.status != "complete" or scene.frame_end > frames[-1])


def check(scene: bpy.types.Scene) -> list[Finding]:
    """Asks the solver whether the scene can be simulated, and waits. Raises JobError, ExportError, OSError."""
    folder = folder_of(scene).with_name(f"{folder_of(scene).name}.check")
    _export(scene, folder)
    stage = str(folder / "scene.usdc")
    words = ["validate", stage, "--progress", "json", *_threads(scene)]
    work = job.start(folder, preferences.version(), words, stage)
    code = work.wait()
    found = [to_finding(scene, event) for event in work.told.findings]
    unexplained = code and not any(finding.level == "error" for finding in found)
    if unexplained:
        found.append(Finding("error", "", "", f"the solver ended with code {code}: {folder / job.MESSAGES} says why"))
    if work.told.start:
        cells, memory = work.told.start["cells"], work.told.start["memory"]
        found.append(Finding("info", "", "", f"can be simulated: {cells:,} cells, {memory / 1e6:.3g} MB of memory"))
    _checks[scene.eulerfsi.uid] = found
    if not unexplained:
        (folder / "scene.usdc").unlink(missing_ok=True)
        job.free(folder)
    return found


def free(scene: bpy.types.Scene) -> None:
    """Deletes the bake and what shows it. Raises JobError, OSError."""
    folder = folder_of(scene)
    if whose := is_foreign(scene, folder):
        raise job.JobError(f"{folder} holds the bake of {whose}: it is not this scene's to delete")
    load.remove(scene)
    (folder / "scene.usdc").unlink(missing_ok=True)
    job.free(folder)
    if not scene.eulerfsi.folder:
        with contextlib.suppress(OSError):  # another scene has a bake beside it
            folder.parent.rmdir()
    _jobs.pop(str(folder), None)
    _checks.pop(scene.eulerfsi.uid, None)


def follow() -> None:
    """From now on looks at bakes by a timer, where Blender has one that fires."""
    if not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=_PAUSE, persistent=True)


def _look() -> float | None:
    alive = [look_at(scene) for scene in bpy.data.scenes]
    for window in bpy.context.window_manager.windows if bpy.context.window_manager else ():
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
    return _PAUSE if any(alive) else None


def look_at(scene: bpy.types.Scene) -> bool:
    """Shows what is new of a scene's bake; whether it runs."""
    now = status(scene)
    if now.folder is None or now.kind in ("foreign", "damaged"):
        return False
    running = now.kind in job.RUNNING
    if bpy.app.is_job_running("RENDER"):
        return running  # what is rendered must not change
    try:
        load.refresh(scene, now.folder, now.cache, final=not running)
    except (OSError, RuntimeError, ValueError) as error:  # the host lives, whatever a half-written file is like
        print(f"Euler FSI: frames are not shown: {error}")
    return running


def wait(scene: bpy.types.Scene, work: job.Job) -> Status:
    """Until the bake ends, showing its frames; for scripts and background."""
    while work.alive:
        time.sleep(_PAUSE / 4)
        look_at(scene)
    work.read()
    look_at(scene)
    return status(scene)


def forget() -> None:
    """Lets go of everything; bakes go on."""
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    _jobs.clear()
    _checks.clear()


@bpy.app.handlers.persistent
def on_load(_file: str) -> None:
    """Another file is open: what the last one's jobs were is found again on disk, bakes that run are followed."""
    _jobs.clear()
    _checks.clear()
    thickness.forget()
    if any(scene.eulerfsi.uid for scene in bpy.data.scenes):
        follow()


def register() -> None:
    bpy.app.handlers.load_post.append(on_load)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(on_load)
    forget()
