"""One run of the laboratory: what it is, and the child process that drives the solver through the binding."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
from eulerfsi.errors import LibraryError
from eulerfsi.solver import binding, c_api
from eulerfsi.solver.simulation import Mesh, Simulation

from . import shut_scenes, thin_scenes
from .company import Company
from .groups import GROUPS
from .overlap import deepest_vertex
from .shapes import RADIUS, SIZE, make_shape, rigid_misfit, vertex_areas
from .symmetry import mirror_gaps
from .watch import Thin, Watch

FRAME = 1 / 24  # s
GRAVITY = 9.8  # m/s^2
SHEAR_MODULUS, LAME = 10000.0, 5000.0  # of the authors' ball [Pa]
YOUNGS_MODULUS = SHEAR_MODULUS * (3 * LAME + 2 * SHEAR_MODULUS) / (LAME + SHEAR_MODULUS)  # Pa
POISSONS_RATIO = LAME / (2 * (LAME + SHEAR_MODULUS))
BULK_MODULUS = LAME + 2 * SHEAR_MODULUS / 3  # Pa

TOKENS = {"preset": binding.PRESETS, "wall": binding.WALLS, "material": binding.MATERIALS}
OPEN_FACE = {"openBottom": 2, "openTop": 3, "openRight": 1}  # walls -> face -x +x -y +y -z +z
ALONG_X = ("open", "open", "slip", "slip", "slip", "slip")  # walls "openAlongX"
CHANNEL = ("periodic", "periodic", "noSlip", "noSlip", "slip", "slip")  # walls "channel"
FASTEST = 5.0  # m/s: no solid of these scenes is faster; one that needs the steps of twice this speed has blown up
WATCHED = thin_scenes.CASES | shut_scenes.CASES
TORN = 20.0  # an interior det F above this or below its inverse has blown up
OUT_OF_TIME = "out of time"  # how the failure of a run begins that its wall-clock limit has ended


@dataclasses.dataclass(frozen=True)
class Experiment:
    """One solid in a box. Lengths [m], times [s]."""

    scene: str
    shape: str = "ball"
    across: int = 10  # cells over SIZE
    box: tuple[float, float, float] = (0.4, 0.4, 0.4)
    corner: tuple[float, float, float] = (0.0, 0.0, 0.0)  # the box's lower one
    center: tuple[float, float, float] | None = None  # of the solid's bounding box; None: of the box
    floor: float | None = None  # height of the solid's lowest point, instead of center's [m]
    turn: float = 0.0  # of the shape about (1,1,1) [rad]
    duration: float = FRAME
    dt: float = FRAME  # largest step; the solver divides it further by its CFL limits
    density_ratio: float | None = 1000.0  # solid : fluid; None: vacuum. The denser of the two is 1000 kg/m^3
    gravity: float = 0.0  # along -y [m/s^2]
    walls: str = "slip"  # slip, noSlip, openTop, openBottom, openRight or openAlongX (the rest slip), periodic, channel
    cfl: float | None = None  # cells a solid may move per step; None: the default
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad/s
    stretch: tuple[float, float, float] | None = None  # initial F = diag(stretch) about the centre
    twist: float = 0.0  # about x, from one end of SIZE to the other at the start [rad]
    scramble: int = 0  # seed of a start whose displacement is random within SIZE / 2 at every node; 0: none
    youngs_modulus: float = YOUNGS_MODULUS  # Pa
    poissons_ratio: float = POISSONS_RATIO
    compressible: bool = False
    damping: float = 0.0  # rayleigh_beta [s]
    friction: float = 0.0  # Coulomb's coefficient
    load: float = 0.0  # beta of the body force -beta (x - x_c) [N/m^4]; of the group "pressed": density of the slab
    settings: tuple[tuple[str, Any], ...] = ()  # fields of EfsiSimulationDef or EfsiSolidDef, the user's last word
    mirror: bool = False  # record how far the fields are from their mirror images
    halved: bool = False  # every step half as long as without this
    probe: str = ""  # one of probes.PROBES, which set up their own solids and what is given
    group: str = ""  # of groups.GROUPS or WATCHED, instead of the shape
    limit: float = 600.0  # wall-clock seconds after which the run is given up

    @property
    def spacing(self) -> float:
        """Cell size h [m]."""
        return SIZE / self.across

    @property
    def middle(self) -> np.ndarray:
        """Where the solid starts [m]."""
        return np.array(self.center if self.center is not None else np.array(self.corner) + np.array(self.box) / 2)

    @property
    def choices(self) -> str:
        """Shape, resolution, step limits, densities and walls in words."""
        fluid = "vacuum" if self.density_ratio is None else f"density {self.density_ratio:g}:1"
        cfl = "" if self.cfl is None else f", CFL {self.cfl:g}"
        grid = f"{self.shape} {self.across} across (h {self.spacing:g} m)"
        return f"{grid}, dt <= {self.dt:.3g} s{cfl}, {fluid}, {self.walls} walls"

    @property
    def cost(self) -> float:
        """Grows with the time that the run takes: cells times steps."""
        return float(np.prod(self.box)) / self.spacing**3 * self.most_steps

    @property
    def most_steps(self) -> int:
        """Steps after which the run is given up: its step has collapsed. A fold that closes takes many."""
        settings = dict(self.settings)
        cfl = min(1.0, settings.get("cfl_solid", self.cfl or 1.0))
        step = min(self.dt, settings.get("max_time_step") or self.dt, cfl * self.spacing / FASTEST)
        return 100 + int(4 * (1 + self.halved) * self.duration / step)

    @property
    def face_kinds(self) -> tuple[str, ...]:
        """What the faces -x +x -y +y -z +z are."""
        if self.walls == "channel":
            return CHANNEL
        if self.walls == "openAlongX":
            return ALONG_X
        if self.walls not in OPEN_FACE:
            return (self.walls,) * 6
        return tuple("open" if face == OPEN_FACE[self.walls] else "slip" for face in range(6))

    def mesh(self) -> Mesh:
        """The solid's surface where it starts [m]."""
        mesh = make_shape(self.shape, self.across, self.turn)
        mesh.points += self.middle.astype(np.float32)
        if self.floor is not None:
            mesh.points[:, 1] += self.floor - mesh.points[:, 1].min()
        return mesh

    def ends(self, observed: dict[str, Any]) -> bool:
        """Whether the run is over before its time: there is nothing left to see. observed: what `observe` gave."""
        return False

    def simulation(self) -> dict[str, Any]:
        """Fields of EfsiSimulationDef."""
        heavy = 1000.0
        ratio = self.density_ratio
        values: dict[str, Any] = {
            "domain_min": self.corner,
            "domain_size": self.box,
            "voxel_size": self.spacing,
            "gravity": (0.0, -self.gravity, 0.0),
            "ambient_fluid": int(ratio is not None),
            "fluid_density": heavy / max(1.0, ratio or 1.0),
            "threads": 1,
        }
        for face, kind in enumerate(self.face_kinds):
            values[f"wall[{face}]"] = binding.WALLS[kind]
        if self.cfl is not None:
            values["cfl_solid"] = self.cfl
        return values | self.set_in(c_api.SimulationDef) | {"energy_ledger": 1}

    def solid(self) -> dict[str, Any]:
        """Fields of EfsiSolidDef."""
        values: dict[str, Any] = {
            "density": 1000.0 * min(1.0, 1000.0 if self.density_ratio is None else self.density_ratio),
            "youngs_modulus": self.youngs_modulus,
            "poissons_ratio": self.poissons_ratio,
            "compressible": int(self.compressible),
            "rayleigh_beta": self.damping,
            "friction": self.friction,
            "velocity": self.velocity,
            "angular_velocity": self.spin,
        }
        return values | self.set_in(c_api.SolidDef)

    def bodies(self) -> list[tuple[Mesh, dict[str, Any]]]:
        """Surfaces and fields of EfsiSolidDef of all solids."""
        if self.group in WATCHED:
            return self.watched().bodies()
        return GROUPS[self.group](self) if self.group else [(self.mesh(), self.solid())]

    def company(self, simulation: Simulation) -> Company:
        """Adds what the scene has beside its solids."""
        if self.group in WATCHED:
            return Watch(simulation, self.watched(), self.spacing)
        return Company()

    def watched(self) -> Thin:
        """The scene of a group that is one of WATCHED."""
        return WATCHED[self.group].make(np.array(self.box), self.spacing)

    def set_in(self, structure: type) -> dict[str, Any]:
        """The settings that are fields of a definition structure, tokens as their constants."""
        chosen = [(name, value) for name, value in self.settings if field_of(name) is structure]
        return {name: TOKENS.get(name.partition("[")[0], {}).get(value, value) for name, value in chosen}


def field_of(name: str) -> type | None:
    """The definition structure that has a field; "wall[2]" is an element of wall."""
    base = name.partition("[")[0]
    for structure in (c_api.SimulationDef, c_api.SolidDef):
        if base in {field for field, *_ in structure._fields_}:
            return structure
    return None


def simulate(run: Experiment) -> dict[str, Any]:
    """Runs an experiment: {"failure": text or "", "start": ..., "columns": {name: one value per step}}."""
    bodies, columns, failure = run.bodies(), [], ""
    ends = step_ends(run)
    begun = time.perf_counter()
    with Simulation(run.simulation()) as simulation:
        reports = [simulation.add_solid(mesh, **values)[1] for mesh, values in bodies]
        if run.stretch:
            stretch(simulation, run)
        if run.twist:
            twist(simulation, run)
        if run.scramble:
            scramble(simulation, run)
        company = run.company(simulation)
        observe = Observer([mesh for mesh, _ in bodies], company)
        last = observe(simulation)
        kept = ("surface_volume", "solid_volume", "thinnest_feature")
        start = last | {of(name, k): report[name] for k, report in enumerate(reports, 1) for name in kept}
        gaps = mirror_gaps if run.mirror else lambda _: {}
        start |= gaps(simulation)
        try:
            for end in ends:
                company.lead(simulation.time, end)
                while end - simulation.time > 1e-9 and not run.ends(last):
                    if run.load and not run.group:
                        push_inwards(simulation, run, end - simulation.time)
                    info = timed_step(simulation, end - simulation.time)
                    if run.load and not run.group and abs(info["dt"] - run.dt) > 1e-6:
                        raise ValueError(f"the load was given for a step of {run.dt:g} s, it was {info['dt']:g} s")
                    last = observe(simulation)
                    columns.append(info | record(simulation) | gaps(simulation) | last)
                    low, high = last["det_f_interior"]
                    if not (low > 1 / TORN and high < TORN):
                        raise ValueError(f"blown up: interior det F {low:.3g}..{high:.3g} at {simulation.time:.3g} s")
                    if len(columns) > run.most_steps:
                        raise ValueError(f"given up after {len(columns)} steps at {simulation.time:.3g} s")
                    if time.perf_counter() - begun > run.limit:
                        raise TimeoutError(f"{OUT_OF_TIME} after {run.limit:g} s at time {simulation.time:.3g} s")
        except (LibraryError, ValueError, TimeoutError) as error:
            failure = str(error)
    names = columns[0].keys() if columns else ()
    return {"failure": failure, "start": start, "columns": {name: [row[name] for row in columns] for name in names}}


def timed_step(simulation: Simulation, largest: float) -> dict[str, Any]:
    """One step: the fields of EfsiStepInfo, wall-clock seconds and processor seconds of all threads."""
    clock, used = time.perf_counter(), time.process_time()
    info = simulation.step(largest)
    return info | {"seconds": time.perf_counter() - clock, "processor": time.process_time() - used}


def step_ends(run: Experiment) -> list[float]:
    """Times at which a step has to end [s]: after every dt; halved: ends and middles of the steps without that."""
    if run.halved:
        columns = simulate(dataclasses.replace(run, halved=False))["columns"]
        return [time - part * dt for time, dt in zip(columns["time"], columns["dt"], strict=True) for part in (0.5, 0)]
    return [min(run.duration, (n + 1) * run.dt) for n in range(int(np.ceil(run.duration / run.dt - 1e-9)))]


def of(name: str, solid: int) -> str:
    """Name of a column of solid 1, 2, ...: as it is, name@2, ..."""
    return name if solid == 1 else f"{name}@{solid}"


class Observer:
    """Diagnostics of the solids and of the fluid now, det F of interior and cut cells, and the shape of the surfaces.

    Of every solid (`of`), beside the fields of EfsiSolidDiagnostics:
    second_moments: mean square of the distances to the surface's centroid along x, y, z [m^2];
    misshape: largest distance of a vertex from where the rest shape, moved to the same centroid, has it [m];
    misfit: the same where the rest shape may turn as well [m].

    Of several solids: det_f_interior is that of full cells after the last repair; overlap: how deep a vertex of one is
    in another one [m]; contact: largest row_overlap of EfsiContactPair in the last step, 0 for less [cells];
    active_rows: sum over the pairs. Colliders count for det_f_interior alone.
    """

    def __init__(self, meshes: list[Mesh], company: Company) -> None:
        self.company = company
        self.rest = [mesh.points.astype(float) for mesh in meshes]
        self.triangles = [mesh.triangles() for mesh in meshes]
        self.areas = [vertex_areas(mesh.points, mesh.triangles()) for mesh in meshes]

    def __call__(self, simulation: Simulation) -> dict[str, Any]:
        fluid, seen = simulation.fluid_diagnostics(), {}
        surfaces = [simulation.surface(k + 1)[0].astype(float) for k in range(len(self.rest))]
        for k, points in enumerate(surfaces, 1):
            seen |= {of(name, k): value for name, value in self.solid(simulation, k, points).items()}
        seen |= {"fluid_energy": fluid["kinetic_energy"], "fluid_carried": fluid["carried_energy"]}
        seen["fluid_momentum"] = fluid["momentum"]
        seen |= self.company.observe()
        if len(surfaces) == 1 and not self.company.colliders:
            return seen | det_f_ranges(simulation)
        repairs = simulation.repairs()
        seen["det_f_interior"] = [repairs["min_det_f_after"], repairs["max_det_f_after"]]
        if len(surfaces) == 1:
            return seen
        pairs = [pair for pair in simulation.contacts() if max(pair["solid"]) <= len(surfaces)]
        return seen | {
            "overlap": deepest_vertex(list(zip(surfaces, self.triangles, strict=True))),
            "contact": max([0.0, *(pair["row_overlap"] for pair in pairs)]),
            "active_rows": sum(pair["active_rows"] for pair in pairs),
        }

    def solid(self, simulation: Simulation, number: int, points: np.ndarray) -> dict[str, Any]:
        """Of one solid."""
        facts, rest, weights = simulation.solid_diagnostics(number), self.rest[number - 1], self.areas[number - 1]
        weights = weights / weights.sum()
        points = points - weights @ points
        centred = rest - weights @ rest
        return {
            **{name: value for name, value in facts.items() if name not in ("min_det_f", "max_det_f")},
            "second_moments": list(weights @ points**2),
            "misshape": float(np.linalg.norm(points - centred, axis=1).max()),
            "misfit": rigid_misfit(points, centred, weights),
        }


def record(simulation: Simulation) -> dict[str, Any]:
    """What the last step did: repairs, what the transport of solid 1 changed, the columns of the energy ledger.

    energy_change: (stages, forms) [J]; energy_end, energy_at_start: (forms,) [J]; stages and forms as in the binding.
    """
    repairs, moved, ledger = simulation.repairs(), simulation.transport_error(1), simulation.energy_ledger()
    return {
        **{name: repairs[name] for name in ("clamped", "rejected", "broken", "repaired_cells")},
        "det_f_before": [repairs["min_det_f_before"], repairs["max_det_f_before"]],
        **{f"transport_{name}": value for name, value in moved.items()},
        "energy_end": list(ledger["at_end"].values()),
        "energy_at_start": list(ledger["at_start"].values()),
        "energy_change": [list(column.values()) for column in ledger["change"].values()],
        "source_work": ledger["source_work"],
    }


def det_f_ranges(simulation: Simulation) -> dict[str, list[float]]:
    """[lowest, highest] det F = 1 / det(I - grad u) at the centres of full cells and of cells more than half solid."""
    u, place = simulation.field("solid_displacement", 1)
    fraction, grid = simulation.field("solid_fraction")
    h = place["spacing"]
    lower = np.rint((np.array(place["origin"]) - np.array(grid["origin"])) / h + 0.5).astype(int)
    cells = tuple(slice(lo, lo + n - 1) for lo, n in zip(lower, u.shape[1:], strict=True))
    fraction = fraction[0][cells]
    gradient = np.empty((*fraction.shape, 3, 3))
    for axis in range(3):
        slope = np.diff(u.astype(float), axis=axis + 1) / h
        for other in {0, 1, 2} - {axis}:
            slope = (np.take(slope, range(1, slope.shape[other + 1]), other + 1) + np.delete(slope, -1, other + 1)) / 2
        gradient[..., axis] = np.moveaxis(slope, 0, -1)
    ranges = {}
    for name, chosen in (("interior", fraction > 1 - 1e-6), ("cut", (fraction > 0.5) & (fraction <= 1 - 1e-6))):
        inverse = np.linalg.det(np.eye(3) - gradient[chosen])
        det = 1 / np.where(inverse == 0, np.nan, inverse)  # negative where inverted
        ranges[f"det_f_{name}"] = [float(np.nanmin(det)), float(np.nanmax(det))] if det.size else [1.0, 1.0]
    return ranges


def stretch(simulation: Simulation, run: Experiment) -> None:
    """Sets u(x) = x - X for X = c + F^-1 (x - c), F = diag(run.stretch)."""
    u, place = simulation.field("solid_displacement", 1)
    simulation.set_field(
        "solid_displacement", offsets(u, place, run) * (1 - 1 / np.array(run.stretch))[:, *[None] * 3], 1
    )


def twist(simulation: Simulation, run: Experiment) -> None:
    """Sets u(x) = x - X, X turned back about x by run.twist of its distance to the middle over SIZE."""
    u, place = simulation.field("solid_displacement", 1)
    x, y, z = offsets(u, place, run)
    turn = -run.twist * x / SIZE
    back = np.stack([x, np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z])
    simulation.set_field("solid_displacement", np.stack([x, y, z]) - back, 1)


def scramble(simulation: Simulation, run: Experiment) -> None:
    """Sets a displacement without any sense."""
    u, _ = simulation.field("solid_displacement", 1)
    drawn = np.random.default_rng(run.scramble).uniform(-SIZE / 2, SIZE / 2, u.shape)
    simulation.set_field("solid_displacement", drawn, 1)


def push_inwards(simulation: Simulation, run: Experiment, dt: float) -> None:
    """Adds dt f / rho of the body force f = -beta (x - x_c) to the solid's velocity, as a step adds gravity."""
    v, place = simulation.field("solid_velocity", 1)
    kick = -run.load * dt / run.solid()["density"]
    simulation.set_field("solid_velocity", v + kick * offsets(v, place, run), 1)


def offsets(field: np.ndarray, place: dict[str, Any], run: Experiment) -> np.ndarray:
    """x - x_c at the nodes of a field, (3, nx, ny, nz) [m]."""
    axes = [place["origin"][a] + place["spacing"] * np.arange(field.shape[a + 1]) - run.middle[a] for a in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"))


__all__ = ["FRAME", "GRAVITY", "RADIUS", "Company", "Experiment", "simulate"]
