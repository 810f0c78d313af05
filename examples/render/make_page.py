"""Makes the picture of docs/view.md anew: the page of a heap whose run has been stopped, in a headless Chromium.

.venv/bin/python examples/render/make_page.py
"""

from __future__ import annotations

import base64
import io
import shutil
import sys
from pathlib import Path

from caches import ROOT, simulate
from PIL import Image

sys.path[:0] = [str(ROOT / folder) for folder in ("batch", "usd_plugin", "tests/python")]

from browser import Browser, find_browser  # noqa: E402
from eulerfsi.cache.manifest import Manifest  # noqa: E402
from eulerfsi.cli.view import view  # noqa: E402

LAST, SHOWN, SIZE = 24, 20, (960, 540)


def unfinished(folder: Path) -> Path:
    """A cache that has LAST frames of the 60 that it should have."""
    whole, stopped = folder / "whole", folder / "stopped"
    simulate("heap", whole, LAST, ["--frames", f"1-{LAST}"], None)
    shutil.rmtree(stopped, ignore_errors=True)
    shutil.copytree(whole, stopped)
    manifest = Manifest.load(stopped)
    manifest.data |= {"status": "interrupted", "last": 60}
    manifest.save()
    return stopped


def main() -> int:
    if not find_browser():
        sys.exit("the picture of the page needs a browser: apt-get install chromium-headless-shell")
    folder = ROOT / "build" / "page"
    page = folder / "heap.html"
    view(unfinished(folder), page, 1, 20.0)
    with Browser(size=SIZE) as browser:
        browser.open(page, f"#frame={SHOWN}")
        browser.wait_for("new Promise((done) => setTimeout(() => done(true), 1000))")
        picture = browser.call("Page.captureScreenshot", format="png")["data"]
    image = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
    path = ROOT / "docs" / "images" / "view_heap.webp"
    image.save(path, quality=85, method=6)
    print(f"{path}: {path.stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
