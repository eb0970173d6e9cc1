"""A packed scene whose frames stand on bodies of their own, with rows for coordinates that are asked for.

What a joint's frame on its body does to rows is what a body does to them: each frame that is a parameter stands on a
probe, a body at the pose of its host that nothing else is on. So the kernel that evaluates rows, their Jacobian and
the Hessian of the Lagrangian gives the derivatives by the frame as well, exactly. All bodies count as moving, fixed
ones too, and coordinates of joints that are measured are rows without a value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.constraints.model.constraint import Coordinate, FramePair
from assembly.constraints.model.objectives import FrameDistance
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program import records as layout
from assembly.constraints.program.objective_terms import POINT_DISTANCE_FIELDS, POSTURE_QUATERNION, TERM
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.solve.second_order.curvature import curvature_at

__all__ = ["Evaluated", "ProbedScene"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
TARGET = place_of(POINT_DISTANCE_FIELDS, "target")
# Where a coordinate says its joint, and its bodies; where a row does, and where its second coordinate is.
JOINT, BODIES = (place_of(layout.BODY_COORDINATE, name) for name in ("joint", "body_f"))
FIRST_JOINT, SECOND = (place_of(layout.JOINT_ROW_RECORD, name) for name in ("joint", "second"))


@dataclass(frozen=True, eq=False)
class Evaluated:
    """Objective and rows at a state, lengths over the scene's size: rows of the program, then four a fold.

    Columns are twists of all bodies, then four coordinates a fold; those of probes are apart.

    Attributes
    ----------
    value : float
    residual, gradient, jacobian, hessian : (m,), (n,), (m, n), (n, n)
        Of the objective and the rows; the Hessian is that of the objective + forces . rows, with frames on their
        bodies.
    by_frames, mixed : (m, 6 k), (n, 6 k)
        The same by twists of the frames, about the origins of their bodies.
    slopes_by_frames, pulls : (6 k,)
        Slopes of the objective, and of the objective + forces . rows, in these twists.
    measured, measured_by_frames : (e, n), (e, 6 k)
        Slopes of the coordinates that were asked for.
    """

    value: float
    residual: Array
    gradient: Array
    jacobian: Array
    hessian: Array
    by_frames: Array
    mixed: Array
    slopes_by_frames: Array
    pulls: Array
    measured: Array
    measured_by_frames: Array


class ProbedScene:
    """The table and the pool of a packed scene, with probes.

    Parameters
    ----------
    packed : Packed
    state : array
        Of the solution; its contacts of clearances count.
    bodies : sequence of Body
    frames : sequence of Frame
        Each on a probe.
    coordinates : sequence of Coordinate
        Those whose slopes are asked for.
    """

    def __init__(
        self,
        packed: Packed,
        state: Array,
        bodies: Sequence[Body],
        frames: Sequence[Frame] = (),
        coordinates: Sequence[Coordinate] = (),
    ) -> None:
        self.packed, self._given = packed, state
        self.bodies, self.rows, self.coordinates = packed.count, packed.rows, len(coordinates)
        places = {id(body): k for k, body in enumerate(bodies)}
        self.hosts = [places[id(frame.body)] for frame in frames]
        self.state = self._with_probes(state)
        self.table, self.pool = packed.table_at(state).copy(), packed.pool
        if frames or coordinates:
            self._add_joints(places, frames, coordinates)
        count = packed.count + len(frames)
        self.table = np.concatenate([self.table, np.arange(count)])
        header = self.table
        header[layout.UNKNOWN_BLOCKS] = self.table.size - count
        header[layout.BODIES] = header[layout.MOVING] = count
        header[layout.BLOCK_RECORD] = header[layout.BLOCK_LENGTH] = 0
        # Rows and columns that there may be, with four for each fold. Slots without a contact have none: room for folds
        # of all of them would be most of what is written.
        folds = packed.pair_rows - sum(pair < 0 for pair, _ in packed.listed(state))
        self._most = int(header[layout.ROWS]) + 4 * folds, 6 * count + 4 * folds

    def _with_probes(self, state: Array) -> Array:
        packed = self.packed
        poses = state[: packed.contacts_at].reshape(-1, 7)
        return np.concatenate([poses.ravel(), poses[self.hosts].ravel(), state[packed.contacts_at :]])

    def _add_joints(self, places: dict[int, int], frames: Sequence[Frame], coordinates: Sequence[Coordinate]) -> None:
        """Write joints and rows anew behind the table, with probes in place of the hosts of frames."""
        packed, table = self.packed, self.table
        numbers: dict[FramePair, int] = dict(packed._frames)
        joints = table[table[layout.JOINT_TABLE] :][: layout.JOINT_RECORD * len(numbers)].reshape(-1, 3).tolist()
        pool: list[Array] = []
        pool_at = packed.pool.size
        for coordinate in coordinates:
            pair = coordinate.frames
            if pair not in numbers:
                numbers[pair] = len(numbers)
                parts = [np.vstack([f.origin / packed.scale, f.axes.T]) for f in (pair.frame_a, pair.frame_b)]
                joints.append([places[id(pair.frame_a.body)], places[id(pair.frame_b.body)], pool_at])
                pool.append(np.concatenate(parts).ravel())
                pool_at += pool[-1].size
        probes = {id(frame): packed.count + k for k, frame in enumerate(frames)}
        for pair, number in numbers.items():
            for side, frame in enumerate((pair.frame_a, pair.frame_b)):
                joints[number][side] = probes.get(id(getattr(frame, "base", frame)), joints[number][side])
        self._put_terms_on(probes)
        rows = table[table[layout.ROW_TABLE] :][: layout.ROW * packed.rows].reshape(-1, layout.ROW).copy()
        of_joints = np.flatnonzero(rows[:, layout.KIND] == layout.JOINT_ROW)
        sides = np.array(joints, dtype=np.int64).reshape(-1, layout.JOINT_RECORD)[:, :2]
        rows[of_joints, layout.BODY_F : layout.BODY_G + 1] = sides[rows[of_joints, FIRST_JOINT]]
        for second in rows[of_joints, SECOND]:
            if second >= 0:
                table[second + BODIES : second + BODIES + 2] = sides[table[second + JOINT]]
        asked = np.zeros((len(coordinates), layout.ROW), dtype=np.int64)
        for row, coordinate in zip(asked, coordinates, strict=True):
            number = numbers[coordinate.frames]
            fields = [layout.JOINT_ROW, *joints[number][:2], 0, 0, int(not coordinate.is_angle)]
            fields += [coordinate.kind, coordinate.component, number, -1, pool_at, -1]
            row[: len(fields)] = fields
        pool.append(np.array([1.0, 0.0, 0.0]))
        table[layout.JOINT_TABLE], table[layout.JOINTS] = table.size, len(joints)
        flat = np.array(joints, dtype=np.int64).ravel()
        table[layout.ROW_TABLE], table[layout.ROWS] = table.size + flat.size, packed.rows + len(coordinates)
        self.table = np.concatenate([table, flat, rows.ravel(), asked.ravel()])
        self.pool = np.concatenate([packed.pool, *pool])

    def _put_terms_on(self, probes: dict[int, int]) -> None:
        """Have terms that draw a frame act on its probe."""
        packed, table = self.packed, self.table
        drawn = {at: term for term, at in packed._targets if isinstance(term, FrameDistance)}
        places = {at - TARGET: term for at, term in drawn.items()}
        places.update({at - POSTURE_QUATERNION: term for term, at in packed._turns})
        for k in range(int(table[layout.TERMS])):
            term = int(table[layout.TERM_TABLE]) + TERM * k
            drawing = places.get(int(table[term + 2]))
            if drawing is not None:
                frame = drawing.frame
                table[term + 1] = probes.get(id(getattr(frame, "base", frame)), table[term + 1])

    def evaluate(self, forces: Array) -> Evaluated:
        """Evaluate with multipliers of the program's rows (m,), and perhaps of rows of folds behind them.

        Raises
        ------
        InputError
            A contact has no pair at the state, or a row or term no derivative.
        """
        most, columns = self._most
        out = np.empty(1 + most + columns + most * columns + columns * columns)
        given = np.zeros(most)
        given[: self.rows] = forces[: self.rows]
        behind = forces[self.rows :]
        given[self.rows + self.coordinates :][: behind.size] = behind
        folds = int(curvature_at(self.table, self.pool, self.state.copy(), given, out, None))
        if folds < 0:
            raise InputError("solution leaves a contact without an extremal pair; expected a pose where it has one")
        m = self.rows + self.coordinates + 4 * folds
        probes = 6 * len(self.hosts)
        n = 6 * self.bodies + probes + 4 * folds
        sizes = np.cumsum([1, m, n, m * n, n * n])
        if not np.isfinite(out[: sizes[-1]]).all():
            raise InputError("solution has a row or a term without derivatives; expected finite ones")
        value, residual, gradient, jacobian, hessian = np.split(out[: sizes[-1]], sizes[:-1])
        jacobian, hessian = jacobian.reshape(m, n), hessian.reshape(n, n)
        if self.packed.end_effectors:
            self._add_dexterities(value, gradient, hessian)
        own = np.ones(m, dtype=bool)
        own[self.rows : self.rows + self.coordinates] = False
        at = slice(6 * self.bodies, 6 * self.bodies + probes)
        slopes_by_frames = gradient[at].copy()
        pulls = slopes_by_frames + given[:m] @ jacobian[:, at]
        by_frames, mixed = jacobian[:, at].copy(), self._on_hosts(hessian[:, at].T).T
        jacobian = self._on_hosts(jacobian)
        return Evaluated(
            float(value[0]),
            residual[own],
            self._on_hosts(gradient[None])[0],
            jacobian[own],
            self._on_hosts(self._on_hosts(hessian).T),
            by_frames[own],
            mixed,
            slopes_by_frames,
            pulls,
            jacobian[~own],
            by_frames[~own],
        )

    def _add_dexterities(self, value: Array, gradient: Array, hessian: Array) -> None:
        """Add what dexterities are, of the mechanism as it is: fixed bodies are fixed, and no row is one too many."""
        packed, state = self.packed, self._given
        table, n = packed.table_at(state), 6 * int(packed.table[layout.MOVING])
        blocks = packed.unknown_blocks
        moving = np.flatnonzero(blocks >= 0)
        # The unknowns of a block, as columns of its body.
        own = (6 * moving[np.argsort(blocks[moving])][:, None] + np.arange(6)).ravel()
        most, columns = packed.rows + 4 * packed.pair_rows, n + 4 * packed.pair_rows
        for sign, end_effectors in ((1.0, packed.end_effectors), (-1.0, None)):
            out = np.empty(1 + most + columns + most * columns + columns * columns)
            folds = int(curvature_at(table, packed.pool, state.copy(), np.zeros(most), out, end_effectors))
            m, columns_there = packed.rows + 4 * folds, n + 4 * folds
            sizes = np.cumsum([1, m, columns_there, m * columns_there, columns_there**2])
            told, _, slopes, _, curves = np.split(out[: sizes[-1]], sizes[:-1])
            if not np.isfinite(told).all() or not np.isfinite(slopes).all() or not np.isfinite(curves).all():
                raise InputError("solution has a dexterity without derivatives; expected finite ones")
            value += sign * told
            gradient[own] += sign * slopes[:n]
            hessian[np.ix_(own, own)] += sign * curves.reshape(columns_there, columns_there)[:n, :n]

    def _on_hosts(self, columns: Array) -> Array:
        """What is by twists of bodies and probes, (k, n), by those of bodies: frames go with them."""
        if not self.hosts:
            return columns
        probes = 6 * len(self.hosts)
        first, last = 6 * self.bodies, 6 * self.bodies + probes
        moved = np.concatenate([columns[:, :first], columns[:, last:]], axis=1)
        for k, host in enumerate(self.hosts):
            moved[:, 6 * host : 6 * host + 6] += columns[:, first + 6 * k : first + 6 * k + 6]
        return moved
