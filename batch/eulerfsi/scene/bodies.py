"""Bodies of a scene: solids where they start and how they move then, pins, colliders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi_usd import deform, given, gprims, standard
from eulerfsi_usd.deformable_checks import LARGEST_POISSON
from eulerfsi_usd.deformables import elastic_source, material_at
from eulerfsi_usd.issues import instance_above
from eulerfsi_usd.physics import friction_of
from eulerfsi_usd.pose import Pose, PoseError
from eulerfsi_usd.subdivide import Refinement, is_smooth, levels_for, scheme_of
from pxr import Usd, UsdGeom

from ..errors import Cancelled, LibraryError, SceneError
from ..progress import Progress, Waiting
from ..reasons import NO_VOLUME, mesh_reason
from ..signals import Signals
from ..solver import binding
from ..solver import simulation as solver
from .motion import fit_rigid_motion, volume_center
from .parts import Collider, Deformation, Emitter, Motion, Passenger, Pin, Solid
from .space import SimulationSpace, determinant, orthonormal_rows, transform_points, transform_vectors
from .values import Reader

DEFAULT_DENSITY = 1000.0  # kg/m^3


def read_solid(reader: Reader, space: SimulationSpace, prim: Usd.Prim) -> Solid:
    """Surface, placement and values; the mesh is not examined yet and the density is missing."""
    path = str(prim.GetPath())
    if prim.IsInstanceProxy():
        instance = instance_above(prim).GetPath()
        raise SceneError(
            f"{path}: a solid inside an instance cannot have its own points; set instanceable = false on {instance}"
        )
    local, file, pose = _surface(reader, prim)
    to_sim = space.from_local(reader.local_to_world(prim))
    handedness = determinant(to_sim)
    if handedness == 0:
        raise SceneError(f"{path}: the transform of the solid has a zero scale")
    mesh = solver.Mesh(transform_points(local.points, to_sim), local.counts, local.indices)
    is_mesh = prim.IsA(UsdGeom.Mesh)
    left_handed = is_mesh and not file and reader.authored(prim, "orientation") == UsdGeom.Tokens.leftHanded
    if left_handed != (handedness < 0):
        mesh = mesh.flipped()  # outward faces stay outward
    values = read_values(reader, prim, "solid")
    origins = read_elastic(reader, prim, prim, values)
    animated = _animated_motion(reader, space, pose, local, mesh)
    values["velocity"], values["angular_velocity"] = _initial_motion(reader, space, prim, values, animated)
    subdivision = "none" if file else scheme_of(prim)
    output = path if is_mesh else _free_child(prim, "surface")
    start = _describe_start(reader, pose, animated, values)
    solid = Solid(path, output, mesh, local, values, None, file, subdivision, left_handed, start, origins=origins)
    if refinement := None if file else _refinement(reader, prim, mesh):
        _use_smooth_surface(solid, refinement, to_sim, left_handed != (handedness < 0))
    return solid


def _use_smooth_surface(solid: Solid, refinement: Refinement, to_sim: np.ndarray, flip: bool) -> None:
    """The limit surface is simulated, the points of the cage are carried along."""
    solid.cage = Passenger(
        path=solid.path,
        local=solid.local,
        subdivision=solid.subdivision,
        left_handed=solid.left_handed,
        solid=solid.path,
        mesh=solid.mesh,
        is_cage=True,
    )
    points = refinement.points(solid.local.points.astype(float))
    solid.local = solver.Mesh(points, refinement.counts, refinement.indices)
    mesh = solver.Mesh(transform_points(points, to_sim), refinement.counts, refinement.indices)
    solid.mesh = mesh.flipped() if flip else mesh
    solid.refinement, solid.output_path = refinement, ""


def _refinement(reader: Reader, prim: Usd.Prim, mesh: solver.Mesh) -> Refinement | None:
    """Of a cage, as fine as the grid. mesh: the cage in simulation space."""
    if not reader.voxel or not is_smooth(prim):
        return None
    ends = np.cumsum(mesh.counts)
    following = np.arange(1, len(mesh.indices) + 1)
    following[ends - 1] = ends - mesh.counts
    edges = mesh.points[mesh.indices[following]].astype(float) - mesh.points[mesh.indices]
    longest = float(np.sqrt((edges * edges).sum(axis=1)).max(initial=0.0))
    return Refinement(prim, reader.time, len(mesh.points), levels_for(longest, reader.voxel, len(mesh.counts)))


def _surface(reader: Reader, prim: Usd.Prim) -> tuple[solver.Mesh, str, Pose]:
    """The prim's surface in its local space, posed as it starts, the file that it came from ('' for none), its pose."""
    path = str(prim.GetPath())
    asset = reader.authored(prim, "eulerfsi:surfaceFile")
    if asset is not None and asset.path:
        file = asset.resolvedPath or asset.path
        if not Path(file).is_file():
            raise SceneError(f"{path}: eulerfsi:surfaceFile = {asset.path}: no such file")
        try:
            return solver.load_mesh(file), file, Pose(prim, own_points=False)
        except LibraryError as error:
            raise SceneError(f"{path}: eulerfsi:surfaceFile = {asset.path}: {mesh_reason(file, error)}") from error
    if not prim.IsA(UsdGeom.Mesh):
        raise SceneError(f"{path}: a {prim.GetTypeName() or 'typeless'} prim needs eulerfsi:surfaceFile; or use a Mesh")
    pose, points, counts, indices = posed_mesh(reader, prim)
    if not len(points) or not counts or not indices:
        raise SceneError(f"{path}: the mesh has no points or no faces at frame {reader.time.GetValue():g}")
    return solver.Mesh(points, np.array(counts), np.array(indices)), "", pose


def posed_mesh(reader: Reader, prim: Usd.Prim) -> tuple[Pose, Any, Any, Any]:
    """The pose of a Mesh, its points in it, and its faces: counts and indices, None where nothing is authored."""
    geom, pose = UsdGeom.Mesh(prim), Pose(prim, own_points=True)
    try:
        points = pose.points(reader.time)
    except PoseError as error:
        raise SceneError(f"{prim.GetPath()}: skel:skeleton = {pose.skeleton}: cannot be applied: {error}") from error
    counts = geom.GetFaceVertexCountsAttr().Get(reader.time)
    return pose, points, counts, geom.GetFaceVertexIndicesAttr().Get(reader.time)


def closed_mesh(reader: Reader, space: SimulationSpace, prim: Usd.Prim) -> solver.Mesh:
    """The surface of a Gprim where it is at the start, in simulation space, faces outwards."""
    return closed_surface(reader, space, prim)[0]


def closed_surface(reader: Reader, space: SimulationSpace, prim: Usd.Prim) -> tuple[solver.Mesh, Refinement | None]:
    """The same, and how a cage is refined to it."""
    path = str(prim.GetPath())
    try:
        local = solver.Mesh(*gprims.surface_of(prim, reader.time))
    except (PoseError, ValueError) as error:
        raise SceneError(f"{path}: {error}") from error
    to_sim = space.from_local(reader.local_to_world(prim))
    handedness = determinant(to_sim)
    if handedness == 0:
        raise SceneError(f"{path}: its transform has a zero scale")
    mesh = solver.Mesh(transform_points(local.points, to_sim), local.counts, local.indices)
    left_handed = prim.IsA(UsdGeom.Mesh) and reader.authored(prim, "orientation") == UsdGeom.Tokens.leftHanded
    refinement = _refinement(reader, prim, mesh)
    if refinement:
        points = refinement.points(local.points.astype(float))
        mesh = solver.Mesh(transform_points(points, to_sim), refinement.counts, refinement.indices)
    return mesh.flipped() if left_handed != (handedness < 0) else mesh, refinement


def read_pins(reader: Reader, space: SimulationSpace, solid: Usd.Prim, first: int, path: str = "") -> list[Pin]:
    """What holds parts of a solid: its volumes, and the vertices that its primvar marks. path: of the solid, else its
    prim's."""
    stage, path = solid.GetStage(), path or str(solid.GetPath())
    pins = []
    for target in given.targets(solid, given.PINS):
        motion = Motion(str(target), stage, space, first)
        mesh = closed_mesh(reader, space, stage.GetPrimAtPath(target))
        pins.append(Pin(str(target), path, motion, mesh=mesh))
    held = given.pinned_vertices(solid, reader.time)
    if held is not None:
        driver = next((str(target) for target in given.targets(solid, given.PIN_TO)), "")
        pins.append(Pin(str(solid.GetPath()), path, Motion(driver, stage, space, first), vertices=held))
    return pins


def read_collider(reader: Reader, space: SimulationSpace, prim: Usd.Prim, first: int) -> Collider:
    path, stage, shape = str(prim.GetPath()), prim.GetStage(), None
    mesh, refinement = closed_surface(reader, space, prim)
    stretched = deform.stretches(prim)
    try:
        if stretched or deform.points_move(prim):
            shape = Deformation(path, stage, space, first, stretched, refinement)
    except PoseError as error:
        raise SceneError(f"{path}: {error}") from error
    motion = Motion("" if stretched else path, stage, space, first)
    return Collider(path, mesh, read_values(reader, prim, "collider"), motion, shape, refinement)


def examine(body: Solid | Pin | Collider | Emitter, domain: dict[str, Any], threads: int, progress: Progress) -> None:
    """Adds the surface that the library makes of the mesh; of a solid also that of where it starts."""
    body.surface = _surface_of(body, body.mesh, domain, threads, progress)
    if isinstance(body, Solid):
        stretched = body.values["stretch"] != [1.0, 1.0, 1.0]
        body.start = body.surface
        if body.tets and body.tets.deforms:
            start = solver.Mesh(body.tets.start, body.mesh.counts, body.mesh.indices)
            body.start = _surface_of(body, start, domain, threads, progress)
        elif stretched:
            body.start = _surface_of(body, _stretched(body, domain), domain, threads, progress)


def _surface_of(
    solid: Solid | Pin | Collider | Emitter,
    mesh: solver.Mesh,
    domain: dict[str, Any],
    threads: int,
    progress: Progress,
) -> solver.Surface:
    """A mesh as the library examines it; in a 2-D scene what of a solid or collider lies in the slab."""
    waiting, signals = Waiting(progress, "examining the surface", solid.path), Signals()

    def stop(fraction: float) -> bool:
        waiting.at(fraction)
        return bool(signals.number)

    try:
        with signals.installed():
            surface = solver.Surface(mesh, domain["voxel_size"], threads, stop)
        axis = solver.slab_axis(domain)
        if axis is None or isinstance(solid, (Pin, Emitter)):
            return surface
        low = domain["domain_min"][axis]
        return surface.extrude_in_slab(axis, low, low + domain["voxel_size"])
    except LibraryError as error:
        if error.status == binding.ERROR_CANCELLED:
            raise Cancelled(signals.number) from error
        source = getattr(solid, "surface_file", "")
        file = f"{source}: " if source else ""
        reason = mesh_reason(source, error)
        if isinstance(solid, Collider) and reason.startswith(NO_VOLUME):
            reason = f"{NO_VOLUME}; {given.THICKNESS_OR_PLANE}"
        raise SceneError(f"{solid.path}: {file}{reason}") from error


def _stretched(solid: Solid, domain: dict[str, Any]) -> solver.Mesh:
    """The solid's surface where it starts, as the library stretches it; in a 2-D scene about what lies in the slab."""
    mesh, factors, inside = solid.mesh, solid.values["stretch"], solid.mesh.points.copy()
    if (axis := solver.slab_axis(domain)) is not None:
        low = domain["domain_min"][axis]
        inside[:, axis] = np.clip(inside[:, axis], low, low + domain["voxel_size"])
    center = volume_center(inside, mesh.triangles())
    return solver.Mesh(center + (mesh.points - center) * factors, mesh.counts, mesh.indices)


def _free_child(prim: Usd.Prim, name: str) -> str:
    """Path of a child that the prim does not have yet."""
    number, candidate = 1, name
    while prim.GetStage().GetPrimAtPath(prim.GetPath().AppendChild(candidate)):
        number, candidate = number + 1, f"{name}{number}"
    return str(prim.GetPath().AppendChild(candidate))


def read_density(reader: Reader, prim: Usd.Prim, volume: float) -> float:
    """[kg/m^3]: physics:mass over the volume, else physics:density, else that of the physics material, else 1000."""
    to_si = reader.units.factor("kg^1 m^-3")
    mass, density = reader.authored(prim, "physics:mass"), reader.authored(prim, "physics:density")
    if mass is not None and mass != 0:  # UsdPhysics: 0 is "not given"
        return mass * reader.units.kilograms_per_unit / volume
    if density is None:
        material = material_at(prim)
        density = reader.authored(material, "physics:density") if material else None
    return density * to_si if density else DEFAULT_DENSITY


def read_values(reader: Reader, prim: Usd.Prim, scope: str, body: Usd.Prim | None = None) -> dict[str, Any]:
    """The values of a body in SI; the friction is that of its physics material where none is authored on it.

    body: of the standard, whose attributes of ours are those of `prim`.
    """
    values, friction = reader.fields(prim, scope), friction_of(body or prim)
    if friction:
        values["friction"] = float(friction.Get(reader.time))
    return values


def read_elastic(
    reader: Reader, prim: Usd.Prim, bound: Usd.Prim, values: dict[str, Any], of_standard: bool = False
) -> dict[str, str]:
    """Sets E and nu to those of the physics material where attributes of ours are not authored. Returns which counted.

    bound: the prim at which the material is bound. of_standard: without any of both, the standard's fallback counts.
    """
    fallbacks = (standard.YOUNGS_MODULUS_FALLBACK, standard.POISSONS_RATIO_FALLBACK)
    pascal = reader.units.kilograms_per_unit / reader.units.meters_per_unit
    origins = {}
    for name, field, symbol, unit, fallback in (
        (standard.YOUNGS_MODULUS, "youngs_modulus", "E", pascal, fallbacks[0]),
        (standard.POISSONS_RATIO, "poissons_ratio", "nu", 1.0, fallbacks[1]),
    ):
        source = elastic_source(bound, name)
        if reader.authored(prim, f"eulerfsi:{name}") is not None:
            if source or of_standard:
                origins[symbol] = f"eulerfsi:{name} of {prim.GetPath()}"
            continue
        if source:
            values[field] = float(source.Get(reader.time)) * unit
            origins[symbol] = f"physics:{name} of {source.GetPrimPath()}"
        elif of_standard:
            values[field], origins[symbol] = fallback, "the standard's fallback"
        if source and field == "poissons_ratio":
            values[field] = min(values[field], LARGEST_POISSON)
    return origins


def _initial_motion(
    reader: Reader,
    space: SimulationSpace,
    prim: Usd.Prim,
    values: dict[str, Any],
    animated: tuple[np.ndarray, np.ndarray],
) -> tuple[list[float], list[float]]:
    """Velocity [m/s] and angular velocity [rad/s] in simulation axes.

    eulerfsi: attributes are in world axes; PhysicsRigidBodyAPI's, used where those are not authored, in local axes;
    where neither is, the motion of the animation.
    """
    linear = reader.local_to_world(prim)[:3, :3]
    velocity, angular = animated
    rigid_velocity = reader.authored(prim, "physics:velocity")
    if reader.authored(prim, "eulerfsi:velocity") is not None:
        velocity = space.vector_to_sim(values["velocity"])
    elif rigid_velocity is not None:
        velocity = space.vector_to_sim(transform_vectors(rigid_velocity, linear)) * reader.units.meters_per_unit
    rigid_angular = reader.authored(prim, "physics:angularVelocity")
    if reader.authored(prim, "eulerfsi:angularVelocity") is not None:
        angular = space.vector_to_sim(values["angular_velocity"])
    elif rigid_angular is not None:
        # An axial vector: a mirror image turns the other way.
        turn = np.copysign(1.0, determinant(linear))
        turning = transform_vectors(np.radians(np.array(rigid_angular, float)), orthonormal_rows(linear)) * turn
        angular = space.vector_to_sim(turning)
    return velocity.tolist(), angular.tolist()


def _animated_motion(
    reader: Reader, space: SimulationSpace, pose: Pose, local: solver.Mesh, mesh: solver.Mesh
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity [m/s] of the centre of volume and angular velocity [rad/s] that the animation has at the start.

    They come from the frame before and the frame after, where it moves in both; from the one in which it moves where it
    stands still in the other: an animation may begin or end at the start.
    """
    if not pose.drivers():
        return np.zeros(3), np.zeros(3)

    def surface(frame: float) -> np.ndarray | None:
        """None where the mesh is another one then, or none at all."""
        at = Reader(reader.units, Usd.TimeCode(frame))
        if not pose.own_points:
            points = local.points
        elif not pose.has_faces(at.time, local.counts, local.indices):
            return None
        else:
            points = pose.points(at.time)
        matrix = at.local_to_world(pose.prim)
        whole = len(points) == len(local.points) and np.isfinite(points).all() and np.isfinite(matrix).all()
        return transform_points(points, space.from_local(matrix)) if whole and determinant(matrix) != 0 else None

    now = reader.time.GetValue()
    poses = {frame: surface(frame) for frame in (now - 1, now, now + 1)}
    poses = {frame: points for frame, points in poses.items() if points is not None}
    times = [frame for frame, points in poses.items() if frame == now or not np.array_equal(points, poses[now])]
    if len(times) == 1:
        return np.zeros(3), np.zeros(3)
    seconds = (times[-1] - times[0]) / pose.prim.GetStage().GetTimeCodesPerSecond()
    triangles = mesh.triangles()
    center = volume_center(mesh.points, triangles)
    return fit_rigid_motion(poses[times[0]], poses[times[-1]], triangles, seconds, center)


def _describe_start(reader: Reader, pose: Pose, animated: tuple[np.ndarray, np.ndarray], values: dict[str, Any]) -> str:
    """What gives a solid its pose and motion at the start, for people; '' where nothing but the mesh does."""
    sources = [f"skinned by {pose.skeleton}"] if pose.skeleton else []
    sources += ["blend shapes"] if pose.has_blend_shapes else []
    sources += [f"animated by {' and '.join(pose.drivers())}"] if pose.drivers() else []
    if not sources:
        return ""
    text = f"starts from its pose at frame {reader.time.GetValue():g} ({', '.join(sources)})"
    if pose.drivers() and not any(motion.any() for motion in animated):
        return f"{text}, although its animation has no motion there"
    for name, unit, motion in zip(("velocity", "angular_velocity"), ("m/s", "rad/s"), animated, strict=True):
        if motion.any():
            kept = values[name] == motion.tolist()
            vector = ", ".join(f"{component:.4g}" for component in np.round(values[name], 9) + 0.0)
            text += f"; {name.replace('_', ' ')} ({vector}) {unit} {'of the animation' if kept else 'as authored'}"
    return text
