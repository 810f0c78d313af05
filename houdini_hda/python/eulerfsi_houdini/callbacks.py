"""What the buttons and menus of the Euler FSI Solver node call; kwargs is Houdini's."""

from __future__ import annotations

import json
import os
import subprocess
from typing import Any

import hou
from eulerfsi_usd import checks  # the package registers the schema
from eulerfsi_usd.presets import DEFAULT_SIZE, values_of

from . import bake, values
from .faults import Fault, report
from .scene import make_stage, size_of_entry

Kwargs = dict[str, Any]


def _node(kwargs: Kwargs) -> hou.SopNode:
    node = kwargs["node"]
    assert isinstance(node, hou.SopNode)
    return node


def write_scene(node: hou.SopNode) -> str:
    """Writes the scene file and returns its path. Raises Fault."""
    stage = make_stage(node)
    errors = [issue.message for issue in checks.check_stage(stage) if issue.severity == "error"]
    if errors:
        raise Fault(*errors)
    path = values.text(node, "scene")
    try:
        os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    except OSError as error:
        raise Fault(f"{node.path()}.scene = {path}: {error.strerror}") from error
    if not stage.GetRootLayer().Export(path):
        raise Fault(f"{node.path()}.scene = {path}: could not be written")
    return path


def save_scene(kwargs: Kwargs) -> str | None:
    """Writes the scene file and returns its path; a fault is shown and None is returned."""
    node = _node(kwargs)
    try:
        return write_scene(node)
    except Fault as fault:
        report(node, fault.messages)
        return None


def execute(kwargs: Kwargs) -> None:
    """Save to Disk: simulates in the foreground. For TOPs it prints the files that it has made."""
    node = _node(kwargs)
    try:
        scene = write_scene(node)
        bake.in_foreground(node, scene)
        if values.flag(node, "pdg_logoutput"):
            for path in bake.files_of(values.text(node, "output"), scene):
                print(f"OUTPUT_FILE:{path};", flush=True)
    except Fault as fault:
        report(node, fault.messages)


def execute_in_background(kwargs: Kwargs) -> subprocess.Popen[bytes] | None:
    """Save to Disk in Background: starts the simulation and returns its process; a fault is shown."""
    node = _node(kwargs)
    try:
        process = bake.in_background(node, write_scene(node))
    except Fault as fault:
        report(node, fault.messages)
        return None
    if hou.isUIAvailable():
        _watch(node.path(), values.text(node, "scene"), process)
    return process


def _watch(path: str, scene: str, process: subprocess.Popen[bytes]) -> None:
    """Shows the progress of a run in the status line until it ends."""
    events, told = open(os.path.splitext(scene)[0] + ".events", "rb"), bake.Told()  # noqa: SIM115 - closed by look
    rest = b""

    def look() -> None:
        nonlocal rest
        ended = process.poll() is not None
        *lines, rest = (rest + events.read()).split(b"\n")
        for line in lines:
            told.take(bake.parse(line))
        if ended:
            hou.ui.removeEventLoopCallback(look)
            events.close()
        severity = hou.severityType.Error if ended and process.returncode else hou.severityType.Message
        hou.ui.setStatusMessage(f"{path}: {told.errors[0] if told.errors else told.text}", severity=severity)

    hou.ui.addEventLoopCallback(look)


def cancel(kwargs: Kwargs) -> None:
    """Stops the run that writes to the cache folder."""
    node = _node(kwargs)
    report(node, (bake.cancel(node),), severe=False)


def validate(kwargs: Kwargs) -> None:
    """Shows what the tool says of the scene: faults, warnings, notes."""
    node = _node(kwargs)
    try:
        scene = write_scene(node)
        arguments = [values.text(node, "command"), "validate", scene, "--json"]
        code, output = bake.run_to_end(node, arguments, bake.log_of(scene))
        try:
            found = json.loads(output)
        except ValueError as error:
            raise Fault(f"{node.path()}: the solver ended with code {code}: {bake.log_of(scene)}") from error
    except Fault as fault:
        report(node, fault.messages)
        return
    errors, warnings = ([str(entry["message"]) for entry in found[key]] for key in ("errors", "warnings"))
    notes = (f"Note: {text}" for text in found.get("notes", ()))
    lines = errors or ["The scene can be simulated.", *(f"Warning: {text}" for text in warnings), *notes]
    report(node, tuple(lines), severe=bool(errors))


def take_preset(kwargs: Kwargs) -> None:
    """Sets the values of the material that the menu of a solid names, stiffer for a larger solid."""
    node = _node(kwargs)
    name = str(kwargs["parm_name"])
    prefix, chosen = name.removesuffix("preset"), values.text(node, name)
    if chosen == "custom":
        return
    try:
        size = size_of_entry(node, prefix) or DEFAULT_SIZE
    except Fault as fault:
        report(node, fault.messages)
        return
    for row, value in values_of(chosen, size).items():
        values.put(node, prefix + row, value)


def show_in_solaris(kwargs: Kwargs) -> None:
    """Makes a Sublayer LOP of the cache in /stage."""
    node = _node(kwargs)
    scene = os.path.basename(values.text(node, "scene"))
    path = os.path.join(values.text(node, "output"), os.path.splitext(scene)[0] + ".usda")
    network = hou.node("/stage")
    if not isinstance(network, hou.OpNode) or not os.path.exists(path):
        report(node, (f"{path}: there is no cache yet" if network else "/stage: there is no such network",))
        return
    layer = network.createNode("sublayer", f"{node.name()}_cache")
    values.put(layer, "filepath1", path)
