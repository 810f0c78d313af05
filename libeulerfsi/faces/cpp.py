"""The faces in C++, X-macros: the parameter table for frame/, the members of the C structs for capi/."""

from __future__ import annotations

import math
import re

from .binding import NOTE as NOTE_OF_HEADERS
from .headers import Header
from .table import SCOPES, STRUCTS, Parameter, Table
from .words import NOTE

KINDS = {"double": "DOUBLE", "int": "INT", "bool": "BOOL", "token": "TOKEN", "vector": "VECTOR"}


def render_parameters(table: Table) -> str:
    """X-macro rows for libeulerfsi/src/sim/params."""
    lines = [
        "// Purpose: the parameter table as X-macros.",
        f"// {NOTE}",
        "//",
        "// X(name, field, kind, default, hard_min, hard_max, min_exclusive, least, unit)",
        "//   name    string, as USD shows it             field   member of the C definition struct",
        "//   kind    DOUBLE | BOOL | TOKEN | VECTOR       default BOOL: 0 or 1; TOKEN: index; VECTOR: EfsiVec3",
        "//   limits  double, EFSI_INF where there is none; they hold for each component of a VECTOR",
        "//   min_exclusive  1: hard_min itself is not allowed",
        "//   least   the least value other than 0; 0: hard_min is it",
        "// and Y(field, member): member of the C++ struct that has the field's value",
        "// clang-format off",
        "#pragma once",
        "",
        "#include <limits>",
        "",
        "#ifndef EFSI_INF",
        "#define EFSI_INF (std::numeric_limits<double>::infinity())",
        "#endif",
    ]
    for scope in SCOPES:
        lines += ["", f"// Fields of {STRUCTS[scope]}.", f"#define EFSI_{scope.upper()}_PARAMETERS(X) \\"]
        rows = [cpp_row(parameter) for parameter in table[scope]["parameter"] if parameter["field"]]
        lines += [f"  {row} \\" for row in rows[:-1]] + [f"  {rows[-1]}"]
        lines += [
            "",
            "// Fields that are members of the C++ struct as they are.",
            f"#define EFSI_{scope.upper()}_MEMBERS(Y) \\",
        ]
        pairs = [(p["field"], p.get("member", p["field"])) for p in table[scope]["parameter"] if p["field"]]
        rows = [f"Y({field}, {member})" for field, member in pairs if member]
        lines += [f"  {row} \\" for row in rows[:-1]] + [f"  {rows[-1]}"]
    return "\n".join(lines) + "\n"


def cpp_row(parameter: Parameter) -> str:
    def real(value: float) -> str:
        return ("-" if value < 0 else "") + "EFSI_INF" if math.isinf(value) else repr(float(value))

    kind, default = parameter["type"], parameter["default"]
    low, high = parameter.get("hard", (0.0, float(len(parameter.get("tokens", (0, 1))) - 1)))
    if kind == "token":
        text = str(parameter["tokens"].index(default))
    elif kind == "vector":
        text = f"(EfsiVec3{{{', '.join(real(x) for x in default)}}})"
    else:
        text = real(default) if kind == "double" else str(int(default))
    exclusive = int(parameter.get("min_exclusive", False))
    return (
        f'X("{parameter["name"]}", {parameter["field"]}, {KINDS[kind]}, {text}, {real(low)}, {real(high)}, '
        f'{exclusive}, {real(parameter.get("least", 0.0))}, "{parameter.get("unit", "")}")'
    )


def render_struct_fields(header: Header) -> str:
    """X-macros of the members of every struct that the library fills, and the last member of every struct."""
    lines = [
        "// Purpose: the members of the structs of the C API, as X-macros X(member).",
        f"// {NOTE_OF_HEADERS}",
        "// clang-format off",
        "#pragma once",
        "",
    ]
    lines += ['#include "eulerfsi/eulerfsi.h"', "", "namespace efsi::capi {", ""]
    lines.append("// Name of a struct, and of its last member: what a library knows of a struct that has grown since.")
    lines += ["template <class Struct>", "struct Layout;", "#define EFSI_LAYOUT(Struct, Member) \\"]
    lines += ["  template <> \\", "  struct Layout<Struct> { \\", "    static constexpr const char* name = #Struct; \\"]
    lines += ["    static constexpr const char* last = #Member; \\", "  };"]
    for name, members in header.structs.items():
        last = next(m.name for m in reversed(members) if m.name != "padding")
        lines.append(f"EFSI_LAYOUT({name}, {last})")
    lines.append("#undef EFSI_LAYOUT")
    lines += ["", "}  // namespace efsi::capi"]
    for name, members in header.structs.items():
        if name.endswith("Def"):
            continue
        macro = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name.removeprefix("Efsi")).upper()
        rows = " ".join(f"X({member.name})" for member in members if member.name != "padding")
        lines += ["", f"#define EFSI_{macro}_FIELDS(X) {rows}"]
    return "\n".join(lines) + "\n"
