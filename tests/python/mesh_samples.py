"""Small valid mesh files of every format that the program reads, and seeded mutations of them."""

from __future__ import annotations

import base64
import json
import random
import re
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from conftest import sphere

MUTATIONS = 30


def ball() -> tuple[np.ndarray, np.ndarray]:
    """A closed ball of triangles: points (26, 3) float32, corners (48, 3)."""
    points, counts, indices = sphere(1.0, 4)
    faces, start = [], 0
    for count in counts:
        faces += [[indices[start], indices[start + k], indices[start + k + 1]] for k in range(1, count - 1)]
        start += count
    return points.astype(np.float32), np.array(faces)


def _rows(values: np.ndarray, prefix: str = "") -> str:
    return "".join(prefix + " ".join(f"{v:.6g}" for v in row) + "\n" for row in values)


def obj() -> bytes:
    points, faces = ball()
    return (f"mtllib none.mtl\no ball\n{_rows(points, 'v ')}usemtl skin\n{_rows(faces + 1, 'f ')}").encode()


def off() -> bytes:
    points, faces = ball()
    return f"OFF\n{len(points)} {len(faces)} 0\n{_rows(points)}{_rows(faces, '3 ')}".encode()


def _ply_header(form: str) -> bytes:
    points, faces = ball()
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat {form} 1.0\ncomment made by a test\nelement vertex {len(points)}\n{axes}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()


def ply_text() -> bytes:
    points, faces = ball()
    return _ply_header("ascii") + f"{_rows(points)}{_rows(faces, '3 ')}".encode()


def ply_binary() -> bytes:
    points, faces = ball()
    corners = b"".join(struct.pack("<B3i", 3, *face) for face in faces.tolist())
    return _ply_header("binary_little_endian") + points.astype("<f4").tobytes() + corners


def stl_text() -> bytes:
    points, faces = ball()
    facet = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"
    return ("solid ball\n" + "".join(facet.format(_rows(points[f], "vertex ")) for f in faces) + "endsolid\n").encode()


def stl_binary() -> bytes:
    points, faces = ball()
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *points[f].ravel().tolist(), 0) for f in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + facets


def gltf_parts(uri: str | None) -> tuple[dict, bytes]:
    """A glTF 2 scene of the ball under a node moved by (10, 0, 0), and its buffer. uri None: the buffer of a .glb."""
    points, faces = ball()
    positions, corners = points.astype("<f4").tobytes(), faces.astype("<u2").tobytes()
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    buffer = {"byteLength": len(positions) + len(corners)}
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"translation": [10, 0, 0], "children": [1]}, {"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 26, "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": 3 * len(faces), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(corners)},
        ],
        "buffers": [buffer if uri is None else {**buffer, "uri": uri}],
    }
    return scene, positions + corners


def gltf() -> bytes:
    data = base64.b64encode(gltf_parts(None)[1]).decode()
    return json.dumps(gltf_parts(f"data:application/octet-stream;base64,{data}")[0], indent=1).encode()


def glb() -> bytes:
    scene, buffer = gltf_parts(None)
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def dae() -> bytes:
    points, faces = ball()
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="meter" meter="1"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="ball"><mesh>
<source id="points"><float_array id="values" count="{points.size}">
{_rows(points)}</float_array><technique_common><accessor source="#values" count="{len(points)}" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="corners"><input semantic="POSITION" source="#points"/></vertices>
<triangles count="{len(faces)}"><input semantic="VERTEX" source="#corners" offset="0"/><p>
{_rows(faces)}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene"><node id="node">
<instance_geometry url="#ball"/>
</node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
""".encode()


def max_3ds() -> bytes:
    points, faces = ball()

    def chunk(kind: int, *parts: bytes) -> bytes:
        body = b"".join(parts)
        return struct.pack("<HI", kind, 6 + len(body)) + body

    vertices = chunk(0x4110, struct.pack("<H", len(points)), points.astype("<f4").tobytes())
    corners = np.concatenate([faces, np.zeros((len(faces), 1))], axis=1).astype("<u2").tobytes()
    mesh = chunk(0x4100, vertices, chunk(0x4120, struct.pack("<H", len(faces)), corners))
    return chunk(0x4D4D, chunk(0x0002, struct.pack("<I", 3)), chunk(0x3D3D, chunk(0x4000, b"ball\0", mesh)))


def _fbx_tree() -> list:
    """Nodes (name, properties, children); a property is a number, a text or an array."""
    points, faces = ball()
    corners = faces.copy()
    corners[:, 2] = -1 - corners[:, 2]  # the last corner of a polygon is its complement
    geometry = [
        ("Vertices", [points.astype("<f8").ravel()], []),
        ("PolygonVertexIndex", [corners.astype("<i4").ravel()], []),
    ]
    objects = [
        ("Geometry", [100001, "Geometry::ball", "Mesh"], geometry),
        ("Model", [100002, "Model::ball", "Mesh"], [("Version", [232], [])]),
    ]
    links = [("C", ["OO", 100001, 100002], []), ("C", ["OO", 100002, 0], [])]
    header = ("FBXHeaderExtension", [], [("FBXHeaderVersion", [1003], []), ("FBXVersion", [7400], [])])
    return [header, ("Objects", [], objects), ("Connections", [], links)]


def fbx_text() -> bytes:
    def node(name: str, properties: list, children: list) -> str:
        words, inside = [], "".join(node(*child) for child in children)
        for value in properties:
            if isinstance(value, np.ndarray):
                words.append(f"*{len(value)}")
                inside = "a: " + ",".join(f"{v:.9g}" for v in value) + "\n"
            else:
                words.append(f'"{value}"' if isinstance(value, str) else str(value))
        return f"{name}: {', '.join(words)}" + (f" {{\n{inside}}}\n" if inside else "\n")

    return ("; FBX 7.4.0 project file\n" + "".join(node(*n) for n in _fbx_tree())).encode()


def fbx_binary() -> bytes:
    def value_bytes(value: object) -> bytes:
        if isinstance(value, str):
            kind, _, name = value.partition("::")
            text = f"{name}\0\x01{kind}".encode() if name else value.encode()
            return b"S" + struct.pack("<I", len(text)) + text
        if isinstance(value, np.ndarray):
            packed = zlib.compress(value.tobytes())
            kind = b"d" if value.dtype.kind == "f" else b"i"
            return kind + struct.pack("<III", len(value), 1, len(packed)) + packed
        return b"L" + struct.pack("<q", value) if value > 100000 or value == 0 else b"I" + struct.pack("<i", value)

    def node(offset: int, name: str, properties: list, children: list) -> bytes:
        values = b"".join(map(value_bytes, properties))
        body = struct.pack("<B", len(name)) + name.encode() + values
        for child in children:
            body += node(offset + 12 + len(body), *child)
        if children:
            body += bytes(13)
        return struct.pack("<III", offset + 12 + len(body), len(properties), len(values)) + body

    data = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400)
    for top in _fbx_tree():
        data += node(len(data), *top)
    return data + bytes(13)


# Suffix -> makers of its kinds; the first of a pair is text, the second binary.
MAKERS: dict[str, list[Callable[[], bytes]]] = {
    "obj": [obj],
    "ply": [ply_text, ply_binary],
    "stl": [stl_text, stl_binary],
    "off": [off],
    "gltf": [gltf],
    "glb": [glb],
    "fbx": [fbx_text, fbx_binary],
    "dae": [dae],
    "3ds": [max_3ds],
}


def _flip(data: bytearray, chance: random.Random) -> bytearray:
    for _ in range(chance.randint(1, 8)):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return data


def _truncate(data: bytearray, chance: random.Random) -> bytearray:
    return data[: chance.randrange(len(data))]


def _inflate(data: bytearray, chance: random.Random) -> bytearray:
    """A number becomes huge or negative: a word of digits where there is one, else four bytes."""
    numbers = [] if b"\0" in data else list(re.finditer(rb"\d+", data))
    if numbers:
        found = chance.choice(numbers[:12] if chance.random() < 0.5 else numbers)  # counts come first
        huge = chance.choice([b"2000000000", b"4294967295", b"-7", b"99999999999999999999", found.group() * 4])
        data[found.start() : found.end()] = huge
    else:
        at = chance.randrange(len(data) - 4)
        data[at : at + 4] = struct.pack("<I", chance.choice([0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0x10000000]))
    return data


def _double(data: bytearray, chance: random.Random) -> bytearray:
    lines = data.splitlines(keepends=True)
    at = chance.randrange(len(lines))
    return bytearray(b"".join([*lines[: at + 1], *[lines[at]] * chance.choice([1, 1, 1000]), *lines[at + 1 :]]))


def _delete(data: bytearray, chance: random.Random) -> bytearray:
    lines = data.splitlines(keepends=True)
    at = chance.randrange(len(lines))
    return bytearray(b"".join(lines[:at] + lines[at + chance.randint(1, 3) :]))


def write_mutations(folder: Path, suffix: str) -> list[Path]:
    """30 damaged files, the same ones every time."""
    kinds = (_flip, _truncate, _inflate, _double, _delete)
    files = []
    for number in range(MUTATIONS):
        chance = random.Random(f"{suffix} {number}")
        maker = MAKERS[suffix][number % len(MAKERS[suffix])]
        data = kinds[number // len(MAKERS[suffix]) % len(kinds)](bytearray(maker()), chance)
        files.append(folder / f"{number:02}.{suffix}")
        files[-1].write_bytes(data)
    return files
