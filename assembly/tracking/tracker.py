"""Tracker: poses that follow targets, one call of the compiled loop for each tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter, sleep

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import read_only
from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Freedom, structure_changes
from assembly.constraints.program.records import CLOCK_AT
from assembly.errors import InputError, integer, number, positive
from assembly.kinematics.body import Body
from assembly.kinematics.changes import changes
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import Pose, pose_rows
from assembly.solve.loop.parameters import ROUNDING
from assembly.solve.loop.settings import (
    ALLOWED_OVERLAP,
    BUDGET,
    FEASIBILITY,
    FINAL_UPDATE,
    ITERATIONS,
    RADIUS,
    SECOND_ORDER,
    STATIONARITY,
    TICK,
)
from assembly.solve.options import Options
from assembly.solve.solution import Solution
from assembly.tracking.hands import Followable, SeveralHands
from assembly.tracking.log import TrackLog
from assembly.tracking.new_hands import new_hands, springs, with_hands
from assembly.tracking.tick import Step, TrackStatus
from assembly.tracking.ticks import LOOP_SHARE, Ticks
from assembly.tracking.trace import Trace

__all__ = ["Tracker"]

Array = NDArray[np.float64]
_CODES = {status: k for k, status in enumerate(TrackStatus)}


def _held_to(begin: Solution) -> Solution:
    """The solve with which a tracker begins, which has to succeed."""
    if not begin.success:
        raise InputError(f"q0 leads to no pose at which the constraints hold; expected one that does: {begin.message}")
    return begin


def _begin(scene: Assembly, q0: ArrayLike | Solution | None, touching: float) -> Array:
    """The poses to begin at, (n, 7)."""
    if scene.constraints:
        return _held_to(scene.solve(q0, touching=touching)).q
    return scene.q if q0 is None else scene.solve(q0, max_iterations=0).q


def _tick_settings(limit: float, iterations: int, second_order: bool) -> Array:
    """Settings of a tick."""
    settings = Options().settings(warm=True)
    settings[FEASIBILITY] = limit
    settings[STATIONARITY] = 1e-9
    settings[ITERATIONS] = integer("iterations", iterations, 1, 1000)
    settings[TICK] = 1.0
    # A tick begins where the last one ended: the overlap that is allowed was set at the start.
    settings[ALLOWED_OVERLAP] = 0.0
    settings[FINAL_UPDATE] = 0.0
    settings[SECOND_ORDER] = float(second_order)
    return settings


class Tracker(Ticks):
    """Makes points or frames of bodies, or coordinates of joints, follow targets; made by `Assembly.tracker`.

    Every tick is a few steps of the loop that `solve` runs, from the pose and the multipliers of the tick before. A
    spring draws the point to its target with `stiffness` times the distance, and the constraints hold all the time.
    Other objectives of the scene are added. Under a clearance a pose is accepted only if bodies are proven to be clear
    or to touch only, at it and on the way from the last pose; otherwise the tick is HELD at the last pose.

    Parameters
    ----------
    scene : Assembly
        Its present bodies, constraints and objectives; driven values and limits may change between ticks. Where
        anything is added or removed, ticks are CHANGED and nothing moves.
    follow : Point, Frame, Body or Freedom, or a list of them
        What follows the target, or a list of several. The target of a `Point` is a point (3,), that of a `Freedom`, as
        in `joint.coordinate("angle")`, a number, that of the others a pose (7,) or a `Pose`; for a list it is a
        sequence of targets in its order. Coordinates are angles about an axis or ways along one, without a value.
    q0 : (n, 7) or Solution, optional
        Where to begin; by default the bodies' poses. The constraints are solved from there, with the target at rest.
    stiffness : float or sequence of float
        Force over distance; one for each target, or one for all. Of a turn it is that of a spring which acts half the
        size of the turned body from its axis.
    budget : float, optional
        Seconds after which a tick begins nothing further: no step or update of the compiled loop, and no part of the
        proof under a `Clearance`. It is LATE then, at the last pose that is proven, and the next tick continues with
        what is not done. Under a clearance the loop has the first four fifths of it. Without a budget a tick takes as
        long as it needs.
    iterations : int
        Number of steps after which a tick ends if the constraints hold; otherwise up to four times as many.
    tolerance : float
        Largest violation at which constraints count as held, in parts of the scene's size; far from the origin at least
        the rounding of coordinates, and at least 1e-6 if the start is FITTED.
    second_order : bool
        Whether every tick is tested for a minimum.
    touching : float
        How much bodies of a clearance may overlap at the start and still count as touching, in parts of the scene's
        size.

    Raises
    ------
    InputError, TypeError
        Arguments out of range, or a start from which the constraints cannot be solved.
    """

    _instead = "keep `tracker.scene` and `tracker.q` and make another one from them"

    def __init__(
        self,
        scene: Assembly,
        follow: Followable | Sequence[Followable],
        *,
        q0: ArrayLike | Solution | None = None,
        stiffness: float | Sequence[float] = 1.0,
        budget: float | None = None,
        iterations: int = 2,
        tolerance: float = 1e-12,
        second_order: bool = False,
        touching: float = 1e-9,
    ) -> None:
        weights = springs(follow, stiffness)
        limit = number("tolerance", tolerance)
        if not 1e-14 <= limit <= 1e-3:
            raise InputError(f"tolerance is {limit:g}; expected a part of the scene's size from 1e-14 to 1e-3")
        if not isinstance(second_order, (bool, np.bool_)):
            raise InputError(f"second_order is {second_order!r}; expected True or False")
        self._scene_given = scene
        self._keep_contents()
        self._touching = touching
        # What is begun with has the numbers that the scene has then; what is solved of it takes its turn again.
        with scene._turn.entry():
            poses = _begin(scene, q0, touching)
            self._hands = new_hands(scene, follow, poses, weights)
            self._inner = inner = with_hands(scene, self._hands)
            # A solve packs anew where contacts found no place: what it ends with is what ticks go on with.
            first = _held_to(inner.solve(poses, touching=touching))
        if first.disagreeing:
            # What rows disagree by depends on the pose.
            limit = max(limit, Options.fit)
        self._take_packed(first)
        self._settings = _tick_settings(limit, iterations, second_order)
        self._budget = budget
        if budget is not None:
            share = LOOP_SHARE if self._packed.keeps_apart else 1.0
            self._settings[BUDGET] = share * 1e9 * positive("budget", budget)
            if self._packed.table[CLOCK_AT] == 0:
                raise InputError("budget is given, but this interpreter has no clock for compiled code; expected None")
        self._begin_at(first)
        # The loop holds rows to this, or to what rounding of coordinates alone can violate.
        far = float(np.abs(poses[:, :3]).max()) / self._packed.scale
        self._tolerance = 1.25 * max(limit, ROUNDING * far) * self._packed.scale

    def __repr__(self) -> str:
        stiffness = self._hands.stiffness
        told = f"{stiffness:g}" if isinstance(stiffness, float) else repr(stiffness)
        return f"Tracker({self._scene_given!r}, follow={self.follow!r}, stiffness={told})"

    @property
    def follow(self) -> Followable | tuple[Followable | None, ...]:
        """What follows the target, or a tuple for several hands, None for one that holds nothing."""
        return self._hands.follow

    def hold(self, hand: int, follow: Followable | None, stiffness: float = 1.0) -> None:
        """Have one of several hands hold something else of its body from the next tick on, or nothing.

        It is at rest there. This takes some microseconds, where another tracker takes a tenth of a second and more.

        Parameters
        ----------
        hand : int
            Which one, in the order of what the tracker was made with.
        follow : Point, Frame, Body, Freedom or None
            Of the same body. A hand that was made with a point holds points, one that was made with a coordinate that
            coordinate, other ones hold points and frames.
        stiffness : float

        Raises
        ------
        InputError, TypeError
            A tracker of a single hand, a hand or a body that it has not, a stiffness that is not positive.
        """
        if not isinstance(self._hands, SeveralHands):
            raise InputError("the tracker has a single hand; expected one that was made with a list")
        k = integer("hand", hand, 0, len(self._hands.terms) - 1)
        spring = positive("stiffness", stiffness)
        if follow is not None and not isinstance(follow, (Point, Frame, Body, Freedom)):
            raise TypeError(f"follow is {follow!r}; expected a Point, a Frame, a Body, a joint's coordinate or None")
        held = None if follow is None else self._hands.can_hold(k, follow)
        if self._awaited is not None:
            # Whatever target it was, it was one of another spring.
            status, _, ended = self._awaited
            self._awaited = TrackStatus.LATE, (), ended
        self._hands = self._hands.holding(k, held, spring, self.q)
        self._followed = replace(self._followed, hands=self._hands)

    def restart(self, q0: ArrayLike | Solution) -> None:
        """Go on from other poses, hands at rest there; where these do not hold, the tracker stays as it is.

        Parameters
        ----------
        q0 : (n, 7) or Solution
            The constraints are solved from there, as in `Assembly.solve`; the hands draw to where they are at rest.

        Raises
        ------
        InputError, TypeError
            A tracker of a single hand, a scene that has other bodies, constraints or terms by now, no poses of all
            bodies, or ones from which the constraints cannot be solved.
        """
        if not isinstance(self._hands, SeveralHands):
            raise InputError("the tracker has a single hand; expected one that was made with a list")
        if self._has_other_contents():
            raise InputError("the scene has other bodies, constraints or terms; expected those the tracker was made of")
        poses = pose_rows("q0", q0.q if isinstance(q0, Solution) else q0, len(self._scene_given.bodies))
        before = self.q
        self._hands.at_rest(poses)
        try:
            first = _held_to(self._inner.solve(poses, touching=self._touching))
        except InputError:
            self._hands.at_rest(before)
            self._hands.pack(self._packed)
            self._hands.take_targets(before)
            raise
        self._take_packed(first)
        self._settings[RADIUS] = self._radius
        self._begin_at(first)
        self._hands.take_targets(first.q)

    @property
    def scene(self) -> Assembly:
        """The assembly that was given."""
        return self._scene_given

    @property
    def q(self) -> Array:
        """Where the bodies stand now, (n, 7), read-only."""
        return read_only(self._before[: self._packed.contacts_at].reshape(-1, 7).copy())

    def step(self, target: ArrayLike | Pose | Sequence[ArrayLike | Pose | None]) -> Step:
        """Follow the target for one tick. Never raises: see `Step.status`.

        Parameters
        ----------
        target : (3,), (7,), Pose or float
            A point, a pose for a frame, or a number for a coordinate; an angle is turned to it the shorter way round.
            For several a sequence of targets, anything for one that holds nothing; if another one is invalid, nothing
            moves.
        """
        begin = perf_counter()
        packed = self._packed
        is_old = packed.stamp == structure_changes() and self._edits is changes()
        changed = not (is_old and self._edition is self._scene_given._edition) and self._has_changed()
        row = None if changed else self._hands.aimed(target)
        if row is None:
            status = TrackStatus.CHANGED if changed else TrackStatus.BAD_TARGET
            return Step(self._followed, self._before, status, self._hands.where(), self._seen, perf_counter() - begin)
        until = self._until(begin)
        if self._clear is not None and self._clear.goes_on:
            step = self._gone_on(row, begin, until)
            if step is not None:
                return step
        ended_with = self._moved_clear(row, until)
        return self._late(row, begin) if ended_with is None else self._ended(*ended_with, row, begin)

    def run(self, trace: Trace | Sequence[Trace], *, paced: bool = False, stride: int = 1) -> TrackLog:
        """Follow recorded motions, one tick per sample.

        Parameters
        ----------
        trace : Trace or sequence of Trace
            Of points, poses, or numbers for a coordinate. For several targets one trace each, with the same times.
        paced : bool
            Whether to wait for each sample's time by the clock, instead of going as fast as possible.
        stride : int
            Poses are kept of every so many ticks.

        Returns
        -------
        TrackLog

        Raises
        ------
        InputError, TypeError
            Not a trace for each target, one of another kind, or one with times other than the first one's.
        """
        bodies, budget = len(self._scene.bodies), self._budget
        times, targets = self._hands.recorded(trace)
        recorder = TrackLog.recorder(times, bodies, TrackStatus, stride=stride, budget=budget)
        start = perf_counter()
        for k, (time, target) in enumerate(zip(times.tolist(), targets, strict=True)):
            if paced:
                wait = start + time - perf_counter()
                if wait > 0.0:
                    sleep(wait)
            step = self.step(target)
            recorder.record(k, step.q, step.seconds, step.feasibility, _CODES[step.status], step.iterations)
            if step.events:
                recorder.note(k, step.events)
        return recorder.log()
