"""Reasons of other programs' parsers, reworded for users: no function names, no path that the message has already."""

from __future__ import annotations

import re
from pathlib import Path

from pxr import Tf

from .errors import LibraryError

NO_VOLUME = "it encloses no volume"
_LONGEST = 200  # characters; parsers quote whole files
# What assimp says, and the library -> what it means.
_MESH_REASONS = (
    (r"No suitable reader found.*", "it is damaged, or of another format"),
    (r"Validation failed: aiScene::mNumMeshes is 0.*", "it contains no mesh"),
    (r"Validation failed: Mesh\s.*contains no faces", "it contains no faces"),
    (r"Failed to determine STL storage representation.*", "it is not an STL file"),
    (r'Cannot parse string ".*', "a number cannot be read"),
    (r"Validation failed: aiMesh::.*", "its faces or points are damaged"),
    (r"Validation failed: ", ""),
    (r"file: GLTF: could not open referenced file (.+)", r"file: it refers to \1, which cannot be opened"),
    (r"file: (?:FBX|Collada|STL|OBJ|PLY|GLTF|3DS|OFF)(?:-\w+)?:? (?:\(.*?\) )?(?=\S)", "file: it is damaged: "),
    # The library's own: the grid of distances is finer than the voxel size that a user sets.
    (
        r"mesh: encloses no node .*, thinnest feature about (\S+) m.*",
        r"it is too thin for this voxel size: nowhere thicker than a cell, thinnest feature about \1 m",
    ),
    (r"mesh: encloses no node .*: it must bound a volume", f"{NO_VOLUME}; give it a thickness"),
    (r"EfsiSolidDef\.mesh: encloses no volume", f"{NO_VOLUME}; give it a thickness"),
    (r"EfsiSolidDef\.mesh: no cell of size \S+ m lies", "it is too thin for this voxel size: no cell lies"),
)


def mesh_reason(file: str | Path, error: LibraryError) -> str:
    """Why a mesh cannot be used, for a message that names the file already; file "": the points of a prim."""
    text = one_line(str(error)).removeprefix(f"{file}: ")
    for pattern, words in _MESH_REASONS:
        text = re.sub(pattern, words, text)
    text = text.replace(str(file), Path(file).name) if str(file) else text
    return text if len(text) <= _LONGEST else text[:_LONGEST].rsplit(" ", 1)[0] + " ..."


def usd_reason(error: Tf.ErrorException | UnicodeDecodeError) -> str:
    """Why USD could not read a file, without its own function names and without the path of the file."""
    try:
        text = error.args[0].commentary if isinstance(error, Tf.ErrorException) and error.args else ""
    except UnicodeDecodeError:
        text = ""
    return plain_reason(text) or "it contains bytes that are not text"


def plain_reason(text: str) -> str:
    """A reason of USD's parser or file formats, reworded: "line 46: Expected } at '...' in </World>"."""
    text = one_line(text)
    place = re.match(r"(?:[^@<>]*?):(\d+):(\d+): (.*)", text)
    reason = place.group(3) if place else text
    reason = re.sub(r"parse error matching \S+::(\w+)", r"a syntax error (\1)", reason)
    reason = re.sub(r"^(?:Failed to open layer @.*@|<.*> is not a valid \w+ layer)$", "it is not a USD layer", reason)
    reason = re.sub(r"^Cannot open (\S+) in \S+: ", r"\1: ", reason)
    reason = re.sub(r"^Sdf crate bootstrap section corrupt$", "the start of the file is damaged", reason)
    reason = re.sub(r" at ''(?= in <|$)", " at the end of the line", reason)
    return f"line {place.group(1)}: {reason}" if place else reason


def one_line(text: str) -> str:
    """The text with single spaces for every run of white space."""
    return " ".join(text.split())
