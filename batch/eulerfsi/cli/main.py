"""The command line: its options, and what each command calls. Exit codes: docs/exit-codes.md."""

from __future__ import annotations

import argparse
import importlib
import json
import re
import runpy
import subprocess
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from .. import __version__, errors, paths, progress, signals
from ..command import command_line
from ..errors import EulerFsiError, UsageError
from ..say import say
from ..solver import binding, mesh_file
from . import farm

# What the commands load beside this module, with USD.
_MODULES = {
    "simulate": "..run.simulate",
    "validate": ".report",
    "info": ".info",
    "view": ".view",
    "verify": ".verify",
    "doctor": ".doctor",
    "plot": ".plot",
    "new": ".new_scene",
    "wedge": "..farm.wedge",
    "submit": "..farm.openjd",
}
_MOST_MEGABYTES = 500  # of a page that a browser still opens
BENCHMARKS = ("speed", "loop", "random", "accuracy", "stress", "skip", "table", "estimate", "meshes", "output", "night")


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="eulerfsi",
        description="Elastic solids in a fluid: from a USD scene to deformed meshes and VDB smoke.",
        epilog=f"Exit codes: {_exit_codes()}.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"eulerfsi {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return commands.add_parser(name, help=text, description=text, allow_abbrev=False)

    simulate = add("simulate", "Simulate a scene into a cache.")
    simulate.add_argument("scene", type=Path, metavar="SCENE")
    simulate.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: ./<scene>_cache")
    _scene_options(simulate)
    simulate.add_argument("--preset", help="production (default), paper2016 or fast; same as --set <domain>.preset=P")
    simulate.add_argument("--progress", choices=progress.MODES, default="auto", help="default: auto")
    simulate.add_argument(
        "--start-from",
        metavar="CACHE[:FRAME]",
        help="initial solids: those of that frame of another cache, by default its last",
    )
    group = simulate.add_mutually_exclusive_group()
    group.add_argument("--overwrite", action="store_true", help="replace an existing cache in the folder")
    group.add_argument("--resume", action="store_true", help="continue the cache at its latest checkpoint")
    group.add_argument(
        "--rebake-from",
        type=int,
        metavar="N",
        help="keep the cache's frames up to N, make later ones anew, from its checkpoint of N; "
        "parameters may have changed",
    )
    simulate.add_argument(
        "--allow-restart", action="store_true", help="with --resume: drop finished frames where others are damaged"
    )
    simulate.add_argument(
        "--checkpoint-every",
        default="10",
        metavar="N|Ts",
        help="a checkpoint every N frames or T seconds, after the first frame and the last one; default: 10",
    )
    simulate.add_argument("--keep-checkpoints", default="2", metavar="N|all", help="the last N checkpoints; default: 2")
    simulate.add_argument(
        "--max-wall-seconds", type=float, metavar="S", help="then stop with a checkpoint and exit code 75"
    )
    simulate.add_argument(
        "--requeue-on-signal", action="store_true", help="end with exit code 75, not 143, after SIGTERM"
    )
    simulate.add_argument(
        "--wait", type=float, default=0.0, metavar="S", help="wait that long for another run in the folder; default: 0"
    )
    simulate.add_argument("--force", action="store_true", help="begin also where there is too little disk")
    simulate.add_argument("--half", action="store_true", help="write smoke as 16-bit floats")
    simulate.add_argument(
        "--smoke-threshold", metavar="X", help="leave out voxels with at most this density; default: 0.001"
    )
    simulate.add_argument("--no-velocity", action="store_true", help="leave out the grid vel")
    simulate.add_argument(
        "--region", metavar="X0,Y0,Z0,X1,Y1,Z1", help="write smoke inside a box in world space alone, in stage units"
    )
    simulate.add_argument(
        "--strict", action="store_true", help="stop after the first frame with a warning of docs/warnings.md"
    )

    simulate.add_argument(
        "--flipbook", action="store_true", help="a picture of every frame, a contact sheet and a film; needs matplotlib"
    )

    validate = add("validate", "Check a scene: schema, meshes, memory; estimate the run time from a few steps.")
    validate.add_argument("scene", type=Path, metavar="SCENE")
    _scene_options(validate)
    shown = validate.add_mutually_exclusive_group()
    shown.add_argument("--json", action="store_true", help="the report as one JSON object")
    shown.add_argument("--progress", choices=("none", "json"), default="none", help="events in place of the report")

    farm.add_commands(add, _scene_options)

    info = add("info", "Describe the program, a scene or a cache folder (and verify its files).")
    info.add_argument("path", type=Path, nargs="?", metavar="SCENE_OR_CACHE")
    info.add_argument("--json", action="store_true", help="as one JSON object")

    look = add("view", "Write a cache or a wedge as one HTML page that plays in a browser, without a network.")
    look.add_argument("cache", type=Path, metavar="CACHE")
    look.add_argument("-o", "--output", type=Path, metavar="FILE", help="default: ./<cache>.html")
    look.add_argument("--every", type=_positive, default=1, metavar="N", help="every N-th frame; default: 1")
    look.add_argument(
        "--max-mb",
        type=_megabytes,
        default=20.0,
        metavar="MB",
        help="size at which smoke is coarsened and then frames are left out; default: 20",
    )
    check = add("verify", "Compare every file of a cache with what was written, and name those that differ.")
    check.add_argument("cache", type=Path, metavar="CACHE")
    check.add_argument("--deep", action="store_true", help="read every grid and every mesh, too")
    check.add_argument("--json", action="store_true", help="as one JSON object")

    doctor = add("doctor", "Describe the program and this machine, and simulate for five seconds to test them.")
    doctor.add_argument("--json", action="store_true", help="as one JSON object")

    draw = add("plot", "Draw a cache's statistics: sizes of steps, volumes, energies, time per frame.")
    draw.add_argument(
        "kind",
        choices=("step", "volume", "energy", "time", "accuracy"),
        help="accuracy: error against run time, of `bench accuracy` (in a checkout, without a cache)",
    )
    draw.add_argument("cache", type=Path, nargs="?", metavar="CACHE")
    draw.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="png, svg or pdf; default: ./<cache>_<kind>.png; accuracy: a folder, default: docs/images",
    )

    new = add("new", "Write a complete scene around mesh files, or a domain around a USD file.")
    new.add_argument("scene", type=Path, metavar="SCENE.usda")
    formats = f"mesh file, named as one of: {', '.join(mesh_file.FORMATS)}; may be repeated"
    source = new.add_mutually_exclusive_group(required=True)
    source.add_argument("--solid", type=Path, action="append", metavar="FILE", help=formats)
    text = "USD file to put a domain around, in its units: its bodies and solids, else one solid per Mesh"
    source.add_argument("--from-usd", type=Path, metavar="FILE", help=text)
    units = ("m", "cm", "mm", "km", "in", "ft")
    new.add_argument("--units", choices=units, help="of the mesh files and the scene; default: m")
    text = "one solid per file; default: one per object that a file names, else per group of its pieces"
    new.add_argument("--join", action="store_true", help=text)
    new.add_argument("--up-axis", choices=("y", "z"), help="of the mesh files and the scene; default: y")
    new.add_argument("--smoke", choices=("carpet", "none"), default="carpet", help="default: carpet")

    bench = add("bench", "Measure speed and quality against the bars (in a checkout).")
    bench.add_argument("name", choices=BENCHMARKS)
    bench.add_argument("rest", nargs=argparse.REMAINDER, help="options of the benchmark; --help lists them")

    package = add("package", "Build a file that installs elsewhere without a system package (in a checkout).")
    package.add_argument("what", choices=("wheel", "blender"))
    package.add_argument("-o", "--output", type=Path, default=Path("dist"), metavar="DIR", help="default: ./dist")
    package.add_argument("--wheel", type=Path, metavar="FILE", help="blender: with this wheel; default: makes one")

    test = add("test", "Run the tests (in a checkout).")
    slow = "the slow tests instead: double precision, slow laws, whole scenes"
    test.add_argument("--slow", action="store_true", help=slow)
    return parser


def _exit_codes() -> str:
    return ", ".join(f"{code} {text}" for code, (_, text) in errors.EXIT_CODES.items())


def _scene_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--frames", metavar="A-B", help="contiguous range, default: the stage's")
    parser.add_argument("--start-frame", type=int, metavar="N", help="start there, default: the scene's first frame")
    parser.add_argument("--threads", type=_positive, metavar="N", help="default: what the cgroup allows")
    parser.add_argument(
        "--set",
        dest="settings",
        action="append",
        default=[],
        metavar="PRIM.ATTR=VALUE",
        help="change one attribute for this run, in stage units; may be repeated",
    )
    parser.add_argument(
        "--path-map",
        action="append",
        default=[],
        metavar="A=B",
        help="look under B for files that the scene has under A; may be repeated; or a file of OpenJD's rules",
    )
    parser.add_argument(
        "--confine", action="store_true", help="refuse a scene that refers to anything outside its own folder"
    )


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be a whole number >= 1")
    return int(text)


def _megabytes(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value <= _MOST_MEGABYTES:
        raise argparse.ArgumentTypeError(f"{text}: must be a number > 0 and <= {_MOST_MEGABYTES}")
    return value


def _join_negative(arguments: Sequence[str]) -> list[str]:
    """`--frames -24-48`, `--region -1,...` as one word: argparse takes what begins with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1] in ("--frames", "--region") and re.match(r"-\d", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit code. A wrong option leaves through SystemExit(2), as argparse does."""
    given = sys.argv[1:] if arguments is None else arguments
    options = build_parser().parse_args(_join_negative(given))
    options.line = command_line(*given)
    run = {
        "simulate": _simulate,
        "validate": _validate,
        "info": _info,
        "view": _view,
        "verify": _verify,
        "doctor": _doctor,
        "plot": _plot,
        "new": _new,
        "bench": _bench,
        "test": _test,
        "package": _package,
        **farm.COMMANDS,
    }
    try:
        if options.command in _MODULES:
            importlib.import_module(_MODULES[options.command], __package__)
        with signals.raised():  # not before: USD drops an exception that meets it while it is loaded, and goes on
            return run[options.command](options)
    except KeyboardInterrupt as error:
        say(errors.describe(error), sys.stderr)
        return errors.exit_code(error)
    except (EulerFsiError, OSError) as error:
        for line in errors.describe(error).splitlines():
            say(line if line.startswith(" ") else f"error: {line}", sys.stderr)  # an indented line goes on
        return errors.exit_code(error)
    except Exception as error:
        traceback.print_exc()
        say("error: internal; please report this with the lines above", sys.stderr)
        return errors.exit_code(error)


def _simulate(options: argparse.Namespace) -> int:
    from ..cache.output import Output
    from ..cache.pictures import FILM
    from ..run.simulate import Options, simulate

    if options.preset is not None and options.preset not in binding.PRESETS:
        raise UsageError(f"--preset {options.preset}: must be one of {', '.join(binding.PRESETS)}")
    wanted = Options(
        output=options.output,
        frames=options.frames,
        start=options.start_frame,
        start_from=options.start_from,
        threads=options.threads,
        preset=options.preset,
        settings=tuple(options.settings),
        path_map=tuple(options.path_map),
        confine=options.confine,
        force=options.force,
        progress=options.progress,
        overwrite=options.overwrite,
        resume=options.resume,
        allow_restart=options.allow_restart,
        checkpoint_every=options.checkpoint_every,
        keep_checkpoints=options.keep_checkpoints,
        strict=options.strict,
        flipbook=options.flipbook,
        rebake_from=options.rebake_from,
        max_wall_seconds=options.max_wall_seconds,
        requeue_on_signal=options.requeue_on_signal,
        wait=options.wait,
        command=options.line,
        written=Output.parse(options.half, options.smoke_threshold, not options.no_velocity, options.region),
    )
    result = simulate(options.scene, wanted)
    if options.progress not in ("json", "openjd", "alf"):
        if result.nothing_to_do:
            say("all frames exist already", sys.stdout)
        say(f"cache:   {result.folder}", sys.stdout)
        say(
            f"open:    {result.root} (in Blender: File > Import > Universal Scene Description; usdview; Houdini; ...)",
            sys.stdout,
        )
        say(f"preview: {result.preview or 'none; drawing it needs matplotlib'}", sys.stdout)
        if options.flipbook:
            film = result.folder / FILM
            say(f"film:    {film if film.is_file() else 'none; drawing it needs matplotlib'}", sys.stdout)
    return errors.EXIT_OK


def _validate(options: argparse.Namespace) -> int:
    from ..usd_messages import usd_messages
    from .report import validate

    with progress.make_progress(options.progress).told() as told, usd_messages():
        try:
            report = validate(
                options.scene,
                options.frames,
                options.start_frame,
                options.settings,
                options.threads,
                told,
                options.path_map,
                options.confine,
            )
        except EulerFsiError as error:
            if options.json:
                say(json.dumps({"scene": str(options.scene), "errors": progress.findings(error)}), sys.stdout)
            raise
    if options.json:
        say(json.dumps({**report.facts(), "errors": []}), sys.stdout)
    elif options.progress == "none":
        say("\n".join(report.lines()), sys.stdout)
    return errors.EXIT_OK


def _info(options: argparse.Namespace) -> int:
    from ..usd_messages import usd_messages
    from .info import info

    with usd_messages():
        found = info(options.path)
    say(json.dumps(found.facts) if options.json else "\n".join(found.lines), sys.stdout)
    if found.damage:
        raise found.damage
    return errors.EXIT_OK


def _view(options: argparse.Namespace) -> int:
    from ..usd_messages import usd_messages
    from .view import view
    from .view_wedge import is_wedge, view_wedge

    with usd_messages():
        make = view_wedge if is_wedge(options.cache) else view
        made = make(options.cache, options.output, options.every, options.max_mb)
    for note in made.notes:
        say(f"note: {note}", sys.stderr)
    say(f"{made.path} ({made.bytes / 1e6:.1f} MB)", sys.stdout)
    return errors.EXIT_OK


def _verify(options: argparse.Namespace) -> int:
    from ..usd_messages import usd_messages
    from .verify import verify

    with usd_messages():
        found, error = verify(options.cache, options.deep)
    say(json.dumps(found.facts()) if options.json else "\n".join(found.lines()), sys.stdout)
    if error:
        raise error
    return errors.EXIT_OK


def _doctor(options: argparse.Namespace) -> int:
    from .doctor import doctor

    found = doctor()
    say(json.dumps(found.facts) if options.json else "\n".join(found.lines), sys.stdout)
    if found.fault:
        raise found.fault
    return errors.EXIT_OK


def _plot(options: argparse.Namespace) -> int:
    from .plot import plot

    if options.kind == "accuracy":
        if options.cache:
            raise UsageError(
                f"plot accuracy {options.cache}: takes no cache; it draws tests/bench/results/accuracy.csv"
            )
        script = _checkout() / "tests" / "bench" / "plot_accuracy.py"
        say("\n".join(map(str, runpy.run_path(str(script))["main"](options.output))), sys.stdout)
        return errors.EXIT_OK
    if options.cache is None:
        raise UsageError(f"plot {options.kind}: needs the folder of a cache")
    say(str(plot(options.kind, options.cache, options.output)), sys.stdout)
    return errors.EXIT_OK


def _new(options: argparse.Namespace) -> int:
    from ..usd_messages import usd_messages
    from .new_scene import new_scene

    if options.from_usd and (options.units or options.up_axis):
        raise UsageError("--units, --up-axis: must not be given with --from-usd, whose file has its own")
    if options.from_usd and options.join:
        raise UsageError("--join: must not be given with --from-usd: it joins the objects of mesh files")
    unit, up, solids = options.units or "m", options.up_axis or "y", options.solid or ()
    with usd_messages():
        layout, warnings = new_scene(options.scene, solids, options.smoke, unit, up, options.from_usd, options.join)
    for line in warnings:
        say(line, sys.stderr)
    stiff = "" if options.from_usd else f"Young's modulus up to {max(layout.moduli):g} Pa, "
    slow = f" (slow motion, 1:{layout.fps // 24})" if layout.fps > 24 and not options.from_usd else ""
    say(
        f"{options.scene}: {len(layout.moduli)} solid(s), voxel size {layout.voxel:g} m, {layout.cells:,} cells, "
        f"{stiff}frames {layout.first}-{layout.first + layout.frames - 1} at {layout.fps:g} per second{slow}\n"
        f"next: {command_line('simulate', options.scene)}",
        sys.stdout,
    )
    return errors.EXIT_OK


def _checkout() -> Path:
    root = paths.checkout()
    if root is None:
        raise UsageError("this command needs a checkout of the project; the package is an installed one")
    return root


def _bench(options: argparse.Namespace) -> int:
    script = _checkout() / "tests" / "bench" / f"bench_{options.name}.py"
    return int(runpy.run_path(str(script))["main"](options.rest))


def _package(options: argparse.Namespace) -> int:
    script = _checkout() / "packaging" / f"{options.what}.py"
    make = runpy.run_path(str(script))["main"]
    if options.what == "blender":
        say("\n".join(map(str, make(options.output, options.wheel))), sys.stdout)
        return errors.EXIT_OK
    if options.wheel:
        raise UsageError("--wheel: belongs to `package blender`")
    say(str(make(options.output)), sys.stdout)
    return errors.EXIT_OK


def _test(options: argparse.Namespace) -> int:
    # The launcher builds first and knows the test presets.
    command = [str(_checkout() / "eulerfsi"), "test", *(["--slow"] if options.slow else [])]
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
