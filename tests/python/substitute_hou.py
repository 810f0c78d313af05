"""A substitute for Houdini's module `hou`: as much of it as the asset uses.

Every class and function is that of the stubs (types-houdini): a test compares names and arguments, and each call
compares the kind of its result with what the stub says, so that an iterator there has no length here.
"""

from __future__ import annotations

import ast
import functools
import inspect
import sys
import types
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np


@functools.cache
def stubs() -> ast.Module:
    places = (Path(place) / "hou-stubs" / "__init__.pyi" for place in sys.path)
    return ast.parse(next(place for place in places if place.is_file()).read_text(encoding="utf-8"))


@functools.cache
def stub_class(name: str) -> ast.ClassDef | None:
    return next((node for node in stubs().body if isinstance(node, ast.ClassDef) and node.name == name), None)


@functools.cache
def stub_of(name: str) -> ast.FunctionDef | None:
    """A function ("fps") or a method ("SopNode.input"), of the class or of those it is derived from."""
    owner, _, method = name.rpartition(".")
    found = stub_class(owner) if owner else stubs()
    for node in found.body if found else ():
        if isinstance(node, ast.FunctionDef) and node.name == method:
            return node
    bases = found.bases if isinstance(found, ast.ClassDef) else ()
    return next((stub for base in bases if (stub := stub_of(f"{ast.unparse(base)}.{method}"))), None)


def fits(value: Any, kind: str) -> bool:
    """Whether a value is of the kind that an annotation of the stubs names."""
    node = ast.parse(kind, mode="eval").body
    if isinstance(node, ast.BinOp):
        return fits(value, ast.unparse(node.left)) or fits(value, ast.unparse(node.right))
    if isinstance(node, ast.Subscript):
        outer, inner = ast.unparse(node.value), ast.unparse(node.slice)
        if outer == "Optional":
            return value is None or fits(value, inner)
        if outer == "Iterator":
            return isinstance(value, Iterator) and not isinstance(value, Sequence)
        return outer in ("Tuple", "tuple") and type(value) is tuple
    if kind in ("float", "int", "str", "bool", "None"):
        return value is None if kind == "None" else type(value).__name__ == kind
    return kind in ("Self", "EnumValue") or kind in [cls.__name__ for cls in type(value).__mro__]


def checked(name: str, function: Callable) -> Callable:
    """The function; a result of another kind than that of the stub is a TypeError."""

    @functools.wraps(function)
    def call(*arguments: Any, **words: Any) -> Any:
        result, stub = function(*arguments, **words), stub_of(name)
        if stub is None or stub.returns is None or not fits(result, ast.unparse(stub.returns)):
            says = ast.unparse(stub.returns) if stub and stub.returns else "nothing"
            raise TypeError(f"hou.{name} returned {type(result).__name__}, the stub says {says}")
        return result

    return call


class Double:
    """Base of all classes: their public methods are checked."""

    def __init_subclass__(cls) -> None:
        for name, member in list(vars(cls).items()):
            if not name.startswith("_") and inspect.isfunction(member):
                setattr(cls, name, checked(f"{cls.__name__}.{name}", member))
            elif isinstance(member, staticmethod):
                setattr(cls, name, staticmethod(checked(f"{cls.__name__}.{name}", member.__func__)))


class ParmTuple(Double):
    """Values, or one of them by frame where they are animated."""

    def __init__(self, values: Sequence[Any]) -> None:
        self._values, self._keys = tuple(values), {}

    def eval(self) -> tuple:
        return self._values

    def evalAtFrame(self, frame: float) -> tuple:  # noqa: N802
        return self._keys.get(frame, self._values)

    def isTimeDependent(self) -> bool:  # noqa: N802
        return bool(self._keys)

    def set(self, value: Sequence[Any]) -> None:
        assert len(value) == len(self._values)
        self._values = tuple(type(old)(new) for old, new in zip(self._values, value, strict=True))


class Matrix4(Double):
    def __init__(self, rows: np.ndarray) -> None:
        self._rows = rows

    def asTuple(self) -> tuple:  # noqa: N802
        return tuple(self._rows.ravel().tolist())


class Point(Double):
    def __init__(self, number: int) -> None:
        self._number = number

    def number(self) -> int:
        return self._number


class Vertex(Double):
    def __init__(self, number: int) -> None:
        self._number = number

    def point(self) -> Point:
        return Point(self._number)


class Prim(Double):
    def __init__(self, number: int, points: Sequence[int], closed: bool = True) -> None:
        self._number, self._points, self._closed = number, points, closed

    def number(self) -> int:
        return self._number

    def vertices(self) -> Iterator[Vertex]:
        return (Vertex(number) for number in self._points)


class Face(Prim):
    def isClosed(self) -> bool:  # noqa: N802
        return self._closed


class Polygon(Face):
    pass


class Attrib(Double):
    pass


class PointGroup(Double):
    def __init__(self, numbers: Sequence[int]) -> None:
        self._numbers = numbers

    def points(self) -> tuple:
        return tuple(Point(number) for number in self._numbers)


class Geometry(Double):
    """names, solids: primitive attributes; groups: of points."""

    def __init__(self, points: Any, prims: Sequence[Prim], groups: dict[str, Sequence[int]], **attributes: Any) -> None:
        self._points, self._prims, self._groups = points, prims, groups
        self._attributes = {name: values for name, values in attributes.items() if values}

    def prims(self) -> tuple:
        return tuple(self._prims)

    def pointFloatAttribValues(self, name: str) -> tuple:  # noqa: N802
        assert name == "P"
        return tuple(np.asarray(self._points, float).ravel().tolist())

    def findPrimAttrib(self, name: str) -> Attrib | None:  # noqa: N802
        return Attrib() if name in self._attributes else None

    def primStringAttribValues(self, name: str) -> tuple:  # noqa: N802
        return tuple(self._attributes[name])

    def findPointGroup(self, name: str) -> PointGroup | None:  # noqa: N802
        return PointGroup(self._groups[name]) if name in self._groups else None


class Node(Double):
    """nodes: by the paths that node() finds."""

    def __init__(self, path: str, parent: Node | None = None) -> None:
        self._path, self._parent, self._parms, self._nodes, self._made = path, parent, {}, {}, []

    def path(self) -> str:
        return self._path

    def name(self) -> str:
        return self._path.rsplit("/", 1)[-1]

    def parent(self) -> Node | None:
        return self._parent


class OpNode(Node):
    def node(self, node_path: str) -> Node | None:
        return self._nodes.get(node_path)

    def parmTuple(self, parm_path: str) -> ParmTuple | None:  # noqa: N802
        return self._parms.get(parm_path)

    def createNode(self, node_type_name: str, node_name: str | None = None) -> OpNode:  # noqa: N802
        made = OpNode(f"{self._path}/{node_name}", self)
        made._type = node_type_name
        self._made.append(made)
        return made


class ObjNode(OpNode):
    """shift: its place by seconds."""

    def __init__(self, path: str, shift: Callable[[float], Sequence[float]] = lambda time: (0.0, 0.0, 0.0)) -> None:
        super().__init__(path)
        self._shift = shift

    def worldTransformAtTime(self, time: float) -> Matrix4:  # noqa: N802
        rows = np.eye(4)
        rows[3, :3] = self._shift(time)
        return Matrix4(rows)


class SopNode(OpNode):
    """shape: its geometry by frame."""

    def __init__(self, path: str, parent: Node, shape: Callable[[float], Geometry] | None = None) -> None:
        super().__init__(path, parent)
        self._shape, self._inputs = shape, {}

    def input(self, input_index: int) -> Node | None:
        return self._inputs.get(input_index)

    def geometryAtFrame(self, frame: float) -> Geometry | None:  # noqa: N802
        return self._shape(frame) if self._shape else None

    def inputGeometryAtFrame(self, frame: float, index: int) -> Geometry | None:  # noqa: N802
        return self._inputs[index].geometryAtFrame(frame) if index in self._inputs else None


class InterruptableOperation(Double):
    """stop_at: the fraction at which the user presses Escape."""

    _stop_at, _seen = 2.0, []

    def __init__(self, operation_name: str, open_interrupt_dialog: bool = False) -> None:
        type(self)._seen = []

    def __enter__(self) -> InterruptableOperation:
        return self

    def __exit__(self, type: Any, value: Any, traceback: Any) -> None:  # noqa: A002
        pass

    def updateProgress(self, percentage: float = -1.0) -> None:  # noqa: N802
        self._seen.append(percentage)
        if percentage >= self._stop_at:
            raise OperationInterrupted


class severityType:  # noqa: N801
    Error, Message = "Error", "Message"


class ui(Double):  # noqa: N801
    """shown: what the user has seen."""

    _shown: list[str] = []
    _loop: list[Callable[[], None]] = []

    @staticmethod
    def displayMessage(text: str, severity: Any = None, title: str | None = None) -> int:  # noqa: N802
        ui._shown.append(text)
        return 0

    @staticmethod
    def setStatusMessage(message: str, severity: Any = None) -> None:  # noqa: N802
        ui._shown.append(message)

    @staticmethod
    def addEventLoopCallback(callback: Callable[[], None]) -> None:  # noqa: N802
        ui._loop.append(callback)

    @staticmethod
    def removeEventLoopCallback(callback: Callable[[], None]) -> None:  # noqa: N802
        ui._loop.remove(callback)


class Error(Exception):
    pass


class NodeError(Error):
    pass


class OperationInterrupted(Error):
    pass


FUNCTIONS: dict[str, Callable] = {
    "fps": lambda: 24.0,
    "frameToTime": lambda frame: (frame - 1) / 24.0,
    "isUIAvailable": lambda: False,
    "node": lambda path: None,
}
CLASSES = [
    cls
    for cls in list(globals().values())
    if isinstance(cls, type) and cls.__module__ == __name__ and cls is not Double
]


def module() -> types.ModuleType:
    """A new `hou`, without a user interface."""
    hou = types.ModuleType("hou")
    for name, function in FUNCTIONS.items():
        setattr(hou, name, checked(name, function))
    for cls in CLASSES:
        setattr(hou, cls.__name__, cls)
    ui._shown, ui._loop, InterruptableOperation._stop_at = [], [], 2.0
    return hou
