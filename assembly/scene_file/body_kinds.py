"""What stands in a scene file of bodies: their surfaces, curves, loops, faces, pictures, and frames on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import Loop
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.kinematics.picture_mesh import PictureMesh
from assembly.kinematics.pose import Pose
from assembly.scene_file.fields import each, flag, number, or_null, table, text, vector, whole
from assembly.scene_file.records import Field, Listed, OrNull, Parts, Plain, Record
from assembly.scene_file.references import BODY_NAME, Index

__all__ = ["BODY", "FACE", "FRAME", "LOOP", "NAME", "NUMBER", "NUMBERS", "POSE", "SURFACE", "SURFACE_INDEX", "VECTOR"]

# Axes of a frame are unit vectors at right angles to this; nine digits of a decimal do.
RIGHT_ANGLES = 1e-9


class _BodyFace(Index):
    """The index of a face; files of version 1 have the face itself."""

    def read(self, path: str, value: Any, parts: Parts) -> Face:
        face: Face = FACE.read(path, value, parts) if parts.version == 1 else super().read(path, value, parts)
        return face


def _array(values: Sequence[Any]) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def to_list(array: NDArray[np.float64]) -> list[Any]:
    """Numbers of an array, nested as its axes are."""
    values: list[Any] = array.tolist()
    return values


def _read_axes(path: str, value: Any) -> NDArray[np.float64]:
    """Columns x, y, z of what stands as rows in a file; right to the bit, so not normalized."""
    rows = _array(each(path, value, vector, 3))
    # Lengths first: squares of large numbers overflow.
    if not (np.abs(rows).max() < 2.0 and np.abs(rows @ rows.T - np.eye(3)).max() <= RIGHT_ANGLES):
        raise InputError(f"{path} is {rows.tolist()}; expected unit vectors x, y, z at right angles")
    if not np.linalg.det(rows) > 0.0:
        raise InputError(f"{path} is {rows.tolist()}, left-handed; expected z = x cross y")
    return _array(rows.T.tolist())


NUMBER = Plain(number)
NUMBERS = Plain(table(1), to_list)
VECTOR = Plain(vector, to_list)
SURFACE_INDEX = Index("surfaces")
FRAME = Record(
    Frame,
    Field("body", BODY_NAME),
    Field("origin", Plain(lambda path, value: _array(vector(path, value)), to_list)),
    Field("axes", Plain(_read_axes, lambda array: array.T.tolist())),
)
POSE = Record(Pose, Field("position", NUMBERS), Field("quaternion", NUMBERS))
NAME = Field("name", Plain(text))
SURFACE = Record(
    NurbsSurface,
    Field("name", Plain(or_null(text))),
    Field("degree", Plain(lambda path, value: each(path, value, whole, 2), list)),
    Field(
        "knots",
        Plain(lambda path, value: each(path, value, table(1), 2), lambda knots: [*map(to_list, knots)]),
    ),
    Field("control_points", Plain(table(3), to_list)),
    Field("weights", Plain(table(2), to_list)),
)
CURVE = Record(
    NurbsCurve,
    Field("name", Plain(or_null(text))),
    Field("degree", Plain(whole)),
    Field("knots", NUMBERS),
    Field(
        "control_points",
        Plain(lambda path, value: each(path, value, lambda at, pair: each(at, pair, number, 2)), to_list),
    ),
    Field("weights", NUMBERS),
)
LOOP = Record(
    Loop,
    Field("tolerance", NUMBER),
    Field("curves", Listed(CURVE)),
    make=lambda tolerance, curves: Loop.unchecked(curves, tolerance, None, "curves"),
)
COLOR = Field("color", Plain(or_null(vector), lambda color: None if color is None else list(color)), since=2)
FACE = Record(
    Face,
    Field("surface", SURFACE_INDEX),
    Field("name", Plain(or_null(text))),
    Field("reversed", Plain(flag)),
    COLOR,
    Field("outer", OrNull(LOOP), since=2),
    Field("holes", Listed(LOOP), since=2),
)
PICTURE = Record(
    PictureMesh,
    Field("vertices", Plain(table(2), to_list)),
    Field("triangles", Plain(lambda path, value: each(path, value, lambda at, row: each(at, row, whole, 3)), to_list)),
    Field("colors", OrNull(Plain(table(2), to_list))),
)
BODY = Record(
    Body,
    NAME,
    Field("fixed", Plain(flag)),
    Field("position", NUMBERS, "pose.position"),
    Field("quaternion", NUMBERS, "pose.quaternion"),
    COLOR,
    Field("density", NUMBER, since=3),
    Field("picture", OrNull(PICTURE), since=4),
    Field("shape", Listed(_BodyFace("faces")), lambda body: [side.face for side in body.faces]),
    make=lambda shape, **others: Body(shape=shape or None, **others),
)
