"""The HTML page: facts and blobs in a template with the script, whose policy allows no request."""

from __future__ import annotations

import base64
import dataclasses
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
    return _filled("page.html", values)


def _filled(name: str, values: dict[str, str]) -> str:
    pieces = _part(name).split("@")  # names and what is between them; no value is looked at again
    return "".join(values[piece] if number % 2 else piece for number, piece in enumerate(pieces))


@dataclasses.dataclass
class Beside:
    """One of the pages that stand side by side. fault: why there is less of it than of others, "" for nothing;
    text: the page, "" for none; seconds: from its first frame to its last."""

    caption: str
    fault: str
    text: str
    seconds: float


def write_side_by_side(title: str, pages: list[Beside], notes: list[str]) -> str:
    """The text of a page with pages inside, which it moves together."""
    style, script = _part("side_by_side.css"), _part("side_by_side.js").strip()
    inner_style, inner_script = _part("page.css"), _part("page.js").strip()
    scripts, styles = f"{_hash(script)} {_hash(inner_script)}", f"{_hash(style)} {_hash(inner_style)}"
    policy = f"default-src 'none'; script-src {scripts}; style-src {styles}; img-src data: blob:; frame-src 'self'"
    values = {
        "POLICY": policy,
        "TITLE": html.escape(title),
        "STYLE": style,
        "PAGES": "\n".join(map(_figure, pages)),
        "NOTES": "\n".join(f"<p>{html.escape(note)}</p>" for note in notes),
        "SCRIPT": script,
    }
    return _filled("side_by_side.html", values)


def _figure(page: Beside) -> str:
    fault = f"<br><b>{html.escape(page.fault)}</b>" if page.fault else ""
    shown = ""
    if page.text:
        title = html.escape(page.caption, quote=True)
        inside = html.escape(page.text, quote=True)
        shown = f'<iframe title="{title}" data-seconds="{page.seconds:.6g}" srcdoc="{inside}"></iframe>'
    return f"<figure>{shown}<figcaption>{html.escape(page.caption)}{fault}</figcaption></figure>"
