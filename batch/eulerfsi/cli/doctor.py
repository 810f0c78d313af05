"""`doctor`: the program, this machine, and a few seconds of simulation whose answers are known."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import eulerfsi_usd
import numpy as np
from pxr import Plug, Usd

from .. import __version__
from ..errors import EulerFsiError
from ..solver import binding
from ..solver.simulation import Mesh, Simulation
from ..solver.volume_file import VolumeFile
from ..system import available_memory, available_threads, format_bytes

_SECONDS = 5.0  # of all tests
_GRAVITY = 9.81
_EDGE, _CELL = 0.3, 0.05  # of the cube that falls in a box of 1 m, and of a cell [m]
_FINE = 0.02  # cell for the pace [m]
# Largest deviation: of the fall, relative; of the smoke in a file, in parts of its sum (single precision).
_FALL, _SMOKE = 0.005, 1e-5


@dataclasses.dataclass
class Doctor:
    """What there is to tell. fault: the tests that failed, None for none."""

    lines: list[str]
    facts: dict[str, Any]
    fault: EulerFsiError | None = None


def doctor(folder: Path = Path()) -> Doctor:
    """Looks at the machine and tests the program on it. folder: where caches would go."""
    facts: dict[str, Any] = {**_versions(), **_machine(folder)}
    lines = [
        f"eulerfsi {facts['program']}, library {facts['library']}: {facts['library_path']}",
        f"Python {facts['python']}, USD {facts['usd']}, numpy {facts['numpy']}, {facts['system']}",
        f"processor: {facts['processor']}, {facts['threads']} threads",
        f"memory: {format_bytes(facts['memory_limit'])} for a simulation",
        *(f"disk: {format_bytes(free)} free in {place}" for place, free in facts["disk"].items()),
        *(f"plug-in {name}: {what}" for name, what in facts["plugins"].items()),
    ]
    tests = list(_tests(facts["threads"]))
    facts["tests"] = [{"name": name, "passed": passed, "text": text} for name, passed, text in tests]
    lines += [f"{'passed' if passed else 'FAILED'}: {name}: {text}" for name, passed, text in tests]
    failed = [name for name, passed, _ in tests if not passed]
    fault = EulerFsiError(f"this installation gives wrong results: {', '.join(failed)}") if failed else None
    return Doctor(lines, facts, fault)


def _versions() -> dict[str, Any]:
    return {
        "program": __version__,
        "library": binding.library_version(),
        "library_path": binding.library().efsi_path,
        "python": platform.python_version(),
        "usd": ".".join(map(str, Usd.GetVersion())),
        "numpy": np.__version__,
        "system": platform.platform(),
        "host": platform.node(),
        "plugins": _plugins(),
    }


def _plugins() -> dict[str, str]:
    """What the program needs beside itself: the USD schema, and for pictures matplotlib."""
    place = Path(eulerfsi_usd.__file__).parent
    known = [plugin for plugin in Plug.Registry().GetAllPlugins() if Path(plugin.path).is_relative_to(place)]
    schema = f"USD schema, {place}" if known and known[0].Load() else "its USD schema is not registered"
    there = importlib.util.find_spec("matplotlib") is not None
    pictures = importlib.metadata.version("matplotlib") if there else "missing: no preview.png, no plot"
    return {"eulerfsi_usd": schema, "matplotlib": pictures}


def _machine(folder: Path) -> dict[str, Any]:
    places = {str(place.resolve()): shutil.disk_usage(place).free for place in (folder, Path(tempfile.gettempdir()))}
    return {
        "processor": _processor(),
        "processors": os.cpu_count(),
        "threads": available_threads(),
        "memory_limit": available_memory(),
        "disk": places,
    }


def _processor(path: Path = Path("/proc/cpuinfo")) -> str:
    """Model and the widest vectors that the library has a path for."""
    lines = path.read_text().splitlines() if path.exists() else []
    known = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    flags = known.get("flags", "").split()
    vectors = "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "basic vectors"
    return f"{known.get('model name') or platform.machine()}, {vectors}"


def _tests(threads: int) -> Iterator[tuple[str, bool, str]]:
    """(name, whether it passed, the numbers) of each test."""
    begun = time.monotonic()
    for name, test in (
        ("a cube falls as Galileo says", _falls),
        ("one thread and all give the same bits", lambda: _same_bits(threads)),
        ("a checkpoint goes on with the same bits, a .vdb gives back its smoke", _files),
    ):
        yield _judged(name, test)
    yield _judged("pace", lambda: _pace(threads, begun + _SECONDS))


def _judged(name: str, test: Callable[[], tuple[bool, str]]) -> tuple[str, bool, str]:
    try:
        return (name, *test())
    except (EulerFsiError, OSError) as error:
        return name, False, str(error)


def _cube(center: float) -> Mesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) - 0.5
    faces = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    return Mesh(corners * _EDGE + (0.5, center, 0.5), [4] * 6, faces)


def _scene(threads: int, fluid: bool, cell: float = _CELL) -> tuple[Simulation, int]:
    """A cube in a box of 1 m; with fluid there is smoke."""
    values = {"voxel_size": cell, "gravity": (0, -_GRAVITY, 0), "ambient_fluid": int(fluid), "threads": threads}
    simulation = Simulation(values)
    cube, _ = simulation.add_solid(_cube(0.65), density=1000.0, youngs_modulus=2e5)
    if fluid:
        simulation.add_emitter(transform=np.diag([0.9, 0.3, 0.9, 1]) + np.eye(4, k=3) * 0.5, density=1.0)
    return simulation, cube


def _falls() -> tuple[bool, str]:
    simulation, cube = _scene(1, fluid=False)
    with simulation:
        before = simulation.solid_diagnostics(cube)["center"][1]
        simulation.advance(0.2)
        fallen = before - simulation.solid_diagnostics(cube)["center"][1]
    right = _GRAVITY * 0.2**2 / 2
    return abs(fallen / right - 1) < _FALL, f"{fallen:.5f} m in 0.2 s, {right:.5f} m is right"


def _same_bits(threads: int) -> tuple[bool, str]:
    hashes = []
    for count in (1, max(2, threads)):
        simulation, _ = _scene(count, fluid=True)
        with simulation:
            simulation.advance(0.35)  # it has met the floor
            hashes.append(simulation.state_hash())
    return hashes[0] == hashes[1], f"state {hashes[0]} and {hashes[1]}"


def _files() -> tuple[bool, str]:
    with tempfile.TemporaryDirectory(prefix="eulerfsi-doctor-") as place:
        checkpoint, volume = Path(place) / "state.efsi", Path(place) / "smoke.vdb"
        first, _ = _scene(1, fluid=True)
        with first:
            first.advance(0.05)
            first.save_checkpoint(checkpoint)
            first.write_vdb(volume, density_threshold=0.0)
            smoke = float(first.field("smoke_density")[0][0].sum(dtype=float))
            first.advance(0.05)
            right = first.state_hash()
        again, _ = _scene(1, fluid=True)
        with again:
            again.restore_checkpoint(checkpoint)
            again.advance(0.05)
            same = again.state_hash() == right
        with VolumeFile(volume) as file:
            read = float(file.read("density").sum(dtype=float))
    fits = abs(read - smoke) <= _SMOKE * abs(smoke)
    text = f"state {'as without it' if same else 'another one'}, smoke {read:.6g} of {smoke:.6g}"
    return same and fits, text


def _pace(threads: int, until: float) -> tuple[bool, str]:
    simulation, _ = _scene(threads, fluid=True, cell=_FINE)
    with simulation:
        simulation.step(0.01)  # sets things up
        cells, begun, count = round(1 / _FINE) ** 3, time.monotonic(), 0
        while count < 1 or time.monotonic() < until:
            simulation.step(0.01)
            count += 1
        seconds = (time.monotonic() - begun) / count
    return True, f"{seconds:.3g} s per step of {cells:,} cells, {cells / seconds / 1e6:.2g} million cells per second"
