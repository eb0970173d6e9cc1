"""How solutions of a scene are derived by the same parameters again and again: what depends on its structure alone.

A plan stays with the packed scene and its twins of other numbers. With it all derivatives of a solution are two
compiled calls: evaluate (`curvature_at`), and `derive`. What is rarer goes the general way of
`derivatives/implicit.py`, which gives the same: numbers that make faces, wrenches, pairs at folds, dexterities,
clearances, rows at their bounds without a force, and ranks and curvatures that are in doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import read_only
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.objectives import FrameDistance
from assembly.constraints.packing.measured_size import base_of
from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.scene_writer import frame_numbers
from assembly.constraints.program import records as layout
from assembly.constraints.program.contact import TOUCHING
from assembly.constraints.program.objective_terms import POSTURE, POSTURE_QUATERNION, TERM
from assembly.derivatives import linearized as records
from assembly.derivatives.columns import Frames
from assembly.derivatives.derived import derive
from assembly.derivatives.measure import Measure, place_of
from assembly.derivatives.measured import FREE
from assembly.derivatives.numbers import FrameOrigin, FrameTurn, LeastGap, RowNumber, TargetNumber, turn_rates
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.probed import ProbedScene
from assembly.derivatives.result import Layout, Least, Moved, Sensitivity
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.solve.second_order.curvature import curvature_at
from assembly.solve.second_order.dense import PUSHING, UNBALANCED
from assembly.solve.solution import Solution

__all__ = ["Plan", "kept_plan", "layout_of", "plan_of"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Plans that a scene keeps; with more the first are made anew.
MOST_PLANS = 8
SEQUENCES = {list, tuple}
# Unknowns up to which the plain loops of `least_steps` take less time than singular values of LAPACK.
MOST_UNKNOWNS = 96
# Numbers of a pair of frames in a pool.
FRAMES = 24
KINDS = {"coordinate": records.COORDINATE, "gap": records.GAP, "place": records.PLACE, "distance": records.DISTANCE}


class Unplanned(Exception):
    """What is asked for goes the general way."""


def plan_of(
    solution: Solution, bodies: Sequence[Body], asked: tuple[Sequence[Measure], Sequence[Parameter]]
) -> Plan | None:
    """The plan of measures and parameters, made at first use; None where there is none."""
    plans = solution._packed.derivative_plans
    key = tuple(asked[0]), tuple(asked[1])
    if key not in plans:
        while len(plans) >= MOST_PLANS:
            del plans[next(iter(plans))]
        try:
            plans[key] = Plan(solution, bodies, asked)
        except Unplanned:
            plans[key] = None
    plan: Plan | None = plans[key]
    return plan


def kept_plan(solution: object, of: object, wrt: object) -> Plan | None:
    """The plan that was made for these measures and parameters, lists or tuples; None where there is none yet."""
    if type(solution) is not Solution or type(of) not in SEQUENCES or type(wrt) not in SEQUENCES:
        return None
    try:
        # The types of `of` and `wrt` were asked above in a way that mypy does not follow.
        plan: Plan | None = solution._packed.derivative_plans.get((tuple(of), tuple(wrt)))  # type: ignore[arg-type]
    except TypeError:  # what cannot be a key is no measure
        return None
    return plan


def layout_of(
    bodies: Sequence[Body], constraints: Sequence[Constraint], packed: Packed, has_all: bool = False
) -> Layout:
    """Where unknowns and rows of a scene are: unknowns of the moving bodies, or of all, in the bodies' order."""
    moving = list(accumulate(not body.fixed for body in bodies))
    blocks = [k if has_all else (-1 if body.fixed else moving[k] - 1) for k, body in enumerate(bodies)]
    names = tuple(body.name for body in bodies), tuple(item.name for item in constraints)
    return Layout(*names, tuple(blocks), packed.spans, packed.lengths)


class _Desk(NamedTuple):
    """Where a thread derives: the pool and the state with probes behind it, multipliers, and what calls write."""

    pool: Array
    state: Array
    forces: Array
    evaluated: Array
    out: Array


class Plan:
    """What measures of solutions change by, in three calls.

    Parameters
    ----------
    solution : Solution
    bodies : sequence of Body
    asked : (measures, parameters)

    Raises
    ------
    Unplanned
        Something is asked for that goes the general way.
    """

    def __init__(
        self, solution: Solution, bodies: Sequence[Body], asked: tuple[Sequence[Measure], Sequence[Parameter]]
    ) -> None:
        packed, state = solution._packed, solution._state
        self._layout = layout_of(bodies, solution._scene.constraints, packed)
        self._measures, self._parameters = tuple(asked[0]), tuple(asked[1])
        self._unknowns = 6 * (max(self._layout.blocks) + 1)
        if packed.end_effectors or packed.clearance_rows or self._unknowns > MOST_UNKNOWNS:
            raise Unplanned
        if not packed.is_implicit and _has_sized_turns(packed, bodies):
            raise Unplanned
        places = {id(body): k for k, body in enumerate(bodies)}
        eyes = np.broadcast_to(np.eye(3), (len(bodies), 3, 3))
        self._frames = Frames(packed, self._parameters, eyes, bodies)
        coordinates = [item.thing.coordinate for item in self._measures if item.kind == "coordinate"]
        # Coordinates that no row has, whose frames stand behind the pool.
        pairs = dict.fromkeys(coordinate.frames for coordinate in coordinates)
        self._pairs = [pair for pair in pairs if pair not in packed._frames]
        probed = ProbedScene(packed, state, bodies, self._frames.each, coordinates)
        self._table, self._most = probed.table, probed._most
        self._behind = probed.pool[packed.pool.size + FRAMES * len(self._pairs) :]
        self._hosts = np.array(probed.hosts, dtype=np.int64)
        self._figures = [0.5 * body.size for body in bodies]
        # Figures that are read anew: rates of turns, and places of frames that are measured.
        self._turned: list[tuple[int, FrameTurn]] = []
        self._placed: list[tuple[int, Frame]] = []
        entries = self._entries(packed, places)
        measured = self._measured(packed, places)
        limits, self._figures = len(self._figures), [*self._figures, TOUCHING, PUSHING, UNBALANCED, FREE]
        self._numbers = np.array(self._figures)
        # The scale of the scene that was derived last, and the figures for it; those of moved frames are read anew.
        self._scaled = (0.0, self._numbers)
        # For every number of the state with probes its place in the state without them. Probes come after the bodies,
        # each at the pose of its host.
        numbers, bodies_end = np.arange(state.size), packed.contacts_at
        on_probes = numbers[:bodies_end].reshape(-1, 7)[self._hosts].ravel()
        self._gathered = np.concatenate((numbers[:bodies_end], on_probes, numbers[bodies_end:]))
        self._desks: list[_Desk] = []
        self._plan = self._written(packed, entries, measured, limits)
        m, e, n, p = packed.rows, len(coordinates), self._unknowns, len(self._parameters)
        k = len(self._measures)
        # Ends of the sections that are written: equations, rates, steps and forces, what is told of measures, and of
        # the objective.
        at = (m + e) * (n + p) + n * n + n * p + p + k * (n + p) + n + 1
        self._shapes = (k, p), (n + m, p)
        self._ends = at, at + k * p, at + (k + n + m) * p, at + (k + n + m) * p + k, at + (k + n + m + 1) * p + k
        self._least = Least(read_only(~packed.one_sided), n, e) if packed.is_implicit else None
        self._is_implicit, self._rows = packed.is_implicit, m
        self._lengths = [k for k, item in enumerate(self._measures) if item.kind == "gap" or _is_slide(item)]
        self._objectives = [k for k, item in enumerate(self._measures) if item.kind == "objective"]
        self._none_loose = read_only(np.zeros(k, dtype=bool))

    def _entries(self, packed: Packed, places: dict[int, int]) -> list[dict[str, int]]:
        """What parameters add, and where."""
        origins: dict[int, int] = {}
        for k, pair in enumerate(packed._frames):
            for side, frame in enumerate((pair.frame_a, pair.frame_b)):
                origins[id(base_of(frame))] = packed.frames_at + 24 * k + 12 * side
        for term, at in packed._targets:
            if isinstance(term, FrameDistance):
                origins.setdefault(id(base_of(term.frame)), at - 3)
        probes = {id(frame): k for k, frame in enumerate(self._frames.each)}
        entries: list[dict[str, int]] = []
        for r, parameter in enumerate(self._parameters):
            number, before = parameter._number, len(entries)
            if self._frames.numbers[r] is not None:
                assert isinstance(number, (FrameOrigin, FrameTurn))
                entry = {"kind": records.ORIGIN, "axis": number.axis, "probe": probes[id(number.frame)]}
                if isinstance(number, FrameTurn):
                    entry |= {"kind": records.TURN, "at": origins[id(number.frame)], "rates": len(self._figures)}
                    self._turned.append((len(self._figures), number))
                    self._figures += np.eye(3).ravel().tolist()
                entries.append(entry | {"parameter": r})
            elif isinstance(number, RowNumber):
                for row, (equation, _, _) in zip(packed.value_rows.tolist(), packed._values, strict=True):
                    source = equation.source
                    if source is not None and source[0] is number.owner and source[1] == number.attribute:
                        sign = 1 if number.attribute == "upper" else -1
                        is_length = int(not equation.terms[0][1].is_angle)
                        entry = {"kind": records.ROW, "at": row, "is_length": is_length, "sign": sign}
                        entries.append(entry | {"parameter": r})
            elif isinstance(number, LeastGap):
                for row, contact in enumerate(packed.contacts):
                    if contact is number.owner:
                        entry = {"kind": records.ROW, "at": row, "is_length": 1, "sign": -1}
                        entries.append(entry | {"parameter": r})
            elif isinstance(number, TargetNumber):
                for term, at in packed._targets:
                    if term is number.term:
                        entry = {"kind": records.TARGET, "axis": number.axis, "at": at, "parameter": r}
                        entries.append(entry | {"body": places[id(term.bodies[0])]})
            if len(entries) == before:
                raise Unplanned
        return entries

    def _measured(self, packed: Packed, places: dict[int, int]) -> list[dict[str, int]]:
        """What is measured, and where."""
        measured: list[dict[str, int]] = []
        probes = {id(frame): k for k, frame in enumerate(self._frames.each)}
        coordinates = 0
        for i, item in enumerate(self._measures):
            if item.kind not in KINDS and item.kind != "objective":
                raise Unplanned
            if item.kind == "coordinate":
                measured.append({"kind": records.COORDINATE, "number": i, "row": coordinates})
                coordinates += 1
            elif item.kind == "gap":
                rows = [k for k, contact in enumerate(packed.contacts) if contact is item.thing]
                if not rows:
                    raise Unplanned
                measured.append({"kind": records.GAP, "number": i, "row": rows[0]})
            elif item.kind != "objective":
                sides = item.thing if item.kind == "distance" else (item.thing,)
                for kind, side in zip((KINDS[item.kind], records.END), sides, strict=False):
                    body, place = place_of(side)
                    if id(body) not in places:
                        raise Unplanned
                    entry = {"kind": kind, "number": i, "axis": item.axis, "body": places[id(body)]}
                    probe = -1
                    if isinstance(side, Frame):
                        self._placed.append((len(self._figures), side))
                        probe = probes.get(id(base_of(side)), -1)
                    measured.append(entry | {"at": len(self._figures), "probe": probe})
                    self._figures += place.tolist()
        return measured

    def _written(
        self, packed: Packed, entries: list[dict[str, int]], measured: list[dict[str, int]], limits: int
    ) -> Table:
        """The table of the plan."""
        blocks = np.array(self._layout.blocks, dtype=np.int64)
        parts: list[Table] = [np.zeros(records.PLAN_SIZE, dtype=np.int64), blocks, self._hosts]
        parts += [_record(records.ENTRY, entry) for entry in entries]
        parts += [_record(records.MEASURE, entry) for entry in measured]
        parts.append(packed.one_sided.astype(np.int64))
        table = np.concatenate(parts)
        header = records.plan_at(table, 0)
        header.bodies, header.probes = blocks.size, self._hosts.size
        header.rows, header.unknowns, header.implicit = packed.rows, self._unknowns, int(packed.is_implicit)
        header.coordinates = sum(entry["kind"] == records.COORDINATE for entry in measured)
        header.blocks, header.hosts = records.PLAN_SIZE, records.PLAN_SIZE + blocks.size
        header.entries, header.entry_count = header.hosts + self._hosts.size, len(entries)
        header.parameters, header.measure_count = len(self._parameters), len(measured)
        header.measures = header.entries + records.ENTRY_SIZE * len(entries)
        header.measured = len(self._measures)
        header.one_sided, header.limits = table.size - packed.rows, limits
        return table

    def _figures_of_now(self, packed: Packed) -> Array:
        scale, figures = self._scaled
        if scale != packed.scale:
            figures = self._numbers.copy()
            levers = figures[: len(self._layout.blocks)]
            levers /= packed.scale
            levers[levers == 0.0] = 0.5
            self._scaled = packed.scale, figures
        turned = [item for item in self._turned if "_turned" in item[1].frame.__dict__]
        if turned or self._placed:
            figures = figures.copy()
            for at, number in turned:
                figures[at : at + 9] = turn_rates(number._turned()[1]).ravel()
            for at, frame in self._placed:
                figures[at : at + 3] = frame.origin
        return figures

    def derived(self, packed: Packed, state: Array) -> Sensitivity | None:
        """The derivatives at a solution; None where it is one of those that go the general way."""
        # Threads have desks of their own.
        desk = self._desks.pop() if self._desks else self._new_desk(packed)
        try:
            return self._derived(packed, state, desk)
        finally:
            self._desks.append(desk)

    def _new_desk(self, packed: Packed) -> _Desk:
        pool = np.concatenate((packed.rows_pool, np.zeros(FRAMES * len(self._pairs)), self._behind))
        rows, columns = self._most
        evaluated = np.empty(1 + rows + columns + rows * columns + columns * columns)
        state, out = np.empty(self._gathered.size), np.empty(self._ends[-1])
        return _Desk(pool, state, np.zeros(rows), evaluated, out)

    def _derived(self, packed: Packed, state: Array, desk: _Desk) -> Sensitivity | None:
        rows, pool = self._rows, packed.rows_pool
        if self._behind.size:
            desk.pool[: pool.size] = pool
            for k, pair in enumerate(self._pairs):
                at = pool.size + FRAMES * k
                desk.pool[at : at + FRAMES] = frame_numbers(pair.frame_a, pair.frame_b, packed.scale)
            pool = desk.pool
        if not self._is_implicit:
            desk.forces[:rows] = state[packed.multipliers_at : packed.residuals_at]
        # Places are those of the state, and without checks are copied in a third of the time.
        state.take(self._gathered, out=desk.state, mode="clip")
        if curvature_at(self._table, pool, desk.state, desk.forces, desk.evaluated, None) != 0:
            return None
        figures = self._figures_of_now(packed)
        rank = derive(self._plan, pool, state, figures, desk.forces, desk.evaluated, desk.out)
        return None if rank < 0 else self._told(packed, rank, desk.out.copy())

    def _told(self, packed: Packed, rank: int, out: Array) -> Sensitivity:
        """What `derive` wrote, in an array of its own."""
        at, rates_end, moved_end, loose_end, _ = self._ends
        measured, stepped = self._shapes
        rates = out[at:rates_end].reshape(measured)
        for i in self._lengths:
            rates[i] *= packed.scale
        for i in self._objectives:
            rates[i] = out[loose_end:] * packed.unit
        loose = self._none_loose
        if self._is_implicit and rank < self._unknowns:
            loose = out[moved_end:loose_end] > 0.0
        numbers = out[rates_end:moved_end].reshape(stepped)
        moved = Moved(self._layout, numbers, packed.scale, packed.unit, self._least, out)
        return Sensitivity.smooth(self._measures, self._parameters, rates, loose, rank, moved)


def _record(dtype: np.dtype[np.void], fields: dict[str, int]) -> Table:
    """A record with these fields, and zeros."""
    record = np.zeros(1, dtype=dtype)
    for name, value in fields.items():
        record[name] = value
    return record.view(np.int64)


def _is_slide(item: Measure) -> bool:
    return item.kind == "coordinate" and item.unit == "length"


def _has_sized_turns(packed: Packed, bodies: Sequence[Body]) -> bool:
    """Whether a posture counts turns by the scene's size, which numbers may change (`derivatives/size.py`)."""
    table = packed.rows_table
    terms = table[table[layout.TERM_TABLE] :][: TERM * table[layout.TERMS]].reshape(-1, TERM).tolist()
    drawn = {at - POSTURE_QUATERNION for _, at in packed._turns}
    return any(kind == POSTURE and at not in drawn and not bodies[k].size for kind, k, at, *_ in terms)
