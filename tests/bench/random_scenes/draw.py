"""Random values by name, from the ranges of one file. A name's value depends on seed, scene and name alone."""

from __future__ import annotations

import functools
import math
import random
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

RANGES = Path(__file__).with_name("ranges.toml")


@functools.cache
def ranges() -> dict[str, Any]:
    """The tables of ranges.toml."""
    return tomllib.loads(RANGES.read_text())


def constant(name: str) -> float:
    """A limit that is not drawn."""
    return ranges()[name]["value"]


class Draw:
    """The random values of one scene. `part` tells values of the same range apart."""

    def __init__(self, seed: int, scene: int | str) -> None:
        self.seed, self.scene = seed, scene

    def evenly(self, name: str, part: object = "") -> float:
        """Between 0 and 1."""
        return random.Random(f"{self.seed} {self.scene} {name} {part}").random()

    def number(self, name: str, part: object = "") -> float:
        """A value of the range."""
        table, t = ranges()[name], self.evenly(name, part)
        low, high = table["low"], table["high"]
        value = low * (high / low) ** t if table.get("scale") == "log" else low + (high - low) * t
        return min(max(value, low), high)

    def happens(self, name: str, part: object = "") -> bool:
        """True with the chance of the table."""
        return self.evenly(name, part) < ranges()[name]["chance"]

    def one_of(self, name: str, part: object = "") -> str:
        """A key of the table's weights."""
        weights = ranges()[name]["weights"]
        left = self.evenly(name, part) * sum(weights.values())
        for key, weight in weights.items():
            left -= weight
            if left < 0:
                return key
        return key

    def direction(self, name: str) -> np.ndarray:
        """A unit vector, every one alike."""
        z, angle = 2 * self.evenly(name, "z") - 1, 2 * math.pi * self.evenly(name, "angle")
        across = math.sqrt(1 - z * z)
        return np.array([across * math.cos(angle), across * math.sin(angle), z])

    def rotation(self, name: str) -> np.ndarray:
        """A rotation matrix, every one alike (Shoemake's quaternions)."""
        part, a, b = self.evenly(name, "part"), *(2 * math.pi * self.evenly(name, side) for side in "ab")
        near, far = math.sqrt(1 - part), math.sqrt(part)
        x, y, z, w = near * math.sin(a), near * math.cos(a), far * math.sin(b), far * math.cos(b)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
