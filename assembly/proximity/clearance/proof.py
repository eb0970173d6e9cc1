"""What is known of pairs of bodies at poses: clear, touching, crossing, one within the other, or undecided; proven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.forest import Fronts, PackedForest
from assembly.proximity.clearance.inside import UNCLEAR, winding_of
from assembly.proximity.clearance.look import (
    AT_POSE,
    BEGUN_ANEW,
    ON_WAY,
    ON_WAY_ANEW,
    ONLY_TRIED,
    PASSED_BY,
    gap_along,
    look_at_pairs,
)
from assembly.proximity.clearance.parting import least_move
from assembly.proximity.clearance.records import (
    BY_PLANE,
    CELL_FACE,
    CLEAR,
    CROSSING,
    GUIDES,
    LINKS,
    NO_ROOM,
    NODE,
    NODES,
    NONE,
    OPEN,
    PARTED,
    WIRE,
)

__all__ = ["Answer", "ClearanceProof", "Contacts", "Verdict", "is_proven"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# A front that has grown by more than this factor and number is begun anew.
GROWN, MANY = 2, 200
# Contacts are opened by this part of what is called touching, beside what they are closed by; those that are open by
# more already by this.
OPENED, LEAST_OPENED = 0.25, 1e-6
# Pairs of nodes that were left open, of which directions to open them are taken at most.
MOST_OPENED = 2000
# The cosine above which normals of cells as small as what was left open oppose each other.
OPPOSED = 0.98
# Places in the stack of a ray, and points of which rays start, at most, of each part of a body.
STACK, POINTS = 4096, 12


class Verdict(Enum):
    """What two bodies are to each other; the value says it in a sentence."""

    CLEAR = "apart by at least the bound, and neither is within the other"
    TOUCHING = "clear once one of them is moved by no more than the depth"
    CROSSING = "their boundaries cross, and no translation by less than the depth undoes it"
    ENCLOSED = "one is wholly within the other, their boundaries apart by at least the bound"
    UNDECIDED = "none of this is proven within the budget"


@dataclass(frozen=True, eq=False)
class Answer(ReadOnlyArrays):
    """What is proven of a pair of bodies.

    Attributes
    ----------
    verdict : Verdict
    bound : float
        A lower bound of the distance of their boundaries; -inf where none is known.
    depth : float
        See `Verdict`.
    place : (3,)
        Of a crossing, where it was found, in the world; else NaN.
    swept : bool
        Whether the way from the last look is proven as well.
    part : float
        Of that way, up to where it was looked at.
    """

    verdict: Verdict
    bound: float = -np.inf
    depth: float = 0.0
    place: Array = field(default_factory=lambda: np.full(3, np.nan))
    swept: bool = False
    part: float = 1.0


class Contacts(NamedTuple):
    """Contacts of a pair of bodies, in the world.

    Attributes
    ----------
    normals, places : (m, 3)
        Unit vectors from the first body to the second, and points of the second.
    gaps : (m,)
        Over the least gap.
    """

    normals: Array
    places: Array
    gaps: Array


def is_proven(answer: Answer) -> bool:
    """Whether bodies are clear, or only touch."""
    return answer.verdict in (Verdict.CLEAR, Verdict.TOUCHING)


class ClearanceProof:
    """The proofs of pairs of bodies, kept from look to look.

    Parameters
    ----------
    shapes : sequence of tuple of Face
        Of every body its faces; bodies without any are of no pair.
    pairs : sequence of (int, int)
        Numbers of bodies.
    minimum : sequence of float
        Of every pair, what its gap is to be at least.
    """

    def __init__(
        self,
        shapes: Sequence[tuple[Face, ...]],
        pairs: Sequence[tuple[int, int]],
        minimum: Sequence[float],
    ) -> None:
        self.pairs = list(pairs)
        used = sorted({body for pair in pairs for body in pair})
        self._number = {body: k for k, body in enumerate(used)}
        self.forest = PackedForest([shapes[body] for body in used])
        local = [(self._number[a], self._number[b]) for a, b in pairs]
        self.fronts = Fronts(self.forest, local, minimum)
        self.fronts.counts.body_a, self.fronts.counts.body_b = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        self.minimum = np.array(minimum, dtype=float)
        self._codes, self._stack = np.zeros(len(self.pairs), dtype=np.int64), np.zeros(STACK, dtype=np.int64)
        self._begun = np.zeros(len(self.pairs), dtype=bool)
        self._on_way = np.full(len(self.pairs), ON_WAY)

    def look(
        self,
        q: Array,
        touching: float,
        moves: Array | None = None,
        which: Sequence[int] | None = None,
        swept: bool = False,
    ) -> list[Answer]:
        """What is proven at poses.

        Parameters
        ----------
        q : (n, 7)
            A row a body.
        touching : float
            Cells that cross by no more are not said to.
        moves : (pairs, 6), optional
            Of every pair, a move of its second body before it is looked at: a translation, and a small rotation about
            its origin, in world axes.
        which : sequence of int, optional
            The pairs that are looked at; all by default.
        swept : bool
            Whether the way from the last look is to be proven as well, of pairs that were clear there.
        """
        rows = list(range(len(self.pairs)) if which is None else which)
        moved = np.zeros((len(self.pairs), 6)) if moves is None else np.ascontiguousarray(moves, dtype=float)
        tasks = np.zeros(len(self.pairs), dtype=np.int64)
        counts, pair = self.fronts.counts, self.fronts.pair
        grown = counts.count > GROWN * counts.fresh + MANY
        asked = np.where(grown | ~self._begun, BEGUN_ANEW, AT_POSE)
        if swept:
            asked = np.where(pair.known == 1.0, np.where(grown, ON_WAY_ANEW, ON_WAY), asked)
        tasks[rows] = asked[rows]
        self._run(np.ascontiguousarray(q, dtype=float), touching, moved, tasks)
        self._begun[rows] = True
        return [self._answer(k, q, moved[k], bool(tasks[k] >= ON_WAY)) for k in rows]

    def stays_clear(self, q: Array, touching: float, moves: Array) -> bool:
        """Whether all pairs, of which none was found otherwise at the last look, are clear at poses and on the way there.

        Where one is not, nothing is known: `look` tells what it is. It makes fronts that have grown anew, too.
        """
        counts = self.fronts.counts
        if not (self.fronts.pair.known == 1.0).all() or (counts.count > GROWN * counts.fresh + MANY).any():
            return False
        self.fronts.pair.touch = touching
        look_at_pairs(self.forest.arrays, self.fronts.arrays, q, moves, self._on_way, self._codes)
        return not self._codes.any()

    def cells_of_both(self, k: int) -> tuple[BodyCells, BodyCells]:
        """The trees of both bodies of pair k."""
        a, b = self.pairs[k]
        return self.forest.cells[self._number[a]], self.forest.cells[self._number[b]]

    def is_apart(self, k: int, q: Array, distance: float, budget: int) -> bool:
        """Whether it is proven, within a budget, that the bodies of pair k are farther apart and none is in the other."""
        needed, budgets = self.fronts.pair.needed, self.fronts.counts.budget
        before, needed[k] = float(needed[k]), distance
        usual, budgets[k] = int(budgets[k]), budget
        tasks = np.zeros(len(self.pairs), dtype=np.int64)
        tasks[k] = BEGUN_ANEW
        still = np.zeros((len(self.pairs), 6))
        self._run(np.ascontiguousarray(q, dtype=float), 0.0, still, tasks)
        found = self._codes[k] == CLEAR and self.nested(k, q, still[k]) is False
        # Gaps of this front are those over another length.
        needed[k], budgets[k], self._begun[k] = before, usual, False
        self.fronts.pair.known[k] = 0.0
        return bool(found)

    def _run(self, q: Array, touching: float, moves: Array, tasks: Table) -> None:
        self.fronts.pair.touch = touching
        waiting = tasks.copy()
        while waiting.any():
            look_at_pairs(self.forest.arrays, self.fronts.arrays, q, moves, waiting, self._codes)
            short = (waiting != PASSED_BY) & (self._codes == NO_ROOM)
            if not short.any():
                return
            if not (self.forest.grow() if self.forest.is_full else self.fronts.grow()):
                self._codes[short] = OPEN
                return
            # What is in the front already stays there.
            kept = np.where(waiting == BEGUN_ANEW, AT_POSE, waiting)
            waiting = np.where(short, kept, PASSED_BY)

    def cells_of(self, k: int) -> BodyCells:
        """The tree of the second body of pair k."""
        return self.forest.cells[self._number[self.pairs[k][1]]]

    def bound(self, k: int) -> float:
        """A lower bound of the distance of pair k at its last look, where that ended clear."""
        pair = self.fronts.pair[k]
        return float(pair.soonest - pair.travelled) + float(pair.needed)

    def _answer(self, k: int, q: Array, move: Array, swept: bool) -> Answer:
        pair, code = self.fronts.pair[k], int(self._codes[k])
        part = float(pair.part)
        if code == CROSSING:
            place = rotation_matrix(q[self.pairs[k][0], 3:]) @ pair.place + q[self.pairs[k][0], :3]
            return Answer(Verdict.CROSSING, depth=float(pair.depth), place=place, part=part)
        if code != CLEAR:
            return Answer(Verdict.UNDECIDED, part=part)
        nested = False if swept else self.nested(k, q, move)
        if nested is None:
            return Answer(Verdict.UNDECIDED, part=part)
        bound = self.bound(k)
        if nested:
            return Answer(Verdict.ENCLOSED, bound, bound)
        pair.known = 1.0
        far = self.move_length(k, q, move)
        if far > 0.0:
            return Answer(Verdict.TOUCHING, bound - far, far, swept=swept)
        return Answer(Verdict.CLEAR, bound, swept=swept)

    def conforms(self, k: int, q: Array, touching: float) -> bool:
        """Whether what a look at pair k leaves open are faces that lie on each other: normals oppose in all cells."""
        tasks = np.zeros(len(self.pairs), dtype=np.int64)
        tasks[k] = ONLY_TRIED
        self._run(np.ascontiguousarray(q), touching, np.zeros((len(self.pairs), 6)), tasks)
        if self._codes[k] != OPEN:
            return False
        nodes = self._left(k)[1]
        if not len(nodes):
            return False
        links, faces = rows_of(LINKS, self.forest.arrays[3]), rows_of(CELL_FACE, self.forest.arrays[2])
        if any((links.face[side] == NONE).any() or (links.form[side] == WIRE).any() for side in (nodes.a, nodes.b)):
            return False
        axes = rows_of(NODE, self.forest.arrays[4]).axes
        turn = self._relative(k, q)[0]
        normal_a = axes[nodes.a, 2] * faces.sign[links.face[nodes.a]][:, None]
        normal_b = axes[nodes.b, 2] * faces.sign[links.face[nodes.b]][:, None] @ turn.T
        return bool(((normal_a * normal_b).sum(axis=1) < -OPPOSED).all())

    def move_apart(self, k: int, q: Array, contacts: Contacts, touching: float) -> Array | None:
        """The least move (6) of the second body of pair k that opens contacts; None where no point may move so far.

        Parameters
        ----------
        k : int
        q : (n, 7)
        contacts : Contacts
        touching : float
            What a point may be moved.
        """
        normals, places, gaps = contacts
        row = q[self.pairs[k][1]]
        root = self.cells_of(k).nodes[0]
        arm, radius = rotation_matrix(row[3:]) @ root[:3], float(root[3])
        asked = np.maximum(OPENED * touching - gaps, LEAST_OPENED * touching)
        guides = self.fronts.pair.guides[k]
        guides[:] = 0.0
        few = normals[np.linspace(0, len(normals) - 1, min(len(normals), GUIDES)).astype(int)]
        guides[: len(few)] = few @ rotation_matrix(q[self.pairs[k][0], 3:])
        move = least_move(normals, places - row[:3] - arm, asked, radius) if touching > 0.0 else None
        if move is None or np.linalg.norm(move[:3]) + radius * np.linalg.norm(move[3:]) > touching:
            return None
        # About the origin of the body instead of its middle.
        move[:3] -= np.cross(move[3:], arm)
        return move

    def opening_move(self, k: int, q: Array, touching: float) -> Array | None:
        """The same for the pairs of nodes that a look at pair k alone left open, along the directions they have."""
        parted, nodes = self._left(k)
        if not 0 < len(nodes) <= MOST_OPENED:
            return None
        cells = rows_of(NODE, self.forest.arrays[4])
        a = q[self.pairs[k][0]]
        turn, shift = self._relative(k, q)
        places = cells.center[nodes.b] @ turn.T + shift
        normals = parted.normal
        rows = zip(nodes.a.tolist(), nodes.b.tolist(), normals, strict=True)
        gaps = np.array([gap_along(self.forest.arrays, (i, j), turn.ravel(), shift, n) for i, j, n in rows])
        if (np.linalg.norm(normals, axis=1) < 0.5).any() or (gaps < -touching).any():
            return None
        world = rotation_matrix(a[3:])
        return self.move_apart(k, q, Contacts(normals @ world.T, places @ world.T + a[:3], gaps), touching)

    def _relative(self, k: int, q: Array) -> tuple[Array, Array]:
        """The rotation and the shift of the second body of pair k, seen from the first."""
        a, b = self.pairs[k]
        turn = rotation_matrix(q[a, 3:])
        return turn.T @ rotation_matrix(q[b, 3:]), (q[b, :3] - q[a, :3]) @ turn

    def _left(self, k: int) -> tuple[np.recarray, np.recarray]:
        """The pairs of nodes that a look at pair k left open: PARTED and NODES of each."""
        count = int(self.fronts.counts.next_count[k])
        parted, nodes = (rows[:count] for rows in self.fronts.left)
        rows = rows_of(PARTED, parted)
        is_open = rows.expiry == -np.inf
        links = rows_of(NODES, nodes)
        is_open &= links.how == BY_PLANE
        return rows[is_open], links[is_open]

    def conforms(self, k: int, q: Array, touching: float) -> bool:
        """Whether what a look at pair k leaves open are faces that lie on each other: normals oppose in all cells."""
        tasks = np.zeros(len(self.pairs), dtype=np.int64)
        tasks[k] = ONLY_TRIED
        self._run(np.ascontiguousarray(q), touching, np.zeros((len(self.pairs), 6)), tasks)
        if self._codes[k] != OPEN:
            return False
        nodes = self._left(k)[1]
        if not len(nodes):
            return False
        links, faces = rows_of(LINKS, self.forest.arrays[3]), rows_of(CELL_FACE, self.forest.arrays[2])
        if any((links.face[side] == NONE).any() or (links.form[side] == WIRE).any() for side in (nodes.a, nodes.b)):
            return False
        axes = rows_of(NODE, self.forest.arrays[4]).axes
        turn = self._relative(k, q)[0]
        normal_a = axes[nodes.a, 2] * faces.sign[links.face[nodes.a]][:, None]
        normal_b = axes[nodes.b, 2] * faces.sign[links.face[nodes.b]][:, None] @ turn.T
        return bool(((normal_a * normal_b).sum(axis=1) < -OPPOSED).all())

    def move_apart(self, k: int, q: Array, contacts: Contacts, touching: float) -> Array | None:
        """The least move (6) of the second body of pair k that opens contacts; None where no point may move so far.

        Parameters
        ----------
        k : int
        q : (n, 7)
        contacts : Contacts
        touching : float
            What a point may be moved.
        """
        normals, places, gaps = contacts
        row = q[self.pairs[k][1]]
        root = self.cells_of(k).nodes[0]
        arm, radius = rotation_matrix(row[3:]) @ root[:3], float(root[3])
        asked = np.maximum(OPENED * touching - gaps, LEAST_OPENED * touching)
        guides = self.fronts.pair.guides[k]
        guides[:] = 0.0
        few = normals[np.linspace(0, len(normals) - 1, min(len(normals), GUIDES)).astype(int)]
        guides[: len(few)] = few @ rotation_matrix(q[self.pairs[k][0], 3:])
        move = least_move(normals, places - row[:3] - arm, asked, radius) if touching > 0.0 else None
        if move is None or np.linalg.norm(move[:3]) + radius * np.linalg.norm(move[3:]) > touching:
            return None
        # About the origin of the body instead of its middle.
        move[:3] -= np.cross(move[3:], arm)
        return move

    def opening_move(self, k: int, q: Array, touching: float) -> Array | None:
        """The same for the pairs of nodes that a look at pair k alone left open, along the directions they have."""
        parted, nodes = self._left(k)
        if not 0 < len(nodes) <= MOST_OPENED:
            return None
        cells = rows_of(NODE, self.forest.arrays[4])
        a = q[self.pairs[k][0]]
        turn, shift = self._relative(k, q)
        places = cells.center[nodes.b] @ turn.T + shift
        normals = parted.normal
        rows = zip(nodes.a.tolist(), nodes.b.tolist(), normals, strict=True)
        gaps = np.array([gap_along(self.forest.arrays, (i, j), turn.ravel(), shift, n) for i, j, n in rows])
        if (np.linalg.norm(normals, axis=1) < 0.5).any() or (gaps < -touching).any():
            return None
        world = rotation_matrix(a[3:])
        return self.move_apart(k, q, Contacts(normals @ world.T, places @ world.T + a[:3], gaps), touching)

    def _gap(self, k: int, a: int, b: int, normal: Array) -> float:
        """The gap of two nodes along a direction at the last pose."""
        pair = self.fronts.pair
        return float(gap_along(self.forest.arrays, (int(a), int(b)), pair.turn[k], pair.shift[k], normal))

    def size(self, k: int) -> float:
        """The size of the larger body of pair k."""
        return max(self.forest.cells[self._number[body]].size for body in self.pairs[k])

    def radius(self, k: int) -> float:
        """The least radius of what is round of either body of pair k."""
        return min(cells.radius for cells in self.cells_of_both(k))

    def move_length(self, k: int, q: Array, move: Array) -> float:
        """How far a move takes points of the second body of pair k, at most."""
        if not move.any():
            return 0.0
        middle, radius = self.cells_of(k).nodes[0, :3], float(self.cells_of(k).nodes[0, 3])
        way = move[:3] + np.cross(move[3:], rotation_matrix(q[self.pairs[k][1], 3:]) @ middle)
        return float(np.linalg.norm(way) + radius * np.linalg.norm(move[3:]))

    def way_length(self, k: int, before: Array, after: Array) -> float:
        """How far points of the second body of pair k go between two poses, seen from the first, at most."""
        (turn0, shift0), (turn1, shift1) = self._relative(k, before), self._relative(k, after)
        middle, radius = self.cells_of(k).nodes[0, :3], float(self.cells_of(k).nodes[0, 3])
        angle = 2.0 * np.arcsin(min(1.0, float(np.linalg.norm(turn1 - turn0)) / np.sqrt(8.0)))
        return float(np.linalg.norm((turn1 - turn0) @ middle + shift1 - shift0) + angle * radius)

    def nested(self, k: int, q: Array, move: Array) -> bool | None:
        """Whether a body of pair k, whose boundaries are apart, is within the other one; None where no ray tells.

        One point of every connected part of a boundary is enough.
        """
        a, b = self.pairs[k]
        turn_a, turn_b = rotation_matrix(q[a, 3:]), _turned(move[3:]) @ rotation_matrix(q[b, 3:])
        at_a, at_b = q[a, :3], q[b, :3] + move[:3]
        for outer, inner, turns, places in (
            (a, b, (turn_a, turn_b), (at_a, at_b)),
            (b, a, (turn_b, turn_a), (at_b, at_a)),
        ):
            number = self._number[outer]
            if not self.forest.cells[number].is_closed:
                continue
            inside = self.forest.cells[self._number[inner]]
            for component in np.unique(inside.component):
                points = self.forest.corners(self._number[inner], component)
                points = (points @ turns[1].T + places[1] - places[0]) @ turns[0]
                side = self._winding(number, points)
                if side != 0:
                    return None if side == UNCLEAR else True
        return False

    def _winding(self, body: int, points: Array) -> int:
        """Whether points of a boundary that does not cross a body's are within that: 1, 0, or UNCLEAR."""
        some = np.ascontiguousarray(points[np.linspace(0, len(points) - 1, min(len(points), POINTS)).astype(int)])
        found = np.full(len(some), UNCLEAR)
        while True:
            asked = winding_of(self.forest.arrays, self.forest.roots[body], some, self._stack, found)
            if found[asked - 1] != UNCLEAR or not self.forest.is_full or not self.forest.grow():
                return int(found[asked - 1])


def _turned(vector: Array) -> Array:
    """The matrix of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    axis = vector / angle
    return rotation_matrix(np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis]))
