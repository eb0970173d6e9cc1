"""Clearance: bodies do not cross, and keep a least gap."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from copy import copy

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.tracked_sizes import check_size
from assembly.errors import InputError, bounded, items, number, renamed
from assembly.kinematics.body import Body
from assembly.kinematics.changes import count_number

__all__ = ["Clearance"]


class Clearance(Constraint):
    """The gap between any two of the bodies is at least `minimum`, everywhere.

    Contacts come and go as the bodies move: a contact manager (`Manager`) lists every extremal pair of points that
    comes near, each is a row gap >= minimum while it is near, and steps are limited so that nothing can touch that is
    not listed. A solve is SOLVED only if every pair of bodies is proven to be clear, or to be clear after a move of one
    body by the option `touching`; for a tick the same is proven, also of the way to it (`docs/certified.md`). For some
    faces that lie on each other without play neither can be proven: then samples are tested, and `Solution.proved` is
    False. If nothing is known of a pair, the solve is STALLED and names it.

    A `Contact` of the same two bodies is no violation. A `minimum` above zero does not apply around it: in the part
    between the two bodies that can be reached from its points without the gap rising to `minimum` they only may not
    cross. For a contact that is still open this is the part around where it will close; a one-sided contact that is
    open by `minimum` or more has no such part. For these two bodies it is proven that they do not cross; the gap around
    the contact is kept by rows, and `Solution.proved` is False if `minimum` is above zero.

    Bodies that cross at the start are pushed apart by their contacts. If they are stuck through each other or within
    each other, parting them by the shortest translation found is tried as well; of the results that hold, the one with
    the least objective (by default the least move) is the answer. If none holds the solve is STALLED.

    For solids with edges, corners are contacts too: vertices and points of edges over a face, edges that cross, if the
    normal misses their normal cones by less than 0.3 rad, and points of a curve along which two faces almost touch,
    such as a ring and the plate below it. Faces that lie on each other have several contacts that carry.

    Parameters
    ----------
    bodies : iterable of Body, optional
        Two or more, with shapes; every body of the assembly that has one by default.
    minimum : float
        Not negative, in the unit of the scene.
    name : str, optional
        "clearance" or "clearance a-b-..." by default.
    exclude : iterable of (Body, Body)
        Pairs that may overlap: a pin in its hole, links that a joint holds together.
    merge_radius : float
        Two contacts of the same two bodies count as one if their points are nearer than this on both bodies, also along
        the surfaces: the radius of the spheres of neglect (paper 001, section 5), in parts of the scene's size.
        Contacts farther apart are all kept, also across a wire thinner than the radius.
    slots : int, optional
        How many contacts may be near at a time; by default six for one pair and two more for each further one, at most
        eight plus four for each body. A solve that needs more begins again with four times as many.
    neglect, places
        Former names of `merge_radius` and `slots`; they warn.

    Raises
    ------
    InputError, TypeError
        Fewer than two bodies, bodies without shape, a pair that is not of the bodies, numbers out of range; sizes of
        bodies outside of 1e-75 to 1e75, or spans of surface parameters outside of 1e-60 to 1e60. With `bodies=None`
        this is checked when the assembly is solved.
    """

    # Whether corners over faces are listed besides extrema, for steps to see.
    corners = True

    def __init__(
        self,
        bodies: Iterable[Body] | None = None,
        minimum: float = 0.0,
        name: str | None = None,
        *,
        exclude: Iterable[tuple[Body, Body]] = (),
        merge_radius: float = 1e-6,
        slots: int | None = None,
        neglect: float | None = None,
        places: int | None = None,
    ) -> None:
        chosen = None if bodies is None else items("bodies", bodies, "two bodies or more, or None for all")
        if chosen is not None:
            for k, body in enumerate(chosen):
                if not isinstance(body, Body):
                    raise TypeError(f"bodies[{k}] is {body!r}; expected a Body")
                if not body.faces:
                    raise InputError(f"bodies[{k}] is {body.name!r}, a body without a shape; expected one with a face")
                check_size(f"bodies[{k}], {body.name!r},", body)
            if len(chosen) < 2:
                raise InputError(f"bodies has {len(chosen)} of them; expected two or more, or None for all")
        super().__init__(chosen or (), "clearance" if chosen is None and name is None else name, "clearance")
        self._all = chosen is None
        self.minimum = minimum
        merge_radius = renamed("merge_radius", merge_radius, "neglect", neglect)
        self._merge_radius = number("merge_radius", merge_radius)
        if not 0.0 < self._merge_radius <= 1.0:
            raise InputError(
                f"merge_radius is {self._merge_radius:g}; expected a positive part of the scene's size, 1 at most"
            )
        slots = renamed("slots", slots, "places", places)
        if slots is not None and (not isinstance(slots, int) or isinstance(slots, bool) or slots < 1):
            raise InputError(f"slots is {slots!r}; expected an integer of 1 or more")
        self._slots = slots
        self._excluded = tuple(_pair(k, pair) for k, pair in enumerate(exclude))
        for k, pair in enumerate(self._excluded):
            for body in pair:
                if chosen is not None and not any(body is other for other in chosen):
                    raise InputError(f"exclude[{k}] names body {body.name!r}; expected bodies of this clearance")

    @property
    def minimum(self) -> float:
        """The least gap; settable between solves."""
        return self._minimum

    @minimum.setter
    def minimum(self, value: float) -> None:
        least = bounded("minimum", value)
        if not least >= 0.0:
            raise InputError(f"minimum is {least:g}; expected a length of zero or more")
        self._minimum = least
        count_number(self)

    @property
    def merge_radius(self) -> float:
        """Radius of the spheres of neglect, in parts of the scene's size."""
        return self._merge_radius

    @property
    def slots(self) -> int | None:
        """How many contacts may be near at a time; None for six a pair."""
        return self._slots

    @property
    def neglect(self) -> float:
        """`merge_radius`, by its former name."""
        return renamed("merge_radius", self._merge_radius, "neglect", self._merge_radius)

    @property
    def places(self) -> int | None:
        """`slots`, by its former name."""
        warnings.warn("places is called slots now", DeprecationWarning, stacklevel=2)
        return self._slots

    @property
    def exclude(self) -> tuple[tuple[Body, Body], ...]:
        """Pairs that may overlap."""
        return self._excluded

    @property
    def is_of_all(self) -> bool:
        """Whether every body of the assembly takes part."""
        return self._all

    def pairs(self, bodies: Sequence[Body]) -> list[tuple[Body, Body]]:
        """The pairs that are kept apart, of bodies of which one moves, among those of an assembly."""
        chosen = [body for body in (bodies if self._all else self.bodies) if body.faces]
        if self._all:
            for body in chosen:
                check_size(f"body {body.name!r} of {self.name!r}", body)
        return [
            (a, b)
            for k, a in enumerate(chosen)
            for b in chosen[k + 1 :]
            if not (a.fixed and b.fixed) and not any({id(a), id(b)} == set(map(id, pair)) for pair in self._excluded)
        ]

    def _without(self, pairs: Sequence[tuple[Body, Body]]) -> Clearance:
        """The same clearance of the other pairs of bodies."""
        other = copy(self)
        other._excluded = (*self._excluded, *pairs)
        return other

    def __repr__(self) -> str:
        bodies = "all bodies" if self._all else [body.name for body in self.bodies]
        return f"Clearance({bodies}, minimum={self.minimum:g}, name={self.name!r})"


def _pair(k: int, pair: tuple[Body, Body]) -> tuple[Body, Body]:
    """Two bodies, checked."""
    try:
        a, b = pair
    except (TypeError, ValueError):
        raise InputError(f"exclude[{k}] is {pair!r}; expected a pair of bodies") from None
    for body in (a, b):
        if not isinstance(body, Body):
            raise TypeError(f"exclude[{k}] is {pair!r}; expected a pair of bodies")
    return a, b
