"""The table of parameters as a page of the reference (docs/reference), in reStructuredText."""

from __future__ import annotations

from .table import SCOPES, STRUCTS, Parameter, Table
from .usd import schema_name
from .words import NOTE, describe_default, describe_range, describe_stage_unit

COLUMNS = ("attribute", "symbol", "type", "default", "range", "unit on a stage", "C field", "meaning")


def render(table: Table) -> str:
    """A list of the schemas, each with its table."""
    lines = [f".. {NOTE}", "", "Parameters", "==========", "", "How to read them: ``docs/parameters.md``."]
    for scope in SCOPES:
        section, name = table[scope], schema_name(scope)
        prims = " or ".join(f"``{prim}``" for prim in section["prims"])
        lines += ["", name, "-" * len(name), "", escaped(section["doc"]), ""]
        lines += [f"Applies to {prims}; C: :c:struct:`{STRUCTS[scope]}`.", ""]
        lines += [".. list-table::", "   :header-rows: 1", ""]
        rows = [COLUMNS, *map(cells, section["parameter"])]
        for row in section["relationship"]:
            rows.append((f"``eulerfsi:{row['name']}``", "", "relationship", "", "", "", "", escaped(row["doc"])))
        for row in rows:
            lines += [f"   {'* -' if i == 0 else '  -'} {cell}".rstrip() for i, cell in enumerate(row)]
    return "\n".join(lines) + "\n"


def cells(parameter: Parameter) -> tuple[str, ...]:
    prefix = "physics" if parameter.get("usd_physics") else "eulerfsi"
    return (
        f"``{prefix}:{parameter['name']}``",
        escaped(parameter["symbol"]),
        parameter["type"],
        describe_default(parameter),
        describe_range(parameter).replace(" | ", ", "),
        describe_stage_unit(parameter),
        f"``{parameter['field']}``" if parameter["field"] else "",
        escaped(parameter["doc"]),
    )


def escaped(text: str) -> str:
    """Characters that mark up text stand for themselves."""
    for mark in ("\\", "*", "`", "|", "_"):
        text = text.replace(mark, f"\\{mark}")
    return text
