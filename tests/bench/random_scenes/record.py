"""What a record shows of the solid and the faces of its box: gaps, contact, flight, rebounds, energy."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from eulerfsi.solver import binding
from loop.experiment import OUT_OF_TIME, of
from loop.measure import FORMS, Result, energy_at_begin, ledger

from .contact import ContactScene
from .scenes import Scene, weight_ratio

WALLS = ("slip", "noSlip")
TOUCH = 1.0  # cells from a wall within which it can push
SEEN = 1.5  # cells from a wall at which a change of direction is a rebound from it
PERIODIC_LIMIT = "of the periodic faces"  # in the message that ends a run at the documented limit
STEADY = 0.995  # of the largest speed: where the push of a wall is over, without gravity towards it
MOST_TURN = 0.3  # rad until a body is clear of the wall, for its corners not to strike it again
CLEAR = 2.0  # cells
STILL = 1e-12  # of Young's modulus times the volume
SAMPLES = 400  # of a ballistic rise
OPPOSITE = 2.0  # cells from the opposite wall, where a rise ends


@dataclasses.dataclass(frozen=True)
class Rebound:
    """A rise after a wall's push; lengths in cells.

    rise, expected: highest of the centre from where it is fastest; spring: what the elastic energy there can add to it
    while the wall still pushes by less than the weight; gap: of the lowest vertex at the highest.
    """

    time: float
    face: int
    rise: float
    expected: float
    spring: float
    gap: float
    is_clear: bool  # the ballistic rise takes every vertex, in the rest shape, over CLEAR cells off the wall


def view(result: Result, number: int) -> Result:
    """What a result says of solid `number`, from 1, as if there were no other."""
    own = lambda names: {name: values for name, values in names.items() if "@" not in name}  # noqa: E731
    start, columns = own(result.start), own(result.columns)
    for name in list(start) + list(columns):
        if number > 1 and of(name, number) in result.start:
            start[name] = result.start[of(name, number)]
        if number > 1 and of(name, number) in result.columns:
            columns[name] = result.columns[of(name, number)]
    return Result(result.run.view(number), result.failure, start, columns)


def with_end(starts: np.ndarray) -> np.ndarray:
    """Values at the starts of the steps, the last one for the end of the run, too (n,)."""
    return np.append(starts, starts[-1:])


class Record:
    """A result and what follows from it. Arrays have the start in front; (n,) or (n, 3) or (n, 6) by face."""

    def __init__(self, result: Result) -> None:
        self.result = result
        self.scene: Scene = result.run
        self.times = result.times
        self.solids = [self]  # a record each

    @classmethod
    def of_all(cls, result: Result) -> Record:
        """The record of a scene: with several solids that of the first one, and of all what is not one solid's."""
        record = cls(result)
        scene = result.run
        if not isinstance(scene, ContactScene) or not result.start:
            return record
        record.solids = [cls(view(result, number)) for number in range(1, len(scene.parts) + 1)]
        whole = np.logical_and.reduce([solid.whole for solid in record.solids])
        for solid in (record, *record.solids):
            solid.__dict__["whole"] = whole
        thinnest = min(solid.result.start["thinnest_feature"] for solid in record.solids)
        result.start["thinnest_feature"] = thinnest
        return record

    def series(self, name: str) -> np.ndarray:
        return self.result.with_start(name)

    def column(self, name: str) -> np.ndarray:
        """A quantity after every step while the solid is whole (n - 1, ...)."""
        return self.result[name][self.whole[1:]]

    @property
    def steps(self) -> int:
        return len(self.times) - 1

    @property
    def out_of_time(self) -> bool:
        return self.result.failure.startswith(OUT_OF_TIME)

    @property
    def at_limit(self) -> bool:
        return PERIODIC_LIMIT in self.result.failure

    @functools.cached_property
    def distances(self) -> np.ndarray:
        """Of the outermost vertex from each face, negative beyond it (n, 6) [cells]."""
        low, high = self.series("extent_min"), np.array(self.scene.box) - self.series("extent_max")
        return np.stack([low, high], axis=2).reshape(len(low), 6) / self.scene.spacing

    @functools.cached_property
    def gaps(self) -> np.ndarray:
        """The same, infinite for faces that are no walls."""
        return np.where([kind in WALLS for kind in self.scene.faces], self.distances, np.inf)

    @functools.cached_property
    def whole(self) -> np.ndarray:
        """No part of any solid has left through an open face, so far (n,)."""
        if not self.steps:
            return np.zeros(1, bool)
        opened = np.where([kind == "open" for kind in self.scene.faces], self.distances, np.inf)
        return np.logical_and.accumulate(opened.min(axis=1) >= 0)

    @functools.cached_property
    def flight(self) -> np.ndarray:
        """It has touched no wall and no collider so far, and is whole (n,)."""
        alone = self.gaps.min(axis=1) > TOUCH
        if "collider_gap" in self.result.columns:
            alone &= self.series("collider_gap") > TOUCH * self.scene.spacing
        return self.whole & np.logical_and.accumulate(alone)

    @functools.cached_property
    def velocity(self) -> np.ndarray:
        return self.result.velocity

    @property
    def fall(self) -> np.ndarray:
        """Acceleration by gravity (3,) [m/s^2]."""
        return weight_ratio(self.scene.density_ratio) * np.array(self.scene.pull)

    @functools.cached_property
    def spin(self) -> np.ndarray:
        """Angular speed, as of a body whose surface's moments are its own (n,) [rad/s]."""
        inertia = 0.4 * self.series("mass") * self.series("second_moments").sum(axis=1)
        return np.linalg.norm(self.series("angular_momentum"), axis=1) / inertia

    @property
    def has_ledger(self) -> bool:
        """The record holds the energies of all matter, taken at one time."""
        return "energy_at_start" in self.result.columns

    @functools.cached_property
    def energies(self) -> tuple[np.ndarray, ...]:
        """Kinetic, elastic and potential above the lowest of the run, less what came from outside, (n,) [J].

        In two readings: elastic energy moves with the velocity at a step's end, which so belongs to its middle or to
        its end, as the scheme has it. Without the ledger of the solid alone.
        """
        if self.has_ledger:
            return self.energy_of_matter - self.outside_work, self.energy_at_ends
        height = -self.series("center") @ self.fall
        kinetic, elastic = self.series("kinetic_energy"), self.series("elastic_energy")
        moved = kinetic + self.result.start["mass"] * (height - height.min())
        middle = np.concatenate([elastic[:1], (elastic[1:] + elastic[:-1]) / 2])
        return moved + elastic, moved + middle

    @functools.cached_property
    def energy_of_matter(self) -> np.ndarray:
        """By the ledger, u and v of one time, potential energy above the lowest of the run.

        (n,) [J]; the end of the last step, of which no velocity is known, has the energy of its start.
        """
        at_start = self.result["energy_at_start"]
        return with_end(at_start.sum(axis=1) - at_start[:, FORMS.index("potential")].min())

    @functools.cached_property
    def energy_at_ends(self) -> np.ndarray:
        """By the ledger, u and v as the steps leave them, less what came from outside, (n,) [J].

        A step into which an impact fits has nothing of the velocity's mean, which then is that of no time.
        """
        end, potential = self.result["energy_end"], FORMS.index("potential")
        energy = np.concatenate([energy_at_begin(self.result)[:1], end.sum(axis=1)]) - end[:, potential].min()
        return energy - np.concatenate([[0.0], np.cumsum(self.work_by_step)])

    @functools.cached_property
    def outside_work(self) -> np.ndarray:
        """Of emitters and jets, and of what holds pins and colliders, so far (n,) [J].

        Half of a step's counts at its start, where the velocity is the mean of those around.
        """
        return with_end(np.cumsum(self.work_by_step) - self.work_by_step / 2)

    @functools.cached_property
    def work_by_step(self) -> np.ndarray:
        """The same of each step (steps,) [J]."""
        work = ledger(self.result)[:, binding.ENERGY_STAGES.index("external")].sum(axis=1)
        if "prescribed_work" in self.result.columns:
            work = work + self.result["prescribed_work"]
        if "jet_flux" in self.result.columns:
            work = work + self.result["source_work"]
        return np.asarray(work)

    @functools.cached_property
    def energy_scale(self) -> np.ndarray:
        """Largest energy, or work from outside, so far, the noise at least (n,) [J]."""
        largest = self.energies[0]
        if self.has_ledger:
            largest = np.maximum(self.energy_of_matter, np.abs(self.outside_work))
        return np.maximum(np.maximum.accumulate(largest), self.energy_noise)

    @property
    def energy_noise(self) -> float:
        """What rounding of the elastic energy comes to [J]."""
        return STILL * self.scene.youngs_modulus * self.result.start["solid_volume"]

    @functools.cached_property
    def strain(self) -> np.ndarray:
        """Root mean square, as far as the elastic energy tells (n,)."""
        solid = self.result.start["solid_volume"]
        return np.sqrt(2 * np.maximum(0, self.series("elastic_energy")) / (self.scene.youngs_modulus * solid))

    @functools.cached_property
    def rebounds(self) -> list[Rebound]:
        """Those whose ballistic rise is over CLEAR cells before anything else can push along the same axis."""
        found = [self.rebound(face, step) for face in range(6) for step in self.turns(face)]
        return [rebound for rebound in found if rebound]

    def turns(self, face: int) -> np.ndarray:
        """Steps after which the centre, which moved towards the face, moves away from it, with the wall near."""
        away = self.away(face, self.velocity)
        return np.flatnonzero((away[:-1] < 0) & (away[1:] >= 0) & (self.gaps[1:, face] < SEEN) & self.whole[1:]) + 1

    @staticmethod
    def away(face: int, vectors: np.ndarray) -> np.ndarray:
        """The component that leads away from a face."""
        return vectors[..., face // 2] * (-1 if face % 2 else 1)

    def rebound(self, face: int, turn: int) -> Rebound | None:
        """How the centre rises from a wall, None where there is nothing to judge."""
        h, times = self.scene.spacing, self.times
        speed, weight = self.away(face, self.velocity), -float(self.away(face, self.fall))
        pushed = (self.gaps[:, face ^ 1] < OPPOSITE) | ~self.whole
        stops = np.flatnonzero(pushed[turn:])
        last = turn + (stops[0] if stops.size else len(times) - turn) - 1
        back = np.flatnonzero(speed[turn : last + 1] < 0)
        rising = speed[turn : turn + (back[0] if back.size else last + 1 - turn)]
        if not rising.size:
            return None
        top = rising.max()
        off = turn + int(rising.argmax() if weight > 0 else np.flatnonzero(rising >= STEADY * top)[0])
        span = times[last] - times[off]
        if weight > 0:
            span = min(span, speed[off] / weight)
        center = self.distance_of_centre(face)
        start, room = float(center[off]), self.scene.box[face // 2] - self.scene.reach
        ways = np.linspace(0, max(0.0, span), SAMPLES)
        rises = speed[off] * ways - weight * ways**2 / 2
        ways, rises = ways[start + rises <= room], rises[start + rises <= room]
        if not rises.size or rises[-1] < CLEAR * h:
            return None
        if self.scene.shape != "sphere" and not self.clears(ways, rises, self.scene.reach - start, self.spin[off]):
            return None
        expected, until = float(rises[-1]), times[off] + ways[-1]
        at = np.append(times[(times > times[off]) & (times < until)], until)
        reached = np.interp(at, times, center)
        highest = int(reached.argmax())
        gap = float(np.interp(at[highest], times, self.distances[:, face]))
        spring = self.series("elastic_energy")[off] / (self.result.start["mass"] * weight) if weight > 0 else 0.0
        return Rebound(
            time=float(times[off]),
            face=face,
            rise=float(reached[highest] - start) / h,
            expected=expected / h,
            spring=float(spring) / h,
            gap=gap,
            is_clear=bool(start + expected - self.scene.reach > CLEAR * h),
        )

    def distance_of_centre(self, face: int) -> np.ndarray:
        """Of the centre of mass from a face [m]."""
        along = self.series("center")[:, face // 2]
        return self.scene.box[face // 2] - along if face % 2 else along

    @staticmethod
    def clears(ways: np.ndarray, rises: np.ndarray, missing: float, spin: float) -> bool:
        """Whether the centre gets out of the corners' reach before the body has turned by MOST_TURN.

        ways, rises: times after take-off [s] and ballistic rises [m]; missing: of the reach at take-off [m].
        """
        past = np.flatnonzero(rises >= missing)
        return bool(past.size) and bool(spin * ways[past[0]] <= MOST_TURN)
