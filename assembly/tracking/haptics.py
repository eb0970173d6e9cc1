"""Forces for the hand: from the coordinates of a scene to a body, from a finger to a wrist, from a wrist to motors.

    W_c = [f, G^T t / |e|^2],   W = [f, G W_c,e / 4]                       (paper 001, eq. 5, for the turn alone)
    W = [f, r x f]                                                         (eq. 6)
    J = [z_1 x b_1 ... z_m x b_m  0 ... 0;  z_1 ... z_m  z_m+1 ... z_n]    (eq. 7)
    tau = J^T W                                                            (eq. 8)

Each does the same work on both sides. W is a force in world axes and a torque t about the body's origin in body axes;
G (`kinematics/pose.py`, in body axes) has the factor two, and e any length, since its rotation is the normalized one:
along e nothing works. Eq. 7 has one column per joint, b_i from the origin of joint i to the wrist; the printed indices,
0 to 7, make eight of seven. `assembly.statics` reads the same off a scene; here are devices, known by arrays, and
many ticks at once: leading axes broadcast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, real_array
from assembly.kinematics.pose import UNIT_TOLERANCE

__all__ = ["body_wrench", "configuration_force", "finger_wrench", "joint_torques", "manipulator_jacobian"]

Array = NDArray[np.float64]


def body_wrench(force: ArrayLike, quaternion: ArrayLike) -> Array:
    """The wrench on a body of a force in the coordinates of its pose: paper 001, eq. 5.

    Parameters
    ----------
    force : (..., 7)
        Rate of work over the rate of x y z qw qx qy qz. What it has along the quaternion does no work and drops out.
    quaternion : (..., 4)
        Of the body, of any length but zero.

    Returns
    -------
    (..., 6)
        Force in world axes, then torque about the body's origin in body axes.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, a zero quaternion.
    """
    given, e = _vectors("force", force, 7), _quaternions(quaternion)
    _leading(1, force=given, quaternion=e)
    torque = 0.25 * np.einsum("...ij,...j->...i", _body_map(e), given[..., 3:])
    return _joined(given[..., :3], torque)


def configuration_force(wrench: ArrayLike, quaternion: ArrayLike) -> Array:
    """The force in the coordinates of a body's pose of a wrench on it, (..., 7): the inverse of `body_wrench`.

    Parameters
    ----------
    wrench : (..., 6)
        Force in world axes, then torque about the body's origin in body axes.
    quaternion : (..., 4)
        Of the body, of any length but zero.

    Raises
    ------
    InputError
        As `body_wrench`.
    """
    given, e = _vectors("wrench", wrench, 6), _quaternions(quaternion)
    _leading(1, wrench=given, quaternion=e)
    along = np.einsum("...ij,...i->...j", _body_map(e), given[..., 3:])
    return _joined(given[..., :3], along / (e * e).sum(axis=-1, keepdims=True))


def finger_wrench(force: ArrayLike, arm: ArrayLike) -> Array:
    """The wrench at the wrist of a force at the finger's tip, (..., 6): paper 001, eq. 6.

    Parameters
    ----------
    force : (..., 3)
    arm : (..., 3)
        From the wrist to the tip, in the axes of the force.
    """
    f, r = _vectors("force", force, 3), _vectors("arm", arm, 3)
    _leading(1, force=f, arm=r)
    return _joined(f, np.cross(r, f))


def manipulator_jacobian(axes: ArrayLike, arms: ArrayLike) -> Array:
    """Twist of the wrist for unit rates of turning joints, (..., 6, n): paper 001, eq. 7.

    Parameters
    ----------
    axes : (..., n, 3)
        Of the joints, from the shoulder to the wrist; unit vectors, to a percent, which are normalized.
    arms : (..., m, 3)
        From the origin of each of the first m joints to the wrist, m at most n. The axes of the others, those of a
        spherical wrist, go through it.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, more arms than axes, an axis far from unit.
    """
    z, b = _vectors("axes", axes, "n", 3), _vectors("arms", arms, "m", 3)
    leading = _leading(2, axes=z, arms=b)
    if b.shape[-2] > z.shape[-2]:
        raise InputError(f"arms has {b.shape[-2]} rows; expected {z.shape[-2]} at most, as axes")
    lengths = np.linalg.norm(z, axis=-1, keepdims=True)
    far = np.abs(lengths - 1.0)
    if not far.max(initial=0.0) <= UNIT_TOLERANCE:
        raise InputError(f"axes has one of length {lengths.flat[far.argmax()]:.6g}; expected unit vectors")
    z = z / lengths
    rates = np.zeros((*leading, *z.shape[-2:]))
    rates[..., : b.shape[-2], :] = np.cross(z[..., : b.shape[-2], :], b)
    return np.swapaxes(_joined(rates, z), -1, -2)


def joint_torques(jacobian: ArrayLike, wrench: ArrayLike) -> Array:
    """Torques of the joints that push with a wrench at the wrist, (..., n): paper 001, eq. 8.

    Parameters
    ----------
    jacobian : (..., 6, n)
    wrench : (..., 6)
        Force, then torque about the wrist, in the axes of the Jacobian.
    """
    j, pushed = _vectors("jacobian", jacobian, 6, "n"), _vectors("wrench", wrench, 6)
    _leading(2, jacobian=j, wrench=pushed[..., None])
    torques: Array = np.einsum("...ij,...i->...j", j, pushed)
    return torques


def _vectors(name: str, value: ArrayLike, *last: int | str) -> Array:
    """Finite numbers whose last axes are these; a string stands for any extent."""
    try:
        shape = np.shape(value)
    except ValueError:
        raise InputError(f"{name} has rows of different lengths; expected an array") from None
    own = shape[-len(last) :]
    if len(own) < len(last) or any(isinstance(want, int) and has != want for has, want in zip(own, last, strict=True)):
        raise InputError(f"{name} has shape {shape}; expected (..., {', '.join(map(str, last))})")
    return real_array(name, value, shape)


def _quaternions(value: ArrayLike) -> Array:
    e = _vectors("quaternion", value, 4)
    # Between these lengths |e|^2 neither vanishes nor overflows.
    lengths = np.abs(e).max(axis=-1, initial=0.0)
    if not ((lengths > 1e-150) & (lengths < 1e150)).all():
        raise InputError(
            "quaternion is zero, or its square no double; expected (w, x, y, z) of a length other than zero"
        )
    return e


def _leading(own: int, **arrays: Array) -> tuple[int, ...]:
    """What the axes of arrays broadcast to, but for the last `own`."""
    try:
        return np.broadcast_shapes(*(array.shape[: array.ndim - own] for array in arrays.values()))
    except ValueError:
        shapes = " and ".join(f"{name} has shape {array.shape}" for name, array in arrays.items())
        raise InputError(f"{shapes}; expected leading axes that broadcast") from None


def _body_map(e: Array) -> Array:
    """G (..., 3, 4) with omega = G e' / |e|^2, in body axes (paper 001, eq. 17, its third row mended)."""
    w, x, y, z = np.moveaxis(e, -1, 0)
    rows = [[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]
    return 2.0 * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _joined(first: Array, second: Array) -> Array:
    """Two arrays beside each other along their last axis, the others broadcast."""
    leading = np.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    return np.concatenate([np.broadcast_to(part, (*leading, part.shape[-1])) for part in (first, second)], axis=-1)
