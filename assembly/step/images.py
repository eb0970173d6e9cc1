"""Parts whose placement mirrors or scales them: images of a part, placed by a rigid motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from assembly.kinematics.pose import Pose, axes_quaternion
from assembly.step.occt import occt, parts
from assembly.step.profiles import Unreadable

__all__ = ["image_of", "placement_of"]

_Said = TypeVar("_Said")
# How far columns of a matrix may be from those of a rotation, and a factor from one.
_RIGID = 1e-9


def placement_of(location: Any, scale: float = 1.0) -> tuple[Pose, float]:
    """A pose, and the factor by which the part is scaled about its origin before; of a mirror image it is negative.

    Every mirror image is the image in a point, turned.

    Parameters
    ----------
    location
        TopLoc_Location.
    scale : float
        Our unit of length in one of the location's.

    Raises
    ------
    Unreadable
        The location shears, or scales by nothing.
    """
    if location.IsIdentity():
        return Pose(), 1.0
    transform = location.Transformation()
    rows = np.array([[transform.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)])
    factor = float(np.cbrt(np.linalg.det(rows[:, :3])))
    if abs(abs(factor) - 1.0) <= _RIGID:
        factor = float(np.sign(factor))
    if factor == 0.0 or not np.isfinite(factor):
        raise Unreadable("its placement has no volume")
    turn = rows[:, :3] / factor
    if np.abs(turn.T @ turn - np.eye(3)).max() > _RIGID:
        raise Unreadable("its placement shears it, which neither a rigid body nor a mirror image does")
    return Pose(scale * rows[:, 3], axes_quaternion(turn)), factor


def image_of(shape: Any, said: Callable[[Any], _Said], factor: float) -> tuple[Any, Callable[[Any], _Said]]:
    """A shape scaled about its origin, and what is said of it and of its faces.

    Where its own location in the part mirrors or scales, its image is what stands there: OCCT leaves faces of a shape
    that is mirrored by its location with their sides as they were.
    """
    own = shape.Location().Transformation()
    is_rigid = abs(own.ScaleFactor() - 1.0) <= _RIGID
    if factor == 1.0 and is_rigid:
        return shape, said
    o = occt()
    transform = o.gp_Trsf()
    transform.SetScale(o.gp_Pnt(0.0, 0.0, 0.0), factor)
    source = shape
    if not is_rigid:
        source = shape.Located(o.TopLoc_Location())
        transform.Multiply(own)
    made = o.BRepBuilderAPI_Transform(source, transform, True).Shape()
    images = o.ShapeMap()
    originals = []
    # Faces of an image are in the order of those of the shape.
    for face, its in zip([made, *parts(made, o.TopAbs_FACE)], [shape, *parts(shape, o.TopAbs_FACE)], strict=True):
        if not images.FindIndex(face):
            images.Add(face)
            originals.append(its)
    return made, lambda one: said(originals[images.FindIndex(one) - 1])
