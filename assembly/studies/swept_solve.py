"""A solve that goes on from another one, asked for its way: it ends where something is in the way.

Everything that may change between solves, driven values, offsets, limits and targets, goes from what the start was
solved with to what is asked for, along a line. At parts of this way the scene is solved, each time from the last pose to
which the way is known, and the proof is asked for the straight way of bodies between the two (`docs/certified.md`).
That is the motion of the mechanism as long as the two hardly differ in the middle. Where one of this fails, the step is
halved, and the way ends where it is too short to be halved.
"""

from __future__ import annotations

from copy import copy
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.asked import Asked
from assembly.errors import InputError
from assembly.proximity.clearance.proof import LEAST_SIZE, ClearanceProof
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.clearance_proof import can_prove, lent_proof, near_contacts
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import OUT_OF_TIME
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.solve.way import Way
from assembly.tracking.clear_ticks import ClearTicks

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["swept_solve"]

Array = NDArray[np.float64]
# Nothing that is asked for, and no angle that is counted, changes by more in one step: radians, parts of the size.
LONGEST = 0.25
# The way is known to this part of it.
SHORTEST = 2.0**-20
# In the middle of a step points of a body, seen from another one, are off its straight way by no more, in parts of the
# size.
STRAIGHT = 1e-4
# Bodies whose faces lie on each other go no farther in one step, in parts of their size: there is no proof between.
SAMPLED_WAY = 1e-2
# Contacts that are open by less, in parts of the size, are where a body is in the way.
NEAR = 1e-2


class _Hindrance(NamedTuple):
    """Why a step is not made: what it says of that, and the numbers of pairs of bodies that are in the way."""

    reason: str
    pairs: list[int]
    place: Array


UNKNOWN = np.full(3, np.nan)


def swept_solve(scene: Assembly, start: object, options: dict[str, Any], interruption: Interruption) -> Solution:
    """See `Assembly.solve`."""
    begin = perf_counter()
    packed = scene.packed()
    if not isinstance(start, Solution):
        raise InputError(f"q0 is {type(start).__name__!r} with swept=True; expected a Solution, where the way begins")
    scene._state_of("q0", packed, start)
    if not (start.success or start.way is not None):
        raise InputError(f"q0 is {start.status.name} with swept=True; expected a solution at which all constraints hold")
    if not packed.clearance_rows:
        raise InputError("swept is True in an assembly where no clearance keeps bodies apart; expected asm.Clearance()")
    if not can_prove(packed):
        raise InputError(f"swept is True in a scene of size {packed.scale:g}; expected {LEAST_SIZE:g} to {1 / LEAST_SIZE:g}")
    direct = scene._from_start(start, None, options, interruption)
    asked = packed.asked
    try:
        with lent_proof(packed, scene.bodies) as proof:
            solution = _Walk(scene, start, direct, proof, options, interruption).end()
    finally:
        packed.ask_for(asked)
    solution.seconds = perf_counter() - begin
    return solution


class _Walk:
    """The steps from a start to what is asked for."""

    def __init__(
        self,
        scene: Assembly,
        start: Solution,
        direct: Solution,
        proof: ClearanceProof,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> None:
        self._scene, self._packed, self._direct, self._proof = scene, direct._packed, direct, proof
        self._options, self._interruption = options, interruption
        self._start, self._asked = start, direct._asked
        touching = direct._touching * self._packed.scale
        self._ticks = ClearTicks(start, touching, proof, SAMPLED_WAY)
        if self._ticks.doubtful:
            named = self._named(list(self._ticks.doubtful))
            raise InputError(f"q0 is a solution with swept=True at which {named} are not clear; expected a clear one")
        self._is_proven, self._depth = self._ticks.proved, 0.0
        self._seen_from, self._seen = np.array(proof.pairs, dtype=np.int64).T
        roots = [proof.cells_of(k).root for k in range(len(proof.pairs))]
        self._middles = np.array([root.center for root in roots])
        self._radii = np.array([float(root.radius) for root in roots])

    def end(self) -> Solution:
        """The solution of what is asked for, or the last one on the way there."""
        done, step, at = 0.0, self._first_step(), self._start
        there = self._solved(at, step)
        while True:
            if self._interruption.is_over():
                return self._ended(self._interruption.status(OUT_OF_TIME), at, done, None)
            middle = self._solved(at, done + 0.5 * step)
            found = self._hindrance(at, middle, there)
            if found is None:
                done, at = done + step, there
                if done == 1.0:
                    return self._ended(at.status, at, done, None)
                # Parts are multiples of powers of two, and so 1 is reached exactly.
                if 2.0 * step <= self._first_step() and done % (2.0 * step) == 0.0:
                    step *= 2.0
                there = self._solved(at, done + step)
            elif step <= SHORTEST:
                return self._ended(Status.BLOCKED, at, done, found)
            else:
                step, there = 0.5 * step, middle

    def _first_step(self) -> float:
        """The longest step, a power of two: in it nothing that is asked for changes by more than is allowed."""
        is_angle = [equation.terms[0][1].is_angle for equation, _, _ in self._packed._sources]
        change = self._start._asked.change(self._asked, self._packed.scale, is_angle)
        return float(min(1.0, max(2.0 ** np.floor(np.log2(LONGEST / change)), SHORTEST))) if change > 0.0 else 1.0

    def _solved(self, at: Solution, part: float) -> Solution:
        """The solution at a part of the way, from an earlier one; at its end the direct one, if it is the same."""
        if part == 1.0 and at is self._start:
            return self._direct
        asked = self._asked if part == 1.0 else self._start._asked.toward(self._asked, part)
        self._packed.ask_for(asked)
        solution = self._scene._from_start(at, None, self._options, self._interruption)
        is_direct = part == 1.0 and self._direct.success and solution.success
        return self._direct if is_direct and self._off(self._direct.q, solution.q) <= self._allowed else solution

    @property
    def _allowed(self) -> float:
        return STRAIGHT * self._packed.scale

    def _hindrance(self, at: Solution, middle: Solution, there: Solution) -> _Hindrance | None:
        """Why the way from one solution to another is not known to be clear; None where it is."""
        if not there.success:
            pairs = [k for k, pair in enumerate(there._clear) if not pair.holds]
            places = [there._clear[k].answer.place for k in pairs]
            return self._told(f"a solve beyond is {there.status.name}", pairs, places, at)
        turned = there._state[self._angles] - at._state[self._angles]
        if not middle.success or np.abs(turned).max(initial=0.0) > LONGEST:
            return _Hindrance("constraints do not hold all along", [], UNKNOWN)
        off = self._bent(at.q, middle.q, there.q)
        if off > self._allowed:
            return _Hindrance("the pose jumps", [], UNKNOWN)
        known = self._proof.fronts.pair.known == 1.0
        for k in np.flatnonzero(~known).tolist():
            if self._proof.way_length(k, at.q, there.q) > SAMPLED_WAY * self._proof.size(k):
                return self._told("the way is not proven", [k], [UNKNOWN], at)
        if not self._ticks.holds(there):
            doubtful = self._ticks.doubtful
            return self._told("the way is not proven", list(doubtful), [one.place for one in doubtful.values()], at)
        self._is_proven = self._is_proven and self._ticks.proved
        self._depth = max(self._depth, self._ticks.way_depth, off)
        return None

    @property
    def _angles(self) -> slice:
        """Where a state has the angles that are counted on past whole turns."""
        return slice(self._packed.angles_at, self._packed.multipliers_at, TRACK)

    def _relative(self, q: Array) -> tuple[Array, Array]:
        """Of all pairs the turn (quaternion) of the second body and the place of its middle, seen from the first."""
        a, b = q[self._seen_from], q[self._seen]
        back = a[:, 3:] * [1.0, -1.0, -1.0, -1.0]
        middles = b[:, :3] + _rotated(b[:, 3:], self._middles) - a[:, :3]
        return _product(back, b[:, 3:]), _rotated(back, middles)

    def _bent(self, before: Array, middle: Array, after: Array) -> float:
        """How far the pose in the middle of a step is from the middle of the straight ways of the proof."""
        (e0, x0), (e2, x2) = self._relative(before), self._relative(after)
        e2 = np.where((e0 * e2).sum(axis=1, keepdims=True) < 0.0, -e2, e2)
        turn = e0 + e2
        return self._farthest((turn / np.linalg.norm(turn, axis=1, keepdims=True), 0.5 * (x0 + x2)), middle)

    def _off(self, q: Array, other: Array) -> float:
        """How far points of bodies, seen from others, are apart at two poses, at most."""
        return self._farthest(self._relative(q), other)

    def _farthest(self, seen: tuple[Array, Array], q: Array) -> float:
        turn, place = self._relative(q)
        # |e - f| is twice the sine of a quarter of the angle between them.
        chord = np.minimum(np.linalg.norm(turn - seen[0], axis=1), np.linalg.norm(turn + seen[0], axis=1))
        angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
        return float((np.linalg.norm(place - seen[1], axis=1) + self._radii * angle).max())

    def _told(self, reason: str, pairs: list[int], places: list[Array], at: Solution) -> _Hindrance:
        """A hindrance, and where its first pair meets: a contact that is nearly closed, or where a crossing was found."""
        place = places[0] if places else UNKNOWN
        near = near_contacts(at, self._proof, NEAR * self._packed.scale) if pairs else {}
        if pairs and pairs[0] in near:
            contacts = near[pairs[0]]
            place = contacts.places[int(np.argmin(contacts.gaps))]
        return _Hindrance(reason, pairs, place)

    def _names(self, pairs: list[int]) -> tuple[tuple[str, str], ...]:
        bodies = self._scene.bodies
        return tuple((bodies[a].name, bodies[b].name) for a, b in (self._proof.pairs[k] for k in pairs))

    def _named(self, pairs: list[int]) -> str:
        return ", ".join(f"{a} and {b}" for a, b in self._names(pairs))

    def _ended(self, status: Status, at: Solution, part: float, found: _Hindrance | None) -> Solution:
        """A solution with what is known of the way to it."""
        # The start stays what it is.
        solution = copy(at) if status is not at.status or at is self._start else at
        solution.status = status
        solution._is_sampled = not self._is_proven
        reason, pairs, place = found or _Hindrance("", [], UNKNOWN)
        if pairs:
            reason = f"{self._named(pairs)} are in the way{'' if np.isnan(place).any() else f' near {_text(place)}'}"
        solution.way = Way(part, self._depth, self._names(pairs), place, reason)
        return solution


def _text(place: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in place) + ")"


def _product(a: Array, b: Array) -> Array:
    """Products (m, 4) of unit quaternions."""
    real = a[:, :1] * b[:, :1] - (a[:, 1:] * b[:, 1:]).sum(axis=1, keepdims=True)
    return np.concatenate([real, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], axis=1)


def _rotated(e: Array, x: Array) -> Array:
    """Vectors (m, 3), turned by unit quaternions (m, 4)."""
    twice = 2.0 * np.cross(e[:, 1:], x)
    return x + e[:, :1] * twice + np.cross(e[:, 1:], twice)
