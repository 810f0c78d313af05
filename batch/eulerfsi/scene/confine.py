"""`--confine`: a scene of strangers refers to nothing outside its own folder, and reading it has limits.

Before USD composes anything, a child process (`confine_child.py`) with limits of memory and time reads every layer of
the scene and judges each path in it by where it leads: `..`, absolute paths, links and the search path of USD's
resolver count the same. What is left, a cache copies or a run reads.
"""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import tempfile
from collections.abc import Sequence
from pathlib import Path

from eulerfsi_usd.issues import Issue
from pxr import Usd

from .. import child
from ..errors import EulerFsiError, SceneError
from ..system import available_memory, format_bytes
from .path_map import Rule

CODE = "Confined"
_SECONDS = 300.0  # that reading a scene may take


def demand_confined(path: Path, rules: Sequence[Rule] = ()) -> None:
    """Raises SceneError with every path of a scene that leads out of its folder, and where it cannot be read at all.

    rules: of `--path-map`; their targets, which the user has named, count as the scene's own folders.
    """
    memory = available_memory()
    with tempfile.TemporaryFile() as answer, tempfile.TemporaryFile() as noise:
        words = [os.fspath(path.absolute()), json.dumps([dataclasses.astuple(rule) for rule in rules])]
        code = child.run("eulerfsi.scene.confine_child", words, memory, _SECONDS, answer, noise)
        if code is None:
            raise SceneError(f"{path}: --confine: not read within {_SECONDS:.0f} s")
        if code == -signal.SIGKILL:
            raise SceneError(f"{path}: --confine: the process reading it was killed; the machine may be out of memory")
        if code < 0:
            raise SceneError(f"{path}: --confine: the process reading it crashed ({signal.strsignal(-code)})")
        if code > 0:
            last = child.last_line(noise)
            if "MemoryError" in last or "bad_alloc" in last:
                raise SceneError(f"{path}: --confine: needs more than {format_bytes(memory)} of memory to be read")
            raise EulerFsiError(f"{path}: --confine: the process reading it failed with code {code}: {last}")
        answer.seek(0)
        found = [Issue(*fields, "error", CODE) for fields in json.loads(answer.read())]
    if found:
        raise SceneError("\n".join(issue.message for issue in found), found)


def demand_layers_within(stage: Usd.Stage, path: Path, rules: Sequence[Rule] = ()) -> None:
    """Raises SceneError where a stage holds a layer from elsewhere after all: files may have changed meanwhile."""
    roots = roots_of(path, rules)
    for layer in stage.GetUsedLayers():
        if layer.realPath and not inside(layer.realPath, roots):
            raise SceneError(f"{path}: --confine: the layer {layer.realPath} lies outside {roots[0]}")


def roots_of(path: Path, rules: Sequence[Rule]) -> list[str]:
    """Folders in which everything has to lie, the scene's own first, links followed."""
    return [os.path.realpath(path.parent), *(os.path.realpath(rule.target) for rule in rules)]


def inside(path: str, roots: Sequence[str]) -> bool:
    """Whether a path leads into one of the folders; links are followed, also where the file does not exist."""
    real = os.path.realpath(path)
    return any(real == root or real.startswith(root.rstrip("/") + "/") for root in roots)
