"""What CadQuery's constraints ask for, after its source (`occ_impl/solver.py`), and how far an assembly is from it.

Its costs are sums of squares; here are the lengths and angles that they are of, from locations alone.
"""

from __future__ import annotations

import math

import numpy as np


def moved(assembly, name):
    """Rotation and translation of a part, in the coordinates that CadQuery's solver has."""
    location = assembly.objects[name].loc.wrapped
    if any(assembly.name in constraint.objects for constraint in assembly.constraints) and name != assembly.name:
        location = assembly.loc.wrapped.Multiplied(location)
    move = location.Transformation()
    rows = np.array([[move.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)])
    return rows[:, :3], rows[:, 3]


def three(thing):
    return np.array([thing.X(), thing.Y(), thing.Z()])


def turned(angles):
    """About the world's x axis, then y, then z."""
    a, b, c = angles
    x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    return z @ y @ x


def angle(a, b):
    return math.atan2(np.linalg.norm(np.cross(a, b)), a @ b)


def residual(assembly, constraint):
    """The largest violation of a constraint: a length, or radians."""
    places = [moved(assembly, name) for name in constraint.objects]
    (r1, t1), (r2, t2) = places[0], places[-1]
    worst = [0.0]
    for markers, kind, value in constraint.toPODs():
        if kind == "Point":
            apart = r1 @ three(markers[0]) + t1 - r2 @ three(markers[1]) - t2
            worst.append(abs(np.linalg.norm(apart) - abs(value or 0.0)))
        elif kind == "Axis":
            wanted = math.pi if value is None else math.acos(math.cos(value))
            worst.append(abs(angle(r1 @ three(markers[0]), r2 @ three(markers[1])) - wanted))
        elif kind == "PointInPlane":
            axis = markers[1].Axis()
            apart = r1 @ three(markers[0]) + t1 - r2 @ three(axis.Location()) - t2
            worst.append(abs(r2 @ three(axis.Direction()) @ apart - (value or 0.0)))
        elif kind == "PointOnLine":
            apart = r1 @ three(markers[0]) + t1 - r2 @ three(markers[1].Location()) - t2
            away = np.linalg.norm(np.cross(r2 @ three(markers[1].Direction()), apart))
            worst.append(abs(away - abs(value or 0.0)))
        elif kind == "FixedPoint":
            worst.append(np.linalg.norm(r1 @ three(markers[0]) + t1 - np.array(value)))
        elif kind == "FixedAxis":
            worst.append(angle(r1 @ three(markers[0]), np.array(value, dtype=float)))
        elif kind == "FixedRotation":
            worst.append(np.abs(r1 - turned(value)).max())
    return float(max(worst))


def violation(assembly):
    """The largest of all constraints."""
    return max(residual(assembly, constraint) for constraint in assembly.constraints)
