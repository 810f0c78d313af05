"""Where a mesh is at a time: its points as UsdGeom and UsdSkel compose them, and what animates them."""

from __future__ import annotations

import math

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdSkel


class PoseError(Exception):
    """The skinning of a mesh cannot be computed; the message says why."""


class Pose:
    """A solid over time: the point cache, blend shapes and skinning of its mesh, and the transforms above it.

    own_points: the solid is the Mesh prim itself; False where its points come from a file, which nothing deforms.
    """

    def __init__(self, prim: Usd.Prim, own_points: bool) -> None:
        self.prim = prim
        self.own_points = own_points
        self._cache = UsdSkel.Cache()
        self._skinning, self._skeleton = self._find_binding() if own_points else (None, None)

    def _find_binding(self) -> tuple[UsdSkel.SkinningQuery | None, UsdSkel.SkeletonQuery | None]:
        root = UsdSkel.Root.Find(self.prim)
        if not root:
            return None, None
        predicate = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
        self._cache.Populate(root, predicate)
        for binding in self._cache.ComputeSkelBindings(root, predicate):
            for query in binding.GetSkinningTargets():
                if query.GetPrim() == self.prim and (query.HasJointInfluences() or query.HasBlendShapes()):
                    return query, self._cache.GetSkelQuery(binding.GetSkeleton())
        return None, None

    @property
    def skeleton(self) -> str:
        """Path of the skeleton that poses the mesh, '' for none."""
        return str(self._skeleton.GetPrim().GetPath()) if self._skeleton else ""

    @property
    def has_blend_shapes(self) -> bool:
        """Whether blend shapes take part."""
        return bool(self._skeleton and self._skinning.HasBlendShapes())

    def idle_skinning(self) -> str:
        """Why the joint weights or blend shapes that the mesh has do nothing; '' where they act, or it has none."""
        names = ("primvars:skel:jointIndices", "skel:blendShapes")
        has = any(a and a.HasAuthoredValue() for a in map(self.prim.GetAttribute, names))
        if not self.own_points or not has or self._skeleton:
            return ""
        root, parent = UsdSkel.Root.Find(self.prim), self.prim.GetParent()
        if not root:
            return "there is no SkelRoot above it"
        while parent != root.GetPrim():
            if not parent.IsA(UsdGeom.Imageable):
                kind = parent.GetTypeName() or "prim without a type"
                return f"{parent.GetPath()}, between it and its SkelRoot, is a {kind}; make it an Xform or a Scope"
            if parent.IsA(UsdGeom.Gprim):
                return f"{parent.GetPath()}, above it, is a {parent.GetTypeName()}; USD applies no skinning below one"
            parent = parent.GetParent()
        if not UsdSkel.BindingAPI(self.prim).GetInheritedSkeleton():
            return "no skel:skeleton is bound to it or above it"
        return "USD does not apply them"

    def points(self, time: Usd.TimeCode) -> np.ndarray:
        """(n, 3) float64 in the prim's local space. Raises PoseError."""
        points = UsdGeom.PointBased(self.prim).GetPointsAttr().Get(time)
        if points and self._skeleton:
            try:
                self._apply_blend_shapes(points, time)
                skinned = self._skin(points, time)
            except Tf.ErrorException as error:
                raise PoseError(error.args[0].commentary if error.args else "unknown fault") from error
            if skinned:
                x, m = np.asarray(points, np.float64), self._skeleton_to_local(time)
                return x[:, 0:1] * m[0, :3] + x[:, 1:2] * m[1, :3] + x[:, 2:3] * m[2, :3] + m[3, :3]
        return np.asarray(points or (), np.float64).reshape(-1, 3)

    def _apply_blend_shapes(self, points: object, time: Usd.TimeCode) -> None:
        """Adds the offsets of the shapes, in place."""
        animation = self._skeleton.GetAnimQuery()
        if not (self.has_blend_shapes and animation):
            return
        weights = animation.ComputeBlendShapeWeights(time)
        if weights is None:
            return
        mapper = self._skinning.GetBlendShapeMapper()
        weights = mapper.Remap(weights) if mapper else weights
        shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(self.prim))
        fractions, shape, subshape = shapes.ComputeSubShapeWeights(weights)
        indices, offsets = shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets()
        if not shapes.ComputeDeformedPoints(fractions, shape, subshape, indices, offsets, points):
            raise PoseError(f"the blend shapes do not match its {len(points)} points")

    def _skin(self, points: object, time: Usd.TimeCode) -> bool:
        """Moves points by the joints, in place, into the skeleton's space; False where no joint holds them."""
        if not self._skinning.HasJointInfluences():
            return False
        transforms = self._skeleton.ComputeSkinningTransforms(time)
        if not transforms or not self._skinning.ComputeSkinnedPoints(transforms, points, time):
            raise PoseError(f"the joints of {self.skeleton}, their weights and its {len(points)} points do not match")
        return True

    def _skeleton_to_local(self, time: Usd.TimeCode) -> np.ndarray:
        cache = UsdGeom.XformCache(time)
        to_world = cache.GetLocalToWorldTransform(self._skeleton.GetPrim())
        return np.array(to_world * cache.GetLocalToWorldTransform(self.prim).GetInverse())

    def has_faces(self, time: Usd.TimeCode, counts: np.ndarray, indices: np.ndarray) -> bool:
        """Whether the faces at a time are these: only then are points with the same number the same points."""
        mesh = UsdGeom.Mesh(self.prim)
        now = mesh.GetFaceVertexCountsAttr().Get(time), mesh.GetFaceVertexIndicesAttr().Get(time)
        return all(np.array_equal(np.asarray(a or ()), b) for a, b in zip(now, (counts, indices), strict=True))

    def drivers(self, after: float = -math.inf) -> list[str]:
        """What animates the solid in world space, by name; only what has keys later than `after`."""
        found = transform_drivers(self.prim, after)
        mesh = UsdGeom.Mesh(self.prim)
        attributes = {
            "its points": [mesh.GetPointsAttr()],
            "its faces": [mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()],
        }
        for name, parts in attributes.items() if self.own_points else ():
            if any(part.ValueMightBeTimeVarying() and _goes_on(part.GetTimeSamples(), after) for part in parts):
                found.append(name)
        if self._skeleton:
            found += transform_drivers(self._skeleton.GetPrim(), after)
            found += self._skeleton_drivers(self._skeleton.GetAnimQuery(), after)
        return list(dict.fromkeys(found))

    def _skeleton_drivers(self, animation: UsdSkel.AnimQuery, after: float) -> list[str]:
        found = []
        if not animation:
            return found
        joints, shapes = animation.GetJointTransformTimeSamples(), animation.GetBlendShapeWeightTimeSamples()
        moves = self._skinning.HasJointInfluences() and animation.JointTransformsMightBeTimeVarying()
        if moves and _goes_on(joints, after):
            found.append(f"the joints of {self.skeleton}")
        if self.has_blend_shapes and animation.BlendShapeWeightsMightBeTimeVarying() and _goes_on(shapes, after):
            found.append("its blend shapes")
        return found


def transform_drivers(prim: Usd.Prim, after: float = -math.inf) -> list[str]:
    """The animated transforms above a prim, its own included, by name; only those with keys later than `after`."""
    found = []
    while prim and not prim.IsPseudoRoot():
        xform = UsdGeom.Xformable(prim)
        if xform and xform.TransformMightBeTimeVarying() and _goes_on(xform.GetTimeSamples(), after):
            found.append(f"the transform of {prim.GetPath()}")
        if xform and xform.GetResetXformStack():
            break
        prim = prim.GetParent()
    return found


def _goes_on(samples: list[float], after: float) -> bool:
    """Whether there are keys later than `after`; an animation without samples (a spline) counts as endless."""
    return not samples or max(samples) > after
