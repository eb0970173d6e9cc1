"""Where a contact is on one of its faces, as a measure: (u, v) there, or the point in the world; and its slopes.

The extremal pair of two surfaces A(u, v) and B(u, v), with d = B - A and the normal n = A_u x A_v, is where

    F = (d . A_u, d . A_v, n . B_u, n . B_v) = 0,

which is regular at a gap of zero as well. A twist changes F by F_x at fixed parameters, so these follow by
-F_p^-1 F_x: the implicit function theorem, as for solutions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.trim_contact import single_face
from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix, skew
from assembly.proximity.features.solid_contact import TRACK

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["COMPONENTS", "place_slopes", "place_value"]

Array = NDArray[np.float64]
# In the face's parameters, and in the world.
COMPONENTS = ("u", "v", "x", "y", "z")
# Columns, rows and singular values that are farther apart are those at a pole, or at a fold. Parameters of faces are
# lengths, or angles of some radii.
SINGULAR = 1e-9


class _Side(NamedTuple):
    """A surface at the contact, in world axes: the arm from the body's origin, and derivatives of both orders.

    Attributes
    ----------
    origin : (3,)
    arm : (3,)
    first : (2, 3)
        Su, Sv.
    second : (2, 2, 3)
        Suu, Suv; Suv, Svv.
    """

    origin: Array
    arm: Array
    first: Array
    second: Array


def place_value(component: int, place: ContactPlace, solution: Solution) -> float:
    """One of `COMPONENTS` at a solution."""
    pair = solution.contacts.get(place.contact.name)
    if pair is None or not any(item is place.contact for item in solution._scene.contacts):
        raise _of_another_scene(place)
    if pair.features is not None:
        raise _of_solids(place)
    if component < 2:
        return float(pair.parameters[2 * place.side + component])
    return float(pair.points[place.side][component - 2])


def place_slopes(component: int, place: ContactPlace, packed: Packed, state: Array) -> tuple[Array, Array]:
    """The slopes of one of `COMPONENTS` in the twists (6,) of the bodies of sides a and b, world axes, user's units.

    Raises
    ------
    InputError
        The contact is at a pole of a face, or at a fold of its pair: there is no derivative.
    """
    found = [k for k, contact in enumerate(packed.contacts) if contact is place.contact]
    if not found:
        raise _of_another_scene(place)
    if not packed.whole[found[0]]:
        raise _of_solids(place)
    at = packed.contacts_at + TRACK * found[0]
    a, b = (_side(place, k, packed, state, state[at + 2 * k : at + 2 * k + 2]) for k in (0, 1))
    by_parameters, by_twists = _slopes_of_pair(a, b)
    columns = np.linalg.norm(by_parameters, axis=0)
    if not columns.min() > SINGULAR * columns.max():
        raise _singular(place)
    scaled = by_parameters / columns
    rows = np.linalg.norm(scaled, axis=1)
    if not rows.min() > SINGULAR * rows.max():
        raise _singular(place)
    values = np.linalg.svd(scaled / rows[:, None], compute_uv=False)
    if not values[-1] > SINGULAR * values[0]:
        raise _singular(place)
    changes = -np.linalg.solve(by_parameters, by_twists)[2 * place.side : 2 * place.side + 2]
    if component < 2:
        slopes = changes[component]
    else:
        own = (a, b)[place.side]
        motion = own.first.T @ changes
        motion[:, 6 * place.side : 6 * place.side + 6] += np.hstack([np.eye(3), -skew(own.arm)])
        slopes = motion[component - 2]
    return slopes[:6], slopes[6:]


def _slopes_of_pair(a: _Side, b: _Side) -> tuple[Array, Array]:
    """F by the four parameters (4, 4), and by the twists of both bodies (4, 12)."""
    d = b.origin + b.arm - a.origin - a.arm
    normal = np.cross(*a.first)
    by_parameters, by_twists = np.zeros((4, 4)), np.zeros((4, 12))
    normals = [np.cross(a.second[k, 0], a.first[1]) + np.cross(a.first[0], a.second[k, 1]) for k in (0, 1)]
    for i in (0, 1):
        for k in (0, 1):
            by_parameters[i, k] = d @ a.second[i, k] - a.first[k] @ a.first[i]
            by_parameters[i, 2 + k] = b.first[k] @ a.first[i]
            by_parameters[2 + i, k] = normals[k] @ b.first[i]
            by_parameters[2 + i, 2 + k] = normal @ b.second[i, k]
        # A step (v, w) takes a point by v + w x arm, and a direction s by w x s; s . (w x t) = w . (t x s).
        by_twists[i, :3], by_twists[i, 6:9] = -a.first[i], a.first[i]
        by_twists[i, 3:6] = np.cross(a.first[i], d) - np.cross(a.arm, a.first[i])
        by_twists[i, 9:] = np.cross(b.arm, a.first[i])
        by_twists[2 + i, 3:6] = np.cross(normal, b.first[i])
        by_twists[2 + i, 9:] = np.cross(b.first[i], normal)
    return by_parameters, by_twists


def _side(place: ContactPlace, k: int, packed: Packed, state: Array, at: Array) -> _Side:
    contact = place.contact
    face = single_face("ab"[k], (contact.a, contact.b)[k])
    body = packed.body_places[contact.bodies[k]]
    row = state[7 * body : 7 * body + 7]
    turn = rotation_matrix(row[3:])
    point, su, sv, suu, suv, svv = (turn @ part for part in face.surface.evaluate(at[0], at[1], 2))
    return _Side(row[:3], point, np.array([su, sv]), np.array([[suu, suv], [suv, svv]]))


def _of_another_scene(place: ContactPlace) -> InputError:
    return InputError(f"measure is of {place.name!r}; expected a place of a contact of the solution's scene")


def _of_solids(place: ContactPlace) -> InputError:
    return InputError(
        f"measure is of {place.name!r}, whose contact is of solids; expected a place in the scene, or edges=False"
    )


def _singular(place: ContactPlace) -> InputError:
    return InputError(f"measure is of {place.name!r}, at a pole of a face or a fold; expected a contact beside it")
