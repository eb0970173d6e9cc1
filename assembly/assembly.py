"""Assembly: bodies, constraints between them, objectives, and the solve."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._progress import Progress
from assembly._turn import holders, in_turn
from assembly.errors import InputError
from assembly.kinematics.changes import changes
from assembly.kinematics.pose import pose_rows
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.options import Options
from assembly.solve.solution import Solution
from assembly.solve.straight import straight_from
from assembly.solving import Solving

if TYPE_CHECKING:
    from assembly.derivatives.measure import Measure
    from assembly.derivatives.parameter import Parameter
    from assembly.solve.diagnosis.mobility import Mobility
    from assembly.studies.batches.result import Batch
    from assembly.studies.multistart import Executor
    from assembly.tracking.hands import Followable
    from assembly.tracking.tracker import Tracker

__all__ = ["Assembly"]

Array = NDArray[np.float64]
_LOG = logging.getLogger("assembly.solve")


class Assembly(Solving):
    """A scene: rigid bodies, constraints between them, an objective.

    Parameters
    ----------
    bodies : iterable of Body
        Names must be distinct.

    Notes
    -----
    The scene is packed once, at the first solve after a change of its bodies, constraints or terms. Targets,
    weights' ratios aside, and starts may change between solves without packing again.
    """

    def __repr__(self) -> str:
        return f"Assembly({len(self._bodies)} bodies, {len(self._constraints)} constraints)"

    def solve(
        self,
        q0: ArrayLike | Solution | None = None,
        *,
        starts: Mapping[str, ArrayLike] | None = None,
        time_limit: float | None = None,
        callback: Callable[[int, float, float], object] | None = None,
        swept: bool = False,
        **options: Any,
    ) -> Solution:
        """Find the pose where every constraint holds and the objective has a local minimum.

        Without an objective the least move is sought; if it is not found, any pose at which all constraints hold is
        returned. A start at which they hold is not moved. If constraints do not hold near the start, other starts are
        tried, the same in every run; the solution with the least objective is returned, and its `restarted` is True.
        Threads that use one scene take turns; `solve_many` solves from many starts at once. A callback may solve the
        scene from elsewhere meanwhile: it is given what a copy of the scene is solved to.

        Parameters
        ----------
        q0 : (n, 7) or Solution, optional
            Where to start: one row for each body (a fixed one stays where its row says), or an earlier solution of this
            assembly, whose contacts and multipliers are used as well. By default the bodies' own poses.
        starts : mapping of constraint name -> (4,), optional
            Surface parameters near the pair that a contact is to track; for other contacts a global search finds the
            pair.
        time_limit : float, optional
            Seconds after which the solve ends with `Status.TIME_LIMIT`, at the last pose that held if there was one.
            They begin with the thread's turn.
        callback : callable, optional
            Called with the iteration, the objective and the feasibility (in the scene's unit; nan and inf before they
            are known) every 50 ms, or after a step that takes longer. If it returns True the solve ends with
            `Status.STOPPED`; an exception in it is raised here. Ctrl-C is answered equally often, with or without a
            callback, and the scene stays usable.
        swept : bool
            Whether to prove the way from q0, which must be a solution. Driven values, offsets, limits and targets go
            along a line from the values that q0 was solved with to the present ones, and the scene is solved in many
            steps. If bodies that a clearance keeps apart are in the way, the solve ends at the last pose before them
            with `Status.BLOCKED`; `way` and the message say what is in the way, and where.
        **options
            See `Options`.

        Returns
        -------
        Solution
            Check `success`; if it is False, the status and the message say what happened.
        """
        turn = self._turn
        # As `in_turn`, which takes as long as a fiftieth of a small scene's warm solve.
        with turn.lock if not holders else turn.entry() as is_mine:
            if not is_mine or turn.is_busy:
                # A callback of a solve of this scene, which reads what it wrote into the packed one until it ends.
                again = self._beside(is_mine)
                return again.solve(q0, starts=starts, time_limit=time_limit, callback=callback, swept=swept, **options)
            is_plain = starts is None and time_limit is None and callback is None and swept is False and not options
            # Where a body or a constraint was set since, it may be one of this scene: `packed` looks.
            if is_plain and type(q0) is Solution and (self._seen is changes() or self._follows_numbers()):
                straight = straight_from(q0, self._scene, self._packed)
                if straight is not None:
                    return straight
            interruption = CTRL_C if time_limit is None and callback is None else Interruption(time_limit, callback)
            before = turn.begin()
            turn.is_busy = True
            try:
                return self._solved_in_turn(q0, starts, swept, options, interruption)
            finally:
                turn.is_busy = False
                turn.end(before)

    def _solved_in_turn(
        self,
        q0: ArrayLike | Solution | None,
        starts: Mapping[str, ArrayLike] | None,
        swept: bool,
        options: dict[str, Any],
        interruption: Interruption,
    ) -> Solution:
        """A solve with everything that it may need."""
        if swept is not False and not isinstance(swept, (bool, np.bool_)):
            raise InputError(f"swept is {swept!r}; expected True or False")
        if swept:
            from assembly.studies.swept_solve import swept_solve

            solution = swept_solve(self, q0, starts, options, interruption)
        else:
            solution = self._from_start(q0, starts, options, interruption)
        if not solution.success:
            solution = self._tried_otherwise(solution, q0, starts, swept, options, interruption)
        if options and Options.of(options).verbose:
            print(solution.iteration_table())
        if _LOG.isEnabledFor(logging.DEBUG):
            _LOG.debug("%s, %d iterations, %.6f s", solution.status.name, solution.iterations, solution.seconds)
        return solution

    @in_turn
    def solve_all(
        self,
        *,
        starts: int | str | Sequence[ArrayLike | Solution] | Array = 16,
        seed: int = 0,
        time_limit: float | None = None,
        executor: Executor | None = None,
        progress: Progress = False,
        **options: Any,
    ) -> list[Solution]:
        """The distinct solutions found from several starts: the bodies' poses, then random ones.

        Random starts are drawn in joint coordinates, within their limits or over all angles, along a tree of joints
        from fixed bodies; loops are closed from there in joint coordinates. A body without a joint is shifted by up to
        the scene's size along each axis, and turned in any way.

        Parameters
        ----------
        starts : int, "all", or sequence of (n, 7) and Solution
            Their number; the first is the bodies' poses. "all": at least 128, and four times as many as led to the last
            new solution, up to 4,096. Or the starts themselves; solutions may be of any scene with these bodies.
        seed : int
            Of the random starts: equal seeds give equal starts.
        time_limit : float, optional
            Seconds after which no further start is tried and the present one ends.
        executor : Executor, optional
            One of `concurrent.futures`, or one like it: solves are submitted to it, the scene pickled. What is found
            is the same.
        progress : bool or callable
            True shows a progress bar; a function is called with the numbers of finished and of all starts, and ends the
            search by returning True. After Ctrl-C the solutions found so far are returned.
        **options
            See `Options`.

        Returns
        -------
        list of Solution
            The successful ones, the smallest objective first. Solutions with different signs of their `configuration`
            are distinct. Otherwise poses within 1e-6 of each other (lengths over the scene's size, radians) are one
            solution, and so are two poses if all poses on the straight way between them are as good. A `Posture`
            without a reference, and the least move of a scene without an objective, are measured from the bodies' poses
            for all of them.
        """
        from assembly.studies.multistart import solve_all

        self._turn.is_busy = True
        try:
            return solve_all(self, starts, seed, Interruption(time_limit), options, executor, progress)
        finally:
            self._turn.is_busy = False

    @in_turn
    def solve_many(
        self,
        q0s: ArrayLike | Solution | Sequence[Solution] | None = None,
        *,
        parameters: Mapping[Parameter, ArrayLike] | None = None,
        of: Iterable[Measure] = (),
        threads: int | None = None,
        retry: bool = True,
        **options: Any,
    ) -> Batch:
        """Solve from many starts, or with many values of parameters, in compiled calls over threads.

        Rows are independent of each other and of the number of threads. A row has the bits of `solve` from its start;
        with parameters lengths are divided by the scene's present size.

        Parameters
        ----------
        q0s : (n, bodies, 7), (bodies, 7), Solution or sequence of Solution, optional
            Where rows begin, or where all of them do; the bodies' own poses by default.
        parameters : mapping of Parameter -> (n,), optional
            Values for every row. Those of the scene are the same afterwards.
        of : iterable of Measure
            Measures to compute for every row.
        threads : int, optional
            By default the number of processors available to this process.
        retry : bool
            Whether rows at which the compiled loop does not arrive are solved again, one after the other, with
            everything that `solve` tries; False leaves them as they are.
        **options
            See `Options`.

        Returns
        -------
        Batch
            One row per solve; rows that fail are rows.

        Raises
        ------
        InputError, TypeError
            Wrong shapes, values that the scene cannot have, parameters of another scene.

        Notes
        -----
        Scenes with clearances, contacts that are lower pairs, nearest axes, and parameters that make faces are solved
        row by row in the interpreter (`Batch.alone`).
        """
        from assembly.studies.batches.solving import solve_many

        return solve_many(self, q0s, parameters, of, threads, retry, options)

    @in_turn
    def at(self, values: Mapping[str, float]) -> Array:
        """Poses (n, 7) at which joint coordinates have given values, by the names in `Solution.values`: a start `q0`.

        Other coordinates have their driven values, or their values at the bodies' poses. Loops of joints are closed if
        Newton's method closes them from there; otherwise each body is where the joints with the fewest coordinates
        between it and the ground put it.

        Raises
        ------
        InputError, TypeError
            Unknown names, values beyond limits, coordinates that determine the pose of no body.
        """
        from assembly.studies.branches.joint_poses import poses_at

        return poses_at(self, values)

    def tracker(self, follow: Followable | Sequence[Followable], **options: Any) -> Tracker:
        """A tracker that makes a point or a frame of a body, a joint's coordinate, or several of them follow targets.

        Parameters
        ----------
        follow : Point, Frame, Body or Freedom, or a list of them
            A `Freedom` is a joint's coordinate, `joint.coordinate("angle")`.
        **options
            See `Tracker`.
        """
        from assembly.tracking.tracker import Tracker

        return Tracker(self, follow, **options)

    @in_turn
    def mobility(
        self,
        q: ArrayLike | Solution | None = None,
        *,
        drives: bool = True,
        tolerance: float | None = None,
        time_limit: float | None = None,
    ) -> Mobility:
        """Degrees of freedom at a pose, free motions, redundant and conflicting constraints.

        Parameters
        ----------
        q : (n, 7) or Solution, optional
            One row for each body, or a solution of this assembly; by default the bodies' own poses. If they violate
            constraints the counts are those of that pose, and `feasibility` says by how much.
        drives : bool
            Whether driven values count as constraints.
        tolerance : float, optional
            Singular values below it count as zero; see `Mobility.tolerance`.
        time_limit : float, optional
            Seconds for the counts and free motions, and as many again for each of what is found when it is read:
            `finite_dof`, `redundant_sets`, `conflicting_sets`, a `trajectory`.

        Returns
        -------
        Mobility
            Print it for a table.

        Raises
        ------
        InputError
            Wrong shapes, a contact without a pair at the pose, a solution of another assembly.
        TimeoutError
            The time limit was reached first; part of a rank has no meaning.
        """
        from assembly.solve.diagnosis.mobility import Mobility

        if not isinstance(drives, (bool, np.bool_)):
            raise InputError(f"drives is {drives!r}; expected True or False")
        self._take_seats(q)
        if isinstance(q, Solution):
            q._list_contacts()
        packed = self.packed()
        assert self._scene is not None
        solved = isinstance(q, Solution)
        # A solution keeps the values it was solved with.
        if isinstance(q, Solution):
            state, fit = self._state_of("q", packed, q), q._allowed
        else:
            state = self._start(packed, None if q is None else pose_rows("q", q, len(self._bodies)), None)
            fit = Options.fit
        return Mobility.at(
            self._scene,
            packed,
            state,
            solved=solved,
            drives=bool(drives),
            tolerance=tolerance,
            fit=fit,
            time_limit=time_limit,
        )

    @in_turn
    def save(self, path: str | PathLike[str]) -> None:
        """Write the scene as JSON; `asm.load` reads it back."""
        from assembly.scene_file import save

        save(self, path)
