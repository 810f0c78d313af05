"""`verify`: whether a cache is as it was written, and what that ends with."""

from __future__ import annotations

from pathlib import Path

from ..cache import verify as cache_verify
from ..cache.verify import Verified
from ..errors import CacheIOError, Unfinished


def verify(folder: Path, deep: bool) -> tuple[Verified, BaseException | None]:
    """What was found, and the error that it amounts to. Raises SceneError, CacheIOError as the cache's own does."""
    found = cache_verify.verify(folder, deep)
    if found.damaged:
        count = len({name for name, _ in found.damaged})
        return found, CacheIOError(f"{folder}: {count} of {found.count} files are missing or damaged")
    missing = found.missing
    if missing:
        frames = f"frame {missing[0]} is" if len(missing) == 1 else f"{len(missing)} frames from {missing[0]} on are"
        return found, Unfinished(f"{folder}: {frames} not there yet ({found.status}); continue with --resume")
    return found, None
