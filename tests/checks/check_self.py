"""The checks themselves: each is run on a small tree that is in order and on copies with one planted fault.

check_self.py CC CXX
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent

STEP = """// Purpose: Algorithm 1.
namespace efsi {
void step() {
%s}
}  // namespace efsi
"""
LINES = (1, 3, 4, 7, 8, 9, 10, 11, 13, 14, 18, 19, 20, 22)
EQUATIONS = (1, 8, 12, 13, 14, 15)
MECHANISM = """# Stage
| `kLimit` | 3 | - | most |

**Guarded by** `tests/unit/system/test_stage.cpp`: "A stage is
a stage".

**Trials.** [index](README.md#index-of-all)
"""
GOOD = {
    "libeulerfsi/include/eulerfsi/base.h": "#define EFSI_API\n/** Does it. */\nEFSI_API int efsi_do(int a);\n",
    "libeulerfsi/src/base/error.hpp": "// Purpose: errors.\nnamespace efsi { inline const int kLimit = 3; }\n",
    "libeulerfsi/src/system/stage.hpp": '// Eq. 1, 8; Eq. 12-15.\n#include "solid/mass.hpp"\nvoid stage();\n',
    "libeulerfsi/src/solid/mass.hpp": '#include "base/error.hpp"\n',
    "libeulerfsi/src/system/stage.cpp": '// Purpose: stage.\n#include "system/stage.hpp"\nvoid stage() {\n}\n',
    "libeulerfsi/src/sim/step.cpp": STEP % "".join(f"  stage();  // Alg. 1 line {n}\n" for n in LINES),
    "libeulerfsi/src/io/vdb_io.cpp": "#include <openvdb/openvdb.h>\n",
    "libeulerfsi/src/contact/row.hpp": '#include "solid/map/map.hpp"\n',
    "libeulerfsi/src/solid/map/map.hpp": '#include "solid/mass.hpp"\n',
    "libeulerfsi/src/solve/equation.hpp": '#include "contact/row.hpp"\n',
    "tests/unit/system/test_stage.cpp": 'TEST_CASE("A stage is a stage") {}\n',
    "batch/eulerfsi/say.py": "from . import paths\n",
    "batch/eulerfsi/scene/read.py": "from ..say import say\nfrom ..solver import binding\nfrom . import parts\n",
    "README.md": "[lines](docs/algorithm.md), `system/stage.cpp`, <https://example.org/a/b.cpp>\n",
    "docs/architecture.md": "| `tests/unit/` | `src/` |\n",
    "docs/numerics/README.md": "# Index of `all`\n[stage](stage.md)\n",
    "docs/numerics/stage.md": MECHANISM,
    "tests/capi/client.c": "int main(void) { return efsi_do(1); }\n",
    "docs/algorithm.md": "".join(f"| {n} | `stage` | `system/stage.cpp` |\n" for n in LINES)
    + "".join(f"| Eq. {n} | `system/stage.hpp` |\n" for n in EQUATIONS),
}
LIBRARY = 'extern "C" int efsi_do(int a) { return a; }\nnamespace efsi { int f(); %s int f() { return %s; } }\n'
LIBRARY_GOOD = LIBRARY % ("extern const int kLimit; const int kLimit = f();", "3")

# (check, file, text that is appended; with a leading "=" it replaces the file)
FAULTS = [
    ("check_sources.py globals", "libeulerfsi/src/system/stage.cpp", '#include <cstdio>\nvoid f() { printf("x"); }\n'),
    (
        "check_sources.py globals",
        "libeulerfsi/src/system/stage.cpp",
        "void f() { std::chrono::steady_clock::now(); }\n",
    ),
    ("check_sources.py threads", "libeulerfsi/src/system/stage.cpp", "#pragma omp parallel for\n"),
    ("check_sources.py threads", "libeulerfsi/src/base/error.hpp", "std::atomic<int> counter;\n"),
    ("check_sources.py includes", "libeulerfsi/src/base/error.hpp", '#include "system/stage.hpp"\n'),
    ("check_sources.py includes", "libeulerfsi/src/system/stage.hpp", '#include "io/vdb_io.hpp"\n'),
    ("check_sources.py includes", "libeulerfsi/src/system/stage.hpp", "#include <openvdb/openvdb.h>\n"),
    ("check_sources.py includes", "libeulerfsi/src/solid/mass.hpp", '#include "system/stage.hpp"\n'),
    ("check_sources.py includes", "libeulerfsi/src/contact/row.hpp", '#include "solve/equation.hpp"\n'),
    ("check_sources.py includes", "libeulerfsi/src/solid/mass.hpp", '#include "solid/map/map.hpp"\n'),
    ("check_sources.py includes", "libeulerfsi/src/solid/map/map.hpp", '#include "io/vdb_io.hpp"\n'),
    ("check_sources.py includes", "libeulerfsi/src/motion/stage.cpp", "void stage();\n"),
    ("check_sources.py includes", "tests/unit/motion/test_stage.cpp", "void stage();\n"),
    ("check_sources.py packages", "batch/eulerfsi/scene/read.py", "from ..run.simulate import simulate\n"),
    ("check_sources.py packages", "batch/eulerfsi/scene/read.py", "from .. import cache\n"),
    ("check_sources.py packages", "batch/eulerfsi/say.py", "    from .scene.read import read_scene\n"),
    ("check_sources.py packages", "batch/eulerfsi/draw/plot.py", "from ..say import say\n"),
    ("check_sources.py lengths", "libeulerfsi/src/system/stage.cpp", "void f() {\n" + "  stage();\n" * 70 + "}\n"),
    (
        "check_sources.py lengths",
        "libeulerfsi/src/system/stage.hpp",
        "struct S {\n  void f() {\n" + "    stage();\n" * 70 + "  }\n};\n",
    ),
    ("check_sources.py words", "docs/algorithm.md", "TO" + "DO: more\n"),
    ("check_sources.py words", "docs/algorithm.md", "see /ho" + "me/someone/x\n"),
    ("check_algorithm.py lines", "libeulerfsi/src/sim/step.cpp", "  stage();  // Alg. 1 line 9\n"),
    ("check_algorithm.py lines", "libeulerfsi/src/sim/step.cpp", STEP % ("  stage();\n" * 80)),
    ("check_algorithm.py lines", "libeulerfsi/src/system/stage.cpp", "=// empty\n"),
    ("check_algorithm.py lines", "docs/deviations.md", "Alg. 1 line 14 is missing\n"),
    ("check_algorithm.py equations", "docs/algorithm.md", "| Eq. 8 | `system/stage.cpp` |\n"),
    ("check_algorithm.py equations", "libeulerfsi/src/system/stage.hpp", "=// Eq. 1\n"),
    ("check_docs.py links", "docs/algorithm.md", "[gone](gone.md)\n"),
    ("check_docs.py links", "README.md", "[index](docs/numerics/README.md#trials)\n"),
    ("check_docs.py links", "CHANGELOG.md", "[gone](docs/gone.md)\n"),
    ("check_docs.py paths", "docs/algorithm.md", "see `system/gone.cpp`\n"),
    ("check_docs.py paths", "README.md", "see examples/c/gone.c\n"),
    ("check_docs.py paths", "docs/architecture.md", "| `tests/gone/` |\n"),
    ("check_docs.py paths", "libeulerfsi/src/base/error.hpp", "// docs/gone.md\n"),
    ("check_docs.py numerics", "libeulerfsi/src/base/error.hpp", "=inline const int kLimit = 4;\n"),
    ("check_docs.py numerics", "docs/numerics/stage.md", "| `kMost` | 3 | - | not in the code |\n"),
    ("check_docs.py numerics", "docs/numerics/stage.md", "\n" * 60),
    ("check_docs.py numerics", "docs/numerics/stage.md", "x" * 121 + "\n"),
    ("check_docs.py numerics", "docs/numerics/stage.md", "=# Stage\nGuarded by nothing.\n"),
    ("check_docs.py numerics", "docs/numerics/README.md", "=# Index\n"),
    ("check_docs.py numerics", "tests/unit/system/test_stage.cpp", '=TEST_CASE("Another") {}\n'),
    ("check_docs.py names", "docs/algorithm.md", "see `gone_stage`\n"),
    ("check_docs.py names", "docs/numerics/stage.md", "`Stage.kGone` is 3\n"),
    ("check_docs.py names", "libeulerfsi/src/base/error.hpp", "=// empty\n"),
    ("check_api.py client", "libeulerfsi/include/eulerfsi/base.h", "/** More. */\nEFSI_API int efsi_more(void);\n"),
    ("check_api.py headers", "libeulerfsi/include/eulerfsi/base.h", "// a C++ comment is fine in C11\nbool x;\n"),
    ("check_api.py exports", "libeulerfsi/include/eulerfsi/base.h", "/** More. */\nEFSI_API int efsi_more(void);\n"),
    (
        "check_api.py exports",
        "libeulerfsi/include/eulerfsi/base.h",
        "=#define EFSI_API\nEFSI_API int efsi_do(int a);\n",
    ),
]
LIBRARY_FAULTS = [
    ("check_sources.py globals", LIBRARY % ("int counter = 1;", "++counter")),
    ("check_sources.py globals", LIBRARY % ("", "[] { static int calls = 0; return ++calls; }()")),
    ("check_api.py exports", LIBRARY_GOOD + 'extern "C" int efsi_secret() { return 1; }\n'),
]


def make(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def build(cxx: str, root: Path, text: str) -> Path:
    """A shared library whose exports are its functions of C linkage."""
    source, library, script = root / "library.cxx", root / "library.so", root / "library.map"
    source.write_text(text)
    script.write_text("{ global: efsi_*; local: *; };")
    subprocess.run([cxx, "-shared", "-fPIC", f"-Wl,--version-script={script}", source, "-o", library], check=True)
    return library


def run(check: str, root: Path, library: Path, cc: str, cxx: str) -> subprocess.CompletedProcess[str]:
    script, action = check.split()
    extra = {"globals": [str(library)], "exports": [str(library)], "headers": [cc, cxx]}.get(action, [])
    return subprocess.run(
        [sys.executable, str(HERE / script), action, *extra],
        env={**os.environ, "EFSI_CHECK_ROOT": str(root)},
        capture_output=True,
        text=True,
    )


def main(cc: str, cxx: str) -> None:
    problems = []
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "tree"
        make(root, GOOD)
        outside = Path(folder)
        library = build(cxx, outside, LIBRARY_GOOD)
        for check in sorted({fault[0] for fault in FAULTS}):
            result = run(check, root, library, cc, cxx)
            if result.returncode:
                problems.append(f"{check} refuses a tree in order:\n{result.stdout}{result.stderr}")
        for check, name, text in FAULTS:
            path = root / name
            before = path.read_text() if path.exists() else None
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text[1:] if text[0] == "=" else (before or "") + text)
            if run(check, root, library, cc, cxx).returncode != 1:
                problems.append(f"{check} does not see the fault in {name}: {text!r}")
            if before is None:
                path.unlink()
            else:
                path.write_text(before)
        for check, text in LIBRARY_FAULTS:
            if run(check, root, build(cxx, outside, text), cc, cxx).returncode != 1:
                problems.append(f"{check} does not see the fault in the library:\n{text}")
    if problems:
        sys.exit("\n".join(problems))
    print(f"ok: {len(FAULTS) + len(LIBRARY_FAULTS)} planted faults found")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
