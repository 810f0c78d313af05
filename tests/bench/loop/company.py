"""What a scene has beside its solids."""

from __future__ import annotations

from typing import Any


class Company:
    """Nothing. Colliders are solids of the simulation after those of the scene."""

    colliders = 0

    def lead(self, begin: float, end: float) -> None:
        """Gives the motions between two times [s]."""

    def observe(self) -> dict[str, Any]:
        """Columns of the last step; of the start before the first one."""
        return {}
