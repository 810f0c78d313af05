"""Values of parameters of a node, with their types."""

from __future__ import annotations

from collections.abc import Sequence

import hou


def _tuple(node: hou.OpNode, name: str) -> hou.ParmTuple:
    found = node.parmTuple(name)
    if found is None:
        raise KeyError(f"{node.path()} has no parameter {name}")
    return found


def _eval(node: hou.OpNode, name: str, frame: float | None) -> Sequence[int | float | str]:
    found = _tuple(node, name)
    values = found.eval() if frame is None else found.evalAtFrame(frame)
    if not isinstance(values, tuple):
        raise TypeError(f"{node.path()}.{name} is a ramp")
    return values


def number(node: hou.OpNode, name: str, frame: float | None = None) -> float:
    return float(_eval(node, name, frame)[0])


def whole(node: hou.OpNode, name: str) -> int:
    return int(_eval(node, name, None)[0])


def flag(node: hou.OpNode, name: str, frame: float | None = None) -> bool:
    return bool(_eval(node, name, frame)[0])


def text(node: hou.OpNode, name: str) -> str:
    return str(_eval(node, name, None)[0])


def vector(node: hou.OpNode, name: str, frame: float | None = None) -> tuple[float, float, float]:
    x, y, z = _eval(node, name, frame)
    return float(x), float(y), float(z)


def is_animated(node: hou.OpNode, name: str) -> bool:
    return _tuple(node, name).isTimeDependent()


def put(node: hou.OpNode, name: str, value: float | bool | str | tuple[float, float, float]) -> None:
    if isinstance(value, str):
        _tuple(node, name).set((value,))
    elif isinstance(value, tuple):
        _tuple(node, name).set(value)
    elif isinstance(value, bool):
        _tuple(node, name).set((int(value),))
    else:
        _tuple(node, name).set((value,))


def frames(node: hou.OpNode) -> range:
    """All frames, first to last."""
    first, last = (int(value) for value in _eval(node, "framerange", None))
    return range(first, last + 1)
