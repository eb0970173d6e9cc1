"""Closest points kept by feedback: a controller that starts anywhere on a patch and follows a point or another patch.

The laws are those of paper 000, theorems 1 and 2, in the corrected form of `docs/controllers.md`; what they promise,
and for which patches, is in `proximity/controllers/bounds.py`. Everything returned is in world axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly.errors import InputError, integer, number, positive, real_array, vector
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, CELLS, COEFFICIENTS, SURFACE_RECORD
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import BodyFace
from assembly.kinematics.frame import Point
from assembly.kinematics.pose import IDENTITY_ROW, check_quaternion
from assembly.proximity.controllers.laws import DISTANCE, ERROR, GAIN, MODE_F, MODE_G, ROW, ControlLaw
from assembly.proximity.controllers.runs import ControlEnd, run_control

__all__ = ["ControlRun", "ControlStatus", "Controller"]

Array = NDArray[np.float64]
Side = NurbsSurface | Face | BodyFace
Form = Literal["unit", "covariant", "contravariant"]
Mode = Literal["interior", "edge", "corner"]
FORMS: tuple[Form, ...] = ("unit", "covariant", "contravariant")
MODES: tuple[Mode, ...] = ("interior", "edge", "corner")
_OFFSETS = [BREAKS_U, BREAKS_V, COEFFICIENTS, CELLS]
# Points nearer than this part of the size meet.
_MEET = 1e-12


class ControlStatus(Enum):
    """How a run of the controller ended; the value says it in a sentence."""

    CLOSEST = "at rest: the distance is stationary on the patches"
    ON_ITS_WAY = "the steps are spent; step on, or raise the gain"
    MEETING = "the points met: the patches cross, or the point is on the patch"
    IRREGULAR = "parameters left the finite numbers; lower the gain"


_STATUSES = tuple(ControlStatus)


@dataclass(frozen=True, eq=False)
class ControlRun(ReadOnlyArrays):
    """Witness points over time; row k is the state after k steps.

    Attributes
    ----------
    parameters : (n, 2) or (n, 4)
        (u, v) of the surface, then those of the target if it is a patch.
    distance : (n,)
        |f - h|.
    error : (n,)
        |psi|: length of the projections of f - h on unit tangents, those that the ends of a patch hold left out.
    mode : (n, 1) or (n, 2) of int
        How many parameters are held: 0 in the interior, 1 on an edge, 2 at a corner; of both patches.
    gain : (n,)
        The gain K of the step that begins there.
    status : ControlStatus
    """

    parameters: Array = field(repr=False)
    distance: Array
    error: Array
    mode: NDArray[np.int64] = field(repr=False)
    gain: Array = field(repr=False)
    status: ControlStatus

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Where the last state is: "interior", "edge" or "corner", of every patch."""
        return tuple(MODES[k] for k in self.mode[-1].tolist())


def surface_of(name: str, side: object) -> NurbsSurface:
    """The surface meant by a surface, a face, or a face of a body; trims are not seen."""
    if isinstance(side, BodyFace):
        side = side.face
    if isinstance(side, Face):
        side = side.surface
    if not isinstance(side, NurbsSurface):
        raise TypeError(f"{name} is {side!r}; expected a NurbsSurface or a Face")
    return side


def form_number(form: str) -> int:
    """The kernels' number of a form."""
    if form not in FORMS:
        raise InputError(f"form is {form!r}; expected one of {', '.join(FORMS)}")
    return FORMS.index(form)


def _poses(name: str, side: object, q: ArrayLike | None) -> Array:
    """Rows (n, 7): those given, or where the side's body stands."""
    if q is None:
        body = side.body if isinstance(side, (BodyFace, Point)) else None
        return np.array([IDENTITY_ROW if body is None else body.q], dtype=np.float64)
    rows = real_array(name, q, ("n", 7)) if np.ndim(q) > 1 else vector(name, q, 7)[None]
    for k, (_x, _y, _z, *e) in enumerate(rows.tolist()):
        check_quaternion(f"{name}[{k}, 3:]", e)
    return rows


class Controller:
    """The point of a patch closest to a point or to another patch, kept by feedback while both move.

    Parameters
    ----------
    surface : NurbsSurface, Face or BodyFace
        Trims are not seen: the patch is the whole domain.
    target : (3,), Point, NurbsSurface, Face or BodyFace
        A point in the axes of its body, or another patch.
    form : "unit", "covariant" or "contravariant"
        What the projections psi are of: f - h on unit tangents, on f_u and f_v, or its components along them.
    gain : float, optional
        K of u' = -K psi [1/s]. By default, and at most with a `rate`, half of the `gain_limit` of a step; if nothing
        moves, a step that would increase the distance is halved.
    rate : float, optional
        K is chosen so that |f - h| - nearest decays by this rate [1/s]: bounded where `nearest` is the least distance.
    nearest : float
        For `rate`: the least distance.
    feedforward : bool
        Whether to add the velocity of the closest point due to the motion, so that the gain only has to reduce the
        initial error.
    start : (2,) or (4,), optional
        Parameters; the middles of the domains by default.
    tolerance : float
        At rest is an error below this part of the size.

    Raises
    ------
    InputError, TypeError
        Naming the argument.

    Notes
    -----
    Paper 000, eqs. 1, 13 and 14, with the sign, the gains and the saturation of `docs/controllers.md`. The closest
    point is reached if `is_globally_convergent` says so. A pole counts as an edge of the patch.
    """

    def __init__(
        self,
        surface: Side,
        target: ArrayLike | Point | Side,
        *,
        form: Form = "unit",
        gain: float | None = None,
        rate: float | None = None,
        nearest: float = 0.0,
        feedforward: bool = True,
        start: ArrayLike | None = None,
        tolerance: float = 1e-10,
    ) -> None:
        f = surface_of("surface", surface)
        self._sides = surface, target
        surfaces = [f]
        if isinstance(target, (NurbsSurface, Face, BodyFace)):
            surfaces.append(surface_of("target", target))
            self._point = (0.0, 0.0, 0.0)
        else:
            place = target.coordinates if isinstance(target, Point) else vector("target", target)
            self._point = tuple(place.tolist())
        if gain is not None and rate is not None:
            raise InputError(f"gain is {gain} and rate is {rate}; expected one of them")
        self._law = ControlLaw(
            form=form_number(form),
            gain=0.0 if gain is None else positive("gain", gain),
            rate=0.0 if rate is None else positive("rate", rate),
            nearest=number("nearest", nearest),
            feed_forward=float(bool(feedforward)),
        )
        self._size = max(s.size for s in surfaces)
        self._tolerance = positive("tolerance", tolerance) * self._size
        tables = [s.packed() for s in surfaces]
        self._table, self._pool = tables[0]
        self._second = -1
        if len(tables) > 1:
            record = tables[1][0].copy()
            record[_OFFSETS] += self._pool.size
            self._second = SURFACE_RECORD
            self._table, self._pool = np.concatenate([self._table, record]), np.concatenate([self._pool, tables[1][1]])
        domains = [interval for s in surfaces for interval in s.domain]
        at = [0.5 * (low + high) for low, high in domains]
        if start is not None:
            at = vector("start", start, len(domains)).tolist()
            for k, (low, high) in enumerate(domains):
                if not low <= at[k] <= high:
                    raise InputError(f"start[{k}] is {at[k]:g}; expected a parameter in [{low:g}, {high:g}]")
        self._x = tuple([*at, 0.0, 0.0][:4])
        self._q: Array | None = None

    @property
    def parameters(self) -> Array:
        """Where the witness points are: (2,), or (4,) with a patch as the target; read-only."""
        return read_only(np.array(self._x[: 4 if self._second >= 0 else 2]))

    def step(self, q: ArrayLike | None = None, q_target: ArrayLike | None = None, dt: float = 1.0) -> ControlRun:
        """One step of `dt` seconds, at whose end the bodies stand at these poses; the state there.

        Parameters
        ----------
        q, q_target : (7,), optional
            Poses of the surface and of the target; by default where their bodies stand, or the identity.
        dt : float
            Without a `gain` or a `rate` it does not matter.
        """
        after = self._motion(q, q_target)
        if len(after) != 1:
            raise InputError(f"q has {len(after)} rows; expected one pose, or call run")
        return self._advance(np.concatenate([after if self._q is None else self._q, after]), 1, dt, kept=1)

    def run(
        self, steps: int, q: ArrayLike | None = None, q_target: ArrayLike | None = None, dt: float = 1.0
    ) -> ControlRun:
        """Up to `steps` steps of `dt` seconds: to rest where nothing moves, or along a motion.

        Parameters
        ----------
        steps : int
            Where nothing moves the run ends earlier, at rest.
        q, q_target : (7,) or (n, 7), optional
            Poses, at rest or one for the beginning and for the end of every step; the last one stays.
        dt : float
        """
        steps = integer("steps", steps, 1, 100_000_000)
        rows = self._motion(q, q_target)
        return self._advance(rows, steps, dt, kept=steps + 1)

    def _motion(self, q: ArrayLike | None, q_target: ArrayLike | None) -> Array:
        """Poses (n, 2, 7) of both."""
        a, b = _poses("q", self._sides[0], q), _poses("q_target", self._sides[1], q_target)
        if len(a) != len(b) and 1 not in (len(a), len(b)):
            raise InputError(f"q has {len(a)} rows and q_target {len(b)}; expected as many, or one")
        poses = np.empty((max(len(a), len(b)), 2, 7))
        poses[:, 0] = a
        poses[:, 1] = b
        return poses

    def _advance(self, poses: Array, steps: int, dt: float, kept: int) -> ControlRun:
        """Steps along poses; of the states the last one, or all of them in `kept` rows."""
        out = np.zeros((kept, ROW))
        end = ControlEnd(steps, self._tolerance, _MEET * self._size)
        status, done = run_control(
            (self._table, self._pool),
            (self._second, self._point),
            poses,
            self._x,
            positive("dt", dt),
            tuple(self._law),
            tuple(end),
            out,
        )
        out = out[: done + 1]
        self._x = tuple(out[-1, :4].tolist())
        last = min(done, len(poses) - 1)
        self._q = poses[last : last + 1]
        count = 4 if self._second >= 0 else 2
        mode = out[:, MODE_F : MODE_G + 1][:, : count // 2].astype(np.int64)
        return ControlRun(out[:, :count], out[:, DISTANCE], out[:, ERROR], mode, out[:, GAIN], _STATUSES[status])
