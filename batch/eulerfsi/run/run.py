"""One run over the frames of a scene: steps, statistics, checkpoints, signals, warnings."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from pathlib import Path
from typing import Any

import numpy as np

from ..cache.cache import Cache
from ..cache.pictures import PREVIEW, Pictures
from ..errors import Cancelled, DivergedError, LibraryError, StrictError
from ..log import Log
from ..progress import Progress
from ..scene import memory
from ..scene.parts import Collider, Scene, beyond_faces, face_name, open_faces
from ..solver import binding, c_api
from .build import Build
from .checkpoints import Checkpoints
from .contacts import FrameContacts
from .measures import Watched
from .stop import Stop
from .watch import Watch

# What moves as given, in a step of stats.jsonl: fields of its EfsiPinReaction.
_GIVEN_COLUMNS = {"pin_impulses": "impulse", "pin_angular_impulses": "angular_impulse", "prescribed_work": "work"}
_RESUME = "continue with --resume"
# Fields of EfsiStepInfo that say what limited a step, and the names of its rules.
_LIMIT = ("limit_rule", "limiting_solid", "limiting_other")
_RULES = {number: name for name, number in c_api.StepRule.items()}
# Fields of EfsiStepInfo that count.
_COUNTERS = ("steps", "velocity_iterations", "pressure_iterations", "degenerate_cells", "retries", "unconverged")


@dataclasses.dataclass
class Result:
    """A finished run. preview: the picture, None where nothing could draw it; resumed: it continued a cache;
    nothing_to_do: the cache was complete already."""

    folder: Path
    root: Path
    preview: Path | None
    resumed: bool
    nothing_to_do: bool = False


def _way_out(scene: Scene, facts: dict[str, Any]) -> str:
    """The open wall beyond which a solid is farthest."""
    middle = 0.5 * (np.array(facts["extent_min"]) + np.array(facts["extent_max"]))
    beyond = beyond_faces(scene.domain, middle, middle)
    return f"wall{face_name(max(open_faces(scene.domain) or range(6), key=lambda face: beyond[face]))}"


def _lands(now: float, start: float, target: float) -> bool:
    """Whether a frame that is continued at `now` ends at the same instant, to the last bit."""
    return now + (target - now) == start + (target - start)


class Run:
    """One run over the frames of a scene."""

    def __init__(
        self,
        scene: Scene,
        cache: Cache,
        build: Build,
        log: Log,
        progress: Progress,
        checkpoints: Checkpoints,
        stop: Stop,
        strict: bool = False,
        flipbook: bool = False,
    ) -> None:
        self.scene, self.cache, self.build, self.log = scene, cache, build, log
        self.checkpoints, self.strict = checkpoints, strict
        self.simulation = build.simulation
        self.progress = progress
        self.pictures = Pictures(cache.folder, scene, flipbook)
        self.stop = stop
        self.surfaces: list[tuple[np.ndarray, np.ndarray]] = []
        self.warned: set[str] = set()  # jets
        self.brought: dict[str, float] = {}  # by every jet in this frame so far: the largest flux of a step
        self.contacts = FrameContacts()
        self.watch = Watch(Watched.of(scene), log)

    def execute(self, resumed: bool) -> Result:
        """Runs to the last frame."""
        folder, scene = self.cache.folder, self.scene
        result = Result(folder, folder / f"{scene.name}.usda", None, resumed)
        if self.cache.complete:
            self._start(scene.frames.last)
            self._be_strict(scene.frames.last, self.cache.manifest.data.get("warnings", []))
            self.cache.finish("complete")
            self._draw_late()
            result.nothing_to_do, result.preview = True, self._picture()
            return result
        with self.stop.signals.installed():
            try:
                self._frames()
            except Cancelled:
                self._leave("interrupted")
                raise
            except StrictError as error:
                self.log.error(str(error))
                self._leave("strict")
                raise
            except Exception as error:
                with contextlib.suppress(Exception):  # a full disk must not hide the first error
                    self.log.error(str(error) or type(error).__name__)
                    self._leave("failed")
                raise
        self._leave("complete")
        result.preview = self._picture()
        return result

    def _start(self, done: int) -> None:
        """done: the last frame that is there already."""
        scene, definition = self.scene, self.build.definition
        self.progress.start(
            "simulate",
            scene.frames,
            done - scene.frames.first + 1,
            scene=str(scene.path),
            scene_hash=self.cache.manifest.data["scene_hash"],
            folder=str(self.cache.folder),
            threads=definition["threads"],
            memory=memory.need(scene, definition["memory_limit"]),
            memory_limit=definition["memory_limit"],
            cells=scene.cells,
        )

    def _frames(self) -> None:
        frames, simulation = self.scene.frames, self.simulation
        done = frames.first - 1
        if self.cache.checkpoint:
            restore = simulation.restore_state if self.cache.is_foreign else simulation.restore_checkpoint
            restore(self.cache.folder / self.cache.checkpoint["file"])
            done = self.cache.checkpoint["frame"]
            if stopped := self.cache.checkpoint.get("stopped"):
                self.contacts.add(**stopped)
            self.watch.replay(self.cache.stats())
            self.surfaces = self.build.surfaces()
        self.cache.set_warnings(self.watch.warnings, at_once=True)
        what = f"frames {frames} of {self.scene.path.name}, {self.build.definition['threads']} threads"
        self.log.info(f"simulate {what}" + (f", from frame {done}" if done >= frames.first else ""))
        self.pictures.forget_after(done)
        self._start(done)
        self._be_strict(done, self.watch.warnings)
        if done < frames.first:
            self._finish_frame(frames.first, 0.0)
            self._checkpoint(frames.first)
            done = frames.first
            self._be_strict(done, self.watch.warnings)
        for frame in range(done + 1, frames.last + 1):
            begun = time.monotonic()
            target = (frame - frames.first) / self.scene.fps
            self._advance(frame, target)
            self._finish_frame(frame, time.monotonic() - begun)
            stop = self.stop.is_due  # asked once: a signal may come at any line
            if self.checkpoints.due(frame - frames.first) or frame == frames.last:
                self._checkpoint(frame)
            elif stop or (self.strict and self.watch.warnings):
                self._checkpoint(frame, stopped=True)
            self._be_strict(frame, self.watch.warnings)
            if stop and frame < frames.last:
                raise self.stop.error()

    def _be_strict(self, frame: int, warnings: list[dict[str, Any]]) -> None:
        """Stops a run with --strict that has warnings."""
        if self.strict and warnings:
            codes = ", ".join(sorted({warning["code"] for warning in warnings}))
            raise StrictError(f"stopped by --strict after frame {frame} ({codes}); {_RESUME} without --strict")

    def _checkpoint(self, frame: int, stopped: bool = False) -> None:
        part = self.contacts.part() if stopped else None
        self.cache.save_checkpoint(frame, self.simulation, self.checkpoints.keep, part)

    def _advance(self, frame: int, target: float) -> None:
        """To `target` seconds; every step is a line of the statistics."""
        simulation, start = self.simulation, self.simulation.time
        if target - start < 1e-9 / self.scene.fps:
            return  # the checkpoint was taken at the very end of the frame
        self._set_motions(frame)
        sums = dict.fromkeys(_COUNTERS, 0)

        def record(info: dict[str, Any]) -> None:
            """The library sums counters over the steps of a call; a line holds those of one step."""
            if info.get("steps", 0) > sums["steps"]:
                own = {name: info[name] - sums[name] for name in _COUNTERS}
                sums.update({name: info[name] for name in _COUNTERS})
                line = {"event": "step", "frame": frame, **info, **own, **self._limit(info), **self._step_columns()}
                for name in _LIMIT:
                    del line[name]
                self.cache.add_stats(line)
                self.watch.step(line)

        def between(fraction: float, step: dict[str, Any]) -> bool:
            record(step)
            self.progress.between_steps(frame, fraction, step["time"])
            # Out of time: not before there is a step that a checkpoint keeps, so that run after run comes to an end.
            kept = sums["steps"] > 0 and _lands(step["time"], start, target)
            return fraction < 1 - 1e-9 and (self.stop.by_signal or (self.stop.out_of_time and kept))

        try:
            info = simulation.advance(target - start, between)
        except LibraryError as error:
            if error.status == binding.ERROR_CANCELLED:
                self.contacts.add(simulation.contacts(), sums["velocity_iterations"])
                self._checkpoint_inside(frame, start, target)
                raise self.stop.error() from error
            if error.status == binding.ERROR_DIVERGED:
                raise DivergedError(f"frame {frame}: {error}", prim=error.prim) from error
            raise LibraryError(error.status, f"frame {frame}: {error}", error.prim) from error
        record(info)
        self.contacts.add(simulation.contacts(), info["velocity_iterations"])
        if info["unconverged"] or info["degenerate_cells"]:
            self.log.info(
                f"frame {frame}: {info['unconverged']} solves at their iteration limit, "
                f"{info['degenerate_cells']} degenerate cells"
            )

    def _set_motions(self, frame: int) -> None:
        """What is given moves from the pose, and the points, of the frame before to those of this one."""
        start, end = ((frame - back - self.scene.frames.first) / self.scene.fps for back in (1, 0))
        for given in self.build.given:
            body = given.part
            shape = body.shape if isinstance(body, Collider) else None
            try:
                if body.motion.moves:
                    poses = body.motion.pose(frame - 1), body.motion.pose(frame)
                    self.simulation.set_motion(given.id, start, end, poses)
                if shape:
                    self.simulation.set_points(given.id, start, end, (shape.points(frame - 1), shape.points(frame)))
            except LibraryError as error:
                driver = body.motion.driver or body.path
                raise LibraryError(error.status, f"{driver}: frame {frame}: {error}", driver) from error

    def _step_columns(self) -> dict[str, Any]:
        """What the last step did beside its counters: repairs, changes by the transport, energies if asked for."""
        columns: dict[str, Any] = {
            "repairs": self.simulation.repairs(),
            "transport_error": {
                solid.part.path: self.simulation.transport_error(solid.id) for solid in self.build.solids
            },
        }
        if self.build.given:
            reactions = {given.part.path: self.simulation.pin_reaction(given.id) for given in self.build.given}
            for column, field in _GIVEN_COLUMNS.items():
                columns[column] = {path: reaction[field] for path, reaction in reactions.items()}
        emitters = [emitter for emitter in self.build.emitters if emitter.part.is_jet]
        jets: dict[str, float] = {}
        for emitter in emitters:  # one that moves has several ids
            flux = self.simulation.emitter_flux(emitter.id)
            jets[emitter.part.path] = jets.get(emitter.part.path, 0.0) + flux
        if jets:
            columns["emitter_flux"] = jets
            self.brought = {path: max(abs(flux), self.brought.get(path, 0.0)) for path, flux in jets.items()}
        if self.scene.domain["energy_ledger"]:
            columns["energy"] = self.simulation.energy_ledger()
        return columns

    def _limit(self, info: dict[str, Any]) -> dict[str, Any]:
        """What limited the last step: the rule by its name, and the prims that it looked at."""
        rule, *bodies = (info[name] for name in _LIMIT)
        return {"limit": {"rule": _RULES[rule], "bodies": [self.build.names[body] for body in bodies if body]}}

    def _checkpoint_inside(self, frame: int, start: float, target: float) -> None:
        """A checkpoint between two frames, where continuing from it lands on the same instant to the last bit."""
        now = self.simulation.time
        if now == start or _lands(now, start, target):
            self._checkpoint(frame - 1, stopped=True)
        else:
            self.log.info(
                f"frame {frame}: stopped in its first steps; a resumed run continues from an earlier checkpoint"
            )

    def _finish_frame(self, frame: int, seconds: float) -> None:
        solids = {solid.part.path: self.simulation.solid_diagnostics(solid.id) for solid in self.build.solids}
        for facts in solids.values():
            del facts["memory_bytes"]  # another one after a checkpoint was read; `profile` has the memory of all
        left = [path for path, facts in solids.items() if facts["elements"] == 0]  # else the run would have ended
        self._report_left(frame, {path: solids[path] for path in left})
        self.surfaces = self.build.surfaces()
        self.cache.write_frame(frame, self.simulation, self.surfaces, left)
        self.pictures.frame(frame, self.surfaces, self._smoke)
        self._look_at_jets(frame)
        line = {"event": "frame", "frame": frame, "time": self.simulation.time, "seconds": round(seconds, 4)}
        line |= {"steps": self.simulation.steps, "solids": solids, "fluid": self.simulation.fluid_diagnostics()}
        line |= self.contacts.columns(self.build.names)
        self.contacts = FrameContacts()
        self.cache.add_stats({**line, "profile": self.simulation.profile()})
        new = self.watch.frame(line)
        self.cache.set_warnings(self.watch.warnings, at_once=new)
        self.progress.frame_done(
            frame, time=self.simulation.time, seconds=round(seconds, 4), steps=self.simulation.steps
        )

    def _report_left(self, frame: int, left: dict[str, dict[str, Any]]) -> None:
        """Warns, once a solid, that it has left the box."""
        known = self.cache.manifest.left()
        for path, facts in left.items():
            if path not in known:
                self.log.warning(
                    f"{path}: frame {frame}: by {self.simulation.time:.4g} s it has left the box through "
                    f"{_way_out(self.scene, facts)}: it is no longer simulated and is invisible from this frame on; "
                    "a larger domain keeps it",
                    "LeftDomain",
                    path,
                )

    def _look_at_jets(self, frame: int) -> None:
        """Warns, once a jet, of one that blew all the frame and has brought nothing in; in a closed box none does."""
        brought, self.brought = self.brought, {}
        if not open_faces(self.scene.domain):
            return
        end = (frame - self.scene.frames.first) / self.scene.fps
        for emitter in self.scene.emitters:
            path, values = emitter.path, emitter.values
            steady = not emitter.keys and emitter.over_time("velocity").any()
            on = values["start_time"] <= end - 1 / self.scene.fps and end <= values["end_time"]
            if steady and on and brought.get(path) == 0.0 and path not in self.warned:
                self.warned.add(path)
                self.log.warning(
                    f"{path}: frame {frame}: the emitter has a velocity but adds no fluid: no part of its region "
                    "is free of solids and colliders",
                    "IdleJet",
                    path,
                    "eulerfsi:velocity",
                )

    def _leave(self, status: str) -> None:
        """What every run does at its end: statistics, warnings, the layer that opens the cache, the picture."""
        self.watch.sum_up()
        self.cache.finish(status)
        if self.cache.manifest.last_frame is None:
            return
        self._draw()
        self.log.info(f"{status}; last frame {self.cache.manifest.last_frame}")

    def _draw_late(self) -> None:
        """The picture of a run that was killed after its last checkpoint."""
        last = self.cache.manifest.data["checkpoints"][-1]
        if self._picture() is None and last["frame"] == self.cache.manifest.last_frame:
            self.simulation.restore_state(self.cache.folder / last["file"])
            self.surfaces = self.build.surfaces()
            self._draw()

    def _draw(self) -> None:
        """The picture, of the last frame."""
        made = len(self.surfaces) == len(self.scene.simulated)  # a frame, in this run
        if made and (self.surfaces or self.scene.has_smoke):
            frames = map(int, self.cache.manifest.frames)
            if not self.pictures.finish(frames, self.surfaces, self._smoke):
                self.log.info("no picture: drawing needs matplotlib")

    def _smoke(self) -> np.ndarray | None:
        return self.simulation.field("smoke_density")[0][0] if self.scene.has_smoke else None

    def _picture(self) -> Path | None:
        path = self.cache.folder / PREVIEW
        return path if path.is_file() else None
