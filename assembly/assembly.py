"""Assembly: bodies, what must hold between them, what is wished for, and the solve."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._progress import Progress
from assembly.errors import InputError
from assembly.kinematics.body import Body, Frame, Point
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

        Without an objective the least move is sought; where that is not found, any pose does at which all holds. What
        holds as it stands is not moved. Where constraints do not hold near the start, others are tried, the same in
        every run, and the solution with the least objective is returned; its `restarted` says so.

        Parameters
        ----------
        q0 : (n, 7) or Solution, optional
            Where to start: a row a body (rows of fixed bodies too), or an earlier solution of this assembly, whose
            contacts and multipliers are taken up as well. The bodies' own poses by default.
        starts : mapping of constraint name -> (4,), optional
            Parameters near the pair each contact is to track; a global start finds the others.
        time_limit : float, optional
            Seconds after which the solve ends with `Status.TIME_LIMIT`, at the last pose that held if there was one.
        callback : callable, optional
            Called with the iteration, the objective and the feasibility (in the scene's unit; nan and inf before they
            are known) every 50 ms, or after a step that takes longer; where it returns True the solve ends with
            `Status.STOPPED`. What it raises is raised here. Ctrl-C is answered as often, with or without a callback;
            the scene stays usable.
        swept : bool
            Whether the way from q0, a solution, is asked for as well. Driven values, offsets, limits and targets go
            from what q0 was solved with to what they are now, along a line, and the scene is solved in many steps.
            Where bodies that a clearance keeps apart are in the way, the solve ends at the last pose before, as
            `Status.BLOCKED`; `way` and the message say what is in the way, and where.
        **options
            See `Options`.

        Returns
        -------
        Solution
            Check `success`; the status and the message say what happened otherwise.
        """
        is_plain = starts is None and time_limit is None and callback is None and swept is False and not options
        # Where a body or a constraint was set since, it may be one of this scene: `packed` looks.
        if is_plain and type(q0) is Solution and (self._seen is changes() or self._follows_numbers()):
            straight = straight_from(q0, self._scene, self._packed, bool(self._objectives))
            if straight is not None:
                return straight
        interruption = CTRL_C if time_limit is None and callback is None else Interruption(time_limit, callback)
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

        Random starts are where joints let bodies be: values of freedoms within limits, angles any where there are none,
        along a tree of joints from fixed bodies on, and loops are closed from there in the joints' coordinates. A body
        that no joint carries is shifted by up to the scene's size along each axis, and turned any way.

        Parameters
        ----------
        starts : int, "all", or sequence of (n, 7) and Solution
            How many; the first is the bodies' poses. "all": 128 at least, and four times as many as led to the last
            solution that is new, up to 4,096. Or the starts themselves; solutions may be of any scene of these bodies.
        seed : int
            Of the random starts: the same seed, the same starts.
        time_limit : float, optional
            Seconds after which no start is begun any more, and the last one ends.
        executor : Executor, optional
            One of `concurrent.futures`, or one like it: solves are submitted to it, the scene pickled. What is found
            is the same.
        progress : bool or callable
            True shows a bar of the starts; a function is called with how many are done, and of how many, and ends the
            search where it returns True. After Ctrl-C the solutions that were found are returned.
        **options
            See `Options`.

        Returns
        -------
        list of Solution
            The successful ones, the smallest objective first. Solutions in another configuration (`configuration`) are
            two. Else poses within 1e-6 of each other (lengths over the scene's size, radians) are one, and so are two
            between which all poses on the straight way are as good. A `Posture` without a reference, and the objective
            of a scene that has none, are measured from the bodies' poses in all of them.
        """
        from assembly.studies.multistart import solve_all

        return solve_all(self, starts, seed, Interruption(time_limit), options, executor, progress)

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

        Rows are independent of each other: they do not depend on the number of threads. A start has the same bits as
        `solve` has from it; with parameters lengths are counted in the size that the scene has now.

        Parameters
        ----------
        q0s : (n, bodies, 7), (bodies, 7), Solution or sequence of Solution, optional
            Where rows begin, or where all of them do; the bodies' own poses by default.
        parameters : mapping of Parameter -> (n,), optional
            Values for every row. Those of the scene are the same afterwards.
        of : iterable of Measure
            What is told of every row.
        threads : int, optional
            By default as many as there are processors for this process.
        retry : bool
            Whether rows at which the loop does not arrive are solved again by all that `solve` tries, one after the
            other: False leaves them as the loop did.
        **options
            See `Options`.

        Returns
        -------
        Batch
            A row a solve; rows that fail are rows.

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

    def at(self, values: Mapping[str, float]) -> Array:
        """Poses (n, 7) at which joints have these values, of freedoms by the names of `Solution.values`: a start `q0`.

        Others have what they are driven to, or what they have where the bodies stand. Loops are closed, where they
        close from there and joints alone close them; else each body is where the joints between it and the ground
        with the fewest freedoms carry it.

        Raises
        ------
        InputError, TypeError
            Unknown names, values beyond limits, freedoms that place no body.
        """
        from assembly.studies.branches.joint_poses import poses_at

        return poses_at(self, values)

    def tracker(self, follow: Point | Frame | Body | Sequence[Point | Frame | Body], **options: Any) -> Tracker:
        """What follows a hand that holds a point or a frame of a body, or several hands.

        Parameters
        ----------
        follow : Point, Frame or Body, or a list of them
        **options
            See `Tracker`.
        """
        from assembly.tracking.tracker import Tracker

        return Tracker(self, follow, **options)

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
            A row a body, or a solution of this assembly; the bodies' own poses by default. Where they violate
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
            The time limit was over before: half of a rank says nothing.
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

    def save(self, path: str | PathLike[str]) -> None:
        """Write the scene as JSON; `asm.load` reads it back."""
        from assembly.scene_file import save

        save(self, path)
