"""What a run warns of: the table of docs/warnings.md."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence


@dataclasses.dataclass(frozen=True)
class Condition:
    """One row. code: for programs; what, threshold: for people; text: of the warning, after the prim and the frame.

    limit: the value from which on it holds, None where the scene has it; frames: in a row, in which it must hold;
    share: values are parts of 1, shown in percent.
    """

    code: str
    what: str
    threshold: str
    limit: float | None
    text: str
    frames: int = 1
    share: bool = False

    def show(self, value: float) -> str:
        """A value, or the limit, for people."""
        return f"{100 * value:.3g} %" if self.share else f"{value:.3g}"

    def message(self, value: float, limit: float, other: str, place: Sequence[float] = ()) -> str:
        """The text with its numbers. place: world position, or nothing."""
        where = f" at ({', '.join(f'{x:.4g}' for x in place)})" if place else ""
        return self.text.format(value=self.show(value), limit=self.show(limit), other=other, place=where)


CONDITIONS = {
    row.code: row
    for row in (
        Condition(
            "overlap",
            "two solids, or a solid and a collider, overlap; a vertex lies in a closed wall",
            "1 cell deep",
            1.0,
            "it is {value} cells deep in {other} (limit {limit}): thicker or stiffer parts, a smaller voxelSize or a "
            "smaller maxTimeStep keep surfaces apart",
        ),
        Condition(
            "exchanged_sides",
            "surfaces have exchanged sides: vertices have come out of another solid on another side than they went in",
            "any",
            1.0,
            "{value} vertices of it and {other} have come out{place} on another side than they went in (limit "
            "{limit}): parts of the two have passed through each other; thicker or stiffer parts, a smaller voxelSize "
            "or a smaller maxTimeStep keep surfaces apart",
        ),
        Condition(
            "repaired_cells",
            "cells of the solids repaired in a step",
            "1 % of their cells",
            0.01,
            "{value} of the solids' cells were repaired in a step (limit {limit}): a smaller voxelSize, a smaller "
            "maxTimeStep or stiffer solids deform less per cell",
            share=True,
        ),
        Condition(
            "volume",
            "volume of an incompressible solid off",
            "3 %, two frames in a row",
            0.03,
            "its volume is off by {value} (limit {limit}): a smaller voxelSize, a smaller maxTimeStep or a mesh of "
            "shorter edges keeps it",
            frames=2,
            share=True,
        ),
        Condition(
            "not_converged",
            "steps with a solve that did not converge",
            "10 % of the steps of a frame, at least two",
            0.1,
            "{value} of the frame's steps have a solve at its iteration limit (limit {limit}): a smaller maxTimeStep "
            "or softer solids converge",
            share=True,
        ),
        Condition(
            "held_solid",
            "a pinned solid has not moved since the first frame though something acts on it",
            "residual of the velocity solve above its tolerance in every step of a frame",
            None,
            "it is pinned and does not move, since its velocity solve never converges (residual {value}, tolerance "
            "{limit}): a smaller maxTimeStep, a smaller voxelSize or a softer solid converges",
        ),
        Condition(
            "energy_rises",
            "energy rises where the ledger is on",
            "2 % of what was put in",
            0.02,
            "energy has risen by {value} of what was put in (limit {limit}): a smaller maxTimeStep or a smaller "
            "voxelSize keeps it",
            share=True,
        ),
        Condition(
            "false_edges",
            "edges of a mesh that the stretch of the solid does not explain",
            "any, two frames in a row",
            1.0,
            "{value} edges of the mesh are longer than 4 times what the largest stretch of the solid explains (limit "
            "{limit}): points of it have moved to another part; a smaller voxelSize tells the parts apart",
            frames=2,
        ),
        Condition(
            "folds",
            "parts of one solid that fold onto each other touch",
            "any, two frames in a row",
            0.0,
            "parts of it that fold onto each other are {value} cells deep in each other (limit {limit}): a smaller "
            "voxelSize or a smaller maxTimeStep keeps them apart",
            frames=2,
        ),
        Condition(
            "fast_fluid",
            "top speed of the fluid over the largest of solids, colliders, jets, wind, walls and sqrt(2 a H)",
            "10, two frames in a row",
            10.0,
            "the fluid is {value} times as fast as anything that drives it (limit {limit}): a smaller maxTimeStep or "
            "a smaller voxelSize",
            frames=2,
        ),
    )
}
