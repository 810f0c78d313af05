"""Rules of the C++ sources and of the tree.

check_sources.py globals LIBRARY...   no mutable globals or function statics (symbols of the libraries); no prints,
                                      exits, environment, clocks or random devices outside capi and io
check_sources.py threads              "#pragma omp parallel / for" only in base/parallel and base/team
check_sources.py includes             a room includes only what stands above it in the table ROOMS, and tests/unit has
                                      no other folders; OpenVDB in two translation units
check_sources.py packages             parts of the Python package eulerfsi import only those before them in PACKAGES
check_sources.py lengths              functions of at most 70 lines
check_sources.py words                no unfinished marks, no paths of one machine
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from common import ROOT, SRC, code_only, finish, relative, sources

# The rooms of libeulerfsi/src. A room is a folder; it may include what stands in a row above its own, and no other room
# of its own row. Files of a room include each other.
ROOMS = [
    ("base",),
    ("linalg", "material", "grid", "geometry"),
    ("io", "fluid", "solid"),
    ("solid/map",),
    ("solid/element", "solid/surface", "solid/particles"),
    ("system",),
    ("frame",),
    ("nodes",),
    ("given",),
    ("contact",),
    ("sources",),
    ("solve",),
    ("transport",),
    ("record",),
    ("sim",),
    ("capi",),
]
ROW = {room: row for row, rooms in enumerate(ROOMS) for room in rooms}
ONLY_USER = {"io": "capi"}
# The parts of batch/eulerfsi. "": the modules that all share; SHOWN: those that only show what parts have.
PACKAGES = ["", "solver", "scene", "cache", "run", "view", "farm", "cli"]
SHOWN = {"__main__.py", "simulate.py"}
FORBIDDEN_CALLS = re.compile(
    r"\b(?:v?f?printf|puts|putchar|perror|exit|_exit|quick_exit|abort|getenv|setenv|rand|srand|clock|gettimeofday)\s*\("
    r"|\bstd::(?:cout|cerr|clog|random_device)\b|\b(?:system_clock|high_resolution_clock|clock_gettime)\b"
    r"|(?<![\w.>])(?:std::)?time\s*\(\s*(?:NULL|nullptr|0|&)"
)
# The profile measures the stages and the whole; nothing else may look at a clock.
CLOCK = re.compile(r"\bsteady_clock\b")
CLOCK_HOME = {"frame/profile.hpp", "sim/simulation.cpp"}
THREAD_HOMES = {"base/parallel", "base/team"}
# Asking how many processors there are starts no thread, and an arena of one takes OpenVDB's away.
THREADS = re.compile(r"\bstd::(?:thread\b(?!::)|jthread\b|async\b|atomic\b)|\btbb::(?!task_arena\(1\))")
VDB_UNITS = 2
PACKAGE = ROOT / "batch" / "eulerfsi"
MAX_LINES = 70  # of a function


def room(path: Path) -> str:
    return path.relative_to(SRC).parent.as_posix()


def numbered(text: str) -> list[tuple[int, str]]:
    return list(enumerate(text.splitlines(), start=1))


def globals_(*libraries: str) -> None:
    if not libraries:
        sys.exit("globals needs the libraries to look at")
    problems = []
    for path in sources():
        name = path.relative_to(SRC).as_posix()
        for line, text in numbered(code_only(path.read_text())):
            if room(path) not in {"capi", "io"} and (found := FORBIDDEN_CALLS.search(text)):
                problems.append(f"{relative(path)}:{line}: {found.group().strip()} is for capi and io only")
            if name not in CLOCK_HOME and room(path) != "capi" and CLOCK.search(text):
                problems.append(f"{relative(path)}:{line}: only frame/profile reads a clock")
    everything = "\n".join(code_only(path.read_text()) for path in sources())
    for library in libraries:
        problems += [f"{library}: mutable global or static {symbol}" for symbol in mutable_symbols(library, everything)]
    finish(problems, f"{len(sources())} files, {len(libraries)} libraries")


def mutable_symbols(library: str, code: str) -> list[str]:
    """Our variables in writable sections. A constant built at run time lies there too: it is declared const."""
    table = subprocess.run(["objdump", "-t", "-C", library], check=True, capture_output=True, text=True).stdout
    if "efsi::" not in table:
        sys.exit(f"{library}: no symbol of namespace efsi; is it stripped?")
    found = set()
    for line in table.splitlines():
        match = re.match(r"[0-9a-f]+ .{7} \.t?(?:data|bss)(?!\.rel\.ro)\S*\s+[0-9a-f]+ +(?:\.hidden )?(.*)", line)
        symbol = match.group(1) if match else ""
        if "efsi::" not in symbol or symbol.startswith(("guard variable", "typeinfo", "vtable")):
            continue
        name = re.sub(r"\[abi:\w+\]|\(\.\w+\)", "", symbol).split("::")[-1]
        if not re.search(rf"\bconst(?:expr)?\b[^;={{}}]*\b{re.escape(name)}\b", code):
            found.add(symbol)
    return sorted(found)


def threads() -> None:
    problems = []
    for path in sources():
        if path.relative_to(SRC).with_suffix("").as_posix() in THREAD_HOMES:
            continue
        for line, text in numbered(code_only(path.read_text())):
            if re.search(r"#\s*pragma\s+omp\b.*\b(parallel|for|task|sections|single|atomic|critical)\b", text):
                problems.append(f"{relative(path)}:{line}: threads start in base/parallel and base/team only")
            if THREADS.search(text):
                problems.append(f"{relative(path)}:{line}: threads and atomics are not for this room")
    finish(problems, f"{len(sources())} files")


def includes() -> None:
    problems = []
    vdb_units = []
    for path in sources():
        here = room(path)
        if here not in ROW:
            problems.append(f"{relative(path)}: '{here}' is no room")
            continue
        for line, text in numbered(path.read_text()):
            match = re.match(r'\s*#\s*include\s+(["<])([^">]+)[">]', text)
            if not match:
                continue
            quoted, target = match.group(1) == '"', match.group(2)
            at = f"{relative(path)}:{line}"
            if target.startswith("openvdb/"):
                if path.suffix != ".cpp":
                    problems.append(f"{at}: OpenVDB is not for headers")
                elif path not in vdb_units:
                    vdb_units.append(path)
            if target.startswith("eulerfsi/"):
                if here != "capi":
                    problems.append(f"{at}: the C API is for capi only")
            elif quoted and (problem := refused(here, target)):
                problems.append(f"{at}: {problem}")
    for test in sorted((ROOT / "tests" / "unit").rglob("test_*.cpp")):
        if (mirrored := test.parent.relative_to(ROOT / "tests" / "unit").as_posix()) not in ROW:
            problems.append(f"{relative(test)}: '{mirrored}' is no room")
    if len(vdb_units) > VDB_UNITS:
        names = ", ".join(map(relative, vdb_units))
        problems.append(f"{len(vdb_units)} translation units include OpenVDB, at most {VDB_UNITS} may: {names}")
    finish(problems, f"{len(sources())} files, {len(ROW)} rooms")


def refused(here: str, target: str) -> str | None:
    """Why a file of room `here` must not include `target`, or None."""
    there = Path(target).parent.as_posix()
    if there not in ROW:
        return f'"{target}" does not start with a room'
    if there == here:
        return None
    if ONLY_USER.get(there, here) != here:
        return f"{there} is used by {ONLY_USER[there]} only"
    if ROW[there] >= ROW[here]:
        return f"{here} must not include {there}, which does not stand above it"
    return None


def packages() -> None:
    problems = []
    files = sorted(PACKAGE.rglob("*.py"))
    if not files:
        sys.exit(f"{PACKAGE}: no modules; the check would prove nothing")
    for path in files:
        parts = path.relative_to(PACKAGE).parts[:-1]
        if (here := "/".join(parts)) not in PACKAGES:
            problems.append(f"{relative(path)}: '{here}' is no part of the package")
        elif parts or path.name not in SHOWN:
            for line, there in imported(path.read_text(), parts):
                if there in PACKAGES and PACKAGES.index(there) > PACKAGES.index(here):
                    problems.append(
                        f"{relative(path)}:{line}: '{here}' must not import '{there}', which comes after it"
                    )
    finish(problems, f"{len(files)} modules of {len(PACKAGES)} parts")


def imported(text: str, parts: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """The parts of the package that a module imports from, with the lines; parts: where the module lies."""
    for line, content in numbered(text):
        if not (match := re.match(r"\s*from (\.+)([\w.]*) import (.+)", content)):
            continue
        base = [*parts[: len(parts) + 1 - len(match.group(1))], *filter(None, match.group(2).split("."))]
        for name in [base[0]] if base else re.findall(r"\w+", match.group(3)):
            yield line, name if name in PACKAGES else ""


def lengths() -> None:
    problems, longest = [], 0
    for path in sources():
        for line, length in functions(code_only(path.read_text()).splitlines()):
            longest = max(longest, length)
            if length > MAX_LINES:
                problems.append(f"{relative(path)}:{line}: a function of {length} lines; at most {MAX_LINES}")
    finish(problems, f"{len(sources())} files, the longest function has {longest} lines")


def functions(text: list[str]) -> Iterator[tuple[int, int]]:
    """First line and length of the functions of a formatted file, also of those in a class: from the first line of the
    signature, which starts where the closing brace stands, to that."""
    outer = inner = 0
    for at, line in enumerate(text):
        if re.match(r"[\w~]", line):
            outer = at
        elif re.match(r"  [\w~]", line):
            inner = at
        elif line == "}":
            yield outer + 1, at + 1 - outer
        elif line == "  }" and re.match(r"(?:class|struct)\b", text[outer]):
            yield inner + 1, at + 1 - inner


def words() -> None:
    # written in parts, so that this file does not find itself
    marks = re.compile("|".join([r"\bTO" + r"DO\b", r"\bFIX" + r"ME\b", r"\bXX" + r"X\b", r"\bfor " + r"now\b"]))
    places = ["/work/" + r"(?:main|shared)\b", "/tmp/" + r"(?:devvenv|build-)", "/ro" + "ot/", "/ho" + r"me/\w"]
    paths = re.compile("|".join(places))
    suffixes = {
        "",
        ".c",
        ".h",
        ".cpp",
        ".hpp",
        ".inc",
        ".py",
        ".md",
        ".txt",
        ".toml",
        ".cmake",
        ".sh",
        ".json",
        ".usda",
    }
    skipped = {
        ".git",
        "build",
        ".venv",
        ".eulerfsi",
        "dist",
        "node_modules",
        "__pycache__",
        ".pytest_cache",
        ".ruff_cache",
    }
    problems = []
    count = 0
    for path in sorted(ROOT.rglob("*")):
        parts = path.relative_to(ROOT).parts
        if any(p in skipped or p.endswith(("_cache", ".egg-info")) for p in parts) or path.suffix not in suffixes:
            continue
        if not path.is_file() or path.is_symlink():
            continue
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue
        count += 1
        for line, content in numbered(text):
            if found := marks.search(content) or paths.search(content):
                problems.append(f"{relative(path)}:{line}: '{found.group()}'")
    finish(problems, f"{count} files")


if __name__ == "__main__":
    actions = {
        "globals": globals_,
        "threads": threads,
        "includes": includes,
        "packages": packages,
        "lengths": lengths,
        "words": words,
    }
    if len(sys.argv) < 2 or sys.argv[1] not in actions:
        sys.exit(__doc__)
    actions[sys.argv[1]](*sys.argv[2:])
