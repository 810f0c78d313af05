"""The documents name things that are there.

check_docs.py links      relative links of docs/ and of the documents of the root lead to a file, and to a heading of it
check_docs.py paths      source files and folders that docs/, README.md and CONTRIBUTING.md name exist, and so do
                         documents that the code names
check_docs.py numerics   docs/numerics: a file is one screen and stands in the index; constants have the values of the
                         code; tests that guard a mechanism exist
check_docs.py names      identifiers in backticks in docs/numerics, algorithm.md and notation.md occur in the code

Rows of constants that are read:  | `kName` | value | ...   value: a number, or a difference or quotient of two.
Identifiers that are looked for have an underscore or a capital inside: `find_slip`, `kFilm`, `Matter.owned`.
Paths in documents are relative to the root, to libeulerfsi, to its src or include, or to the document.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from common import INCLUDE, ROOT, SRC, code_only, finish, relative, sources

DOCS = ROOT / "docs"
NUMERICS = DOCS / "numerics"
SCREEN_LINES, SCREEN_WIDTH = 60, 120
LINK = re.compile(r"\]\(([^)\s]+)\)")
SOURCE_PATH = re.compile(r"(?<![\w/.<>-])[\w.-]+(?:/[\w.-]+)+\.(?:cpp|hpp|inc|h|c|py|sh|cmake|toml)\b(?!/)")
FOLDER = re.compile(r"`([\w.-]+(?:/[\w.-]+)*/)`")  # in docs/architecture.md
NAMED_DOCUMENT = re.compile(r"\bdocs/[\w./-]+\.md\b")
CODE_FOLDERS = ("libeulerfsi", "tests", "batch", "usd_plugin", "examples", "houdini_hda", "blender_addon", "packaging")
CODE_SUFFIXES = {".cpp", ".hpp", ".inc", ".h", ".c", ".py", ".sh", ".cmake", ".txt", ".toml"}
SPOKEN_FOLDERS = ("libeulerfsi", "batch", "usd_plugin", "tests", "examples")
SPAN = re.compile(r"`([\w.:]+?)(?:\(\)|\.\.\.)?`")
IDENTIFIER = re.compile(r"(?=[^\W\d])(?=\w*(?:_|[a-z][A-Z]))\w+")
CONSTANT = re.compile(r"^\| `(k\w+)` \| ([^|]+) \|", re.M)
NUMBER = r"(\d[\d.]*(?:e[+-]?\d+)?)"
EXPRESSION = re.compile(rf"{NUMBER}(?: ?([-/]) ?{NUMBER})?")


def documents(*more: str) -> list[Path]:
    """All of docs/ and those of the root; an empty answer is an error of the check itself."""
    files = sorted(DOCS.rglob("*.md")) + [ROOT / name for name in more if (ROOT / name).is_file()]
    if not files:
        sys.exit(f"{DOCS}: no documents; the check would prove nothing")
    return files


def without_code(text: str) -> str:
    """The text with blocks and spans of code blanked; line numbers stay."""
    blank = lambda match: re.sub(r"[^\n]", " ", match.group())  # noqa: E731
    return re.sub(r"`[^`\n]*`", blank, re.sub(r"^```.*?^```", blank, text, flags=re.M | re.S))


def matches(pattern: re.Pattern[str], text: str) -> Iterator[tuple[int, str]]:
    """Line and text, of the first group where there is one."""
    for found in pattern.finditer(text):
        yield text.count("\n", 0, found.start()) + 1, found.group(found.re.groups and 1)


def anchors(path: Path) -> set[str]:
    """The names by which a document's headings are linked to."""
    headings = re.findall(r"^#+ +(.+)$", re.sub(r"^```.*?^```", "", path.read_text(), flags=re.M | re.S), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


def links() -> None:
    problems, count = [], 0
    for path in documents("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        for line, target in matches(LINK, without_code(path.read_text())):
            if re.match(r"[a-z]+:", target):
                continue
            count += 1
            name, _, anchor = target.partition("#")
            to = (path.parent / name) if name else path
            at = f"{relative(path)}:{line}"
            if not to.exists():
                problems.append(f"{at}: {target} does not exist")
            elif anchor and anchor not in anchors(to):
                problems.append(f"{at}: {target}: there is no such heading")
    finish(problems, f"{count} links")


def exists(name: str, document: Path) -> bool:
    bases = (ROOT, ROOT / "libeulerfsi", SRC, INCLUDE.parent, document.parent)
    return any((base / name).exists() for base in bases)


def paths() -> None:
    problems, count = [], 0
    for document in documents("README.md", "CONTRIBUTING.md"):
        patterns = [SOURCE_PATH] + ([FOLDER] if document == DOCS / "architecture.md" else [])
        text = document.read_text()
        for line, name in (found for pattern in patterns for found in matches(pattern, text)):
            count += 1
            if not exists(name, document):
                problems.append(f"{relative(document)}:{line}: {name} does not exist")
    for folder in CODE_FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix not in CODE_SUFFIXES or path.is_relative_to(ROOT / "tests" / "checks"):
                continue
            for line, name in matches(NAMED_DOCUMENT, path.read_text(errors="replace")):
                count += 1
                if not (ROOT / name).is_file():
                    problems.append(f"{relative(path)}:{line}: {name} does not exist")
    finish(problems, f"{count} paths")


def value_of(expression: str) -> float | None:
    """Of a number, or of a difference or quotient of two; None: it is something else."""
    found = EXPRESSION.fullmatch(re.sub(r"\bReal\(([^()]*)\)", r"\1", expression).strip())
    if not found:
        return None
    first, sign, second = found.groups()
    return float(first) if not sign else float(first) - float(second) if sign == "-" else float(first) / float(second)


def constants() -> dict[str, list[float]]:
    """The values of every constant kName of the sources that is a number; rooms may use a name for different things."""
    found: dict[str, list[float]] = {}
    for path in sources():
        for name, expression in re.findall(r"\b(k[A-Z]\w*)\s*=\s*([^;,=]+)", code_only(path.read_text())):
            value = value_of(expression)
            found.setdefault(name, []).extend([] if value is None else [value])
    return found


def missing_guards(text: str) -> Iterator[str]:
    """Tests between "Guarded by" and "Trials" that are not in the file named before them."""
    guards = re.search(r"\*\*Guarded by\*\*(.*?)(?:\*\*Trials|\Z)", text, re.S)
    if not guards:
        yield "says nothing of what guards it"
        return
    file = None
    for name, test in re.findall(r'`(tests/[\w/]+\.cpp)`|"([^"]+)"', re.sub(r"\s+", " ", guards.group(1))):
        if name:
            file = ROOT / name
        elif file is None or not file.is_file() or f'"{test}"' not in file.read_text():
            yield f'there is no test "{test}"' + (f" in {relative(file)}" if file else "")


def numerics() -> None:
    problems, rows = [], 0
    values = constants()
    index = (NUMERICS / "README.md").read_text() if (NUMERICS / "README.md").is_file() else ""
    files = sorted(path for path in NUMERICS.glob("*.md") if path.name != "README.md")
    if not files:
        sys.exit(f"{NUMERICS}: no mechanisms; the check would prove nothing")
    for path in files:
        text, at = path.read_text(), relative(path)
        lines = text.splitlines()
        if len(lines) > SCREEN_LINES or any(len(line) > SCREEN_WIDTH for line in lines):
            problems.append(f"{at}: more than a screen of {SCREEN_LINES} lines of {SCREEN_WIDTH} characters")
        if f"({path.name})" not in index:
            problems.append(f"{at}: the index docs/numerics/README.md does not link to it")
        problems += [f"{at}: {problem}" for problem in missing_guards(text)]
        for name, said in CONSTANT.findall(text):
            rows += 1
            wanted = value_of(said)
            if name not in values:
                problems.append(f"{at}: there is no constant {name}")
            elif wanted not in values[name] and (wanted is not None or values[name]):
                code = ", ".join(f"{value:g}" for value in values[name]) or "no number"
                problems.append(f"{at}: {name} is said to be {said.strip()}; in the code: {code}")
    finish(problems, f"{len(files)} mechanisms, {rows} constants")


def spoken_words() -> set[str]:
    """All words of the code, comments and names of files too; without those of the checks and of tables."""
    left_out = (ROOT / "tests" / "checks", ROOT / "tests" / "bench" / "results")
    words: set[str] = set()
    for folder in SPOKEN_FOLDERS:
        for path in (ROOT / folder).rglob("*"):
            is_code = path.suffix in CODE_SUFFIXES | {".usda"} and not any(map(path.is_relative_to, left_out))
            if is_code and path.is_file():
                words.update(re.findall(r"\w+", f"{path.name} {path.read_text(errors='replace')}"))
    return words


def names() -> None:
    problems, count, words = [], 0, spoken_words()
    pages = [*NUMERICS.glob("*.md"), DOCS / "algorithm.md", DOCS / "notation.md"]
    for page in sorted(path for path in pages if path.is_file()):
        for line, span in matches(SPAN, page.read_text()):
            for name in filter(IDENTIFIER.fullmatch, re.split(r"[.:]+", span)):
                count += 1
                if name not in words:
                    problems.append(f"{relative(page)}:{line}: {name} does not occur in the code")
    finish(problems, f"{count} identifiers")


if __name__ == "__main__":
    actions = {"links": links, "paths": paths, "numerics": numerics, "names": names}
    if len(sys.argv) != 2 or sys.argv[1] not in actions:
        sys.exit(__doc__)
    actions[sys.argv[1]]()
