"""The HTML page: facts and blobs in a template with the script, whose policy allows no request."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from pathlib import Path
from typing import Any

from .packing import Blobs

_FOLDER = Path(__file__).parent


def _part(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def frame_size() -> int:
    """Bytes of a page without facts and blobs."""
    return sum(len(_part(name).encode()) for name in ("page.html", "page.css", "page.js", "three-LICENSE.txt"))


def write_page(title: str, subtitle: str, facts: dict[str, Any], blobs: Blobs) -> str:
    """The text of the page. Names in it are data or escaped: none becomes markup."""
    style, script = _part("page.css"), _part("page.js").strip()
    policy = f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; img-src data: blob:"
    texts = "\n".join(
        f'<script type="text/plain" id="b{number}">{text}</script>' for number, text in enumerate(blobs.texts)
    )
    values = {
        "POLICY": policy,
        "TITLE": html.escape(title),
        "SUBTITLE": html.escape(subtitle),
        "STYLE": style,
        "FACTS": json.dumps(facts, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "BLOBS": texts,
        "SCRIPT": script,
        "LICENSE": _part("three-LICENSE.txt").strip(),
    }
    pieces = _part("page.html").split("@")  # names and what is between them; no value is looked at again
    return "".join(values[piece] if number % 2 else piece for number, piece in enumerate(pieces))
