"""The child process of `confine.py`: every path of a scene, judged by where it leads.

`python -m eulerfsi.scene.confine_child SCENE RULES DESCRIPTOR MEMORY PARENT` writes a JSON list of findings to the open
file DESCRIPTOR, each [prim, field, value, limit, message]; an empty one for a scene that stays inside. RULES: those of
`--path-map`, as JSON.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import eulerfsi_usd  # noqa: F401 - the schema
from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from .. import child
from .confine import inside, roots_of
from .mesh_references import files_of_mesh
from .path_map import Rule, map_layers, mapped

MOST_LAYERS, MOST_PRIMS, MOST_FINDINGS = 10_000, 1_000_000, 100
_URI = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
_PATTERN = re.compile(r"<UDIM>|<uvtile\d*>|#+(?:\.#+)?")
_ARCS = ("references", "payload")
_STRUCTURE = ("subLayers", "subLayerOffsets", "primChildren", "properties")  # read above, or without paths
_LISTS = ("explicitItems", "addedItems", "prependedItems", "appendedItems", "deletedItems", "orderedItems")


@dataclasses.dataclass(frozen=True)
class Named:
    """A path as it is written somewhere: in a layer, of a prim or property, in a field."""

    prim: str
    field: str
    path: str


class Walk:
    """Reads layer after layer, none that lies outside. findings: [prim, field, value, limit, message]."""

    def __init__(self, scene: Path, rules: list[Rule]) -> None:
        self.roots, self._rules = roots_of(scene, rules), rules
        self.findings: list[list[str]] = []
        self._waiting, self._seen = [str(scene)], set()
        if fault := self._fault(str(scene)):
            self._refuse(scene.name, Named("/", "scene", str(scene)), fault)
            self._waiting = []

    def run(self) -> None:
        """All layers."""
        while self._waiting and len(self.findings) < MOST_FINDINGS:
            name = self._waiting.pop()
            if name in self._seen:
                continue
            self._seen.add(name)
            if len(self._seen) > MOST_LAYERS:
                limit = f"at most {MOST_LAYERS} layers and mesh files"
                self._refuse(name, Named("/", "subLayers", name), f"must be {limit}")
                return
            outer = Ar.SplitPackageRelativePathOuter(name)[0]
            if not os.path.isfile(outer):
                continue  # a run names what is missing
            if Usd.Stage.IsSupportedFile(name):
                self._layer(name)
            else:
                for field, path in files_of_mesh(Path(outer)):
                    self._judge(name, Named("/", field, path), os.path.join(os.path.dirname(outer), path))

    def _layer(self, name: str) -> None:
        try:
            layer = Sdf.Layer.FindOrOpen(name)
        except (Tf.ErrorException, UnicodeDecodeError):
            return  # the same: a run says why it cannot be opened
        if not layer:
            return
        known = set()
        for named in paths_of(layer):
            known.add(named.path)
            self._judge(name, named, self._absolute(layer, named.path))
        others: list[str] = []
        UsdUtils.ModifyAssetPaths(layer, lambda path: others.append(path) or path)
        for path in dict.fromkeys(others):
            if path and path not in known:
                self._judge(name, Named("/", "asset", path), self._absolute(layer, path))

    def _absolute(self, layer: Sdf.Layer, path: str) -> str:
        """Where USD finds it."""
        try:
            plain = Sdf.Layer.SplitIdentifier(mapped(path, self._rules))[0]
            anchored = layer.ComputeAbsolutePath(plain)
            found = str(Ar.GetResolver().Resolve(anchored)) or anchored
            return os.path.join(os.path.dirname(layer.realPath), found)  # nothing changes where it was found
        except (Tf.ErrorException, ValueError):
            return path

    def _judge(self, file: str, named: Named, absolute: str) -> None:
        """Of one path: refused, or read later."""
        path = mapped(named.path, self._rules)
        if path.startswith("`"):
            fault = "must be a plain path: an expression may lead anywhere"
        elif _URI.match(path):
            fault = "must be a path, not an address or a drive"
        elif "\0" in path or ".." in path.split("\\"):
            fault = "must be a path with / between its parts"
        else:
            fault = self._fault(absolute)
        if fault:
            self._refuse(file, named, fault)
        else:
            self._waiting.append(absolute)

    def _fault(self, absolute: str) -> str:
        """Why a path is refused; "" where it leads inside the scene's folder, to a file or to nothing."""
        outer = Ar.SplitPackageRelativePathOuter(absolute)[0]
        folder, name = os.path.split(outer)
        places = [outer]
        if pattern := _PATTERN.search(name):
            start, end = name[: pattern.start()], name[pattern.end() :]
            if inside(folder, self.roots) and os.path.isdir(folder):
                places += [e.path for e in os.scandir(folder) if e.name.startswith(start) and e.name.endswith(end)]
        for place in places:
            if not inside(place, self.roots):
                return f"must lead to a file below {self.roots[0]}, leads to {os.path.realpath(place)}"
            if os.path.exists(place) and not os.path.isfile(place) and not os.path.isdir(place):
                return "must lead to a file, leads to a device or a pipe"
        return ""

    def _refuse(self, file: str, named: Named, fault: str) -> None:
        value = f"@{named.path}@"
        message = f"{file}: {named.prim}: {named.field} = {value}: {fault} (--confine)"
        self.findings.append([named.prim, named.field, value, fault, message])


def paths_of(layer: Sdf.Layer) -> Iterator[Named]:
    """Every path in a layer: sublayers, references, payloads, clips, values and samples, in all variants."""
    specs: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, specs.append)
    for path in layer.subLayerPaths:
        yield Named("/", "subLayers", path)
    for place in dict.fromkeys([Sdf.Path.absoluteRootPath, *specs]):
        spec = layer.GetObjectAtPath(place)
        if not spec:
            continue
        prim = str(place.GetPrimPath()) or "/"
        for key in spec.ListInfoKeys():
            field = place.name if key == "default" else f"{place.name}: {key}" if place.IsPropertyPath() else key
            if key in _ARCS:
                items = spec.GetInfo(key)
                for item in (one for name in _LISTS for one in getattr(items, name)):
                    yield from (Named(prim, key, path) for path in [item.assetPath] if path)
                    yield from _in_value(prim, key, getattr(item, "customData", {}))
            elif key == "timeSamples":
                for time in layer.ListTimeSamplesForPath(place) if _holds_assets(spec) else ():
                    yield from _in_value(prim, f"{place.name} at {time:g}", layer.QueryTimeSample(place, time))
            elif key not in _STRUCTURE:
                yield from _in_value(prim, field, spec.GetInfo(key))


def _holds_assets(spec: Sdf.Spec) -> bool:
    """Whether the samples of an attribute are paths, by its type; others `ModifyAssetPaths` finds by their values."""
    return isinstance(spec, Sdf.AttributeSpec) and spec.typeName.scalarType == Sdf.ValueTypeNames.Asset


def _in_value(prim: str, field: str, value: Any) -> Iterator[Named]:
    """Paths in a value, which may be a dictionary or an array."""
    if isinstance(value, Sdf.AssetPath):
        if value.path:
            yield Named(prim, field, value.path)
    elif isinstance(value, (Sdf.AssetPathArray, list, tuple)):
        for item in value:
            yield from _in_value(prim, field, item)
    elif isinstance(value, dict):
        for key, item in value.items():
            if key == "templateAssetPath" and isinstance(item, str):
                yield Named(prim, f"{field}:{key}", item)
            else:
                yield from _in_value(prim, f"{field}:{key}", item)


def _too_many_prims(scene: Path, rules: list[Rule]) -> list[list[str]]:
    """A finding where references multiply what a small file holds beyond what can be read."""
    held = map_layers(scene, rules)
    stage = Usd.Stage.Open(held[0] if held else str(scene))
    prims = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate))
    for count, prim in enumerate(prims, 1):
        if count > MOST_PRIMS:
            limit, value = f"at most {MOST_PRIMS} prims in a scene", f"more than {MOST_PRIMS} prims"
            message = f"{scene}: {prim.GetPath()}: references = {value}: must be {limit} (--confine)"
            return [[str(prim.GetPath()), "references", value, limit, message]]
    return []


def main(arguments: list[str]) -> None:
    """Judges the scene and writes the answer."""
    out, memory = child.begin(arguments[2:])
    scene, rules = Path(arguments[0]), [Rule(*fields) for fields in json.loads(arguments[1])]
    with out:
        child.limit(memory)
        walk = Walk(scene, rules)
        walk.run()
        findings = walk.findings
        if not findings:
            try:
                findings = _too_many_prims(scene, rules)
            except (Tf.ErrorException, UnicodeDecodeError):
                findings = []  # a run says why
        out.write(json.dumps(findings[:MOST_FINDINGS]).encode())


if __name__ == "__main__":
    main(sys.argv[1:])
