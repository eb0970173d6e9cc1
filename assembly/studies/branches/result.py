"""A branch that was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._html import printed
from assembly._read_only import ReadOnlyArrays
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.solve.loop.settings import OBJECTIVE
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.studies.branches.curve import Curve, Place
from assembly.studies.branches.events import Found
from assembly.studies.branches.slots import NOBODY, meeting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from assembly.studies.branches.follower import Way

__all__ = ["Branch", "BranchEvent", "branch_of"]

Array = NDArray[np.float64]
# Of events.
KINDS = (
    "turning point",
    "crossing",
    "limit reached",
    "limit left",
    "contact closed",
    "contact opened",
    "contact over an edge",
    "end of range",
    "closed loop",
    "lost",
    "step limit",
)

# Of these some end a branch; at any other one that does it is blocked.
ENDS = ("end of range", "closed loop", "lost", "step limit")


@dataclass(frozen=True, eq=False)
class BranchEvent(ReadOnlyArrays):
    """Something that happens on a branch.

    Attributes
    ----------
    kind : str
        "turning point", "crossing", "limit reached", "limit left", "contact closed", "contact opened", "contact over an
        edge", "end of range", "closed loop", "lost", "step limit".
    name : str
        The constraint that it is of; empty where there is none.
    row : int
        Of the branch's table.
    value : float
        Of the parameter.
    q : (n, 7)
    bodies : tuple of str
        Of a contact, the names of the two that meet; of a branch that is lost, those of which it is not known whether
        they are clear beyond. Empty where there are none.
    place : (3,)
        Where they meet, in the world; NaN where that is not known.
    """

    kind: str
    name: str
    row: int
    value: float
    q: Array = field(repr=False)
    bodies: tuple[str, ...] = ()
    place: Array = field(default_factory=lambda: np.full(3, np.nan))


@dataclass(frozen=True, eq=False)
class Branch(ReadOnlyArrays):
    """A branch of solutions along a parameter: one row per point, in order along the branch; print it for its events.

    Attributes
    ----------
    parameter : Parameter
    values : (k,)
        Of the parameter.
    lengths : (k,)
        Along the branch, from its first row: twists, lengths over the scene's size, and the parameter, in radians or
        over the size too.
    poses : (k, n, 7)
    of : tuple of Measure
    measures : (k, m)
        Angles of joints go on past whole turns.
    events : tuple of BranchEvent
        In order along the branch; each has a row of its own but the ends that are no points.
    closed : bool
        Whether the branch came back to where it began, and `closure`, by how much it missed that; NaN where it did not.
    start : int
        The row that it was followed from.
    proved : (k,) bool
        Whether it is proven at a point that all pairs of bodies which clearances keep apart are clear, or only touch.
        False where faces lie on each other and samples stand for the proof.
    depth : float
        With `swept=True` the largest possible overlap of bodies on the way, in the scene's unit; else NaN.
    """

    parameter: Parameter
    values: Array = field(repr=False)
    lengths: Array = field(repr=False)
    poses: Array = field(repr=False)
    of: tuple[Measure, ...]
    measures: Array = field(repr=False)
    events: tuple[BranchEvent, ...]
    closed: bool
    closure: float
    start: int
    proved: NDArray[np.bool_] = field(repr=False)
    depth: float
    _has_clearances: bool = field(default=False, repr=False)

    @property
    def table(self) -> NDArray[np.void]:
        """One row per point: the parameter, the length along the branch, and measures, by their names.

        Of a scene with clearances also whether the point is proven, as "proved".
        """
        names = [self.parameter.name, "length", *(item.name for item in self.of)]
        for k, name in enumerate(names):
            if name in names[:k] or (name == "proved" and self._has_clearances):
                raise InputError(f"measures are {names[2:]}; expected names that differ: give them name=")
        columns = [self.values, self.lengths, *self.measures.T]
        if self._has_clearances:
            names.append("proved")
            columns.append(self.proved)
        table = np.empty(len(self.values), dtype=[(name, one.dtype) for name, one in zip(names, columns, strict=True)])
        for name, column in zip(names, columns, strict=True):
            table[name] = column
        return table

    @property
    def ends(self) -> tuple[str, str]:
        """How the branch ends before its first row and after its last one.

        "end of range", "closed loop", "lost", "step limit"; or "blocked" by a limit or a contact, which the last event
        there tells.
        """
        if self.closed:
            return "closed loop", "closed loop"
        kinds = self.events[0].kind, self.events[-1].kind
        first, last = (kind if kind in ENDS else "blocked" for kind in kinds)
        return first, last

    def events_of(self, kind: str) -> tuple[BranchEvent, ...]:
        """The events of a kind.

        Raises
        ------
        InputError
            There is no such kind.
        """
        if kind not in KINDS:
            raise InputError(f"kind is {kind!r}; expected one of {', '.join(map(repr, KINDS))}")
        return tuple(event for event in self.events if event.kind == kind)

    def plot(self) -> Figure:
        """Measures along the parameter, with events; the length along the branch where there are none (extra plot)."""
        from assembly.view.branch_plot import plot_branch

        return plot_branch(self)

    def _repr_html_(self) -> str:
        return printed(self)

    def __str__(self) -> str:
        end = f"closed to {self.closure:.1e}" if self.closed else "not closed"
        name, low, high = self.parameter.name, self.values.min(), self.values.max()
        lines = [f"branch along {name} from {low:.9g} to {high:.9g}: {len(self.values)} points, {end}"]
        for event in self.events:
            what = f"{event.kind} of {event.name}" if event.name else event.kind
            if event.bodies:
                near = "" if np.isnan(event.place).any() else f" near ({', '.join(f'{x:.4g}' for x in event.place)})"
                what += f", {' and '.join(event.bodies)}{near},"
            told = [f"{item.name} = {x:.9g}" for item, x in zip(self.of, self.measures[event.row], strict=True)]
            lines.append(", ".join([f"  {what} at {event.value:.12g}", *told]))
        return "\n".join(lines)


def branch_of(curve: Curve, ways: Sequence[Way], measures: tuple[Measure, ...], depth: float) -> Branch:
    """The branch that was found in one direction, and perhaps in the other, and how deep bodies may go in on it."""
    ahead, *rest = ways
    places, lengths, proved = list(ahead.places), list(ahead.lengths), list(ahead.proved)
    events = [(row, found) for row, found in ahead.events]
    if rest:
        back = rest[0]
        shift = len(back.places) - 1
        places, proved = back.places[:0:-1] + places, back.proved[:0:-1] + proved
        lengths = [back.lengths[-1] - x for x in back.lengths[:0:-1]] + [back.lengths[-1] + x for x in lengths]
        turned = [(shift - row, found) for row, found in reversed(back.events)]
        events = turned + [(shift + row, found) for row, found in events]
    told = tuple(_told(curve, row, found) for row, found in events)
    start = len(rest[0].places) - 1 if rest else 0
    return Branch(
        curve.parameter,
        np.array([place.value for place in places]),
        np.array(lengths),
        np.array([place.q for place in places]),
        measures,
        _columns(curve, measures, places, start),
        told,
        ahead.closure is not None,
        float("nan") if ahead.closure is None else ahead.closure,
        start,
        np.array(proved, dtype=np.bool_),
        depth,
        curve.scene.packed().keeps_apart,
    )


def _told(curve: Curve, row: int, found: Found) -> BranchEvent:
    """An event of a row of the table."""
    place = found.place
    meets = found.meets
    if meets is None:
        meets = meeting(place.packed, place.state, found.row) if found.row >= 0 else NOBODY
    name = curve.owner(found.row) if found.row >= 0 else ""
    return BranchEvent(found.kind, name, row, place.value, place.q.copy(), meets.bodies, meets.place)


def _columns(curve: Curve, measures: Sequence[Measure], places: Sequence[Place], start: int) -> Array:
    """Measures (k, m) at places; angles go on past whole turns from what they are at the start."""
    rows = [[_measured(curve, item, place) for item in measures] for place in places]
    told = np.array(rows, dtype=np.float64).reshape(len(places), len(measures))
    for k, item in enumerate(measures):
        if item.kind == "coordinate" and item.unit == "rad":
            turned = np.unwrap(told[:, k])
            told[:, k] = turned + (told[start, k] - turned[start])
    return told


def _measured(curve: Curve, measure: Measure, place: Place) -> float:
    """A measure at a place."""
    # What measures read of a solution: poses, tracked values and forces.
    scene = curve.scene._scene
    assert scene is not None
    curve.parameter._number.put(place.value)
    curve.scene.packed().refresh()
    state, packed = place.state.copy(), place.packed
    state[packed.multipliers_at : packed.residuals_at] = place.forces
    state[packed.residuals_at : packed.memory_at] = 0.0
    if measure.kind == "objective":
        state[packed.results_at + OBJECTIVE] = curve.objective(place)
    return measure.value(Solution(scene, packed, state, Status.SOLVED, 0.0, np.empty((0, 7))))
