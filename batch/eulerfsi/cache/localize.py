"""A copy of a scene with everything that it refers to, in one folder that can be moved."""

from __future__ import annotations

import itertools
import os
import re
import shutil
from pathlib import Path

from pxr import Ar, Sdf, Tf, UsdUtils

from ..errors import CacheIOError
from ..files import export_layer, replacing
from ..reasons import usd_reason


def localize_scene(scene: Path, folder: Path) -> Path:
    """Copies the scene's layers and assets into `folder` with relative paths; returns the copy of the root layer.

    Files under the scene's own folder keep their place relative to it; others go to external/<n>/, or external1/<n>/
    where the scene has a folder of that name itself, and so on. References that do not resolve stay as they are.
    """
    root = scene.resolve()
    try:
        layers, assets, _ = UsdUtils.ComputeAllDependencies(str(root))
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        raise CacheIOError(f"{folder}: cannot copy the scene: {usd_reason(error)}") from error
    places = _Places(root.parent, folder)
    try:
        for layer in layers:
            if layer.anonymous or not layer.realPath or "[" in layer.identifier:
                continue  # what lies inside a package travels with the package
            source = Path(layer.realPath)
            target = places.of(source)
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.suffix == ".usdz":
                _copy(source, target)
                continue
            copy = Sdf.Layer.CreateAnonymous(source.suffix, layer.GetFileFormatArguments())
            copy.TransferContent(layer)
            UsdUtils.ModifyAssetPaths(copy, lambda path, at=layer, to=target: places.relative(path, at, to))
            with replacing(target) as temporary:  # USD's own temporary files begin with its name and are swept with it
                export_layer(copy, temporary)
        for asset in assets:
            source = Path(Ar.SplitPackageRelativePathOuter(asset)[0])
            target = places.of(source)
            if source.is_file() and not (target.exists() and target.samefile(source)):
                target.parent.mkdir(parents=True, exist_ok=True)
                _copy(source, target)
    except OSError as error:
        raise CacheIOError(
            f"{folder}: cannot copy the scene: {error.filename or ''} {error.strerror or error}"
        ) from error
    return places.of(root)


def _copy(source: Path, target: Path) -> None:
    with replacing(target) as temporary:
        shutil.copyfile(source, temporary)


class _Places:
    """Where each source file goes; one external/<n>/ per source folder."""

    def __init__(self, home: Path, folder: Path) -> None:
        self.home = home
        self.folder = folder
        names = itertools.chain(["external"], (f"external{number}" for number in itertools.count(1)))
        self.outside = folder / next(name for name in names if not (home / name).exists())
        self.external: dict[Path, int] = {}

    def of(self, source: Path) -> Path:
        source = Path(os.path.normpath(source))
        if self.home in source.parents:
            return self.folder / source.relative_to(self.home)
        number = self.external.setdefault(source.parent, len(self.external))
        return self.outside / str(number) / source.name

    def relative(self, authored: str, layer: Sdf.Layer, target: Path) -> str:
        """What `authored` in `layer` reads in the copy at `target`."""
        if not authored:
            return authored
        outer, inner = Ar.SplitPackageRelativePathOuter(authored)
        source = Path(layer.ComputeAbsolutePath(outer))
        pattern = re.search(r"<UDIM>|<uvtile\d*>", source.name)
        exists = any(source.parent.glob(source.name.replace(pattern.group(), "*"))) if pattern else source.is_file()
        if not source.is_absolute() or not exists:
            return authored
        path = Path(os.path.relpath(self.of(source), target.parent)).as_posix()
        path = path if path.startswith("../") else f"./{path}"
        return Ar.JoinPackageRelativePath(path, inner) if inner else path
