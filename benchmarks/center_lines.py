"""Center lines of round wires, made of straight lines and arcs, and how often closed ones are linked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.shapes.path import Path

__all__ = ["Wire", "ball_wire", "linking_number", "paper_clip_wire", "path_wire", "torus_wire"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Wire:
    """A center line in body axes, piece by piece, and the radius around it.

    Attributes
    ----------
    radius : float
    start : (n, 3)
        First points of lines, centers of arcs.
    axes : (n, 3, 3)
        Lines: the direction, twice zero. Arcs: to the first point, along the tangent there, and their product.
    bend : (n,)
        Radii of arcs, 0 for lines.
    length : (n,)
        Arc lengths.
    ends : (m, 3), (m, 3)
        Free ends and the directions out of them; a ball has one end without a direction.
    """

    radius: float
    start: Array
    axes: Array
    bend: Array
    length: Array
    ends: tuple[Array, Array]


def path_wire(path: Path, radius: float) -> Wire:
    """The wire of `shapes.pipe`; arcs that follow one another about one center are one."""
    start, axes, bend, length = [], [], [], []
    for piece in path.pieces:
        if piece.radius is None:
            start.append(piece.start)
            axes.append(np.stack([piece.tangent, np.zeros(3), np.zeros(3)]))
            bend.append(0.0)
            length.append(piece.length)
            continue
        assert piece.toward is not None
        center = piece.start + piece.radius * piece.toward
        if bend and bend[-1] == piece.radius and np.linalg.norm(center - start[-1]) < 1e-12 * path.length:
            length[-1] += piece.length
            continue
        start.append(center)
        axes.append(np.stack([-piece.toward, piece.tangent, np.cross(-piece.toward, piece.tangent)]))
        bend.append(piece.radius)
        length.append(piece.length)
    ends = (np.zeros((0, 3)), np.zeros((0, 3)))
    if not path.closed:
        ends = (np.stack([path.start, path.end]), np.stack([-path.start_direction, path.end_direction]))
    return Wire(radius, np.array(start), np.array(axes), np.array(bend), np.array(length), ends)


def torus_wire(major: float, minor: float) -> Wire:
    """The wire of `shapes.torus`."""
    none = np.zeros((0, 3))
    return Wire(
        minor, np.zeros((1, 3)), np.eye(3)[None], np.array([major]), np.array([2.0 * np.pi * major]), (none, none)
    )


def ball_wire(radius: float) -> Wire:
    """A ball: a wire of no length."""
    nothing = np.zeros(0)
    point = np.zeros((1, 3))
    return Wire(radius, np.zeros((0, 3)), np.zeros((0, 3, 3)), nothing, nothing, (point, point))


def paper_clip_wire(length: float = 33.0, width: float = 8.0, radius: float = 0.5) -> Wire:
    """The wire of `shapes.paper_clip` with its default legs, from the lengths that its text gives."""
    top = 0.5 * width - radius
    bottom, inner = top - 1.5 * radius, top - 3.0 * radius
    second = length - 2.0 * radius - top - bottom
    path = Path((-top, 0.0, 0.5 * length - radius - top - 0.7 * second)).line(0.7 * second)
    path = path.arc(top, np.pi, (1, 0, 0)).line(second).arc(bottom, np.pi, (-1, 0, 0)).line(0.8 * second)
    return path_wire(path.arc(inner, np.pi, (1, 0, 0)).line(0.55 * second), radius)


def linking_number(a: Array, b: Array) -> int:
    """How often closed polygons with corners (n, 3) and (m, 3) go through each other: Gauss's integral, exactly.

    Two sides see each other under the solid angle of a parallelogram, which two triangles make up (Van Oosterom and
    Strackee, IEEE Trans. Biomed. Eng. 30, 1983).
    """
    b_next, a_next = np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)
    corners = [r[None] - p[:, None] for p, r in ((a, b), (a, b_next), (a_next, b_next), (a_next, b))]
    lengths = [np.linalg.norm(x, axis=2) for x in corners]

    def angle(i: int, j: int, k: int) -> Array:
        x, y, z = corners[i], corners[j], corners[k]
        volume = (x * np.cross(y, z)).sum(axis=2)
        side = lengths[i] * lengths[j] * lengths[k]
        side = side + (x * y).sum(2) * lengths[k] + (y * z).sum(2) * lengths[i] + (z * x).sum(2) * lengths[j]
        return np.asarray(2.0 * np.arctan2(volume, side))

    number = float((angle(0, 1, 2) + angle(2, 3, 0)).sum()) / (4.0 * np.pi)
    if abs(number - round(number)) > 1e-6:
        raise ArithmeticError(f"the linking number is {number}; the polygons meet")
    return round(number)
