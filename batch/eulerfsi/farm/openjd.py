"""`submit --openjd DIR`: a job bundle of Open Job Description, which Deadline Cloud takes too.

template.json, parameter_values.json, asset_references.json. Steps: Validate, Simulate, Verify; a wedge is their
parameter space, each of its axes zipped with the names of the folders.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from .. import files
from ..errors import CacheIOError, UsageError
from ..frames import parse_frames
from .submission import Submission
from .variations import Axis, folder_name

TEMPLATE, VALUES, ASSETS = "template.json", "parameter_values.json", "asset_references.json"
NOTIFY_SECONDS = 120  # between SIGTERM and SIGKILL: time for a checkpoint
_CANCEL = {"cancelation": {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": NOTIFY_SECONDS}}
# Limits of the specification 2023-09.
MOST_VALUES, MOST_TASK_PARAMETERS, LONGEST_NAME = 1024, 16, 64
# What Deadline Cloud itself reads from the parameter values.
_DEADLINE = ("targetTaskRunStatus", "maxFailedTasksCount", "maxRetriesPerTask", "priority")


def write_bundle(
    folder: Path, job: Submission, program: Sequence[str], values: Iterable[str], timeout: int | None
) -> list[Path]:
    """Writes the three files. program: words of the command on a node; values: options NAME=VALUE.

    timeout: seconds of a run. Raises UsageError.
    """
    template = make_template(job, program, timeout)
    given = parameter_values(job, template, values)
    inputs = {"filenames": [str(path) for path in job.files], "directories": []}
    outputs = {"directories": [next(entry["value"] for entry in given if entry["name"] == "OutputFolder")]}
    assets = {"assetReferences": {"inputs": inputs, "outputs": outputs, "referencedPaths": job.missing}}
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CacheIOError(f"{folder}: cannot be made: {error.strerror}") from error
    written = []
    for name, data in ((TEMPLATE, template), (VALUES, {"parameterValues": given}), (ASSETS, assets)):
        files.write_text(folder / name, json.dumps(data, indent=2) + "\n")
        written.append(folder / name)
    return written


def make_template(job: Submission, program: Sequence[str], timeout: int | None) -> dict[str, Any]:
    """The job template. Raises UsageError for what the specification cannot hold."""
    space, folder, settings = _space(job.axes)
    cache = "{{Param.OutputFolder}}" + (f"/{folder}" if folder else "")
    threads = ["--threads={{Param.Threads}}"] if job.options.threads else []
    scene = ["{{Param.Scene}}", "--frames={{Param.Frames}}", *job.fixed(), *threads]
    maps = [f"--path-map={_plain(rule)}" for rule in job.options.path_map]
    scene += ["--path-map={{Session.PathMappingRulesFile}}", *maps, *map(_plain, job.settings()), *settings]
    run = [*scene, "-o", cache, "--resume", "--allow-restart", "--progress", "openjd"]
    words = list(map(_plain, program[1:]))
    steps = [
        _step("Validate", None, space, _action([*words, "validate", *scene], None)),
        _step("Simulate", "Validate", space, {**_action([*words, "simulate", *run], timeout), **_CANCEL}, _host(job)),
        _step("Verify", "Simulate", _folders_of(space), _action([*words, "verify", cache], None)),
    ]
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "name": job.name,
        "parameterDefinitions": _parameters(job, program[0]),
        "steps": steps,
    }


def parameter_values(job: Submission, template: dict[str, Any], given: Iterable[str]) -> list[dict[str, Any]]:
    """Scene and folder, and what the user gives, as [{"name", "value"}]. Raises UsageError for unknown names."""
    known = {definition["name"]: definition for definition in template["parameterDefinitions"]}
    values: dict[str, Any] = {"Scene": str(job.scene), "OutputFolder": str(job.folder)}
    for text in given:
        name, equals, value = text.partition("=")
        where = f"--parameter {text}"
        if not equals:
            raise UsageError(f"{where}: must read NAME=VALUE")
        if name.removeprefix("deadline:") in _DEADLINE and name.startswith("deadline:"):
            values[name] = _deadline_value(where, name, value)
            continue
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are: {', '.join(known)}"
            raise UsageError(f"{where}: the job has no parameter {name}; {hint}")
        if known[name]["type"] == "INT" and (not value.isdecimal() or int(value) < 1):
            raise UsageError(f"{where}: must be a whole number >= 1")
        if not value:
            raise UsageError(f"{where}: is empty")
        if known[name]["type"] == "PATH" and not Path(value).is_absolute():
            raise UsageError(f"{where}: must be an absolute path")
        if name == "Scene" and Path(value).resolve() != job.scene:
            raise UsageError(
                f"{where}: must be {job.scene}, whose files and memory the bundle names: submit that scene in its place"
            )
        if name == "Frames":
            value = str(parse_frames(value))
        values[name] = int(value) if known[name]["type"] == "INT" else value
    return [{"name": name, "value": value} for name, value in values.items()]


def _deadline_value(where: str, name: str, value: str) -> int | str:
    """Of one of Deadline's own parameters. Raises UsageError."""
    if name == "deadline:targetTaskRunStatus":
        if value not in ("READY", "SUSPENDED"):
            raise UsageError(f"{where}: must be READY or SUSPENDED")
        return value
    if not value.isdecimal():
        raise UsageError(f"{where}: must be a whole number >= 0")
    return int(value)


def _parameters(job: Submission, program: str) -> list[dict[str, Any]]:
    path = {"type": "PATH", "description": "USD scene", "objectType": "FILE", "dataFlow": "IN"}
    out = {"type": "PATH", "description": "of the cache or the wedge", "objectType": "DIRECTORY", "dataFlow": "OUT"}
    found = [
        {"name": "Scene", **path},
        {"name": "OutputFolder", **out},
        {"name": "Frames", "type": "STRING", "description": "first-last", "default": str(job.frames)},
        {"name": "Program", "type": "STRING", "description": "the command on a node", "default": program},
    ]
    if job.options.threads:
        found.append({"name": "Threads", "type": "INT", "minValue": 1, "default": job.options.threads})
    return found


def _space(axes: list[Axis]) -> tuple[dict[str, Any] | None, str, list[str]]:
    """(parameter space, folder of a task, its --set options), the latter two as format strings."""
    if not axes:
        return None, "", []
    names: dict[str, str] = {}
    definitions, groups, folders = [], [], []
    for number, axis in enumerate(axes, 1):
        if len(axis.choices) > MOST_VALUES:
            raise UsageError(
                f"{axis.where[:60]}: {len(axis.choices)} values: must be at most {MOST_VALUES}, as Open Job "
                "Description has it; split the wedge"
            )
        lists = {f"Folder{number}": [folder_name(choice) for choice in axis.choices]}
        for target in axis.choices[0]:
            names[target] = _identifier(target, names.values())
            lists[names[target]] = [_plain(choice[target]) for choice in axis.choices]
        definitions += [{"name": name, "type": "STRING", "range": values} for name, values in lists.items()]
        groups.append(f"({', '.join(lists)})")
        folders.append(f"{{{{Task.Param.Folder{number}}}}}")
    if len(definitions) > MOST_TASK_PARAMETERS:
        raise UsageError(
            f"submit: {len(definitions)} task parameters, one for each list and one for each attribute: must be at "
            f"most {MOST_TASK_PARAMETERS}, as Open Job Description has it"
        )
    settings = [w for target, name in names.items() for w in ("--set", f"{_plain(target)}={{{{Task.Param.{name}}}}}")]
    space = {"taskParameterDefinitions": definitions, "combination": " * ".join(groups)}
    return space, "__".join(folders), settings


def _folders_of(space: dict[str, Any] | None) -> dict[str, Any] | None:
    """What a task needs that only looks at its folder."""
    if space is None:
        return None
    kept = [one for one in space["taskParameterDefinitions"] if one["name"].startswith("Folder")]
    return {"taskParameterDefinitions": kept, "combination": " * ".join(one["name"] for one in kept)}


def _identifier(target: str, taken: Iterable[str]) -> str:
    """Ball_youngsModulus for /World/Ball.eulerfsi:youngsModulus, in no use yet."""
    prim, _, attribute = target.rpartition(".")
    base = re.sub(r"\W", "_", f"{prim.rpartition('/')[2]}_{attribute.rpartition(':')[2]}", flags=re.ASCII)
    base = base[: LONGEST_NAME - 6] if base[0].isalpha() or base[0] == "_" else f"_{base}"[: LONGEST_NAME - 6]
    name, number = base, 1
    while name in taken or name.startswith("Folder"):
        number += 1
        name = f"V{base}"[: LONGEST_NAME - 6] + f"_{number}"
    return name


def _plain(text: str) -> str:
    """Raises UsageError for what the template would take for a reference."""
    if "{{" in text or "}}" in text:
        raise UsageError(f"submit: {text}: must not hold {{{{ or }}}}, which Open Job Description replaces")
    return text


def _action(arguments: list[str], timeout: int | None) -> dict[str, Any]:
    return {"command": "{{Param.Program}}", "args": arguments, **({"timeout": timeout} if timeout else {})}


def _host(job: Submission) -> dict[str, Any]:
    amounts = [{"name": "amount.worker.memory", "min": -(-job.memory // 2**20)}]
    if job.options.threads:
        amounts.append({"name": "amount.worker.vcpu", "min": job.options.threads})
    return {"amounts": amounts}


def _step(
    name: str, after: str | None, space: dict[str, Any] | None, action: dict[str, Any], host: dict | None = None
) -> dict[str, Any]:
    return {
        "name": name,
        **({"dependencies": [{"dependsOn": after}]} if after else {}),
        **({"parameterSpace": space} if space else {}),
        **({"hostRequirements": host} if host else {}),
        "script": {"actions": {"onRun": action}},
    }
