"""The sides of a loop: its smooth parts between corners, each going on straight beyond both of its ends.

A loop with corners has no smooth distance, its sides have. That a side goes on along its tangents makes its distance
smooth through a corner (its curvature jumps there), so that a row may be of a side wherever a step leads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.trim_nearest import SMOOTH
from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import NurbsCurve

__all__ = ["LoopSide", "Stretch", "loop_sides"]

Array = NDArray[np.float64]
# Pieces smaller than this part of the loop's size have no direction of their own.
NO_LENGTH = 1e-14
# An extension is tried in so many lengths. A point of its side counts as nearer than the side's own end only if it is
# nearer by more than this part, the rounding of distances.
PARTS, NEARER = 32, 1e-9
# Points of every piece that tell how near a side is to its own extensions.
SAMPLES = 17
# An extension is at most this part of a period long: it does not meet itself from the other side.
OF_PERIOD = 0.25


@dataclass(frozen=True, eq=False)
class LoopSide:
    """A smooth part of a loop.

    Attributes
    ----------
    curve : NurbsCurve
        Its curves as one, with a straight extension at each end.
    start, end : float
        The parameters between which the curve is the loop's.
    before, after : int
        The sides that it meets at its start and at its end.
    turn_before, turn_after : int
        How the loop turns there: 1 to the left, where what it encloses is convex, -1 to the right, 0 for a place at
        which it is smooth.
    """

    curve: NurbsCurve
    start: float
    end: float
    before: int
    after: int
    turn_before: int
    turn_after: int


@dataclass(frozen=True)
class Stretch:
    """The part of a boundary curve that is on one side: from a parameter to another."""

    curve: int
    start: float
    end: float
    side: int


@dataclass(frozen=True, eq=False)
class _Piece:
    """A Bezier piece of boundary curve number `curve` between two parameters: homogeneous points (degree + 1, 3)."""

    curve: int
    start: float
    end: float
    points: Array

    @property
    def places(self) -> Array:
        return np.asarray(self.points[:, :2] / self.points[:, 2:])

    def direction(self, at_end: bool) -> Array:
        """The unit tangent at an end: of the first control point that is not the end itself."""
        places = self.places[::-1] if at_end else self.places
        steps = places[1:] - places[0]
        lengths = np.linalg.norm(steps, axis=1)
        first = int(np.argmax(lengths > 1e-9 * lengths.max()))
        return np.asarray((-1.0 if at_end else 1.0) * steps[first] / lengths[first])

    def halves(self) -> tuple[_Piece, _Piece]:
        """Both halves by parameter."""
        left, right = bezier.divided(self.points, 0.5)
        middle = 0.5 * (self.start + self.end)
        return _Piece(self.curve, self.start, middle, left), _Piece(self.curve, middle, self.end, right)


def loop_sides(
    curves: Sequence[NurbsCurve], chains: Sequence[range], periods: Sequence[float]
) -> tuple[list[LoopSide], list[Stretch]]:
    """The sides of a boundary, and which of them its curves are on; none where it is smooth.

    Parameters
    ----------
    curves : plane curves, head to tail within a chain, or a whole period apart
    chains : which of them follow one another, the first one the last
    periods : of u and v, 0 for an open direction
    """
    runs = [_pieces(curves, chain) for chain in chains]
    turns = [_turns(run) for run in runs]
    if not any(any(turn) for turn in turns):
        return [], []
    sides: list[LoopSide] = []
    stretches: list[Stretch] = []
    longest = min([OF_PERIOD * period for period in periods if period > 0.0], default=np.inf)
    for run, turn in zip(runs, turns, strict=True):
        parts, corners = _cut(run, turn)
        first, count = len(sides), len(parts)
        for k, part in enumerate(parts):
            curve, start, end = _extended(part, longest)
            before, after = first + (k - 1) % count, first + (k + 1) % count
            sides.append(LoopSide(curve, start, end, before, after, corners[k], corners[(k + 1) % count]))
            stretches += [Stretch(piece.curve, piece.start, piece.end, first + k) for piece in part]
    return sides, stretches


def _pieces(curves: Sequence[NurbsCurve], chain: range) -> list[_Piece]:
    """The Bezier pieces of a chain, without those that have no length."""
    size = float(np.linalg.norm(np.ptp(np.concatenate([curves[k].control_points for k in chain]), axis=0)))
    pieces = []
    for k in chain:
        at = curves[k].breaks().tolist()
        for a, b, points in zip(at[:-1], at[1:], curves[k].bezier_pieces(), strict=True):
            piece = _Piece(k, a, b, points)
            if np.ptp(piece.places, axis=0).max() > NO_LENGTH * size:
                pieces.append(piece)
    return pieces


def _turns(pieces: Sequence[_Piece]) -> list[int]:
    """How the chain turns where each piece begins: 0 where it is smooth."""
    turns = []
    for k, piece in enumerate(pieces):
        a, b = pieces[k - 1].direction(at_end=True), piece.direction(at_end=False)
        across = float(a[0] * b[1] - a[1] * b[0])
        smooth = float(a @ b) > 0.0 and abs(across) <= SMOOTH
        turns.append(0 if smooth else (1 if across > 0.0 else -1))
    return turns


def _cut(pieces: list[_Piece], turns: list[int]) -> tuple[list[list[_Piece]], list[int]]:
    """The pieces of each side, and how the chain turns where each begins: at least two sides.

    A chain with fewer corners is cut in its middle as well: a row is to know which end of a side a contact is near.
    """
    corners = [k for k, turn in enumerate(turns) if turn]
    begin = corners[0] if corners else 0
    pieces, turns = pieces[begin:] + pieces[:begin], turns[begin:] + turns[:begin]
    cuts = [k for k, turn in enumerate(turns) if turn] or [0]
    if len(cuts) == 1:
        if len(pieces) == 1:
            pieces = list(pieces[0].halves())
            turns = [turns[0], 0]
        lengths = np.cumsum([np.linalg.norm(np.diff(piece.places, axis=0), axis=1).sum() for piece in pieces])
        middle = int(np.argmin(np.abs(lengths[:-1] - 0.5 * lengths[-1]))) + 1
        cuts.append(middle)
    stops = [*cuts[1:], len(pieces)]
    return [pieces[a:b] for a, b in zip(cuts, stops, strict=True)], [turns[k] for k in cuts]


def _extended(pieces: Sequence[_Piece], longest: float) -> tuple[NurbsCurve, float, float]:
    """The pieces of a side as one curve that goes on straight at both ends, and where on it they begin and end."""
    degree = max(len(piece.points) - 1 for piece in pieces)
    points: list[Array] = []
    for piece in pieces:
        raised = bezier.elevation(len(piece.points) - 1, degree) @ piece.points
        place, weight = raised[0, :2] / raised[0, 2], raised[0, 2]
        end = points[-1][-1] if points else np.array([*place, 1.0])
        raised *= end[2] / weight
        # By whole periods, and by what ends of curves differ in rounding.
        raised[:, :2] += raised[:, 2:] * (end[:2] / end[2] - place)
        points.append(raised)
    steps = [piece.end - piece.start for piece in pieces]
    t = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    samples = np.concatenate([_bezier_points(part, t) for part in points])
    size = min(float(np.linalg.norm(np.ptp(samples, axis=0))), longest)
    total = float(np.sum(steps))
    ends = []
    for at_end in (False, True):
        end = points[-1][-1] if at_end else points[0][0]
        way = pieces[-1].direction(True) if at_end else -pieces[0].direction(False)
        length = _free_length(samples, end[:2] / end[2], way, size)
        part, step = (points[-1], steps[-1]) if at_end else (points[0][::-1], steps[0])
        rate = (
            degree * part[-2, 2] / part[-1, 2] * np.linalg.norm(np.diff(part[-2:, :2] / part[-2:, 2:], axis=0)) / step
        )
        share = np.linspace(0.0, 1.0, degree + 1)[:, None]
        places = end[:2] / end[2] + share * length * way
        line = np.column_stack([places * end[2], np.full(degree + 1, end[2])])
        ends.append((line if at_end else line[::-1], length / max(float(rate), 1e-3 * size / total)))
    (line, begin), (beyond, stop) = ends
    at = np.concatenate([[-begin, 0.0], np.cumsum(steps), [total + stop]])
    at[-2] = total
    whole = bezier.joined(np.stack([line, *points, beyond]))
    curve = NurbsCurve(whole[:, :2] / whole[:, 2:], bezier.full_knots(at, degree), degree, whole[:, 2])
    return curve, 0.0, total


def _bezier_points(points: Array, t: Array) -> Array:
    """Places of a piece at parameters (n, 1) of [0, 1]."""
    level = np.broadcast_to(points[:, None], (len(points), len(t), 3))
    while len(level) > 1:
        level = (1.0 - t) * level[:-1] + t * level[1:]
    return np.asarray(level[0, :, :2] / level[0, :, 2:])


def _free_length(samples: Array, end: Array, way: Array, size: float) -> float:
    """How far a side may go on from an end: as long as no other point of it is nearer to that than the end."""
    lengths = size * np.arange(1, PARTS + 1) / PARTS
    places = end + lengths[:, None] * way
    nearest = np.linalg.norm(places[:, None] - samples, axis=2).min(axis=1)
    # A first part is there at any rate: only what a loop passes within a part of its size it may come near to.
    taken = int(np.argmin(np.append(nearest >= lengths - NEARER * size, False)))
    return float(lengths[max(taken - 1, 0)])
