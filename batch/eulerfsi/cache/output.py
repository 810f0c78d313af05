"""What is written of the smoke: `--half`, `--smoke-threshold`, `--no-velocity`, `--region`."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ..errors import UsageError
from ..scene.space import SimulationSpace


@dataclasses.dataclass(frozen=True)
class Output:
    """half: 16-bit floats; threshold: voxels with at most this density are inactive; velocity: `vel` is written;
    region: lower and upper corner of a box in world space [stage units], () for the whole domain."""

    half: bool = False
    threshold: float = 1e-3
    velocity: bool = True
    region: tuple[float, ...] = ()

    @classmethod
    def parse(cls, half: bool, threshold: str | None, velocity: bool, region: str | None) -> Output:
        """From the options of the command line. Raises UsageError."""
        chosen = cls(half=half, velocity=velocity)
        if threshold is not None:
            [value] = _numbers("--smoke-threshold", threshold, 1, "a number >= 0")
            if value < 0:
                raise UsageError(f"--smoke-threshold {threshold}: must be a number >= 0")
            chosen = dataclasses.replace(chosen, threshold=value)
        if region is not None:
            shape = "six numbers X0,Y0,Z0,X1,Y1,Z1, each of the first three below the one of the last three"
            corners = _numbers("--region", region, 6, shape)
            if any(low >= high for low, high in zip(corners[:3], corners[3:], strict=True)):
                raise UsageError(f"--region {region}: must be {shape}")
            chosen = dataclasses.replace(chosen, region=tuple(corners))
        return chosen

    @classmethod
    def of(cls, facts: dict[str, Any] | None) -> Output:
        """As a manifest holds it; None: one that does not, since it is older."""
        return cls(**{**facts, "region": tuple(facts["region"])}) if facts else cls()

    def definition(self, space: SimulationSpace) -> dict[str, Any]:
        """Fields of EfsiVdbDef. A domain that is turned gets the box around the region."""
        fields = {
            "transform": space.to_world_matrix(),
            "half_float": int(self.half),
            "density_threshold": self.threshold,
            "write_velocity": int(self.velocity),
        }
        if self.region:
            fields["region_min"], fields["region_max"] = self._region_in(space)
        return fields

    def check(self, space: SimulationSpace, domain: dict[str, Any]) -> None:
        """Raises UsageError for a region that misses the domain. domain: fields of EfsiSimulationDef."""
        if not self.region:
            return
        low, size = np.array(domain["domain_min"]), np.array(domain["domain_size"])
        region_low, region_high = self._region_in(space)
        if (region_low < low + size).all() and (region_high > low).all():
            return
        world = space.point_to_world(_corners(np.stack([low, low + size])))
        box = ",".join(f"{x:.6g}" for x in [*world.min(axis=0), *world.max(axis=0)])
        given = ",".join(f"{x:g}" for x in self.region)
        raise UsageError(f"--region {given}: must overlap the domain, which lies in {box} (world space, stage units)")

    def _region_in(self, space: SimulationSpace) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of the box around it in simulation space [m]."""
        corners = _corners(np.reshape(self.region, (2, 3)))
        sim = space.vector_to_sim(corners - space.center) * space.meters_per_unit
        return sim.min(axis=0), sim.max(axis=0)

    def facts(self) -> dict[str, Any]:
        """What the manifest holds of it."""
        return {**dataclasses.asdict(self), "region": list(self.region)}


def _corners(box: np.ndarray) -> np.ndarray:
    """(8, 3) of a box from its lower and upper corner (2, 3)."""
    return np.array([[box[(n >> a) & 1, a] for a in range(3)] for n in range(8)])


def _numbers(option: str, text: str, count: int, shape: str) -> list[float]:
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise UsageError(f"{option} {text}: must be {shape}")
    return numbers
