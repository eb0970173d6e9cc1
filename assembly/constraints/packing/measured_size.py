"""The size of a scene measured again for what was set, with the same bits as `scene_size`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import chain
from math import frexp, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.packing.scene_size import LEAST, MOST, ONE_PLACE, Objectives, equations_of, marks_of, reach_of
from assembly.errors import FARTHEST
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame

__all__ = ["MeasuredSize", "base_of"]

Array = NDArray[np.float64]
# Sums of three squares differ by less, whoever adds them.
ROUNDING = 1e-14


class MeasuredSize:
    """The marks of a scene's bodies, and the boxes around them.

    Parameters
    ----------
    bodies, constraints, objectives
        As `scene_size` takes them.

    Attributes
    ----------
    shapes : float
        The size of the largest body with a shape; 0 without one.
    frames : dict
        Where the origins of a frame are: bodies and places among their marks, by the frame's identity.
    """

    def __init__(self, bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Objectives) -> None:
        self.shapes = max(body.size for body in bodies)
        self.frames: dict[int, tuple[Frame, list[tuple[int, int]]]] = {}
        self._marks: list[list[list[float]]] = []
        for b, marks in enumerate(marks_of(bodies, constraints, objectives).values()):
            self._marks.append([(mark.origin if isinstance(mark, Frame) else mark).tolist() for mark in marks])
            for k, mark in enumerate(marks):
                if isinstance(mark, Frame):
                    base = base_of(mark)
                    self.frames.setdefault(id(base), (base, []))[1].append((b, k))
        self._boxes = [_box(marks) for marks in self._marks]
        self._rough = [hypot(*box) for box in self._boxes]
        self._take_longest()
        self._far = max(map(abs, chain.from_iterable(chain.from_iterable(self._marks))), default=0.0)
        self._reach = reach_of(bodies, self._marks)
        self._asked: list[tuple[object, str]] = []
        self._fixed_asked = 0.0
        for equation in equations_of(constraints):
            (_, first), *others = equation.terms
            if not first.is_angle and not equation.one_sided:
                factors = [abs(factor) for factor, other in others if other.is_angle]
                self._fixed_asked = max(self._fixed_asked, *factors, 0.0)
                if equation.source is not None:
                    self._asked.append(equation.place()[:2])

    def read(self, frames: Iterable[int]) -> None:
        """Read the origins of frames anew, by their identities."""
        is_other = False
        for key in frames:
            frame, places = self.frames.get(key, (None, []))
            if frame is None:
                continue
            x, y, z = origin = frame.origin.tolist()
            self._far = max(self._far, abs(x), abs(y), abs(z))
            for b, k in places:
                marks = self._marks[b]
                marks[k] = origin
                box = _box(marks)
                if box != self._boxes[b]:
                    rough = hypot(*box)
                    is_other = is_other or rough >= self._near or self._rough[b] >= self._near
                    self._boxes[b], self._rough[b] = box, rough
        if is_other:
            self._take_longest()

    def _take_longest(self) -> None:
        """The longest diagonal of the boxes; of those that are as long within rounding the bits decide."""
        self._near = near = (1.0 - ROUNDING) * max(self._rough)
        longest = 0.0
        for box, about in zip(self._boxes, self._rough, strict=True):
            if about >= near:
                longest = max(longest, _diagonal(box))
        self._on_bodies = longest

    def size(self) -> float | None:
        """The size now; None where it rests on values and places in the world, or is out of range: measure in full."""
        size = max(self.shapes, self._on_bodies)
        if not self.shapes:
            if size < LEAST or size <= ONE_PLACE * max(self._far, self._reach):
                return None
            for owner, name in self._asked:
                size = max(size, abs(float(getattr(owner, name))))
            size = max(size, self._fixed_asked)
        return size if LEAST <= size <= MOST and self._far <= FARTHEST * size else None


def base_of(frame: Frame) -> Frame:
    """The frame itself, or the one that it is turned from."""
    base: Frame = getattr(frame, "base", frame)
    return base


def _box(marks: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """The sides of the box around marks."""
    if len(marks) < 2:
        return 0.0, 0.0, 0.0
    if len(marks) == 2:
        # A link between two joints.
        (a, b, c), (u, v, w) = marks
        return abs(u - a), abs(v - b), abs(w - c)
    xs, ys, zs = zip(*marks, strict=True)
    return max(xs) - min(xs), max(ys) - min(ys), max(zs) - min(zs)


@lru_cache(64)
def _diagonal(box: tuple[float, float, float]) -> float:
    """Its diagonal, to the bits of `pose.length`. The longest often is the same as before."""
    unit = 2.0 ** (frexp(max(box))[1] - 1)
    sides = np.array(box) / unit
    return unit * sqrt(sides.dot(sides))
