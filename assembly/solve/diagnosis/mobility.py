"""How a scene can move: degrees of freedom by rank, redundant constraints, free motions.

With J the Jacobian of the rows in the twists of the moving bodies, the degrees of freedom at a pose are

    dof = 6 moving - rank J,

and the free motions span the null space of J. Grubler's count, 6 moving - rows, is right only where rows are
independent. One-sided rows do not count: they take away no degree of freedom until they bind.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly._html import Table, as_html
from assembly._read_only import ReadOnlyArrays
from assembly._turn import FoundInTurn, Turn
from assembly.constraints.packing.scene import Packed
from assembly.errors import integer, positive
from assembly.solve.dense.groups import Group, groups_of
from assembly.solve.dense.jacobian import Rows, rows_of
from assembly.solve.dense.rank import HELD
from assembly.solve.diagnosis.conflicts import conflicting_sets
from assembly.solve.diagnosis.nearby_poses import finite_dof, path
from assembly.solve.diagnosis.redundancy import dependent_sets
from assembly.solve.diagnosis.subset import Problem, Snapshot
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.scene import Scene

__all__ = ["Mobility"]

Array = NDArray[np.float64]
# Free motions that are printed.
MOST_MOTIONS = 12


@dataclass(frozen=True, eq=False)
class Mobility(ReadOnlyArrays):
    """What a scene's constraints leave free at a pose; `scene.mobility()` makes it, print it for a table.

    Attributes
    ----------
    dof : int
        Degrees of freedom: motions that violate no two-sided row to first order.
    grubler : int
        6 for every moving body, less the number of rows: the true count where rows are independent.
    rank, rows : int
        Of the two-sided rows' Jacobian, and their number. A contact is one row, that of two flat faces lying on each
        other three.
    free_motions : (dof, n, 6)
        Twists of all bodies (linear, then angular velocity, world axes, at the body's origin), zero for fixed ones.
        Orthonormal when lengths are divided by `size`; each is as near to a coordinate axis as the ones before it
        leave. Bodies that no constraint ties together do not share a motion.
    feasibility : float
        Largest violation at the pose, in the user's units. Where it is not zero the counts are those of this pose, of
        a mechanism that is not closed; pass a solution for those of the closed one.
    singular_values : array
        Of the rows, falling, one for every unknown; lengths divided by `size`, every row of length one.
    tolerance : float
        Singular values below it count as zero: 1e-7, or 10 sqrt(feasibility / size) if that is more, because a residual
        leaves a singular pose uncertain by its square root; where redundant rows disagree by 1e-9 to `fit` of the size,
        50 times as much as they do. Where some are within a factor 10 of it, the widest gap
        between them decides.
    size : float
        The scene's size, which lengths are divided by.
    q : (n, 7)
        The pose.

    Notes
    -----
    `finite_dof`, `redundant_sets`, `conflicting_sets` and `trajectory` are found when they are read. Where the time
    limit of `Assembly.mobility` is over before, they raise TimeoutError, and the table says that they are not known.
    """

    dof: int
    grubler: int
    rank: int
    rows: int
    free_motions: Array = field(repr=False)
    feasibility: float
    singular_values: Array = field(repr=False)
    tolerance: float
    size: float
    q: Array = field(repr=False)
    _scene: Scene = field(repr=False)
    _groups: tuple[Group, ...] = field(repr=False)
    _rows: Rows = field(repr=False)
    _worst: float = field(repr=False)
    _held: float = field(repr=False)
    _snapshot: Snapshot = field(repr=False)
    _drives: bool = field(repr=False)
    _time_limit: float | None = field(repr=False)

    @classmethod
    def at(
        cls,
        scene: Scene,
        packed: Packed,
        state: Array,
        *,
        solved: bool,
        drives: bool = True,
        tolerance: float | None = None,
        fit: float,
        time_limit: float | None = None,
    ) -> Mobility:
        """The mobility of a packed scene at a state; `solved` as of `Snapshot`, the rest as of `Assembly.mobility`.

        Rows that repeat each other and disagree by no more than `fit` count once.
        """
        interruption = _interruption(time_limit)
        rows = rows_of(packed, state)
        counted = ~rows.one_sided & (drives | ~rows.drives)
        limit = None if tolerance is None else positive("tolerance", tolerance)
        groups = tuple(groups_of(scene.bodies, scene.constraints, rows, counted, limit, fit, interruption))
        rank = sum(group.balanced.rank for group in groups)
        unknowns = 6 * sum(len(group.places) for group in groups)
        motions = np.zeros((unknowns - rank, packed.count, 6))
        k = 0
        for group in groups:
            for motion in group.balanced.free(interruption):
                motions[k, list(group.places)] = motion.reshape(-1, 6) * np.repeat([packed.scale, 1.0], 3)
                k += 1
        worst = float(np.abs(rows.residual[counted]).max(initial=0.0))
        held = fit if HELD < worst <= fit else HELD
        values = np.concatenate([group.balanced.singular_values for group in groups])
        return cls(
            dof=unknowns - rank,
            grubler=unknowns - int(counted.sum()),
            rank=rank,
            rows=int(counted.sum()),
            free_motions=motions,
            feasibility=_feasibility(packed, rows),
            singular_values=np.sort(values)[::-1],
            tolerance=groups[0].balanced.tolerance,
            size=packed.scale,
            q=rows.state[: packed.contacts_at].reshape(-1, 7),
            _scene=scene,
            _groups=groups,
            _rows=rows,
            _worst=worst,
            _held=held,
            _snapshot=Snapshot(scene, packed, rows.state, rows, solved, held),
            _drives=drives,
            _time_limit=time_limit,
        )

    @property
    def _turn(self) -> Turn:
        """That of the scene."""
        return self._snapshot.turn

    @cached_property
    def redundant_sets(self) -> list[tuple[str, ...]]:
        """Sets of constraints the last of which asks, in part or wholly, what the others ask already.

        Constraints are taken in the order they were given; all the others of a set are needed to say what its last one
        repeats. A single name repeats itself. Dependencies are those at the pose, to first order.
        """
        asked = _interruption(self._time_limit)
        owners = self._rows.owners
        found = [
            places for group in self._groups for places in dependent_sets(group.balanced, owners[group.rows], asked)
        ]
        return [self._names(places) for places in sorted(found, key=lambda places: (places[-1], len(places)))]

    @property
    def redundant(self) -> list[str]:
        """Names in `redundant_sets`, sorted, each once."""
        return sorted({name for names in self.redundant_sets for name in names})

    @FoundInTurn
    def conflicting_sets(self) -> list[tuple[str, ...]]:
        """Disjoint minimal sets of constraints that cannot hold together near the pose; [] where all can.

        Found by solves that leave out one constraint after the other, when this is first read. Driven values, limits
        and one-sided constraints take part.
        """
        found = conflicting_sets(self._snapshot, _interruption(self._time_limit))
        return [self._names(places) for places in sorted(found)]

    @property
    def conflicting(self) -> list[str]:
        """Names in `conflicting_sets`, sorted, each once."""
        return sorted({name for names in self.conflicting_sets for name in names})

    def _names(self, places: Sequence[int]) -> tuple[str, ...]:
        return tuple(self._scene.constraints[k].name for k in places)

    @FoundInTurn
    def finite_dof(self) -> int:
        """Degrees of freedom of the poses nearby: the least that was found a small way along the free motions.

        Where rows are dependent, bodies are moved by 0.02 (sizes of the scene, radians) along free motions and put back
        onto the constraints by solves, and the rank is taken there; no more than the directions in which they went. So
        motions from which bodies come back do not count: they exist to first order only. Found when this is first
        read. Where the rows do not hold it is `dof`.
        """
        if self.dof == 0 or not self._worst <= self._held:
            return self.dof
        return finite_dof(self._problem, self._groups, self.q, self.size, _interruption(self._time_limit))

    @property
    def singular(self) -> bool:
        """Whether the pose has more degrees of freedom than poses nearby: `finite_dof < dof`."""
        return self.finite_dof < self.dof

    @FoundInTurn
    def _problem(self) -> Problem:
        return self._snapshot.problem(one_sided=False, drives=self._drives)

    def trajectory(self, k: int = 0, amplitude: float = 0.5, frames: int = 61) -> Array:
        """Poses along a free motion, to and fro, put back onto the constraints: for `asm.view.animate`.

        Parameters
        ----------
        k : int
            Which of `free_motions`.
        amplitude : float
            How far, in lengths of that motion: sizes of the scene and radians, all bodies together.
        frames : int
            Poses; the first and the last are the pose itself.

        Returns
        -------
        (frames, n, 7)
            One swing there, back and to the other side. Where the constraints let bodies go no farther they wait.

        Raises
        ------
        InputError
            No such motion, an amplitude that is not positive, fewer than 5 frames.
        """
        k = integer("k", k, 0, self.dof - 1)
        reach = positive("amplitude", amplitude)
        count = integer("frames", frames, 5, 10**6)
        motion = self.free_motions[k] / np.repeat([self.size, 1.0], 3)
        interruption = _interruption(self._time_limit)
        level = reach * np.sin(2.0 * pi * np.arange(count) / (count - 1))
        level[-1] = 0.0
        poses = np.repeat(self.q[None], count, axis=0)
        for side in (1.0, -1.0):
            there = np.flatnonzero(side * level > 1e-9 * reach)
            rising = there[np.argsort(side * level[there], kind="stable")]
            poses[rising] = path(self._problem, self.q, side * motion, self.size, side * level[rising], interruption)
        return poses

    def _singular_lines(self) -> list[str]:
        return [f"  singular: {self.finite_dof} at poses nearby"] if self.singular else []

    def _redundant_lines(self) -> list[str]:
        return [f"  redundant: {_listed(names)}" for names in self.redundant_sets]

    def _conflicting_lines(self) -> list[str]:
        return [f"  conflicting: {_listed(names)}" for names in self.conflicting_sets]

    def _first_lines(self) -> list[str]:
        many = "degree" if self.dof == 1 else "degrees"
        lines = [
            f"{self.dof} {many} of freedom; Grubler's count is {self.grubler}: {self.rows} rows of rank {self.rank}"
        ]
        if self._worst <= self._held:
            lines += _known("freedoms of poses nearby", self._singular_lines)
            lines += _known("redundant constraints", self._redundant_lines)
        if HELD < self._worst <= self._held:
            lines.append(f"  redundant constraints disagree by up to {self.feasibility:.3g}")
        if not self._worst <= self._held:
            lines.append(f"  the pose violates constraints by {self.feasibility:.3g}; counts are those of this pose")
            lines += _known("conflicting constraints", self._conflicting_lines)
        return lines

    def _motions(self) -> list[tuple[int, str, str]]:
        """Of the first free motions: the number, a body that moves, and how, in words."""
        return [
            (k, body.name, words)
            for k, motion in enumerate(self.free_motions[:MOST_MOTIONS])
            for body, twist, place in zip(self._scene.bodies, motion, self.q[:, :3], strict=True)
            if (words := _words(twist, place, self.size))
        ]

    def __str__(self) -> str:
        lines = self._first_lines() + [f"  motion {k}  {name:<20} {words}" for k, name, words in self._motions()]
        if self.dof > MOST_MOTIONS:
            lines.append(f"  and {self.dof - MOST_MOTIONS} motions more")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        more = [f"and {self.dof - MOST_MOTIONS} motions more"] if self.dof > MOST_MOTIONS else []
        return as_html(*self._first_lines(), Table(("motion", "body", "how it moves"), list(self._motions())), *more)


def _interruption(time_limit: float | None) -> Interruption:
    """Whom is asked whether to go on: CTRL_C where there is no limit, else one whose time begins now."""
    return CTRL_C if time_limit is None else Interruption(time_limit)


def _known(what: str, lines: Callable[[], list[str]]) -> list[str]:
    """Lines of a table; where the time limit is over before they are known, one that says so."""
    try:
        return lines()
    except TimeoutError:
        return [f"  {what} are not known: time_limit was over"]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))


def _feasibility(packed: Packed, rows: Rows) -> float:
    """Largest violation in the user's units."""
    each = np.where(rows.one_sided, np.maximum(-rows.residual, 0.0), np.abs(rows.residual))
    units = np.where(packed.lengths[rows.program_rows], packed.scale, 1.0)
    return float((each * units).max(initial=0.0))


def _words(twist: Array, place: Array, size: float) -> str:
    """A twist in words; "" where nothing moves."""
    v, w = twist[:3], twist[3:]
    rate, speed = float(np.linalg.norm(w)), float(np.linalg.norm(v))
    if rate < 1e-9:
        return "" if speed < 1e-9 * size else f"slides along {_vector(v / speed)} at {speed:.4g}"
    axis = w / rate
    # The point of the screw's axis nearest to the body's origin.
    center = place + np.cross(axis, v) / rate
    slide = float(v @ axis)
    text = f"turns about {_vector(axis)} through {_vector(center)} at {rate:.4g}"
    return text if abs(slide) < 1e-9 * size else f"{text}, slides along it at {slide:.4g}"


def _vector(v: Array) -> str:
    return "(" + ", ".join(f"{value + 0.0:.4g}" for value in np.where(np.abs(v) < 1e-9, 0.0, v)) + ")"
