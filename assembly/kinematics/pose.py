"""Poses and the algebra of their quaternions.

A quaternion e = (w, x, y, z) rotates a vector by the rotation of e / |e|:

    R(e) v = ((w^2 - |u|^2) v + 2 w u x v + 2 u (u.v)) / |e|^2,    u = (x, y, z)

(paper 001, appendix B, normalized). So -e is the same rotation, and derivatives along e itself are zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import hypot, pi, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._copies import FoundAgain
from assembly._read_only import ReadOnlyArrays, read_only
from assembly.errors import InputError, check_coordinates, number, real_array, vector

__all__ = [
    "Pose",
    "PoseLike",
    "angular_velocity_map",
    "axes_quaternion",
    "deg",
    "direction",
    "length",
    "multiply",
    "pose_rows",
    "quaternion_rate_map",
    "retract",
    "rotate",
    "rotate_jacobian",
    "rotation_matrix",
    "rotation_of",
]

Array = NDArray[np.float64]
# A pose, or its row x y z qw qx qy qz.
PoseLike: TypeAlias = "Pose | ArrayLike"
# A degree in radians: `90 * deg` is a right angle.
deg = pi / 180.0
# A body's place where none is given: x y z qw qx qy qz.
IDENTITY_ROW = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
# A quaternion typed to two digits is off by less; a forgotten normalization is off by more.
UNIT_TOLERANCE = 1e-2
# Rounding of a normalization: within it a quaternion is left as it is, so that normalizing twice changes no bit.
UNIT_ROUNDING = 1e-15


def unit_quaternion(name: str, value: ArrayLike) -> Array:
    """The normalized quaternion; raises where it is zero or far from unit."""
    e = vector(name, value, 4)
    norm = hypot(*e)  # np.linalg.norm overflows
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:
        raise InputError(f"{name} is {e.tolist()} with norm {norm:.6g}; expected a unit quaternion (w, x, y, z)")
    return e if abs(norm - 1.0) <= UNIT_ROUNDING else e / norm


def nonzero_quaternion(name: str, value: ArrayLike) -> Array:
    """A quaternion of any length but zero, as it came."""
    e = vector(name, value, 4)
    check_quaternion(name, e.tolist())
    return e


def check_quaternion(name: str, e: list[float]) -> None:
    """Raise where a quaternion has no direction that doubles can tell."""
    # Between these lengths |e|^2 neither vanishes nor overflows.
    if not 1e-150 < hypot(*e) < 1e150:
        raise InputError(f"{name} is {e}; expected a quaternion (w, x, y, z) of a length other than zero")


def pose_row(name: str, value: PoseLike) -> Array:
    """One pose row x y z qw qx qy qz, (7,), its quaternion of any length but zero, as it came; or that of a pose."""
    row = vector(name, value.q if isinstance(value, Pose) else value, 7)
    check_quaternion(f"{name}[3:]", row.tolist()[3:])
    return row


def pose_rows(name: str, value: ArrayLike, count: int | str = "n") -> Array:
    """Pose rows x y z qw qx qy qz, (count, 7), their quaternions normalized as in `unit_quaternion`."""
    rows = real_array(name, value, (count, 7))
    for k, row in enumerate(rows):
        check_coordinates(name, row[:3].tolist(), f"{k}, ")
        row[3:] = unit_quaternion(f"{name}[{k}, 3:]", row[3:])
    return rows


def direction(name: str, value: ArrayLike) -> Array:
    """The unit vector along a vector (3,) of any length but zero."""
    v = vector(name, value)
    largest = float(np.abs(v).max())
    if not largest > 0.0:
        raise InputError(f"{name} is {v.tolist()}; expected a direction other than zero")
    v /= largest  # squares of very short and very long vectors have no doubles
    unit: Array = v / np.linalg.norm(v)
    return unit


def length(v: Array) -> float:
    """Euclidean norm of a vector, where squares of its components vanish or overflow, too."""
    # A power of two changes no bit of what needs none.
    unit = 2.0 ** (np.frexp(np.abs(v).max())[1] - 1)
    return float(unit * np.linalg.norm(v / unit))


def _vectors(name: str, value: ArrayLike, length: int = 3) -> Array:
    """Finite vectors (..., length)."""
    try:
        shape = np.shape(value)[:-1]
    except ValueError:  # rows of different lengths, which real_array reports
        shape = ()
    return real_array(name, value, (*shape, length))


def skew(a: ArrayLike) -> Array:
    """The (3, 3) matrix of the cross product: skew(a) b = a x b."""
    x, y, z = vector("a", a)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """Quaternion product a b, (4,)."""
    e, f = vector("a", a, 4), vector("b", b, 4)
    # In plain floats: np.cross takes ten times as long.
    (a0, a1, a2, a3), (b0, b1, b2, b3) = e.tolist(), f.tolist()
    x = a0 * b1 + b0 * a1 + (a2 * b3 - a3 * b2)
    y = a0 * b2 + b0 * a2 + (a3 * b1 - a1 * b3)
    z = a0 * b3 + b0 * a3 + (a1 * b2 - a2 * b1)
    return np.array([a0 * b0 - float(e[1:] @ f[1:]), x, y, z])


def rotation_matrix(quaternion: ArrayLike) -> Array:
    """Rotation (3, 3) of the normalized quaternion."""
    return rotation_of(nonzero_quaternion("quaternion", quaternion))


def rotation_of(quaternion: Array) -> Array:
    """The same of one that is known to be a quaternion, as that of a solution is, without looking."""
    e = quaternion / sqrt(quaternion @ quaternion)
    u = e[1:]
    w, x, y, z = e.tolist()
    # (w^2 - |u|^2) I + 2 (w [u]x + u u^T) in plain floats: arrays this small take three times the time.
    s = w * w - float(u @ u)
    zero = s * 0.0
    return np.array(
        [
            [s + 2.0 * (x * x), zero + 2.0 * (x * y - w * z), zero + 2.0 * (w * y + x * z)],
            [zero + 2.0 * (w * z + x * y), s + 2.0 * (y * y), zero + 2.0 * (y * z - w * x)],
            [zero + 2.0 * (x * z - w * y), zero + 2.0 * (w * x + y * z), s + 2.0 * (z * z)],
        ]
    )


def rotate(quaternion: ArrayLike, v: ArrayLike) -> Array:
    """The vectors v (..., 3) rotated by the normalized quaternion."""
    rotated: Array = _vectors("v", v) @ rotation_matrix(quaternion).T
    return rotated


def axes_quaternion(axes: ArrayLike) -> Array:
    """Unit quaternion of a rotation matrix (3, 3), its scalar part not negative.

    The eigenvector of Bar-Itzhack's matrix: exact to rounding for every rotation, halves of a turn too.
    """
    m = real_array("axes", axes, (3, 3))
    if not np.abs(m.T @ m - np.eye(3)).max() <= UNIT_TOLERANCE or not np.linalg.det(m) > 0.0:
        raise InputError(f"axes is {m.tolist()}; expected a rotation matrix, columns x, y, z")
    k = np.zeros((4, 4))
    k[1:, 1:] = m + m.T - np.trace(m) * np.eye(3)
    k[0, 0] = np.trace(m)
    k[0, 1:] = k[1:, 0] = (m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])
    e: Array = np.linalg.eigh(k)[1][:, -1]
    return -e if e[0] < 0.0 else e


def angular_velocity_map(quaternion: ArrayLike, body_axes: bool = False) -> Array:
    """G (3, 4) with omega = G(e) e' / |e|^2, omega in world axes, or in body axes on request.

    Paper 001, eq. 17 (body axes; its third row is misprinted). G G^T = 4 |e|^2 I and G e = 0.
    """
    w, x, y, z = nonzero_quaternion("quaternion", quaternion)
    if body_axes:
        return 2.0 * np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    return 2.0 * np.array([[-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]])


def quaternion_rate_map(quaternion: ArrayLike, body_axes: bool = False) -> Array:
    """The inverse (4, 3): e' = G(e)^T omega / 4, the rate that keeps |e|."""
    return 0.25 * angular_velocity_map(quaternion, body_axes).T


def rotate_jacobian(quaternion: ArrayLike, v: ArrayLike) -> Array:
    """d(R(e) v) / de, (3, 4), of the normalized rotation: -[R v]x G(e) / |e|^2.

    Paper 001, eq. 25, with the factor and the term it lacks; radial derivatives are zero.
    """
    e = nonzero_quaternion("quaternion", quaternion)
    jacobian: Array = -skew(rotate(e, vector("v", v))) @ angular_velocity_map(e) / (e @ e)
    return jacobian


def retract(q: ArrayLike, twist: ArrayLike) -> Array:
    """Pose row(s) (..., 7) moved by twist(s) (..., 6): x + dx and exp(dw) e, normalized."""
    row = _vectors("q", q, 7)
    step = real_array("twist", twist, (*row.shape[:-1], 6))
    for e in row[..., 3:].reshape(-1, 4):
        nonzero_quaternion("q[..., 3:]", e)
    w = step[..., 3:]
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    c, s = np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi)
    e0, u = row[..., 3:4], row[..., 4:]
    v = s * w
    turned = np.concatenate([c * e0 - (v * u).sum(-1, keepdims=True), c * u + e0 * v + np.cross(v, u)], axis=-1)
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    return np.concatenate([row[..., :3] + step[..., :3], turned], axis=-1)


@dataclass(frozen=True, eq=False)
class Pose(FoundAgain, ReadOnlyArrays):
    """A rigid placement, body to world: p_w = R(quaternion) p_b + position.

    Parameters
    ----------
    position : (3,)
    quaternion : (4,)
        (w, x, y, z), unit to within a percent; it is normalized.

    Raises
    ------
    InputError
        Not finite, wrong shapes, or a quaternion far from unit.
    """

    position: Array = (0.0, 0.0, 0.0)  # type: ignore[assignment]  # checked and converted below
    quaternion: Array = (1.0, 0.0, 0.0, 0.0)  # type: ignore[assignment]  # likewise

    def __post_init__(self) -> None:
        position = vector("position", self.position)
        quaternion = unit_quaternion("quaternion", self.quaternion)
        position.flags.writeable = quaternion.flags.writeable = False
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quaternion", quaternion)

    @classmethod
    def from_axis_angle(cls, axis: ArrayLike, angle: float, position: ArrayLike = (0.0, 0.0, 0.0)) -> Pose:
        """Rotation by an angle [rad] about an axis, then the position."""
        along = direction("axis", axis)
        half = 0.5 * number("angle", angle)
        return cls(position, np.concatenate([[np.cos(half)], np.sin(half) * along]))  # type: ignore[arg-type]  # likewise

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """The pose of a homogeneous matrix (4, 4), as `matrix` gives it, or of a rotation (3, 3) alone.

        Raises
        ------
        InputError
            The columns x, y, z are not unit vectors at right angles, or the last row is not 0 0 0 1.
        """
        size = 3 if np.shape(matrix) == (3, 3) else 4
        m = real_array("matrix", matrix, (size, size))
        if size == 3:
            return cls(quaternion=axes_quaternion(m))
        if m[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise InputError(
                f"matrix has the last row {m[3].tolist()}; expected 0 0 0 1, the position in the last column"
            )
        return cls(m[:3, 3], axes_quaternion(m[:3, :3]))

    @property
    def q(self) -> Array:
        """The row x y z qw qx qy qz, (7,), read-only."""
        return read_only(np.array(self.row))

    @cached_property
    def row(self) -> tuple[float, ...]:
        """The same as numbers: an array of many poses is made of these in a fraction of the time."""
        return (*self.position.tolist(), *self.quaternion.tolist())

    @property
    def matrix(self) -> Array:
        """Homogeneous (4, 4) matrix, read-only."""
        m = np.eye(4)
        m[:3, :3] = rotation_matrix(self.quaternion)
        m[:3, 3] = self.position
        return read_only(m)

    def apply(self, points: ArrayLike) -> Array:
        """World coordinates of body points (..., 3)."""
        return rotate(self.quaternion, _vectors("points", points)) + self.position

    def inverse(self) -> Pose:
        """World to body."""
        conjugate = self.quaternion * np.array([1.0, -1.0, -1.0, -1.0])
        return Pose(-rotate(conjugate, self.position), conjugate)

    def __matmul__(self, other: Pose) -> Pose:
        """First the other pose, then this one."""
        return Pose(self.apply(other.position), multiply(self.quaternion, other.quaternion))
