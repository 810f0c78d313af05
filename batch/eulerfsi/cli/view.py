"""`view`: a cache as one HTML page that plays in a browser."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from .. import __version__, files
from ..cache import stats_file
from ..cache.lock import is_held
from ..cache.manifest import Manifest
from ..errors import CacheIOError, UsageError
from ..frames import file_number
from ..run.watch import last_text
from ..scene.parts import open_faces
from ..scene.read import open_stage
from ..scene.shown import parameter_rows
from ..scene.space import transform_points
from ..view.packing import Blobs
from ..view.page import frame_size, write_page
from ..view.shapes import FrameLayer, Item, Reader, drawn_prims, radius
from ..view.smoke import MOST_CELLS, Volumes, find_volumes, pack_smoke

_SUFFIX = ".html"
_MEGABYTE = 1_000_000
_LEAST_CELLS = 8_000  # of the smoke, before frames are left out
_LEAST_SHARE = 0.03
_MOST_SAMPLES = 1500  # of a curve
_VOLUME_RANGE = 0.02  # least height of the plot of volumes


@dataclasses.dataclass
class View:
    """A page that was written. notes: what is not shown as it is in the cache."""

    path: Path
    bytes: int
    notes: list[str]


def view(folder: Path, output: Path | None, every: int, max_mb: float) -> View:
    """Writes the page of a cache, by default ./<cache>.html.

    Raises SceneError where the folder is no cache, CacheIOError where it has no frame yet or a damaged file, UsageError
    for a page that cannot be as small as `max_mb`.
    """
    output = page_file(folder, output)
    text, notes, _ = make_page(folder, every, max_mb)
    return write(output, text, notes)


def make_page(folder: Path, every: int, max_mb: float) -> tuple[str, list[str], float]:
    """(the page of a cache, what of it is not shown as it is, seconds from its first frame to its last)."""
    source = _Source(folder)
    text, notes = _fit(source, every, max_mb * _MEGABYTE)
    return text, notes, (source.frames[-1] - source.frames[0]) / source.data["fps"]


def write(output: Path, text: str, notes: list[str]) -> View:
    """Writes a page."""
    with files.replacing(output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return View(output, len(text.encode()), notes)


def page_file(folder: Path, output: Path | None) -> Path:
    """Where a page goes. Raises UsageError."""
    output = output or Path(f"{folder.resolve().name}{_SUFFIX}")
    if output.suffix.lower() not in (_SUFFIX, ".htm"):
        raise UsageError(f"--output {output}: must end with {_SUFFIX}")
    return output


class _Source:
    """A cache, opened: its stage, the frames that are whole, its statistics."""

    def __init__(self, folder: Path) -> None:
        self.manifest = Manifest.load(folder)
        self.data = self.manifest.data
        self.frames = sorted(map(int, self.manifest.frames))
        root = folder / self.data["scene"]
        if not self.frames or not root.is_file():
            raise CacheIOError(f"{folder}: has no finished frame yet: there is nothing to show")
        self.stage = open_stage(root)
        self.name = root.stem
        self.domain = next(path for path, values in self.data["parameters"].items() if "voxel_size" in values)
        self.kinds = {path: parameter_rows(values)[0] for path, values in self.data["parameters"].items()}
        self.values = self.data["parameters"][self.domain]
        self.lines = stats_file.read(folder)
        for checkpoint in self.data["checkpoints"][-1:]:
            if fault := stats_file.fault(folder, checkpoint["stats"]):
                raise CacheIOError(f"{folder / stats_file.NAME}: {fault}")
        self.box = self._box()
        self.edge = float(np.ptp(self.box, axis=0).max())
        self.flat = self._flat()

    def _box(self) -> np.ndarray:
        """(8, 3) corners of the domain in world space; bit k of the number: upper along axis k."""
        prim = self.stage.GetPrimAtPath(self.domain)
        first = self.data["first"]
        place = np.array(UsdGeom.XformCache(Usd.TimeCode(first)).GetLocalToWorldTransform(prim))
        half = np.array(self.values["domain_size"]) / 2 / UsdGeom.GetStageMetersPerUnit(self.stage)
        axes = place[:3, :3] / np.linalg.norm(place[:3, :3], axis=1, keepdims=True)
        signs = np.array([[1 if number >> k & 1 else -1 for k in range(3)] for number in range(8)])
        return place[3, :3] + (signs * half) @ axes

    def _flat(self) -> np.ndarray | None:
        """Of a 2-D scene the direction to look from, in the page's space."""
        size = np.array(self.values["domain_size"])
        axis = int(size.argmin())
        if size[axis] > 1.5 * self.values["voxel_size"]:
            return None
        across = (self.box[1 << axis] - self.box[0]) @ self.to_page()[:3, :3].T
        return across / np.linalg.norm(across)

    def to_page(self) -> np.ndarray:
        """(4, 4) for column vectors, world space to the page's: y up, longest edge 1, the domain in the middle."""
        turn = np.eye(3)
        if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z:
            turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        matrix = np.eye(4)
        matrix[:3, :3] = turn / self.edge
        matrix[:3, 3] = -matrix[:3, :3] @ self.box.mean(axis=0)
        return matrix

    def file(self, frame: int, suffix: str) -> Path | None:
        """A file of a frame by its suffix; None where it has none. Raises CacheIOError where it is damaged."""
        for name, facts in self.manifest.frames[str(frame)]["files"].items():
            if name.endswith(suffix):
                path = self.manifest.folder / name
                if not path.is_file() or path.stat().st_size != facts["bytes"]:
                    state = "is damaged" if path.is_file() else "is missing"
                    raise CacheIOError(f"{path}: {state}; `info` verifies the cache, --resume makes it whole")
                return path
        return None

    def layer(self, frame: int) -> FrameLayer:
        """What the run has written of a frame."""
        path = self.file(frame, ".usdc")
        if path is None:
            raise CacheIOError(f"{self.manifest.folder}: frame {file_number(frame)} has no layer")
        return FrameLayer(path, frame)

    @functools.lru_cache(maxsize=1)  # noqa: B019 - lives as long as the command
    def items(self, every: int) -> list[Item]:
        """What is drawn in every N-th frame."""
        frames = self.frames[::every]
        reader = Reader(self.stage, frames, [self.layer(frame) for frame in frames], self.kinds)
        prims = drawn_prims(self.stage, self.domain)
        found = (reader.item(prim, self.hidden_from(str(prim.GetPath()))) for prim in prims)
        return [item for item in found if item]

    def hidden_from(self, path: str) -> int | None:
        """Frame in which a solid, or the one that carries a passenger, has left."""
        left = self.manifest.left()
        carrier = self.data["parameters"].get(path, {}).get("carried_by", path)
        return left.get(carrier)


def _fit(source: _Source, every: int, most: float) -> tuple[str, list[str]]:
    """The page, with coarser smoke and then fewer frames until it is small enough; notes on what was left out."""
    cells, wanted = MOST_CELLS, every
    while True:
        made = _Page(source, wanted, cells)
        text = made.text(every, most)
        size = len(text.encode())
        if size <= most:
            return text, made.notes(every, most)
        room = most - (size - made.smoke_size)  # for smoke
        share = room / max(made.smoke_size, 1)
        if cells > _LEAST_CELLS and share > _LEAST_SHARE:
            cells = max(int(min(made.cells, cells) * min(0.9 * share, 0.9)), _LEAST_CELLS)
        elif len(made.frames) > 1:
            wanted *= 2
        else:
            least = f"{size / _MEGABYTE:.2f} MB with one frame ({frame_size() / _MEGABYTE:.2f} MB without any)"
            raise UsageError(f"--max-mb {most / _MEGABYTE:g}: the page of {source.manifest.folder} needs {least}")


class _Page:
    """One attempt at a page, with every N-th frame and smoke of at most so many cells."""

    def __init__(self, source: _Source, every: int, most_cells: int) -> None:
        self.source, self.every = source, every
        self.frames = source.frames[::every]
        self.blobs = Blobs()
        self.items = [self._packed(item) for item in source.items(every)]
        before = self.blobs.size
        self.smoke, self.factor, self.cells = None, 1, 0
        volumes: Volumes | None = find_volumes([source.file(frame, ".vdb") for frame in self.frames])
        if volumes:
            self.factor = volumes.factor(most_cells)
            self.smoke = pack_smoke(volumes, self.factor, source.to_page(), source.flat is not None, self.blobs)
            self.cells = int(np.prod(self.smoke["cells"]))
        self.smoke_size = self.blobs.size - before

    def _packed(self, item: Item) -> dict[str, Any]:
        """An item as the script reads it."""
        frames = transform_points(item.frames, self.source.to_page().T)
        shown = frames if len(frames) == 1 else frames[np.array(item.visible)]
        low, high = shown.min(axis=(0, 1)), shown.max(axis=(0, 1))
        facts = {
            "path": item.path,
            "kind": item.kind,
            "form": item.form,
            "color": item.color,
            "roughness": item.roughness,
            "low": low.tolist(),
            "size": (high - low).tolist(),
            "still": len(frames) == 1,
            "visible": None if all(item.visible) else item.visible,
            "point_count": frames.shape[1],
            "triangle_count": len(item.triangles),
            "points": self.blobs.points(frames, low, high - low),
        }
        if item.form == "mesh":
            corners = None if item.corners is None else self.blobs.integers(item.corners)
            return {**facts, "triangles": self.blobs.integers(item.triangles), "corners": corners}
        return {**facts, "counts": item.counts, "radius": radius(item, self.source.edge)}

    def notes(self, every: int, most: float) -> list[str]:
        """What a viewer must know."""
        source, data, notes = self.source, self.source.data, []
        total = data["last"] - data["first"] + 1
        if len(source.frames) < total:
            state = "is still running" if is_held(source.manifest.folder) else "has not finished"
            notes.append(f"The simulation {state}: {len(source.frames)} of {total} frames.")
        if self.every > 1:
            why = f", so that the page stays below {most / _MEGABYTE:g} MB" if self.every > every else ""
            notes.append(f"Every {_ordinal(self.every)} frame is shown{why}.")
        if self.factor > 1:
            voxel = self.factor * source.values["voxel_size"]
            notes.append(f"The smoke is coarsened to cells of {voxel:g} m, {self.factor} voxels.")
        if data.get("stretches"):
            notes.append("Earlier frames were made with other parameters than those listed.")
        return notes

    def text(self, every: int, most: float) -> str:
        """The HTML."""
        source, data = self.source, self.source.data
        corners = transform_points(source.box, source.to_page().T)
        flat = None if source.flat is None else source.flat.tolist()
        size = " x ".join(str(round(edge / source.values["voxel_size"])) for edge in source.values["domain_size"])
        facts = {
            "frames": self.frames,
            "times": [(frame - data["first"]) / data["fps"] for frame in self.frames],
            "fps": data["fps"],
            "every": self.every,
            "items": self.items,
            "smoke": self.smoke,
            "box": corners.tolist(),
            "flat": flat,
            "open": open_faces(source.values),
            "notes": self.notes(every, most),
            "plots": _plots(source),
            "warnings": [{"frame": w["frame"], "text": last_text(w)} for w in data.get("warnings", [])],
            "parameters": _parameters(data["parameters"]),
            "made": f"Simulated by eulerfsi {data['program']['eulerfsi']}; page by {__version__}.",
        }
        seconds = (self.frames[-1] - data["first"]) / data["fps"]
        subtitle = f"{seconds:.3g} s at {data['fps']:g} frames per second, {size} cells"
        return write_page(source.name, subtitle, facts, self.blobs)


def _ordinal(number: int) -> str:
    ends = {1: "st", 2: "nd", 3: "rd"}
    return f"{number}{'th' if number % 100 in (11, 12, 13) else ends.get(number % 10, 'th')}"


def _parameters(parameters: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    result = []
    for path, values in parameters.items():
        kind, rows = parameter_rows(values)
        result.append({"path": path, "kind": kind, "rows": rows})
    return result


def _plots(source: _Source) -> list[dict[str, Any]]:
    """Curves over time of what the run has recorded, up to the last frame shown."""
    end = (source.frames[-1] - source.data["first"]) / source.data["fps"]
    lines = [line for line in source.lines if line["time"] <= end + 1e-9]
    frames = [line for line in lines if line["event"] == "frame"]
    steps = [line for line in lines if line["event"] == "step"]
    common = {"range": [0.0, end]}
    plots = []
    solids = list(frames[-1]["solids"]) if frames else []
    if solids:
        series = [_series(path, frames, lambda line, p=path: _volume(line["solids"].get(p))) for path in solids]
        plots.append({"title": "Volume", "unit": "of that at rest", "series": series, "least": _VOLUME_RANGE, **common})
        series = [
            _series("solids, kinetic", frames, lambda line: _sum(line["solids"], "kinetic_energy")),
            _series("elastic", frames, lambda line: _sum(line["solids"], "elastic_energy")),
        ]
    else:
        series = []
    if frames:
        series.append(_series("fluid, kinetic", frames, lambda line: line["fluid"]["kinetic_energy"]))
        plots.append({"title": "Energy", "unit": "J", "series": series, "zero": True, **common})
    if steps:
        series = [_series("step", steps, lambda line: 1e3 * line["dt"])]
        plots.append({"title": "Step size", "unit": "ms", "series": series, "zero": True, **common})
        count = [_series("steps", frames[1:], _StepCount(frames))]
        plots.append({"title": "Steps per frame", "unit": "", "series": count, "zero": True, **common})
    return plots


class _StepCount:
    """Steps of a frame, from the sums that the lines have."""

    def __init__(self, frames: list[dict[str, Any]]) -> None:
        self._before = {line["frame"]: before["steps"] for before, line in zip(frames, frames[1:], strict=False)}

    def __call__(self, line: dict[str, Any]) -> int:
        return line["steps"] - self._before[line["frame"]]


def _series(name: str, lines: list[dict[str, Any]], value: Callable[[dict[str, Any]], float | None]) -> dict[str, Any]:
    """Every line's value, thinned to those that are lowest and highest in equal parts where there are many."""
    pairs = [(round(line["time"], 6), value(line)) for line in lines]
    if len(pairs) > _MOST_SAMPLES:
        parts = [
            pairs[i : i + 2 * len(pairs) // _MOST_SAMPLES]
            for i in range(0, len(pairs), 2 * len(pairs) // _MOST_SAMPLES)
        ]
        known = [[pair for pair in part if pair[1] is not None] or part[:1] for part in parts]
        ends = [(min(part, key=lambda p: p[1] or 0), max(part, key=lambda p: p[1] or 0)) for part in known]
        pairs = [pair for low, high in ends for pair in sorted({low, high})]
    return {"name": name, "x": [x for x, _ in pairs], "y": [None if y is None else float(f"{y:.6g}") for _, y in pairs]}


def _volume(solid: dict[str, Any] | None) -> float | None:
    """Of the mesh, over that at rest; None of one that has left or encloses nothing."""
    if not solid or not solid["rest_volume"] or not solid["elements"] or solid["volume_mesh"] is None:
        return None
    return solid["volume_mesh"] / solid["rest_volume"]


def _sum(solids: dict[str, dict[str, Any]], name: str) -> float:
    return sum(solid[name] or 0.0 for solid in solids.values())
