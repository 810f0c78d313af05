"""Dialog and help of the Houdini asset."""

from __future__ import annotations

import json
import math
import re

from .table import ROOT, Parameter, Table, TableError
from .words import NOTE, describe_range, number, title

DIALOG_TEMPLATE = ROOT / "houdini_hda" / "DialogScript.template"
HELP_TEMPLATE = ROOT / "houdini_hda" / "Help.template"
PRESETS = ROOT / "usd_plugin" / "eulerfsi_usd" / "presets.json"
CUSTOM = "custom"  # of a menu that stands above a number: the number counts
DIALOG_TYPES = {"double": "float", "bool": "toggle", "token": "string", "asset": "file"}


def render_dialog(table: Table) -> str:
    """DialogScript of the Houdini asset: the template with each line "@rows SCOPE PREFIX@" replaced by parameters and
    the materials put into their menu."""

    def rows(match: re.Match[str]) -> str:
        indent, scope, prefix = match.groups()
        blocks = []
        for parameter in table[scope]["parameter"]:
            blocks += [dialog_names(prefix or "", parameter)] if "names" in parameter else []
            blocks += [dialog_parameter(scope, prefix or "", parameter)]
        return "\n".join(indent + line if line else "" for block in blocks for line in block)

    presets = json.loads(PRESETS.read_text(encoding="utf-8"))["presets"]
    menu = f"\n{' ' * 20}".join(f'"{name}" "{preset["label"]}"' for name, preset in presets.items())
    behaves = " ".join(f"{preset['label']}: {preset['behaves']}." for preset in presets.values())
    template = DIALOG_TEMPLATE.read_text(encoding="utf-8").replace("@note@", NOTE)
    template = template.replace("@presets@", menu).replace("@behaves@", behaves)
    return re.sub(r"^( *)@rows (\w+) ?([\w#]*)@$", rows, template, flags=re.MULTILINE)


CARD = re.compile(
    r' *(group|multiparm|parm) {\n *name +"(.*)"\n *label +"(.*)"\n(?:(?! *(?:group|multiparm|parm) {).*\n)*'
)


def render_help(table: Table) -> str:
    """Help of the Houdini asset: the template with "@cards@" replaced by a card for every parameter of the dialog."""
    cards = []
    for match in CARD.finditer(render_dialog(table)):
        kind, name, label = match.groups()
        if kind == "group":
            cards.append(f"== {label} ==\n")
        elif kind == "parm":
            text = json.loads(re.search(r'^ *help +(".*")$', match[0], re.MULTILINE)[1])
            cards.append(f"{label}:\n    #id: {name}\n\n    {text}\n")
    return HELP_TEMPLATE.read_text(encoding="utf-8").replace("@cards@\n", "\n".join(cards))


def names_of(name: str) -> str:
    """Name of the menu that stands above a number (eulerfsi_houdini.scene)."""
    return f"{name}Name"


def dialog_names(prefix: str, parameter: Parameter) -> list[str]:
    """Lines of the menu of a number whose values have names."""
    name, label, names = prefix + parameter["name"], title(parameter["name"]), parameter["names"]
    told = ", ".join(f"{title(word)} ({number(value)})" for word, value in names.items())
    return [
        "parm {",
        f'    name    "{names_of(name)}"',
        f'    label   "{label} by Name"',
        "    type    string",
        f'    default {{ "{CUSTOM}" }}',
        "    menu    {",
        f'        "{CUSTOM}" "Custom"',
        *(f'        "{word}" "{title(word)}"' for word in names),
        "    }",
        f"    help    {json.dumps(f'{told}, or, with Custom, the number of {label}.')}",
        "}",
    ]


def dialog_parameter(scope: str, prefix: str, parameter: Parameter) -> list[str]:
    """Lines of one parm block. A finite hard limit locks its end of the slider ("!")."""
    kind, default = parameter["type"], parameter["default"]
    if kind == "int":
        raise TableError(f"[{scope}] {parameter['name']}: the dialog has no integer rows")
    values = default if kind == "vector" else [default]
    texts = [str(int(x)) if isinstance(x, bool) else number(x) if isinstance(x, float) else x for x in values]
    lines = [
        f'name    "{prefix}{parameter["name"]}"',
        f'label   "{title(parameter["name"])}"',
        "type    vector" if kind == "vector" else f"type    {DIALOG_TYPES[kind]}",
        *(["size    3"] if kind == "vector" else []),
        f"default {{ {' '.join(json.dumps(text) for text in texts)} }}",
    ]
    if "names" in parameter:
        lines.append(f'disablewhen "{{ {names_of(prefix + parameter["name"])} != {CUSTOM} }}"')
    if "hard" in parameter:
        ends = zip(parameter["hard"], parameter["soft"], strict=True)
        lines.append(
            "range   { " + " ".join(f"{number(h)}!" if math.isfinite(h) else number(s) for h, s in ends) + " }"
        )
    if "tokens" in parameter:
        lines += ["menu    {", *(f'    "{token}" "{title(token)}"' for token in parameter["tokens"]), "}"]
    unit = "degrees/s" if parameter.get("stage_unit") == "degrees" else parameter.get("unit", "")
    limits = f" Range: {describe_range(parameter)}." if "hard" in parameter else ""
    lines.append(f"help    {json.dumps(parameter['doc'] + limits + (f' Unit: {unit}.' if unit else ''))}")
    lines.append(f'parmtag {{ "eulerfsi" "{scope}.{parameter["name"]}" }}')
    return ["parm {", *(f"    {line}" for line in lines), "}"]
