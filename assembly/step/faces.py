"""Faces of OCCT as trimmed NURBS faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.boundary import OVERSHOOT
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_packing import signed_area
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.chains import chained, head_to_tail
from assembly.step.edges import Edges, Laid
from assembly.step.occt import occt
from assembly.step.profiles import Unreadable
from assembly.step.surfaces import Patch
from assembly.step.trims import Drawn, curves_of, edge_curves, ready_edges
from assembly.step.wires import outermost

__all__ = ["Read", "read_face", "read_faces"]

Array = NDArray[np.float64]
# A loop whose end is so near to its start, over its extent, does not go round.
CLOSED = 1e-6


@dataclass(frozen=True)
class Read:
    """A face, and what was not exact about it [mm]: of its surface, and of the ends of its edges.

    `is_against` says that its outer wire has the material on its right.
    """

    face: Face
    deviation: float
    gap: float
    is_against: bool


@dataclass(eq=False)
class _Draft:
    """A face while it is read.

    Attributes
    ----------
    face, forward
        TopoDS_Face, and the same taken forward.
    name : str, optional
    reason : Unreadable, optional
        Why it cannot be read.
    laid
        What it lies in.
    surface, factors
        The surface in our unit, and the factors of u and v that go with it.
    drawn, ends, loops : list
        Edges of its wires, where these meet, and the boundary curves; None where nothing is left of a wire but seams
        and poles.
    tolerance, deviation, gap : float
        What the ends of its edges are forgiven, in our unit; what was not exact, as `Read` has it.
    read
        The face.
    """

    face: Any
    forward: Any
    name: str | None
    reason: Unreadable | None = None
    drawn: list[Drawn | None] = field(default_factory=list)
    ends: list[Array | None] = field(default_factory=list)
    loops: list[list[NurbsCurve] | None] = field(default_factory=list)
    tolerance: float = 0.0
    deviation: float = 0.0
    gap: float = 0.0

    def lay(self, edges: Edges, scale: float) -> None:
        """Find what it lies in."""
        self.laid: Laid = edges.laid(self.forward)
        where = self.laid.patch
        self.surface, self.factors = _scaled(where, scale)
        self.deviation = where.deviation
        # What the file says of its edges and vertices, and at least what faces forgive by themselves.
        self.tolerance = OVERSHOOT * self.surface.size

    def ready(self, edges: Edges, scale: float) -> None:
        """Have the curves at hand that have to be compared with its edges."""
        for wire in self.laid.wires:
            ready_edges(wire, self.laid.patch, edges)

    def draw(self, edges: Edges, scale: float) -> None:
        """Find the curves of its edges."""
        where = self.laid.patch
        for wire in self.laid.wires:
            drawn = None
            if wire.edges and not wire.is_bare:
                drawn = edge_curves(wire, where, edges)
                drawn = drawn if wire.ordered else head_to_tail(drawn, where)
                self.tolerance = max(self.tolerance, scale * drawn.tolerance)
                self.deviation = max(self.deviation, drawn.deviation)
            self.drawn.append(drawn)

    def join(self, edges: Edges, scale: float) -> None:
        """Have edges meet where they should."""
        for k, drawn in enumerate(self.drawn):
            ends = None
            if drawn is not None:
                self.drawn[k], ends, gap = chained(drawn, self.laid.patch)
                self.gap = max(self.gap, gap)
            self.ends.append(ends)

    def close(self, edges: Edges, scale: float) -> None:
        """Make the curves of its loops."""
        for drawn, ends in zip(self.drawn, self.ends, strict=True):
            loop = None
            if drawn is not None and ends is not None:
                loop = curves_of(drawn, ends, self.factors)
            self.loops.append(loop)

    def make(self, edges: Edges, scale: float) -> None:
        """Make the face."""
        around = outermost(self.laid.wires, self.laid.surface, self.forward)
        outer = next((loop for k, loop in enumerate(self.loops) if k == around), None)
        holes = [loop for k, loop in enumerate(self.loops) if k != around and loop is not None]
        reverse = self.face.Orientation() == occt().TopAbs_REVERSED
        made = Face(self.surface, outer, holes, name=self.name, reversed=reverse, tolerance=self.tolerance)
        if outer is None and not holes:
            # The edge of a surface that is damaged may bound no face, which is otherwise found when it is asked for.
            _ = made.boundary
        # A face turns loops that run clockwise, and those that are its boundary as they are it has not turned.
        is_kept = outer is None or bool(made.boundary) and made.boundary[0] is outer[0]
        self.read = Read(made, self.deviation, self.gap, not is_kept and outer is not None and _is_clockwise(outer))


def _is_clockwise(loop: list[NurbsCurve]) -> bool:
    """Whether a loop that closes in (u, v) runs clockwise; one that goes round does not."""
    points = np.concatenate([curve.control_points for curve in loop])
    points -= points[0]
    if np.abs(points[-1]).max() > CLOSED * np.abs(points).max():
        return False
    polygon = points[:-1, 0] @ points[1:, 1] - points[:-1, 1] @ points[1:, 0]
    # Control polygons of wild curves may say what is not so.
    return bool(polygon < 0.0) and signed_area(loop) < 0.0


def _scaled(where: Patch, scale: float) -> tuple[NurbsSurface, Array]:
    """The surface in another unit, and the factors of u and v that go with it."""
    factors = np.array([scale if along.is_length else 1.0 for along in (where.u, where.v)])
    surface = where.surface
    if scale == 1.0:
        return surface, factors
    knots = [factor * row for factor, row in zip(factors, surface.knots, strict=True)]
    return NurbsSurface(scale * surface.control_points, knots, surface.degree, surface.weights), factors


def read_face(face: Any, edges: Edges, name: str | None, scale: float = 1.0) -> Read:
    """A face of OCCT, its surface and its loops; see `read_faces`.

    Raises
    ------
    Unreadable
        Saying why.
    """
    [read] = read_faces([face], edges, [name], scale)
    if isinstance(read, Unreadable):
        raise read
    return read


def read_faces(
    faces: Sequence[Any], edges: Edges, names: Sequence[str | None], scale: float = 1.0
) -> list[Read | Unreadable]:
    """Faces of OCCT, their surfaces and their loops, or why they cannot be read.

    Each step is done for all faces before the next one: what it needs then stays in the processor's caches, which
    halves the time.

    Parameters
    ----------
    faces
        TopoDS_Face, of one solid.
    edges
        Those of the solid, with their numbers.
    names : str, optional, of each
    scale : float
        Our unit of length in a millimeter.
    """
    o = occt()
    drafts = [
        _Draft(face, o.as_face(face.Oriented(o.TopAbs_FORWARD)), name) for face, name in zip(faces, names, strict=True)
    ]
    edges.lay([draft.forward for draft in drafts])
    for step in (_Draft.lay, _Draft.ready, _Draft.draw, _Draft.join, _Draft.close, _Draft.make):
        for draft in drafts:
            if draft.reason is None:
                try:
                    step(draft, edges, scale)
                except Unreadable as reason:
                    draft.reason = reason
                except InputError as error:
                    draft.reason = Unreadable(str(error))
                    draft.reason.__cause__ = error
    return [draft.reason or draft.read for draft in drafts]
