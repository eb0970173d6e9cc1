"""Several starts of one scene, and the distinct solutions they lead to.

Starts are drawn where joints say that bodies may be (`branches/joint_tree.py`), and loops are closed by Newton's method
in the coordinates of joints, which takes microseconds a start. Ends that are one by then are solved once.
"""

from __future__ import annotations

import logging
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._progress import Advance, Progress, checked_progress, watched
from assembly.errors import InputError, integer
from assembly.kinematics.pose import pose_rows
from assembly.solve.attempts.postures import postures_from
from assembly.solve.attempts.starts import moving_rows, scattered
from assembly.solve.interruption import Interruption
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.studies.branches.joint_tree import JointTree
from assembly.studies.branches.signs import differ
from assembly.studies.distinct import are_one

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Executor", "solve_all"]

Array = NDArray[np.float64]
Starts = int | str | Sequence[ArrayLike | Solution] | Array
# Starts at a time; of an executor's task. Of "all": as few at least, as many at most, and by how many times more than
# led to the last new solution. A branch that one start in 40 leads to is missed once in 25 times by the fewest.
BATCH, TASK, FEWEST, MOST, AGAIN = 64, 16, 128, 4096, 4
# Where loops are closed to this; starts nearer to each other, places over the size and columns of rotations, are one.
CLOSED, SAME = 1e-9, 1e-7


class Executor(Protocol):
    """What takes tasks: one of `concurrent.futures`, or a client that is like one."""

    def submit(self, function: Any, /, *arguments: Any) -> Any:
        """Begin a task."""


class End(NamedTuple):
    """How a solve in another process ended: plain numbers."""

    status: Status
    state: Array
    history: Array
    seconds: float
    rows: int
    q: Array


_LOG = logging.getLogger("assembly.studies")


def solve_all(
    scene: Assembly,
    starts: Starts,
    seed: int,
    interruption: Interruption,
    options: Mapping[str, Any],
    executor: Executor | None = None,
    progress: Progress = False,
) -> list[Solution]:
    """See `Assembly.solve_all`."""
    number = integer("seed", seed, 0, 2**63 - 1)
    if executor is not None and not hasattr(executor, "submit"):
        raise TypeError(f"executor is {executor!r}; expected one of concurrent.futures, or another one with submit")
    given, asked = _given(starts, scene)
    checked_progress(progress)
    # Of "all" nobody knows how many there will be: the fewest are told.
    total = len(given) or asked or FEWEST
    with postures_from(scene.packed(), scene.q), watched(progress, "solve_all", total, "start") as advance:
        search = _Search(scene, dict(options), interruption, executor, advance)
        try:
            if given:
                search.solve(given)
            else:
                _from_drawn(search, asked, np.random.default_rng(number))
        except KeyboardInterrupt:
            # What is found is found.
            _LOG.warning("solve_all was interrupted after %d starts", search.count)
    # Of equal objectives, which are so up to rounding only where a scene is symmetric, the first found comes first.
    return sorted(search.found, key=lambda solution: solution.objective)


def _given(starts: Starts, scene: Assembly) -> tuple[list[Array], int | None]:
    """Starts that are poses or solutions; else none, and how many are asked for: None of "all"."""
    if isinstance(starts, str):
        if starts != "all":
            raise InputError(f"starts is {starts!r}; expected a number, 'all', or poses and solutions")
        return [], None
    if isinstance(starts, (Sequence, np.ndarray)):
        if not len(starts):
            raise InputError("starts is empty; expected a number, 'all', or poses and solutions")
        rows = [item.q if isinstance(item, Solution) else item for item in starts]
        return [pose_rows(f"starts[{k}]", row, len(scene.bodies)) for k, row in enumerate(rows)], None
    return [], integer("starts", starts, 1, 10**6)


def _from_drawn(search: _Search, asked: int | None, rng: np.random.Generator) -> None:
    """Solve from the bodies' poses, then from drawn ones, as many as are asked for; None: of "all"."""
    scene, tree = search.scene, None
    moving = moving_rows(scene.bodies)
    search.solve([scene.q])
    most = MOST if asked is None else asked
    while search.count < most and not search.is_over():
        if asked is None and search.count >= max(FEWEST, AGAIN * search.newest):
            return
        if tree is None:
            tree = JointTree(scene)
        count = min(BATCH, most - search.count)
        if not tree.carried:
            # Nothing is cheaper than solves here: one start after the other, as time lets them.
            search.solve([scattered(rng, scene.q, moving, scene.packed().scale) for _ in range(count)])
            continue
        q, off = _drawn(scene, tree, rng, count)
        search.solve(list(q), merge=not scene.objectives and tree.loops_close, off=off)


def _drawn(scene: Assembly, tree: JointTree, rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    """Poses (count, n, 7) from the joint space, those that no joint carries from a box; what loops are off by."""
    loose = [k for k in moving_rows(scene.bodies) if k not in set(tree.carried)]
    q, off = tree.closed(tree.drawn(rng, count), scene.q)
    if loose:
        for k in range(count):
            q[k] = scattered(rng, q[k], loose, scene.packed().scale)
    lost = ~np.isfinite(q).all(axis=(1, 2)) | ~np.isfinite(off)
    q[lost], off[lost] = scene.q, np.inf
    return q, off


def _rotations(e: Array) -> Array:
    """The first two columns of rotations of quaternions (n, 4), (n, 6): the same of a quaternion and its negative."""
    w, x, y, z = e.T
    first = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
    second = [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)]
    return np.array(first + second).T


@dataclass(eq=False)
class _Search:
    """What was found so far."""

    scene: Assembly
    options: dict[str, Any]
    interruption: Interruption
    executor: Executor | None
    advance: Advance
    found: list[Solution] = field(default_factory=list)
    count: int = 0  # of starts
    newest: int = 0  # the start that led to the last new solution
    is_enough: bool = False  # whoever watches wants no more
    _seen: list[Array] = field(default_factory=list)

    def solve(self, starts: Sequence[Array], merge: bool = False, off: Array | None = None) -> None:
        """Solve from starts; where they are merged, of those that are one by now from one only."""
        closes = np.ones(len(starts), dtype=bool) if off is None else off <= CLOSED
        if not merge or not closes.any():
            # Of loops that close nowhere a solve tells what contradicts what.
            closes[:] = True
        asked = [
            (self.count + k + 1, q) for k, q in enumerate(starts) if closes[k] and not (merge and self._is_seen(q))
        ]
        self.count += len(starts)
        for number, solution in self._ends(asked):
            is_new = solution.success and not any(
                are_one(solution, other) and not differ(solution, other) for other in self.found
            )
            if is_new:
                self.found.append(solution)
                self.newest = max(self.newest, number)
            self._told(1)
        self._told(len(starts) - len(asked))

    def _told(self, count: int) -> None:
        self.is_enough = not self.advance(count) or self.is_enough

    def _is_seen(self, q: Array) -> bool:
        """Whether a start is one that was solved from; it is from now on."""
        place = np.hstack([q[:, :3] / self.scene.packed().scale, _rotations(q[:, 3:])])
        if self._seen and (np.abs(np.array(self._seen) - place).max(axis=(1, 2)) <= SAME).any():
            return True
        self._seen.append(place)
        return False

    def _ends(self, asked: Sequence[tuple[int, Array]]) -> Iterator[tuple[int, Solution]]:
        """Solutions from numbered starts, in order; those that there is time for, and that are wanted."""
        if self.executor is None or len(asked) < 2:
            for k, (number, q) in enumerate(asked):
                if k and self.is_over():
                    return
                yield number, self.scene._from_start(q, None, self.options, self.interruption)
            return
        whole = pickle.dumps(self.scene)
        tasks = [asked[first : first + TASK] for first in range(0, len(asked), TASK)]
        running = [self.executor.submit(_solved, whole, self.scene.q, [q for _, q in t], self.options) for t in tasks]
        for task, future in zip(tasks, running, strict=True):
            if self.is_over():
                future.cancel()
                continue
            for (number, _), end in zip(task, future.result(), strict=True):
                yield number, self._taken(end)

    def is_over(self) -> bool:
        """Whether no start is to be begun any more."""
        return self.is_enough or self.interruption.is_over()

    def _taken(self, end: End) -> Solution:
        """A solution of this scene from what another process tells."""
        packed, scene = self.scene.packed(), self.scene._scene
        assert scene is not None
        if packed.keeps_apart or packed.rows != end.rows or packed.new_state().size != end.state.size:
            # What is proven of clearances, and rows that a solve came to need, are no plain numbers.
            return self.scene._from_start(end.q, None, self.options, self.interruption)
        return Solution(scene, packed, end.state, end.status, end.seconds, end.history)


def _solved(whole: bytes, reference: Array, starts: Sequence[Array], options: dict[str, Any]) -> list[End]:
    """What a scene's solves from starts end with, in whatever process."""
    scene: Assembly = pickle.loads(whole)
    ends, interruption = [], Interruption(None)
    with postures_from(scene.packed(), reference):
        for q in starts:
            solution = scene._from_start(q, None, options, interruption)
            packed, state = solution._ended
            ends.append(
                End(solution.status, state, solution._rows, solution.seconds, packed.rows, np.array(solution.q))
            )
    return ends
