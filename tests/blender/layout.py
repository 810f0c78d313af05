# SPDX-License-Identifier: GPL-3.0-or-later
"""A layout that draws nothing: it compares every call of a panel with what Blender's UILayout takes."""

from __future__ import annotations

from typing import Any

import bpy

_RNA = bpy.types.UILayout.bl_rna
_LAYOUTS = {"row", "column", "box", "split", "column_flow", "grid_flow"}
# Written in Python on top of the RNA functions.
_KEYWORDS_OF_ALL = {"text_ctxt", "translate"}


class DrawError(AssertionError):
    """A panel calls what Blender does not have."""


class _Properties:
    """Of an operator's button: takes what the operator has."""

    def __init__(self, rna: Any) -> None:
        object.__setattr__(self, "_rna", rna)

    def __setattr__(self, name: str, value: Any) -> None:
        found = self._rna.properties.get(name)
        if found is None:
            raise DrawError(f"operator {self._rna.identifier} has no property {name}")
        if found.type == "ENUM" and value not in found.enum_items:
            raise DrawError(f"operator {self._rna.identifier}: {name} = {value!r}")


class Layout:
    """calls: (function, arguments) of this layout and those in it; texts: of labels and bars; greyed: calls in layouts
    that are not enabled."""

    def __init__(self, parent: Layout | None = None) -> None:
        object.__setattr__(self, "calls", parent.calls if parent else [])
        object.__setattr__(self, "greyed", parent.greyed if parent else [])
        object.__setattr__(self, "is_on", parent is None or parent.is_on)

    @property
    def texts(self) -> str:
        return " ".join(str(a.get("text", "")) for _, a in self.calls)

    @property
    def operators(self) -> list[str]:
        return [a["operator"] for name, a in self.calls if name == "operator"]

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in _RNA.properties or _RNA.properties[name].is_readonly:
            raise DrawError(f"layout.{name} cannot be set")
        if name == "enabled":
            object.__setattr__(self, "is_on", self.is_on and value)

    def __getattr__(self, name: str) -> Any:
        function = _RNA.functions.get(name)
        if function is None:
            raise DrawError(f"layout.{name} does not exist")
        given = [p for p in function.parameters if not p.is_output]

        def call(*positional: Any, **named: Any) -> Any:
            arguments = dict(zip([p.identifier for p in given], positional, strict=False))
            arguments |= named
            self._check(name, {p.identifier: p for p in given}, arguments)
            self.calls.append((name, arguments))
            if not self.is_on:
                self.greyed.append((name, arguments))
            if name in _LAYOUTS:
                return Layout(self)
            return _Properties(_operator(arguments["operator"])) if name == "operator" else None

        return call

    def _check(self, name: str, given: dict[str, Any], arguments: dict[str, Any]) -> None:
        for key, value in arguments.items():
            if key not in given and key not in _KEYWORDS_OF_ALL:
                raise DrawError(f"layout.{name} has no argument {key}")
            if key == "icon" and value not in given[key].enum_items:
                raise DrawError(f"layout.{name}: no icon {value}")
            if key in ("text", "operator", "property") and not isinstance(value, str):
                raise DrawError(f"layout.{name}: {key} = {value!r}")
        missing = [key for key, p in given.items() if p.is_required and key not in arguments]
        if missing:
            raise DrawError(f"layout.{name} needs {missing}")
        if name in ("prop", "prop_search"):
            data, field = arguments["data"], arguments["property"]
            if field not in data.bl_rna.properties:
                raise DrawError(f"{data.bl_rna.identifier} has no property {field}")
        if name == "prop_search":
            data, field = arguments["search_data"], arguments["search_property"]
            if field not in data.bl_rna.properties:
                raise DrawError(f"{data.bl_rna.identifier} has no property {field}")
        if name == "progress" and not 0.0 <= arguments["factor"] <= 1.0:
            raise DrawError(f"layout.progress: factor {arguments['factor']}")


def _operator(name: str) -> Any:
    module, _, function = name.partition(".")
    try:
        return getattr(getattr(bpy.ops, module), function).get_rna_type()
    except KeyError as error:
        raise DrawError(f"there is no operator {name}") from error
