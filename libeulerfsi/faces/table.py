"""Reads and validates the parameter table parameters.toml; the generator and tests use it."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

from .headers import Header, read_headers

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "libeulerfsi" / "parameters.toml"

SCOPES = ("domain", "solid", "emitter", "force", "collider")
STRUCTS = {
    "domain": "EfsiSimulationDef",
    "solid": "EfsiSolidDef",
    "emitter": "EfsiEmitterDef",
    "force": "EfsiForceDef",
    "collider": "EfsiSolidDef",
}
C_TYPES = {"double": "double", "int": "int32_t", "bool": "int32_t", "token": "int32_t", "vector": "EfsiVec3"}
TYPES = {*C_TYPES, "asset"}
REQUIRED_KEYS = {"name", "field", "symbol", "type", "default", "another", "doc"}
KNOWN_KEYS = REQUIRED_KEYS | {
    "tokens",
    "hard",
    "soft",
    "least",
    "names",
    "min_exclusive",
    "unit",
    "stage_unit",
    "usd_physics",
    "animated",
    "initial",
    "member",
    "advanced",
    "rebake",
}

Parameter = dict
Table = dict[str, dict]


class TableError(ValueError):
    """An entry of the table breaks a rule; the message names scope, parameter, key and value."""


def load_table(path: Path = TABLE) -> Table:
    """Reads and validates the table; {prims} and {SCOPE} in its docs are replaced by prim types.

    Returns {scope: {"prims": [str], "doc": str, "parameter": [Parameter], "relationship": [{"name", "doc"}]}}.

    Raises TableError when an entry breaks a rule.
    """
    with open(path, "rb") as stream:
        table = tomllib.load(stream)
    if tuple(table) != SCOPES:
        raise TableError(f"{path.name}: sections are {list(table)}, must be {list(SCOPES)}")
    header = read_headers()
    for scope in SCOPES:
        section = table[scope]
        if not section.get("prims") or not section.get("doc"):
            raise TableError(f"[{scope}]: needs prims and doc")
        members = struct_members(header, STRUCTS[scope])
        names: set[str] = set()
        fields: set[str] = set()
        for parameter in section["parameter"]:
            where = f"[{scope}] {parameter.get('name', '?')}"
            check_parameter(where, parameter)
            check_field(where, parameter, STRUCTS[scope], members)
            for key, seen in (("name", names), ("field", fields)):
                if parameter[key] and parameter[key] in seen:
                    raise TableError(f"{where}: {key} = {parameter[key]!r} occurs twice")
                seen.add(parameter[key])
        for relationship in section.setdefault("relationship", []):
            where = f"[{scope}] {relationship.get('name', '?')}"
            if set(relationship) != {"name", "doc"}:
                raise TableError(f"{where}: keys are {sorted(relationship)}, must be ['doc', 'name']")
            check_name_and_doc(where, relationship)
            if relationship["name"] in names:
                raise TableError(f"{where}: name = {relationship['name']!r} occurs twice")
            names.add(relationship["name"])
    for scope in SCOPES:
        for entry in (table[scope], *table[scope]["parameter"], *table[scope]["relationship"]):
            entry["doc"] = with_prims(entry["doc"], scope, table)
    return table


def with_prims(doc: str, scope: str, table: Table) -> str:
    """The text with prim types in the place of {prims}, those of its own scope, and of {SCOPE}."""

    def types(match: re.Match[str]) -> str:
        name = scope if match[1] == "prims" else match[1]
        if name not in table:
            raise TableError(f"[{scope}]: {match[0]}: must be {{prims}} or one of {list(SCOPES)}")
        *first, last = table[name]["prims"]
        return f"{', '.join(first)} or {last}"

    return re.sub(r"{(\w+)}", types, doc)


def check_parameter(where: str, parameter: Parameter) -> None:
    """Checks keys, type, default, limits and units of one parameter."""
    keys = set(parameter)
    if missing := REQUIRED_KEYS - keys:
        raise TableError(f"{where}: missing keys {sorted(missing)}")
    if unknown := keys - KNOWN_KEYS:
        raise TableError(f"{where}: unknown keys {sorted(unknown)}")
    kind, default = parameter["type"], parameter["default"]
    check_name_and_doc(where, parameter)
    if kind not in TYPES:
        raise TableError(f"{where}: type = {kind!r}, must be one of {sorted(TYPES)}")
    if (kind == "token") != ("tokens" in keys):
        raise TableError(f"{where}: tokens belong to type token, and to it only")

    accepted = {"double": float, "int": int, "bool": bool, "vector": list}.get(kind, str)
    if type(default) is not accepted or (kind == "vector" and [type(x) for x in default] != [float] * 3):
        raise TableError(f"{where}: default = {default!r} is not of type {kind}")
    if kind == "token" and default not in parameter["tokens"]:
        raise TableError(f"{where}: default = {default!r} is not one of {parameter['tokens']}")
    if kind in ("double", "int", "vector"):
        check_limits(where, parameter)
        check_names(where, parameter)
    elif keys & {"hard", "least", "soft", "unit", "stage_unit", "min_exclusive", "names"}:
        raise TableError(f"{where}: limits and units belong to numbers")


def check_name_and_doc(where: str, entry: Parameter) -> None:
    """What parameters and relationships have in common."""
    if not re.fullmatch(r"[a-z][A-Za-z0-9]*", entry["name"]):
        raise TableError(f"{where}: name must be camelCase")
    if not entry["doc"].endswith("."):
        raise TableError(f"{where}: doc must be a sentence that ends in a full stop")


def check_limits(where: str, parameter: Parameter) -> None:
    """The default lies inside the limits, sliders are finite, and limits hold in every stage unit."""
    if missing := {"hard", "soft", "unit", "stage_unit"} - set(parameter):
        raise TableError(f"{where}: missing keys {sorted(missing)}")
    (low, high), (soft_low, soft_high) = parameter["hard"], parameter["soft"]
    values = parameter["default"] if parameter["type"] == "vector" else [parameter["default"]]
    if not low < high or not soft_low < soft_high:
        raise TableError(f"{where}: a lower limit is not below its upper limit")
    if not (math.isfinite(soft_low) and math.isfinite(soft_high) and low <= soft_low and soft_high <= high):
        raise TableError(f"{where}: soft = {parameter['soft']} must be finite and within hard = {parameter['hard']}")
    for value in values:
        if not low <= value <= high or (parameter.get("min_exclusive") and value == low):
            raise TableError(f"{where}: default = {parameter['default']} is outside hard = {parameter['hard']}")
    if (least := parameter.get("least")) and not (low == 0.0 < least < high and set(values) == {0.0}):
        raise TableError(f"{where}: least = {least} must be within limits that begin at 0, which is the default")
    stage_unit = parameter["stage_unit"]
    if stage_unit and any(limit != 0 and math.isfinite(limit) for limit in (low, high)):
        raise TableError(f"{where}: a finite hard limit other than 0 needs stage_unit = ''")
    if stage_unit not in ("", "local", "degrees") and unit_powers(parameter["unit"]) != stage_powers(stage_unit):
        raise TableError(f"{where}: unit = {parameter['unit']!r} and stage_unit = {stage_unit!r} do not agree")


def check_names(where: str, parameter: Parameter) -> None:
    """Values that have a name lie within the limits."""
    low, high = parameter["hard"]
    for name, value in parameter.get("names", {}).items():
        if type(value) is not float or not max(low, parameter.get("least", low)) <= value <= high:
            raise TableError(f"{where}: names: {name} = {value} must be a number within the limits")


def unit_powers(unit: str) -> dict[str, int]:
    """Powers of m and kg in a unit such as "kg/m^3": {"kg": 1, "m": -3}."""
    powers: dict[str, int] = {}
    for position, factor in enumerate(unit.split("/")):
        base, _, exponent = factor.partition("^")
        if base in ("m", "kg"):
            powers[base] = int(exponent or 1) * (1 if position == 0 else -1)
    return powers


def stage_powers(stage_unit: str) -> dict[str, int]:
    """Powers in a stage unit such as "kg^1 m^-3"."""
    return {base: int(exponent) for base, exponent in (factor.split("^") for factor in stage_unit.split())}


def struct_members(header: Header, struct: str) -> dict[str, str]:
    """C type of every member of a definition struct, arrays as one entry per element ("wall[0]")."""
    if struct not in header.structs:
        raise TableError(f"no struct {struct} in the headers")
    members: dict[str, str] = {}
    for member in header.structs[struct]:
        names = [f"{member.name}[{i}]" for i in range(member.count)] if member.count else [member.name]
        members |= dict.fromkeys(names, member.base)
    return members


def check_field(where: str, parameter: Parameter, struct: str, members: dict[str, str]) -> None:
    """The C field exists and has the type of the parameter."""
    field, expected = parameter["field"], C_TYPES.get(parameter["type"])
    if field and members.get(field) != expected:
        raise TableError(f"{where}: {struct}.{field} is {members.get(field, 'missing')}, must be {expected}")
