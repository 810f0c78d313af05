"""The commands for many runs: wedge, submit."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import errors
from ..errors import UsageError
from ..say import say
from ..system import format_bytes

if TYPE_CHECKING:
    from ..farm.variations import Axis


def add_commands(
    add: Callable[[str, str], argparse.ArgumentParser], scene_options: Callable[[argparse.ArgumentParser], None]
) -> None:
    """Their options. add(name, text): makes a command; scene_options: adds those that read a scene."""
    wedge = add("wedge", "Simulate a scene once for each of some values, as many at once as memory and cores allow.")
    wedge.add_argument("scene", type=Path, metavar="SCENE")
    wedge.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: ./<scene>_wedge")
    _variations(wedge)
    scene_options(wedge)
    group = wedge.add_mutually_exclusive_group()
    group.add_argument("--overwrite", action="store_true", help="replace an existing wedge in the folder")
    group.add_argument("--resume", action="store_true", help="continue the wedge: what is done stays")

    submit = add("submit", "Write a job for a farm engine: one run, or a wedge. Nothing is sent anywhere.")
    submit.add_argument("scene", type=Path, metavar="SCENE")
    engine = submit.add_mutually_exclusive_group(required=True)
    engine.add_argument("--openjd", type=Path, metavar="DIR", help="a job bundle of Open Job Description")
    engine.add_argument("--slurm", type=Path, metavar="FILE", help="a script for sbatch")
    submit.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="cache or wedge on the nodes; default: as of simulate, wedge"
    )
    _variations(submit)
    scene_options(submit)
    submit.add_argument("--program", default="eulerfsi", metavar="COMMAND", help="on a node; default: eulerfsi")
    submit.add_argument("--timeout", metavar="S", help="seconds of one simulation; the next run goes on; default: none")
    submit.add_argument(
        "--parameter",
        dest="parameters",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="with --openjd: a value for a parameter of the job; may be repeated",
    )


def _variations(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="PRIM.ATTR=V,V,...",
        help="values of one attribute, in stage units; may be repeated: all combinations are simulated",
    )
    parser.add_argument("--table", type=Path, metavar="FILE.csv", help="a column PRIM.ATTR each, a row a job")
    parser.add_argument("--together", action="store_true", help="the lists side by side in place of combinations")


def _axes(options: argparse.Namespace) -> list[Axis]:
    from ..farm.variations import parse_list, read_table

    return [*([read_table(options.table)] if options.table else []), *map(parse_list, options.vary)]


def _shared(options: argparse.Namespace) -> dict[str, Any]:
    """What all runs share, for Options."""
    return {
        "frames": options.frames,
        "start": options.start_frame,
        "threads": options.threads,
        "settings": tuple(options.settings),
        "path_map": tuple(options.path_map),
        "confine": options.confine,
    }


def _wedge(options: argparse.Namespace) -> int:
    from ..farm import wedge
    from ..farm.variations import check, plan
    from ..run.simulate import Options
    from ..system import available_threads
    from ..usd_messages import usd_messages

    axes = _axes(options)
    jobs = plan(axes, options.together)
    with usd_messages():
        attributes = check(options.scene, axes, options.path_map, options.confine)
    shared = Options(**_shared(options), overwrite=options.overwrite, resume=options.resume)
    arguments = [word for setting in options.settings for word in ("--set", setting)]
    arguments += [f"--path-map={rule}" for rule in options.path_map]
    arguments += ["--confine"] if options.confine else []
    arguments += [f"--frames={options.frames}"] if options.frames else []
    arguments += [f"--start-frame={options.start_frame}"] if options.start_frame is not None else []
    folder = options.output or Path.cwd() / f"{options.scene.stem}_wedge"
    threads = options.threads or available_threads()
    wedge.run(options.scene, folder, jobs, attributes, shared, arguments, threads, _tell)
    return errors.EXIT_OK


def _submit(options: argparse.Namespace) -> int:
    from ..farm import openjd, slurm, submission
    from ..run.simulate import Options
    from ..usd_messages import usd_messages

    axes = _axes(options)
    if options.slurm and options.parameters:
        raise UsageError("--parameter: belongs to --openjd; a SLURM job takes its options from sbatch")
    timeout = submission.parse_seconds("--timeout", options.timeout)
    program = submission.parse_program(options.program)
    kind = "wedge" if axes else "cache"
    folder = options.output or Path.cwd() / f"{options.scene.stem}_{kind}"
    with usd_messages():
        job = submission.prepare(options.scene, folder, Options(**_shared(options)), axes, options.together)
    for name in job.missing:
        say(f"warning: {options.scene}: refers to {name}, which is not there", sys.stderr)
    tasks = f"{len(job.jobs) or 1} task(s), frames {job.frames}, {format_bytes(job.memory)} of memory each"
    if options.slurm:
        path = slurm.write_script(options.slurm, job, program, timeout)
        _tell(f"{path}: {tasks}\nnext: sbatch {shlex.quote(str(path))}")
    else:
        openjd.write_bundle(options.openjd, job, program, options.parameters, timeout)
        _tell(f"{options.openjd}: {tasks}\nnext: deadline bundle submit {shlex.quote(str(options.openjd))}")
    return errors.EXIT_OK


def _tell(text: str) -> None:
    say(text, sys.stdout)


COMMANDS = {"wedge": _wedge, "submit": _submit}
