"""The step is Algorithm 1, and every equation has one home.

check_algorithm.py lines       markers "// Alg. 1 line N" in sim/step.cpp against the table of docs/algorithm.md
check_algorithm.py equations   Eq. 1, 8, 12, 13, 14, 15: one home file each, named by docs/algorithm.md

docs/algorithm.md holds two tables whose rows are read here:
  | line | function | file |        for example  | 10 | `solve_pressure` | `system/pressure_solve.cpp` | ... |
  | Eq. N | file |                  for example  | Eq. 12 | `system/pressure_solve.hpp` | ... |
A line or equation that is not built yet is named in docs/deviations.md as "Alg. 1 line N is missing" or
"Eq. N is missing".
"""

from __future__ import annotations

import re
import sys

from common import ROOT, SRC, code_only, finish

LINES = [1, 3, 4, 7, 8, 9, 10, 11, 13, 14, 18, 19, 20, 22]
EQUATIONS = [1, 8, 12, 13, 14, 15]
MAX_STEP_LINES = 80


def numbers(text: str) -> list[int]:
    """ "2-4, 8" -> [2, 3, 4, 8]"""
    found: list[int] = []
    for first, last in re.findall(r"(\d+)(?:\s*-\s*(\d+))?", text):
        found += range(int(first), int(last or first) + 1)
    return found


def table_rows() -> list[list[str]]:
    document = ROOT / "docs" / "algorithm.md"
    if not document.is_file():
        sys.exit("docs/algorithm.md is missing")
    rows = [line.strip().strip("|").split("|") for line in document.read_text().splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows]


def named_missing(what: str) -> set[int]:
    document = ROOT / "docs" / "deviations.md"
    text = document.read_text() if document.is_file() else ""
    return {int(n) for n in re.findall(rf"{re.escape(what)} (\d+) is missing", text)}


def lines() -> None:
    step = SRC / "sim" / "step.cpp"
    if not step.is_file():
        sys.exit("libeulerfsi/src/sim/step.cpp is missing")
    text = step.read_text().splitlines()
    problems = []
    marked: dict[int, list[int]] = {}
    for at, line in enumerate(text):
        match = re.search(r"// Alg\. 1 lines? ([\d ,-]+)", line)
        for n in numbers(match.group(1)) if match else []:
            marked.setdefault(n, []).append(at)

    calls = {}
    for row in table_rows():
        if re.fullmatch(r"[\d ,-]+", row[0]) and len(row) >= 3:
            functions, files = re.findall(r"`(\w+)`", row[1]), re.findall(r"`([\w/.]+)`", row[2])
            for n in numbers(row[0]):
                calls[n] = (functions, files)

    missing = named_missing("Alg. 1 line")
    for n in LINES:
        where = marked.get(n, [])
        if n in missing:
            if where:
                problems.append(f"docs/deviations.md calls line {n} missing, but sim/step.cpp marks it")
            continue
        if len(where) != 1:
            problems.append(f"sim/step.cpp marks line {n} of Algorithm 1 {len(where)} times, not once")
            continue
        if n not in calls or not all(calls[n]):
            problems.append(f"docs/algorithm.md has no row with function and file for line {n}")
            continue
        functions, files = calls[n]
        after = code_only("\n".join(text[where[0] : where[0] + 8]))
        for function in functions:
            if not re.search(rf"\b{function}\s*[(<]", after):
                problems.append(f"sim/step.cpp:{where[0] + 1}: line {n} does not call {function}")
            if not any(defines(file, function) for file in files):
                problems.append(f"docs/algorithm.md: {function} is not defined in {', '.join(files)}")
    body = longest_function(text)
    if body > MAX_STEP_LINES:
        problems.append(f"sim/step.cpp: a function of {body} lines; the step has at most {MAX_STEP_LINES}")
    finish(problems, f"{len(LINES) - len(missing & set(LINES))} lines of Algorithm 1")


def defines(file: str, function: str) -> bool:
    path = SRC / file
    if not path.is_file():
        return False
    return re.search(rf"\b{function}\s*\([^;{{}}]*\)[^;{{}}]*\{{", code_only(path.read_text())) is not None


def longest_function(text: list[str]) -> int:
    """Lines of the longest function, from its unindented signature to the "}" in column 0."""
    longest, start = 0, 0
    for at, line in enumerate(text):
        if re.match(r"\w", line):
            start = at
        elif line == "}":
            longest = max(longest, at - start + 1)
    return longest


def equations() -> None:
    homes: dict[int, list[str]] = {}
    for row in table_rows():
        match = re.fullmatch(r"Eq\. (\d+)", row[0])
        if match and len(row) >= 2:
            homes.setdefault(int(match.group(1)), []).extend(re.findall(r"`([\w/.]+\.[ch]pp)`", row[1]))
    problems = []
    missing = named_missing("Eq.")
    for n in EQUATIONS:
        if n in missing:
            continue
        files = homes.get(n, [])
        if len(files) != 1:
            problems.append(f"docs/algorithm.md names {len(files)} home files for Eq. {n}, not one")
            continue
        path = SRC / files[0]
        if not path.is_file():
            problems.append(f"docs/algorithm.md: the home of Eq. {n}, {files[0]}, does not exist")
        elif not cites(path.read_text(), n):
            problems.append(f"{files[0]}: the home of Eq. {n} does not cite it in its header comment")
    finish(problems, f"{len(EQUATIONS) - len(missing & set(EQUATIONS))} equations")


def cites(text: str, n: int) -> bool:
    """True when the comment at the top of the file names Eq. n ("Eq. 8", "Eq. 8, 12", "Eq. 12-13")."""
    header = "\n".join(line for line in text.splitlines()[:40] if line.lstrip().startswith(("//", "/*", "*")))
    return any(n in numbers(found) for found in re.findall(r"Eqs?\. (\d[\d ,-]*)", header))


if __name__ == "__main__":
    actions = {"lines": lines, "equations": equations}
    if len(sys.argv) != 2 or sys.argv[1] not in actions:
        sys.exit(__doc__)
    actions[sys.argv[1]]()
