"""`--path-map A=B`: files that a scene refers to under one folder are looked for under another, as on a farm node."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path

from pxr import Sdf, Tf, UsdUtils

from .. import files
from ..errors import UsageError


@dataclasses.dataclass(frozen=True)
class Rule:
    """Paths under the folder `source` are those under `target`. windows: `source` has a drive letter, in any case."""

    source: str
    target: str
    windows: bool = False

    def apply(self, path: str) -> str | None:
        """The path under `target`, None where it does not lie under `source`."""
        source, given = self.source, path
        if self.windows:
            source, given = source.replace("\\", "/").lower(), path.replace("\\", "/")
        source = source.rstrip("/")
        start = given.lower() if self.windows else given
        if not (start == source or start.startswith(f"{source}/")):
            return None
        return self.target.rstrip("/") + given[len(source) :]


def parse_rules(options: Iterable[str]) -> list[Rule]:
    """Of options A=B, or the name of a file of Open Job Description (pathmapping-1.0); the longest A first.

    Raises UsageError.
    """
    rules: list[Rule] = []
    for option in options:
        source, equals, target = option.partition("=")
        if equals:
            rules.append(_rule(f"--path-map {option}", source.strip(), target.strip()))
        else:
            rules += _read(Path(option))
    return sorted(rules, key=lambda rule: -len(rule.source))


def _rule(where: str, source: str, target: str, windows: bool = False) -> Rule:
    if not source or not target:
        raise UsageError(f"{where}: must read A=B, the old folder and the new one, or name a file of rules")
    absolute = windows or source.startswith("/") or source[1:3] in (":/", ":\\")
    if not absolute:
        raise UsageError(f"{where}: {source}: must be absolute, for paths relative to the scene need no map")
    if not Path(target).is_absolute():
        raise UsageError(f"{where}: {target}: must be absolute")
    return Rule(source, target, windows or source[1:2] == ":")


def _read(path: Path) -> list[Rule]:
    where = f"--path-map {path}"
    try:
        data = files.read_tagged(path, "a file of Open Job Description's rules", True, version="pathmapping-1.0")
    except OSError as error:
        raise UsageError(f"{where}: must read A=B, or name a file of rules: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f'{where}: {error}; such a file holds "version": "pathmapping-1.0"') from error
    rules = []  # a session without rules has an empty object
    for number, entry in enumerate(data.get("path_mapping_rules", []), 1):
        try:
            windows = entry["source_path_format"].upper() == "WINDOWS"
            rules.append(_rule(f"{where}: rule {number}", entry["source_path"], entry["destination_path"], windows))
        except (KeyError, TypeError, AttributeError) as error:
            needed = "source_path_format, source_path and destination_path"
            raise UsageError(f"{where}: rule {number}: must have {needed}") from error
    return rules


def mapped(path: str, rules: Iterable[Rule]) -> str:
    """A path as this machine has it."""
    return next((found for rule in rules if (found := rule.apply(path)) is not None), path)


def map_layers(root: Path, rules: list[Rule]) -> list[Sdf.Layer]:
    """Maps what the layers of a scene refer to, in memory alone. The stage has to be opened while the result is held.

    A layer that cannot be read is left to the stage, which says why.
    """
    held: dict[str, Sdf.Layer] = {}
    waiting = [str(root)]
    while rules and waiting:
        name = waiting.pop()
        try:
            layer = Sdf.Layer.FindOrOpen(name)
        except (Tf.ErrorException, UnicodeDecodeError):
            layer = None
        if not layer or layer.identifier in held or layer.GetFileFormat().IsPackage():
            continue
        held[layer.identifier] = layer
        UsdUtils.ModifyAssetPaths(layer, lambda path: mapped(path, rules))
        waiting += [layer.ComputeAbsolutePath(path) for path in layer.GetCompositionAssetDependencies() if path]
    return list(held.values())
