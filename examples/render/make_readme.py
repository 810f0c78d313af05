"""Makes the pictures of the README anew that are frames of flip-books, or rendered where those show too little.

    .venv/bin/python examples/render/make_readme.py [NAME...] [--threads N]     # default: all of readme.toml

Caches lie in build/readme and are used again where they are complete. What is rendered needs Blender: make_gallery.py.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path
from typing import Any

import make_gallery
from caches import ROOT, simulate
from PIL import Image

CACHES, PICTURES = ROOT / "build" / "readme", ROOT / "docs" / "images"
GAP = 6


def pictures() -> list[dict[str, Any]]:
    """The rows of readme.toml."""
    return tomllib.loads(Path(__file__).with_name("readme.toml").read_text(encoding="utf-8"))["picture"]


def options(run: dict[str, Any]) -> list[str]:
    """Of `simulate`."""
    voxel = ["--set", f"/World/Domain.voxelSize={run['voxel']}"] if "voxel" in run else []
    return ["--frames", f"1-{max(run['frames'])}", *voxel, *([] if "smoke" in run else ["--flipbook"])]


def frames_of(run: dict[str, Any], height: int, threads: int | None) -> list[Image.Image]:
    """The frames of a run that are shown; rendered ones side by side, in that height."""
    cache = CACHES / run["scene"]
    simulate(run["scene"], cache, max(run["frames"]), options(run), threads)
    if "smoke" in run:
        strip = CACHES / f"{run['scene']}.webp"
        make_gallery.render(run, cache, strip, make_gallery.blender(), threads, "--height", height)
        return [Image.open(strip)]
    images = [Image.open(cache / "flipbook" / f"{run['scene']}.{frame:04}.png") for frame in run["frames"]]
    return [lower_part(image, run.get("lower", 1.0)) for image in images]


def lower_part(image: Image.Image, share: float) -> Image.Image:
    """That share of the height."""
    return image.crop((0, round(image.height * (1.0 - share)), image.width, image.height))


def put_together(images: list[Image.Image], height: int, columns: int) -> Image.Image:
    """Rows of images of one height, in few colors, which makes the file small."""
    images = [image.convert("RGB").resize((round(image.width * height / image.height), height)) for image in images]
    rows = [images[at : at + columns] for at in range(0, len(images), columns)]
    width = max(sum(image.width + GAP for image in row) - GAP for row in rows)
    sheet = Image.new("RGB", (width, len(rows) * (height + GAP) - GAP), "white")
    for number, row in enumerate(rows):
        for at, image in enumerate(row):
            sheet.paste(image, (sum(other.width + GAP for other in row[:at]), number * (height + GAP)))
    # Colors that are means of what they stand for, else the background turns blue; dithered, else smoke has steps.
    palette = sheet.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=1)
    return sheet.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--threads", type=int, help="of runs; default: all")
    given = parser.parse_args(arguments)
    known = {picture["name"]: picture for picture in pictures()}
    if unknown := [name for name in given.names if name not in known]:
        parser.error(f"{', '.join(unknown)}: not in readme.toml")
    names, blender = given.names or known, make_gallery.blender()
    if any("smoke" in run for name in names for run in known[name]["runs"]) and not blender.is_file():
        parser.error(f"{blender}: {make_gallery.NO_BLENDER}")
    for name in names:
        row = known[name]
        images = [image for run in row["runs"] for image in frames_of(run, row["height"], given.threads)]
        path = PICTURES / f"{name}.png"
        put_together(images, row["height"], row.get("columns", len(images))).save(path, optimize=True)
        print(f"{path}: {path.stat().st_size:,} bytes", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
