# SPDX-License-Identifier: GPL-3.0-or-later
"""What the solver gets of a scene: evaluated meshes and settings, as scene.json and .npz files (runner/stage.py)."""

from __future__ import annotations

import dataclasses
import json
import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from . import place, properties, table

MESH_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
_RESERVED = {"PhysicsScene", "smoke"}


@dataclasses.dataclass
class Finding:
    """Something that the artist should see. object: name or ""; field: what it is about; level: error, warning."""

    level: str
    object: str
    field: str
    message: str

    @property
    def text(self) -> str:
        where = f"{self.object}: " if self.object and not self.message.startswith(f"{self.object}:") else ""
        return f"{where}{self.message}"


class ExportError(Exception):
    """The scene cannot be exported; findings say why."""

    def __init__(self, findings: list[Finding]) -> None:
        super().__init__("\n".join(finding.text for finding in findings))
        self.findings = findings


def members(scene: bpy.types.Scene, *roles: str) -> list[bpy.types.Object]:
    """Objects of a scene that have one of the roles (any), sorted by name."""
    found = [o for o in scene.objects if o.eulerfsi.role in roles or (not roles and o.eulerfsi.role != "NONE")]
    return sorted(found, key=lambda o: o.name)


def prim_name(name: str) -> str:
    """A USD name of an object's name: ASCII letters, digits, underscores."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    plain = re.sub(r"\W", "_", plain) or "Object"
    return f"_{plain}" if plain[0].isdigit() else plain


def name_prims(scene: bpy.types.Scene) -> None:
    """Gives every member a prim of its own, which stays when the object is renamed; copies get a new one."""
    taken: set[str] = set(_RESERVED)
    objects = members(scene)
    objects.sort(key=lambda o: (o.eulerfsi.prim != prim_name(o.name), o.name))  # before a copy comes its original
    for obj in objects:
        name = base = obj.eulerfsi.prim or prim_name(obj.name)
        number = 1
        while name in taken:
            number += 1
            name = f"{base}_{number}"
        taken.add(name)
        if obj.eulerfsi.prim != name:
            obj.eulerfsi.prim = name


def path_of(obj: bpy.types.Object) -> str:
    return f"/World/{obj.eulerfsi.prim}"


def object_of(scene: bpy.types.Scene, path: str | None) -> bpy.types.Object | None:
    """The member that a prim's path names."""
    names = (path or "").split("/")
    return next((o for o in members(scene) if len(names) > 2 and o.eulerfsi.prim == names[2]), None)


def frames_per_second(scene: bpy.types.Scene) -> float:
    return scene.render.fps / scene.render.fps_base


def check(scene: bpy.types.Scene) -> list[Finding]:
    """What is wrong before the solver has a look."""
    found = []
    domains = members(scene, "DOMAIN")
    if not domains:
        found.append(
            Finding("error", "", "Domain", "there is no domain: add one (Add Domain), or give an object that role")
        )
    if len(domains) > 1:
        names = ", ".join(f"“{o.name}”" for o in domains)
        found += [Finding("error", domains[1].name, "Role", f"two domains: {names}: one must have another role")]
    if not members(scene, "SOLID", "EMITTER"):
        found.append(Finding("error", "", "Role", "nothing moves: give an object the role Solid or Smoke"))
    for obj in members(scene):
        found += _check_object(scene, obj)
    if scene.frame_end <= scene.frame_start:
        text = f"the end frame {scene.frame_end} must be after the start frame {scene.frame_start}"
        found.append(Finding("error", "", "Frame Range", text))
    return found


def _check_object(scene: bpy.types.Scene, obj: bpy.types.Object) -> Iterable[Finding]:
    settings, role = obj.eulerfsi, obj.eulerfsi.role
    allowed = MESH_TYPES | ({"EMPTY"} if role in ("DOMAIN", "FORCE") else set())
    if obj.type not in allowed:
        kinds = "a mesh or an empty" if "EMPTY" in allowed else "a mesh"
        yield Finding("error", obj.name, "Role", f"a {role.lower()} must be {kinds}, not a {obj.type.lower()}")
    if role in ("PIN", "PASSENGER"):
        allowed_roles = ("SOLID",) if role == "PIN" else ("SOLID", "COLLIDER")
        carrier = settings.carrier
        if carrier is None or carrier.name not in scene.objects or carrier.eulerfsi.role not in allowed_roles:
            what = " or ".join(r.lower() for r in allowed_roles)
            yield Finding("error", obj.name, "Belongs To", f"Belongs To must name a {what} of the scene")
    if role == "SOLID" and settings.pin_group and settings.pin_group not in obj.vertex_groups:
        yield Finding(
            "error", obj.name, "Pin Group", f"Pin Group “{settings.pin_group}”: there is no such vertex group"
        )
    scale = place.of(obj).to_scale()
    if min(abs(s) for s in scale) == 0.0:
        yield Finding("error", obj.name, "Scale", f"scale {tuple(round(s, 4) for s in scale)} must not be zero")


def domain_box(obj: bpy.types.Object) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Edges and centre of a box in the object's own space. A mesh: its bounding box; an empty: its shape."""
    if obj.type == "EMPTY":
        edge = obj.empty_display_size * 2
        return (edge,) * 3, (0.0,) * 3
    corners = np.array(obj.bound_box)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return tuple((high - low).tolist()), tuple(((low + high) / 2).tolist())


def world_size(scene: bpy.types.Scene, obj: bpy.types.Object) -> list[float]:
    """Edges of an object's box in metres, along its own axes."""
    edges, _ = domain_box(obj)
    scale = place.of(obj).to_scale()
    unit = scene.unit_settings.scale_length
    return [abs(e * s) * unit for e, s in zip(edges, scale, strict=True)]


@dataclasses.dataclass
class _Track:
    """An object over the frames."""

    obj: bpy.types.Object
    moves: bool  # its transform counts in every frame
    deforms: bool
    matrices: dict[int, list[float]] = dataclasses.field(default_factory=dict)
    points: dict[int, np.ndarray] = dataclasses.field(default_factory=dict)
    faces: tuple[np.ndarray, np.ndarray] | None = None
    pin: np.ndarray | None = None
    values: dict[int, dict[str, Any]] = dataclasses.field(default_factory=dict)


def _mesh_arrays(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, counts and indices of the evaluated mesh: with its modifiers."""
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    counts, indices = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.loops), np.int32)
    mesh.polygons.foreach_get("loop_total", counts)
    mesh.loops.foreach_get("vertex_index", indices)
    evaluated.to_mesh_clear()
    return points.reshape(-1, 3), counts, indices


def _pin_weights(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> np.ndarray:
    """Weights of the pin group at the vertices of the evaluated mesh."""
    group = obj.vertex_groups[obj.eulerfsi.pin_group].index
    evaluated = obj.evaluated_get(depsgraph)
    weights = [next((g.weight for g in v.groups if g.group == group), 0.0) for v in evaluated.data.vertices]
    return np.array(weights, np.float32)


def _values(obj: bpy.types.Object, scope: str) -> dict[str, Any]:
    """{name in the table: value} of an object's settings, SI (angles in degrees)."""
    settings = getattr(obj.eulerfsi, scope)
    return {row["name"]: table.plain(_get(settings, name)) for name, row in table.rows(scope).items()}


def _get(settings: Any, name: str) -> Any:
    value = getattr(settings, name)
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def trimmed(samples: dict[int, Any]) -> dict[int, Any]:
    """Samples without those at the end that change nothing: a longer range of frames is the same scene then."""
    frames = sorted(samples)
    while len(frames) > 1 and samples[frames[-1]] == samples[frames[-2]]:
        frames.pop()
    return {frame: samples[frame] for frame in frames}


class Exporter:
    """Writes the export of one scene. Changes the scene's frame while it does, and sets it back."""

    def __init__(self, scene: bpy.types.Scene, folder: Path) -> None:
        self.scene, self.folder = scene, folder
        self.first, self.last = scene.frame_start, scene.frame_end
        self.tracks: dict[str, _Track] = {}

    def write(self) -> dict[str, Any]:
        """Returns what was written. Raises ExportError, OSError."""
        faults = [finding for finding in check(self.scene) if finding.level == "error"]
        if faults:
            raise ExportError(faults)
        name_prims(self.scene)
        self._sample()
        self.folder.mkdir(parents=True, exist_ok=True)
        for old in self.folder.glob("*.npz"):
            old.unlink()
        prims = [self._entry(track) for track in self.tracks.values() if track.obj.eulerfsi.role != "NONE"]
        self._relate(prims)
        data = {
            "meters_per_unit": table.plain(self.scene.unit_settings.scale_length),
            "fps": frames_per_second(self.scene),
            "first": self.first,
            "last": self.last,
            "gravity": table.plain(self.scene.gravity if self.scene.use_gravity else (0.0, 0.0, 0.0)),
            "prims": prims,
        }
        (self.folder / "scene.json").write_text(json.dumps(data, indent=1), encoding="utf-8")
        return data

    def _sample(self) -> None:
        """Goes through the frames once, for all that may move."""
        for obj in members(self.scene):
            role = obj.eulerfsi.role
            self.tracks[obj.name] = _Track(obj, role in ("COLLIDER", "EMITTER", "PIN"), role == "COLLIDER")
            driver = obj.eulerfsi.pin_to
            if role == "SOLID" and driver and driver.name not in self.tracks and driver.eulerfsi.role == "NONE":
                self.tracks[driver.name] = _Track(driver, True, False)
        for track in self.tracks.values():
            if any(t.obj.eulerfsi.pin_to == track.obj for t in self.tracks.values()):
                track.moves = True
        through = any(track.moves or track.obj.eulerfsi.role == "FORCE" for track in self.tracks.values())
        frames = range(self.first - 1, self.last + 1) if through else range(self.first - 1, self.first + 1)
        now, sub = self.scene.frame_current, self.scene.frame_subframe
        hidden = [track.obj for track in self.tracks.values() if track.obj.hide_viewport]
        try:
            for obj in hidden:  # Blender does not evaluate what is hidden
                obj.hide_viewport = False
            for frame in frames:
                self.scene.frame_set(frame)
                depsgraph = bpy.context.evaluated_depsgraph_get()
                for track in self.tracks.values():
                    self._sample_one(track, frame, depsgraph)
        finally:
            for obj in hidden:
                obj.hide_viewport = True
            self.scene.frame_set(now, subframe=sub)

    def _sample_one(self, track: _Track, frame: int, depsgraph: bpy.types.Depsgraph) -> None:
        obj, role = track.obj, track.obj.eulerfsi.role
        evaluated = obj.evaluated_get(depsgraph)
        solid_starts = role == "SOLID" and frame <= self.first  # its motion before gives its velocity
        if track.moves or solid_starts or frame == self.first:
            track.matrices[frame] = [x for row in evaluated.matrix_world for x in row]
        scope = properties.SCOPE_OF.get(role)
        if scope and frame >= self.first:
            track.values[frame] = _values(obj, scope)  # animation writes to it; a new value reaches no evaluated copy
        if role in ("NONE", "DOMAIN", "FORCE") or obj.type not in MESH_TYPES:
            return
        if frame == self.first or track.deforms:
            points, counts, indices = _mesh_arrays(obj, depsgraph)
            if frame == self.first - 1 and track.deforms:
                track.faces = counts, indices
            self._check_mesh(track, frame, len(points), counts, indices)
            track.points[frame], track.faces = points, (counts, indices)
        if frame == self.first and role == "SOLID" and obj.eulerfsi.pin_group:
            track.pin = _pin_weights(obj, depsgraph)

    def _check_mesh(self, track: _Track, frame: int, size: int, counts: np.ndarray, indices: np.ndarray) -> None:
        name = track.obj.name
        if not len(counts):
            raise ExportError([Finding("error", name, "Mesh", f"its mesh has no faces in frame {frame}")])
        if not track.points:
            return
        before = len(next(iter(track.points.values())))
        same = before == size and np.array_equal(track.faces[0], counts) and np.array_equal(track.faces[1], indices)
        if not same:
            text = f"its mesh has {size} vertices in frame {frame}, {before} before: a collider's faces must not change"
            raise ExportError([Finding("error", name, "Modifiers", text)])

    def _entry(self, track: _Track) -> dict[str, Any]:
        obj, role = track.obj, track.obj.eulerfsi.role
        scope = properties.SCOPE_OF.get(role)
        return {
            "path": path_of(obj),
            "object": obj.name,
            "role": role,
            "shape": self._shape(track),
            "matrices": self._matrices(track),
            "values": {scope: self._over_time(track, scope)} if scope else {},
            "relationships": {},
        }

    def _matrices(self, track: _Track) -> dict[str, list[float]]:
        """By frame; one where nothing moves. Domains and forces: with the box in them, a unit cube or ball."""
        matrices = trimmed(track.matrices)
        if all(matrix == track.matrices[self.first] for matrix in matrices.values()):
            matrices = {self.first: track.matrices[self.first]}
        role = track.obj.eulerfsi.role
        if role in ("DOMAIN", "FORCE"):
            edges, center = domain_box(track.obj)
            box = np.diag([*edges, 1.0])
            box[:3, 3] = center
            matrices = {f: (np.reshape(m, (4, 4)) @ box).ravel().tolist() for f, m in matrices.items()}
        return {str(frame): list(map(float, matrix)) for frame, matrix in matrices.items()}

    def _shape(self, track: _Track) -> dict[str, Any]:
        obj, role = track.obj, track.obj.eulerfsi.role
        if role == "DOMAIN":
            return {"type": "Cube"}
        if role == "FORCE":
            round_ = obj.empty_display_type == "SPHERE" if obj.type == "EMPTY" else obj.eulerfsi.shape == "SPHERE"
            return {"type": "Sphere", "radius": 0.5} if round_ else {"type": "Cube"}
        if role == "NONE":
            return {"type": "Xform"}
        counts, indices = track.faces
        frames = sorted(track.points)
        while len(frames) > 1 and np.array_equal(track.points[frames[-1]], track.points[frames[-2]]):
            frames.pop()
        points = [track.points[frame] for frame in frames]
        if role == "COLLIDER" and (plane := _plane(points, counts)):
            return plane
        still = all(np.array_equal(at, points[0]) for at in points)
        arrays = {
            "points": track.points[self.first] if still else np.stack(points),
            "counts": counts,
            "indices": indices,
        }
        arrays |= {} if still else {"frames": np.array(frames)}
        arrays |= {} if track.pin is None else {"pin": track.pin}
        file = f"{obj.eulerfsi.prim}.npz"
        np.savez(self.folder / file, **arrays)
        return {"type": "Mesh", "file": file, "vertices": len(points[0])}

    def _over_time(self, track: _Track, scope: str) -> dict[str, Any]:
        """Values at the first frame, {frame: value} of those that are animated and may be."""
        first = track.values[self.first]
        result: dict[str, Any] = dict(first)
        for row in table.rows(scope).values():
            name = row["name"]
            if row.get("animated") and any(values[name] != first[name] for values in track.values.values()):
                samples = trimmed({frame: values[name] for frame, values in track.values.items()})
                result[name] = {str(frame): value for frame, value in samples.items()}
        return result

    def _relate(self, prims: list[dict[str, Any]]) -> None:
        """Pins, passengers and what pinned vertices follow."""
        by_path = {entry["path"]: entry for entry in prims}
        for track in list(self.tracks.values()):
            obj, role = track.obj, track.obj.eulerfsi.role
            if role in ("PIN", "PASSENGER"):
                targets = by_path[path_of(obj.eulerfsi.carrier)]["relationships"]
                targets.setdefault("pins" if role == "PIN" else "passengers", []).append(path_of(obj))
            if role == "SOLID" and obj.eulerfsi.pin_group and (driver := obj.eulerfsi.pin_to):
                path = f"/World/{prim_name(driver.name)}_holds_{obj.eulerfsi.prim}"
                prims.append(
                    {
                        "path": path,
                        "object": driver.name,
                        "role": "NONE",
                        "shape": {"type": "Xform"},
                        "matrices": self._matrices(self.tracks[driver.name]),
                        "values": {},
                    }
                )
                by_path[path_of(obj)]["relationships"]["pinTo"] = [path]


def _plane(points: list[np.ndarray], counts: np.ndarray) -> dict[str, Any] | None:
    """A single rectangle across z around its origin, as Blender's Plane is: the upper side of a slab."""
    if counts.tolist() != [4] or len(points[0]) != 4 or any(not np.array_equal(at, points[0]) for at in points):
        return None
    low, high = points[0].min(axis=0), points[0].max(axis=0)
    corners = ((points[0] == low) | (points[0] == high)).all()
    if not corners or low[2] != 0.0 or high[2] != 0.0 or np.abs(low + high).max() > 1e-6:
        return None
    return {"type": "Plane", "width": float(high[0] - low[0]), "length": float(high[1] - low[1])}


def snapshot(scene: bpy.types.Scene) -> dict[str, Any]:
    """What a bake depends on, cheap enough for every redraw: settings and places, not the points of meshes."""
    result: dict[str, Any] = {
        "frames": {"Start": scene.frame_start, "Frame Rate": frames_per_second(scene)},
        "world": {
            "Gravity": table.plain(scene.gravity) if scene.use_gravity else [0.0, 0.0, 0.0],
            "Unit Scale": table.plain(scene.unit_settings.scale_length),
        },
    }
    for obj in members(scene):
        settings = obj.eulerfsi
        scope = properties.SCOPE_OF.get(settings.role)
        facts: dict[str, Any] = {"Role": settings.role, "Mesh": len(obj.data.vertices) if obj.type == "MESH" else 0}
        if not (obj.animation_data and obj.animation_data.action) and not obj.parent and not obj.constraints:
            facts["Place"] = [table.plain(x) for row in place.of(obj) for x in row]
        facts["Pin Group"] = settings.pin_group
        if scope:
            group = getattr(settings, scope)
            facts |= {
                row["label"]: table.plain(_get(group, name))
                for name, row in table.rows(scope).items()
                if not row.get("animated")
            }
        result[settings.prim or prim_name(obj.name)] = facts
    return result


def changes(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """What differs between two snapshots, for people."""
    found = []
    for name in sorted({*before, *now}):
        if name not in before or name not in now:
            found.append(f"{name} is {'new' if name in now else 'gone'}")
            continue
        for key in sorted({*before[name], *now[name]}):
            old, new = before[name].get(key), now[name].get(key)
            if old != new:
                found.append(f"{name}: {key} has changed" if isinstance(old, list) else f"{name}: {key} {old} → {new}")
    return found
