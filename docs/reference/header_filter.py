"""Prints a C header as Doxygen shall read it, on the same lines.

Names of the API in comments become links: Doxygen refuses a link to what is not declared. The object that a function
acts on becomes one of its documented parameters, and members declared together share their comment.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

OBJECTS = {"sim": "simulation", "def": "definition", "mesh": "mesh", "surface": "surface"}
COMMENT = re.compile(r"/\*\*.*?\*/", re.S)
NAME = re.compile(r"(?<!@retval )\b(?:efsi_|EFSI_|Efsi)\w*\w\b(?!\*)")
FUNCTION = re.compile(r"(/\*\*(?:(?!\*/).)*?)(\s*\*/\nEFSI_API\b[^;(]*\([^;,)]*?(\w+)[,)])", re.S)
MEMBERS = re.compile(r"^( +\w+) (\w+(?:, \w+)+); +(/\*\*<.*\*/)$", re.M)


def with_object(function: re.Match[str]) -> str:
    comment, declaration, name = function.groups()
    if name not in OBJECTS or re.search(rf"@param\S* {name}\b", comment):
        return function[0]
    above, commands, below = comment.partition("\n * @")
    return f"{above} @param {name} the {OBJECTS[name]}{commands}{below}{declaration}"


def one_by_one(members: re.Match[str]) -> str:
    kind, names, comment = members.groups()
    return " ".join(f"{kind} {name}; {comment}" for name in names.split(", "))


if __name__ == "__main__":
    text = MEMBERS.sub(one_by_one, FUNCTION.sub(with_object, Path(sys.argv[1]).read_text()))
    sys.stdout.write(COMMENT.sub(lambda comment: NAME.sub(r"#\g<0>", comment[0]), text))
