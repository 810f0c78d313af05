"""Deformable bodies written to the proposed standard: which prims they are, their tetrahedra, mass and material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

from . import standard, tets
from .issues import all_prims, first_time, is_enabled, scopes_of


@dataclass(frozen=True)
class Body:
    """A volume body. prim: with the schema of a body; sim: the TetMesh that is simulated, that prim or its child."""

    prim: Usd.Prim
    sim: Usd.Prim

    @property
    def path(self) -> str:
        """Of the body."""
        return str(self.prim.GetPath())

    @property
    def schemas(self) -> list[Usd.Prim]:
        """The prims with EulerFsiSolidAPI, which gives what the standard lacks; at most one of a valid body."""
        return [prim for prim in dict.fromkeys((self.prim, self.sim)) if "solid" in scopes_of(prim)]

    @property
    def ours(self) -> Usd.Prim:
        """The prim that attributes of eulerfsi are read from."""
        return next(iter(self.schemas), self.prim)

    @property
    def enabled(self) -> bool:
        """Whether it takes part."""
        time = first_time(self.prim.GetStage())
        on = standard.value(self.prim, standard.BODY_ENABLED, time, True)
        return bool(on) and is_enabled(self.ours) and not owned_by_others(self.prim)

    @property
    def kinematic(self) -> bool:
        """Whether it moves as it is animated."""
        return bool(standard.value(self.prim, standard.KINEMATIC, first_time(self.prim.GetStage()), False))


def find_bodies(stage: Usd.Stage) -> list[Body]:
    """All volume bodies in stage order, disabled ones too; of several sim meshes in a body the first."""
    found: dict[Usd.Prim, Body] = {}
    for sim in _sims(stage):
        prim = body_prim(sim)
        if prim and prim not in found:
            found[prim] = Body(prim, sim)
    return list(found.values())


def simulated_bodies(stage: Usd.Stage) -> list[Body]:
    """Those that become solids."""
    return [body for body in find_bodies(stage) if body.enabled and not body.kinematic]


def kinematic_bodies(stage: Usd.Stage) -> list[Body]:
    """Those that become colliders."""
    return [body for body in find_bodies(stage) if body.enabled and body.kinematic]


def idle_sims(stage: Usd.Stage) -> list[Usd.Prim]:
    """Prims with the schema of a sim mesh that no body takes."""
    taken = {body.sim for body in find_bodies(stage)}
    return [prim for prim in all_prims(stage) if standard.has(prim, standard.VOLUME_SIM) and prim not in taken]


def _sims(stage: Usd.Stage) -> list[Usd.Prim]:
    return [p for p in all_prims(stage) if p.IsA(UsdGeom.TetMesh) and standard.has(p, standard.VOLUME_SIM)]


def body_prim(sim: Usd.Prim) -> Usd.Prim | None:
    """The prim, itself or its parent, whose body a sim mesh is."""
    for prim in (sim, sim.GetParent()):
        applied = standard.apis(prim)
        if standard.BODY in applied:
            return prim if standard.RIGID_BODY not in applied else None
    return None


def body_at(prim: Usd.Prim) -> Body | None:
    """The volume body of which this is the prim or the sim mesh."""
    near = [prim, *prim.GetChildren()] if standard.has(prim, standard.BODY) else [prim]
    for sim in near:
        owner = body_prim(sim) if sim.IsA(UsdGeom.TetMesh) and standard.has(sim, standard.VOLUME_SIM) else None
        if owner and prim in (owner, sim):
            return Body(owner, sim)
    return None


def owned_by_others(prim: Usd.Prim) -> bool:
    """Whether it belongs to another PhysicsScene than the first, whose gravity counts."""
    owners = standard.targets(prim, standard.OWNER)
    scenes = [p for p in all_prims(prim.GetStage()) if p.IsA(UsdPhysics.Scene)] if owners else []
    return bool(scenes) and scenes[0] not in owners


def members(body: Body) -> list[Usd.Prim]:
    """What has points, belongs to the body and follows its sim mesh: graphics and collision meshes."""
    return [prim for prim in below(body.prim) if prim != body.sim and prim.IsA(UsdGeom.PointBased)]


def below(prim: Usd.Prim) -> list[Usd.Prim]:
    """All prims below one, up to bodies nested in it and prims with a schema of ours."""
    found = []
    inside = iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    body = body_at(prim)
    for child in inside:
        if child == prim:
            continue
        is_sim = body is not None and child == body.sim
        nested = standard.has(child, standard.BODY) or standard.has(child, standard.RIGID_BODY)
        if not is_sim and (nested or scopes_of(child)):
            inside.PruneChildren()
        else:
            found.append(child)
    return found


# ------------------------------------------------------------------------------------------------------- the sim mesh


def tet_indices(sim: Usd.Prim) -> np.ndarray:
    """(m, 4) of the tetrahedra now; empty where they are not authored."""
    got = UsdGeom.TetMesh(sim).GetTetVertexIndicesAttr().Get(first_time(sim.GetStage()))
    return np.asarray(got if got is not None else (), np.int64).reshape(-1, 4)


def points_now(prim: Usd.Prim) -> np.ndarray:
    """(n, 3) of what has points where the scene starts."""
    return _points(UsdGeom.PointBased(prim).GetPointsAttr().Get(first_time(prim.GetStage())))


def has_default_points(prim: Usd.Prim) -> bool:
    """Whether the default value of its points is authored, from which rest and bind pose come."""
    return UsdGeom.PointBased(prim).GetPointsAttr().Get() is not None


def default_points(prim: Usd.Prim) -> np.ndarray:
    """(n, 3) by default; where there are only time samples those of the first frame."""
    return _points(UsdGeom.PointBased(prim).GetPointsAttr().Get()) if has_default_points(prim) else points_now(prim)


def bind_points(prim: Usd.Prim) -> np.ndarray:
    """(n, 3) in its bind pose."""
    pose = standard.pose_points(prim)
    return default_points(prim) if pose is None else _points(pose.Get(first_time(prim.GetStage())))


def _points(value: object) -> np.ndarray:
    return np.asarray(value if value is not None else (), float).reshape(-1, 3)


def rest_arrays(sim: Usd.Prim) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) and tetrahedra (m, 4) of the rest shape."""
    time = first_time(sim.GetStage())
    points = standard.value(sim, standard.REST_POINTS, time)
    corners = standard.value(sim, standard.REST_TETS, time)
    if corners is None or not len(corners):
        corners = UsdGeom.TetMesh(sim).GetTetVertexIndicesAttr().Get()
        corners = tet_indices(sim) if corners is None else corners
    return (
        default_points(sim) if points is None else _points(points),
        np.asarray(corners, np.int64).reshape(-1, 4),
    )


def rest_of_points(sim: Usd.Prim) -> tuple[np.ndarray, int]:
    """(n, 3) the place at rest of each point of the sim mesh, and the first point that has several, -1 for none.

    The rest shape may join its tetrahedra in another way; then each point is where its corners are.
    """
    points, corners = rest_arrays(sim)
    own = tet_indices(sim)
    count = len(points_now(sim))
    if corners.shape == own.shape and np.array_equal(corners, own) and len(points) == count:
        return points, -1
    # Of all corners at a point the lowest and the highest place.
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    places = points[corners.ravel()]
    np.minimum.at(low, own.ravel(), places)
    np.maximum.at(high, own.ravel(), places)
    unused = ~np.isfinite(low).all(axis=1)
    low[unused] = high[unused] = points_now(sim)[unused]
    apart = np.flatnonzero((high - low).max(axis=1) > 1e-6 * np.ptp(places, axis=0).max())
    return low, int(apart[0]) if len(apart) else -1


def surface_at(sim: Usd.Prim, time: Usd.TimeCode) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All points of a TetMesh, and the triangles around its tetrahedra: counts and indices, faces outwards."""
    points = _points(UsdGeom.PointBased(sim).GetPointsAttr().Get(time))
    start = points_now(sim)
    faces, _ = tets.boundary(tets.oriented(start, tet_indices(sim)))
    return points, np.full(len(faces), 3), faces.ravel()


# ---------------------------------------------------------------------------------------------------- mass and material


def material_at(prim: Usd.Prim) -> Usd.Prim | None:
    """The material bound for physics, else for all purposes, that has a schema of physics."""
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
    applied = standard.apis(material.GetPrim()) if material else ()
    return material.GetPrim() if any(api in applied for api in standard.MATERIALS) else None


def subset_materials(sim: Usd.Prim) -> list[tuple[np.ndarray, Usd.Prim]]:
    """Tetrahedra and material of each GeomSubset that binds one."""
    found = []
    for child in sim.GetChildren():
        subset = UsdGeom.Subset(child) if child.IsA(UsdGeom.Subset) else None
        if not subset or subset.GetElementTypeAttr().Get() != "tetrahedron":
            continue
        material = material_at(child)
        if material and subset.GetFamilyNameAttr().Get() == "materialBind":
            indices = np.asarray(subset.GetIndicesAttr().Get(first_time(sim.GetStage())) or (), np.int64)
            found.append((indices, material))
    return found


def main_material(sim: Usd.Prim) -> Usd.Prim | None:
    """The material whose elastic values count: that of most tetrahedra."""
    subsets, whole = subset_materials(sim), material_at(sim)
    if not subsets:
        return whole
    rest = len(tet_indices(sim)) - sum(len(indices) for indices, _ in subsets)
    _, material = max(subsets, key=lambda pair: len(pair[0]))
    largest = max(len(indices) for indices, _ in subsets)
    return whole if whole and rest >= largest else material


def collision_geometry(body: Body) -> list[Usd.Prim]:
    """The prims of a body that its schemas make take part in collisions."""
    time = first_time(body.prim.GetStage())
    parts = [body.sim, *members(body)]
    return [
        prim
        for prim in dict.fromkeys(parts)
        if standard.has(prim, standard.COLLISION) and standard.value(prim, standard.COLLISION_ENABLED, time, True)
    ]


def masses_of(sim: Usd.Prim) -> tuple[np.ndarray, str]:
    """The array of masses and what one belongs to: constant, tetrahedron, point; empty where it is not authored."""
    time = first_time(sim.GetStage())
    masses = np.asarray(standard.value(sim, standard.MASSES, time, ()), float)
    kind = str(standard.value(sim, standard.MASSES_OF, time, "") or "")
    if len(masses) and not kind and len(masses) == len(points_now(sim)):
        kind = "point"  # files of June 2026 do not say
    return masses, kind


def element_masses(body: Body, volumes: np.ndarray, units: tuple[float, float]) -> tuple[np.ndarray, str]:
    """(m,) mass of each tetrahedron [kg] and where it comes from. volumes: (m,) at rest [m^3].

    units: metres and kilograms of the stage's units.
    """
    meters, kilograms = units
    time = first_time(body.prim.GetStage())
    masses, kind = masses_of(body.sim)
    if len(masses):
        source = f"physics:masses ({kind}) of {body.sim.GetPath()}"
        if kind == "tetrahedron":
            return masses * kilograms, source
        if kind == "point":
            corners = tet_indices(body.sim)
            around = np.bincount(corners.ravel(), np.repeat(volumes / 4.0, 4), len(masses))
            shares = masses / np.where(around > 0.0, around, 1.0)
            return volumes / 4.0 * sum(shares[corners[:, k]] for k in range(4)) * kilograms, source
        return masses.sum() * kilograms * volumes / volumes.sum(), source
    mass = standard.number(body.prim, standard.MASS, time)
    if mass is not None:
        return mass * kilograms * volumes / volumes.sum(), f"physics:mass of {body.prim.GetPath()}"
    density = standard.number(body.prim, standard.DENSITY, time)
    factor = kilograms / meters**3
    if density is not None:
        return density * factor * volumes, f"physics:density of {body.prim.GetPath()}"
    return _by_materials(body, volumes, factor)


def _by_materials(body: Body, volumes: np.ndarray, factor: float) -> tuple[np.ndarray, str]:
    time, densities = first_time(body.prim.GetStage()), np.full(len(volumes), np.nan)
    sources = []
    for part, material in [(slice(None), material_at(body.sim)), *subset_materials(body.sim)]:
        density = standard.number(material, standard.DENSITY, time) if material else None
        if density is not None:
            densities[part] = density * factor
            sources.append(f"physics:density of {material.GetPath()}")
    if np.isnan(densities).any():
        densities = np.where(np.isnan(densities), standard.DENSITY_FALLBACK, densities)
        sources.append("the standard's fallback")
    return densities * volumes, " and ".join(dict.fromkeys(sources))


def elastic_source(prim: Usd.Prim, name: str) -> Usd.Attribute | None:
    """The attribute of a material that gives E or nu of the prim at which it is bound; None where none is authored."""
    material = main_material(prim) if prim.IsA(UsdGeom.TetMesh) else material_at(prim)
    found = standard.attribute(material, name) if material else None
    if found is None or found.Get(first_time(prim.GetStage())) == float("-inf"):
        return None
    return found
