"""The C API: exported symbols, the client's coverage, headers that compile alone.

check_api.py exports LIBRARY       nm -D of the library = functions declared with EFSI_API, each with a comment
check_api.py client                tests/capi calls every function
check_api.py headers CC CXX        every header alone as C11 and C++17, pedantic, warnings as errors
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from common import INCLUDE, ROOT, code_only, finish, relative

_DECLARATION = re.compile(r"EFSI_API\b[^;{]*?\b(efsi_\w+)\s*\(", re.S)


def declared() -> dict[str, Path]:
    """Function name -> header."""
    functions = {}
    for header in sorted(INCLUDE.glob("*.h")):
        functions.update(dict.fromkeys(_DECLARATION.findall(code_only(header.read_text())), header))
    if not functions:
        sys.exit(f"{INCLUDE}: no function is declared")
    return functions


def exports(library: str) -> None:
    listing = subprocess.run(["nm", "-D", "--defined-only", library], check=True, capture_output=True, text=True).stdout
    exported = {line.split()[-1].split("@")[0] for line in listing.splitlines() if line.strip()}
    functions = declared()
    problems = [f"{library}: exports {name}, which no header declares" for name in sorted(exported - set(functions))]
    for name in sorted(set(functions) - exported):
        problems.append(f"{relative(functions[name])}: {name} is declared but not in the library")
    problems += undocumented(functions)
    finish(problems, f"{len(functions)} functions")


def undocumented(functions: dict[str, Path]) -> list[str]:
    """Above every function stands a comment of its own that starts with a verb: "Adds ...", "Returns ..."."""
    problems = []
    for name, header in functions.items():
        text = header.read_text()
        above = text[: re.search(rf"\bEFSI_API\b(?:(?!EFSI_API)[^;{{])*?\b{name}\s*\(", text).start()].rstrip()
        if not (above.endswith("*/") and re.match(r"/\*\* [A-Z][a-z]*s ", above[above.rfind("/*") :])):
            problems.append(f"{relative(header)}: {name} has no comment of its own that starts with a verb")
    return problems


def client() -> None:
    text = "".join(code_only(p.read_text()) for p in sorted((ROOT / "tests" / "capi").glob("*.c")))
    called = set(re.findall(r"\b(efsi_\w+)\s*\(", text))
    functions = declared()
    uncalled = sorted(set(functions) - called)
    finish(
        [f"tests/capi never calls {name} ({relative(functions[name])})" for name in uncalled], f"{len(functions)} calls"
    )


def headers(cc: str, cxx: str) -> None:
    problems = []
    files = sorted(INCLUDE.glob("*.h"))
    strict = ["-pedantic-errors", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{INCLUDE.parent}"]
    for header in files:
        for command in ([cc, "-std=c11", "-x", "c"], [cxx, "-std=c++17", "-x", "c++"]):
            # through standard input: a header given as the main file would be warned about for its own sake
            source = f'#include "eulerfsi/{header.name}"\nint main(void) {{ return 0; }}\n'.replace(
                "main(void)", "main()" if "c++" in command else "main(void)"
            )
            result = subprocess.run([*command, *strict, "-"], input=source, capture_output=True, text=True)
            if result.returncode:
                problems.append(f"{relative(header)} as {command[1]}:\n{result.stderr.strip()}")
    finish(problems, f"{len(files)} headers as C11 and C++17")


if __name__ == "__main__":
    actions = {"exports": exports, "client": client, "headers": headers}
    if len(sys.argv) < 2 or sys.argv[1] not in actions:
        sys.exit(__doc__)
    actions[sys.argv[1]](*sys.argv[2:])
