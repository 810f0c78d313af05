"""Reads the C headers: enums, structs, callbacks, opaque types and functions, in the order of their declaration.

It knows the C that the headers are written in and no more: a declaration that it does not know is a HeaderError.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

HEADERS = Path(__file__).resolve().parents[1] / "include" / "eulerfsi"
_STATEMENT = re.compile(r"[^;{}]+(?:{[^{}]*}[^;{}]*)?;")
_DECLARATION = re.compile(r"(const )?(?:struct )?(\w+)((?: ?\*(?: ?const)?)*) ?(\w+)?((?:\[\d+\])?)")
_CALLBACK = re.compile(r"typedef (.+?)\(\* ?(\w+)\)\((.*)\)")
_FUNCTION = re.compile(r"(.+?[ *])(\w+)\((.*)\)")


class HeaderError(ValueError):
    """A declaration that the reader does not know."""


@dataclass(frozen=True)
class Declared:
    """A member, an argument or a result: `const float* data[3]` has base float, const, one star and 3 elements."""

    name: str
    base: str
    const: bool = False
    stars: int = 0
    count: int | None = None


@dataclass(frozen=True)
class Function:
    """Also the type of a callback."""

    result: Declared
    arguments: tuple[Declared, ...]


class Header:
    """The declarations of a text without comments and preprocessor lines."""

    def __init__(self, text: str) -> None:
        self.enums: dict[str, dict[str, int]] = {}
        self.structs: dict[str, list[Declared]] = {}
        self.callbacks: dict[str, Function] = {}
        self.aliases: dict[str, Declared] = {}
        self.functions: dict[str, Function] = {}
        for statement in _STATEMENT.findall(text):
            self._read(" ".join(statement[:-1].split()))
        if left := _STATEMENT.sub("", text).strip():
            raise HeaderError(f"unknown declaration: {left}")

    def _read(self, statement: str) -> None:
        if found := re.fullmatch(r"typedef enum (\w+) {(.*)} \1", statement):
            pairs = re.findall(r"(\w+) = (\d+)", found[2])
            self.enums[found[1]] = {name: int(value) for name, value in pairs}
        elif found := re.fullmatch(r"typedef struct (\w+) {(.*)} \1", statement):
            lines = [line.strip() for line in found[2].split(";")]
            self.structs[found[1]] = [member for line in lines if line for member in _members(line)]
        elif found := _CALLBACK.fullmatch(statement):
            self.callbacks[found[2]] = _function(found[1], found[3])
        elif re.fullmatch(r"(typedef struct (\w+) \2|struct \w+)", statement):
            pass  # an opaque type
        elif statement.startswith("typedef "):
            alias = _declared(statement.removeprefix("typedef "))
            self.aliases[alias.name] = alias
        elif found := _FUNCTION.fullmatch(statement):
            self.functions[found[2]] = _function(found[1], found[3])
        else:
            raise HeaderError(f"unknown declaration: {statement}")


def _declared(text: str) -> Declared:
    found = _DECLARATION.fullmatch(text.strip())
    if not found:
        raise HeaderError(f"unknown declaration: {text}")
    const, base, stars, name, count = found.groups()
    return Declared(name or "", base, bool(const), stars.count("*"), int(count[1:-1]) if count else None)


def _members(line: str) -> list[Declared]:
    """`double x, y, z` declares three."""
    first, *others = line.split(",")
    head = _declared(first)
    return [head, *(Declared(name.strip(), head.base, head.const, head.stars) for name in others)]


def _function(result: str, arguments: str) -> Function:
    given = () if arguments.strip() in ("", "void") else arguments.split(",")
    return Function(_declared(result), tuple(map(_declared, given)))


def _include_once(name: str, seen: set[str]) -> str:
    """A header with those that it includes before it, each once."""
    seen.add(name)
    text = (HEADERS / name).read_text(encoding="utf-8")
    included = re.findall(r'^#include "eulerfsi/(.*)"$', text, flags=re.M)
    return "".join(_include_once(part, seen) for part in included if part not in seen) + text


def read_headers() -> Header:
    """All headers as one text, without preprocessor lines and comments."""
    text = re.sub(r"/\*.*?\*/", "", _include_once("eulerfsi.h", set()), flags=re.S)
    text = re.sub(r"^#ifdef __cplusplus\n.*?^#endif$", "", text, flags=re.S | re.M)
    return Header(re.sub(r"^#.*$", "", text.replace("EFSI_API", ""), flags=re.M))
