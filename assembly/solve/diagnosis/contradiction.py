"""Equations that cannot hold at any poses, so that no other start need be tried.

An equation is a sum of coordinates of joints, with factors, that is to have a value. Taken as unknowns by themselves,
coordinates may have any values that poses give them and more. So where the linear equations have no solution, no pose
has one: a slide driven to two values, or gears whose wheels are all driven.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from assembly.constraints.model.constraint import Coordinate
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.primitives import AZIMUTH, TURN
from assembly.kinematics.frame import Frame
from assembly.solve.dense.rank import HELD

__all__ = ["is_certain"]

# A dense system of more takes longer than other starts.
MOST_EQUATIONS = 400


def is_certain(packed: Packed) -> bool:
    """Whether equations of a packed scene contradict each other at all poses."""
    rows = [(equation, unit) for equation, _, unit in packed._values if not equation.one_sided]
    terms = [{_key(coordinate): factor for factor, coordinate in equation.terms} for equation, _ in rows]
    left = _closed(terms)
    if not left or len(left) > MOST_EQUATIONS:
        return False
    unknowns = {key: k for k, key in enumerate(dict.fromkeys(key for row in left for key in terms[row]))}
    matrix = np.zeros((len(left), len(unknowns)))
    for k, row in enumerate(left):
        for key, factor in terms[row].items():
            matrix[k, unknowns[key]] = factor / rows[row][1]
    values = np.array([rows[row][0].current() / rows[row][1] for row in left])
    found = np.linalg.lstsq(matrix, values, rcond=None)[0]
    return bool(np.abs(matrix @ found - values).max() > HELD * max(1.0, np.abs(values).max()))


def _closed(terms: list[dict[tuple[object, ...], float]]) -> list[int]:
    """The equations all of whose unknowns are in others, too: an unknown that is in one alone makes it hold."""
    left = list(range(len(terms)))
    while True:
        counts = Counter(key for row in left for key in terms[row])
        kept = [row for row in left if all(counts[key] > 1 for key in terms[row])]
        if len(kept) == len(left):
            return left
        left = kept


def _key(coordinate: Coordinate) -> tuple[object, ...]:
    """The same of coordinates that have one value at every pose; angles of two joints may be on different turns."""
    if coordinate.kind in (TURN, AZIMUTH):
        return (id(coordinate),)
    frames = coordinate.frames
    return coordinate.kind, coordinate.component, _place(frames.frame_a), _place(frames.frame_b)


def _place(frame: Frame) -> tuple[object, ...]:
    return id(frame.body), *frame.origin.tolist(), *frame.axes.ravel().tolist()
