"""Processors and memory that this process may use, as the cgroup sets them."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

_CGROUP_ROOT = Path("/sys/fs/cgroup")


def _cgroup_folders(root: Path, membership: Path) -> Iterator[Path]:
    """Folders of this process's cgroup and its ancestors (version 2, or the v1 memory and cpu hierarchies)."""
    try:
        lines = membership.read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        bases = [root] if not controllers else [root / name for name in (controllers, *controllers.split(","))]
        for base in bases:
            folder = base / path.lstrip("/")
            while folder != base and base in folder.parents:
                yield folder
                folder = folder.parent
            yield base
    yield root


def _read_words(path: Path) -> list[str]:
    try:
        return path.read_text().split()
    except OSError:
        return []


def available_threads(root: Path = _CGROUP_ROOT, membership: Path = Path("/proc/self/cgroup")) -> int:
    """Processors that this process may keep busy: CPU affinity, bounded by the cgroup's quota (rounded up)."""
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for folder in _cgroup_folders(root, membership):
        words = _read_words(folder / "cpu.max")
        if not words:
            quota, period = _read_words(folder / "cpu.cfs_quota_us"), _read_words(folder / "cpu.cfs_period_us")
            words = quota + period if quota and period and quota[0] != "-1" else []
        if len(words) == 2 and words[0] != "max":
            threads = min(threads, max(1, math.ceil(int(words[0]) / int(words[1]))))
    return max(1, threads)


def available_memory(root: Path = _CGROUP_ROOT, membership: Path = Path("/proc/self/cgroup")) -> int:
    """Bytes that a simulation may take: the machine's available memory, bounded by the cgroup's limit."""
    limit = 0
    for line in Path("/proc/meminfo").read_text().splitlines() if Path("/proc/meminfo").exists() else []:
        if line.startswith("MemAvailable:"):
            limit = int(line.split()[1]) * 1024
    if not limit:
        limit = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for folder in _cgroup_folders(root, membership):
        words = _read_words(folder / "memory.max") or _read_words(folder / "memory.limit_in_bytes")
        if len(words) == 1 and words[0] != "max":
            limit = min(limit, int(words[0]))
    return limit


def format_bytes(count: float) -> str:
    """1536 -> '1.5 KiB'."""
    for unit in ("bytes", "KiB", "MiB", "GiB", "TiB", "PiB"):
        if count < 1024 or unit == "PiB":
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.1f} {unit}"
        count /= 1024
    raise AssertionError("unreachable")
