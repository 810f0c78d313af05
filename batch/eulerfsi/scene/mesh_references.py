"""Files that a mesh file names and its reader opens: arrays of a .gltf or .glb, materials of an .obj."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

_GLB_MAGIC, _GLB_HEAD, _GLB_JSON = b"glTF", 20, 12  # bytes of both headers; where the length of the text is


def files_of_mesh(path: Path) -> Iterator[tuple[str, str]]:
    """(field, path as written) of each; nothing for what cannot be read, which its reader refuses."""
    suffix = path.suffix.lower()
    try:
        if suffix in (".gltf", ".glb"):
            yield from _gltf(path.read_bytes())
        elif suffix == ".obj":
            yield from _obj(path)
    except (OSError, ValueError, struct.error):
        return


def _obj(path: Path) -> Iterator[tuple[str, str]]:
    """A line may go on behind a backslash; a name may hold spaces, or be one of several."""
    with open(path, encoding="utf-8", errors="surrogateescape") as file:
        begun = ""
        for line in file:
            whole = begun + line.rstrip("\r\n")
            begun = whole[:-1] + " " if whole.endswith("\\") else ""
            if begun or not whole.lstrip().startswith("mtllib"):
                continue
            rest = whole.strip().removeprefix("mtllib").strip()
            yield from (("mtllib", name) for name in dict.fromkeys([rest, *rest.split()]) if name)


def _gltf(data: bytes) -> Iterator[tuple[str, str]]:
    if data.startswith(_GLB_MAGIC):
        [length] = struct.unpack_from("<I", data, _GLB_JSON)
        data = data[_GLB_HEAD : _GLB_HEAD + length]
    parsed = json.loads(data)
    for field in ("buffers", "images"):
        for number, entry in enumerate(_list(parsed, field)):
            uri = entry.get("uri") if isinstance(entry, dict) else None
            if isinstance(uri, str) and uri and not uri.startswith("data:"):
                yield f"{field}[{number}].uri", unquote(uri)


def _list(parsed: Any, field: str) -> list[Any]:
    found = parsed.get(field) if isinstance(parsed, dict) else None
    return found if isinstance(found, list) else []
