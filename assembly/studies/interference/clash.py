"""The report: a row for every pair of bodies that is not proven to be farther apart than the margin."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from assembly._html import Table, as_html
from assembly._read_only import ReadOnlyArrays

if TYPE_CHECKING:
    from meshcat import Visualizer

    from assembly.assembly import Assembly

__all__ = ["Clash", "Interference", "Kind", "Relation"]

Array = NDArray[np.float64]
Kind = Literal["clear", "touching", "crossing", "enclosed", "undecided"]
Relation = Literal["free", "joined", "excluded", "contact"]
_COLUMNS = ("a", "b", "kind", "proved", "relation", "gap", "bound", "on_a", "on_b", "ax", "ay", "az", "bx", "by", "bz")
_HEADINGS = ("bodies", "kind", "proved", "relation", "gap", "bound", "on")


@dataclass(frozen=True, eq=False)
class Clash(ReadOnlyArrays):
    """Two bodies that are near each other, touch or cross.

    Attributes
    ----------
    bodies : (str, str)
        Names, in the order of the scene.
    kind : str
        ``"clear"``: apart by more than `touching`. ``"touching"``: they have points in common, or nearly, and overlap
        by no more than `touching`. ``"crossing"``: their surfaces cross. ``"enclosed"``: one is entirely inside the
        other one's material. ``"undecided"``: the time limit was reached before they were searched.
    gap : float or None
        The distance of the nearest points found. For bodies that cross, minus the depth: the deepest known place at
        which their surfaces face each other from inside, or, if less, how far the bodies have to be moved apart along
        the normal at `points`; 0 if it is not known. For an enclosed body, minus its distance from the walls. None if
        undecided.
    bound : float
        No points of the two surfaces are nearer than this; 0 where none is proven apart.
    points : (2, 3) or None
        The point of either body, in the world: as far apart as `gap` says.
    faces : (str, str) or None
        The face, edge or vertex of either body that the point is on.
    proved : bool
        Whether `kind` is certified. Clear: `bound` is the gap to within 1e-9 of the bodies' size. Touching: the bodies
        are clear as they are, or once one of them is moved or made slimmer by no more than `touching`. Crossing: the
        surfaces cross and no shorter translation undoes it, or a ball is inside of both bodies. Enclosed: the surfaces
        are apart, and one body is inside of the other one.
    relation : str
        ``"joined"`` by a joint, a gear or a rack, ``"excluded"`` by a clearance, in ``"contact"``, or ``"free"``.
    witness : (3,) or None
        For a crossing, the center of that ball, if one was found.
    """

    bodies: tuple[str, str]
    kind: Kind
    gap: float | None
    bound: float
    points: Array | None = field(repr=False)
    faces: tuple[str, str] | None
    proved: bool
    relation: Relation
    witness: Array | None = field(default=None, repr=False)

    @property
    def order(self) -> tuple[float, tuple[str, str]]:
        """Rows are in this order: the smallest gap first, then by names."""
        return (self.bound if self.gap is None else self.gap), self.bodies

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        gap = "?" if self.gap is None else f"{self.gap:.6g}"
        on = "" if self.faces is None else " / ".join(self.faces)
        proved = "proved" if self.proved else "-"
        return " / ".join(self.bodies), self.kind, proved, self.relation, gap, f"{self.bound:.6g}", on


@dataclass(frozen=True, eq=False)
class Interference(ReadOnlyArrays):
    """Pairs of bodies that cross, touch or are nearer to each other than a margin. Print it for a table.

    Attributes
    ----------
    rows : tuple of Clash
        Those that are not proven to be farther apart than the margin; the smallest gap first, then by names.
    margin : float
        In the unit of the scene.
    pairs : int
        All pairs of bodies with shapes.
    searched : int
        Those whose nearest points were searched for; of the others boxes tell that they are farther apart.
    without_shape : tuple of str
        Bodies that have no faces: nothing is said of them.
    scene : Assembly
    q : (n, 7)
        Where the bodies stand.
    """

    rows: tuple[Clash, ...]
    margin: float
    pairs: int
    searched: int
    without_shape: tuple[str, ...]
    scene: Assembly = field(repr=False)
    q: Array = field(repr=False)

    def __iter__(self) -> Iterator[Clash]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def is_complete(self) -> bool:
        """Whether all pairs were searched."""
        return not any(row.kind == "undecided" for row in self.rows)

    def _repr_html_(self) -> str:
        return as_html(self._counts(), Table(_HEADINGS, [row.cells for row in self.rows]))

    def _counts(self) -> str:
        counts = {kind: sum(row.kind == kind for row in self.rows) for kind in get_args(Kind)}
        found = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count) or "none"
        return f"{self.pairs} pairs, within {self.margin:g}: {found}"

    def __str__(self) -> str:
        lines = [_HEADINGS, *(row.cells for row in self.rows)]
        widths = [max(len(line[k]) for line in lines) for k in range(len(_HEADINGS))]
        numbers = (_HEADINGS.index("gap"), _HEADINGS.index("bound"))
        text = [
            "  ".join(
                cell.rjust(width) if k in numbers else cell.ljust(width)
                for k, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        ]
        return "\n".join([self._counts(), *(text if self.rows else [])])

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write a file of comma-separated values, one line per row; what is not known is empty."""
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_COLUMNS)
            for row in self.rows:
                gap = "" if row.gap is None else repr(row.gap)
                at = [""] * 6 if row.points is None else [repr(x) for x in row.points.ravel().tolist()]
                known = [row.kind, str(row.proved).lower(), row.relation, gap, repr(row.bound)]
                writer.writerow([*row.bodies, *known, *(row.faces or ("", "")), *at])

    def plot(self, open: bool = False, visualizer: Visualizer | None = None) -> Visualizer:
        """Draw the scene as `assembly.view.show` does, bodies that cross in red, and the places of all rows."""
        from assembly.view import show

        return show(self.scene, open=open, interference=self, visualizer=visualizer)
