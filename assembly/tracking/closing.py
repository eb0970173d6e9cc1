"""Contacts that joints let close: those whose gaps change along a motion that joints alone would make.

Links that slide on each other touch all along, and no motion that their joints allow changes their gaps: rows of such
contacts hold whatever the hand does. A collar that comes to lie on the face of a nut has contacts of another kind.
Both may push by nothing, where what is pushed is free to go, so multipliers do not tell them apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.pose import rotation_matrix
from assembly.solve.contact_pairs import ContactRows

__all__ = ["closing_rates", "screw_between"]

Array = NDArray[np.float64]
# Below this angle [rad] the third term of the inverse is that of its series, 1 / 12, to rounding.
SMALL = 1e-4


def screw_between(rotation: Array, shift: Array) -> tuple[Array, Array]:
    """The twist (v, w) that, kept up for a unit of time, makes a motion x -> rotation x + shift.

    Parameters
    ----------
    rotation, shift : (3, 3), (3,)
        A turn by less than half a revolution.

    Returns
    -------
    (3,), (3,)
        Velocity of what is at the origin, and angular velocity.
    """
    skew = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.linalg.norm(skew))
    angle = float(np.arctan2(sine, 0.5 * (np.trace(rotation) - 1.0)))
    w = skew * (angle / sine) if sine > 0.0 else skew
    third = 1.0 / 12.0 if angle < SMALL else 1.0 / angle**2 - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    across = np.cross(w, shift)
    return shift - 0.5 * across + third * np.cross(w, across), w


def closing_rates(contacts: ContactRows, here: Array, there: Array) -> Array:
    """How gaps of contacts would change on the way from some poses to others, by rates where the way begins.

    On the way every pair of bodies goes along one screw, as seen from its first body. So what joints only let slide has
    a rate of zero, however long the way.

    Parameters
    ----------
    contacts : ContactRows
        At the poses where the way begins.
    here, there : (n, 7)
        Poses of all bodies.

    Returns
    -------
    (m,)
        In the unit of the scene.
    """
    rates = np.empty(len(contacts.pairs))
    for a, b in set(map(tuple, contacts.bodies.tolist())):
        first, second = rotation_matrix(here[a, 3:]), rotation_matrix(here[b, 3:])
        turned = rotation_matrix(there[a, 3:])
        rotation = turned.T @ rotation_matrix(there[b, 3:]) @ second.T @ first
        before, after = first.T @ (here[b, :3] - here[a, :3]), turned.T @ (there[b, :3] - there[a, :3])
        v, w = screw_between(rotation, after - rotation @ before)
        rows = (contacts.bodies == (a, b)).all(axis=1)
        normals, points = contacts.normals[rows] @ first, (contacts.points[rows, 1] - here[a, :3]) @ first
        rates[rows] = (normals * (v + np.cross(w, points))).sum(axis=1)
    return rates
