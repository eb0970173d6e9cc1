"""A CasADi function of body poses as a constraint or an objective, with exact derivatives, inside the compiled loop.

A scalar CasADi function is a list of elementary instructions. So are its derivatives along twists, which CasADi
finds once: with v(t) the values at the poses retracted by the twists t (`kinematics/motion.py`), rows are v and dv/dt
at t = 0, and the Hessian is that of y . v for multipliers y. `geometry/expression/tape.py` runs both lists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.objectives import Objective
from assembly.errors import InputError, positive
from assembly.geometry.expression.instructions import Tape, compact, instructions, packed
from assembly.geometry.expression.tape import OPERATIONS
from assembly.kinematics.body import Body
from assembly.kinematics.pose import pose_rows

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["Expression", "Tape", "Tapes", "derived_tapes"]

Array = NDArray[np.float64]
_BINARY = frozenset(
    (
        *("MUL", "ADD", "SUB", "DIV", "LIFT", "POW", "CONSTPOW", "ATAN2", "HYPOT", "COPYSIGN", "FMIN", "FMAX", "LT"),
        *("LE", "EQ", "NE", "AND", "OR", "IF_ELSE_ZERO", "FMOD", "REMAINDER"),
    )
)


class Tapes(NamedTuple):
    """The lists of one expression of b bodies and m values; lengths in the user's unit, poses in rows of 7.

    rows
        Poses (7 b) -> values (m), then their Jacobian (m, 6 b) in the twists of the bodies.
    hessian
        Poses (7 b), multipliers (m) -> Hessian of multipliers . values (6 b, 6 b) in the same twists.
    """

    rows: Tape
    hessian: Tape


class Expression(Constraint, Objective):
    """Values of a CasADi function of poses: all zero as a constraint, small as an objective.

    Parameters
    ----------
    function : casadi.Function
        One input (7,) a body, its pose x y z qw qx qy qz in the user's units, body to world, the quaternion unit up to
        rounding; one output, a column of m values. SX, or MX that expands to SX.
    bodies : sequence of Body
        Distinct, in the order of the inputs.
    name : str, optional
        The function's and the bodies' names by default.
    unilateral : bool
        As a constraint: values >= 0 instead of values = 0.
    scale : float
        As a constraint: positive, what counts as one unit of violation, in the units of the values. Tolerances are
        relative to it.
    weight : float
        As an objective, of which there is one value: factor, positive.

    Raises
    ------
    InputError, TypeError
        No CasADi function, one of other inputs or outputs, one that does not expand to SX or has instructions that
        are no elementary functions (the text names them), or something else than distinct bodies.
    """

    def __init__(
        self,
        function: ca.Function,
        bodies: Iterable[Body],
        name: str | None = None,
        *,
        unilateral: bool = False,
        scale: float = 1.0,
        weight: float = 1.0,
    ) -> None:
        inputs = _checked_function(function)
        given = _checked_bodies(bodies, inputs)
        if not isinstance(unilateral, (bool, np.bool_)):
            raise InputError(f"unilateral is {unilateral!r}; expected True or False")
        Constraint.__init__(self, given, name, function.name())
        Objective.__init__(self, given, weight)
        self._unilateral = bool(unilateral)
        self._scale = positive("scale", scale)
        self._function = function
        self._expanded = _expanded(function)

    @property
    def function(self) -> ca.Function:
        """The function, as it was given."""
        return self._function

    @property
    def count(self) -> int:
        """Number of values."""
        return int(self._function.size1_out(0))

    @property
    def unilateral(self) -> bool:
        """Whether values may be positive."""
        return self._unilateral

    @property
    def scale(self) -> float:
        """One unit of violation, in the units of the values."""
        return self._scale

    def __repr__(self) -> str:
        bodies = ", ".join(body.name for body in self.bodies)
        settings = "".join(
            f", {name}={value!r}"
            for name, value, default in (
                ("unilateral", self.unilateral, False),
                ("scale", self.scale, 1.0),
                ("weight", self.weight, 1.0),
            )
            if value != default
        )
        return f"Expression({self.function.name()}, [{bodies}], name={self.name!r}{settings})"

    def values(self, q: ArrayLike) -> Array:
        """The values (m,) at poses q (b, 7), one row per body of the expression, by CasADi itself.

        Neither divided by the scale nor multiplied by the weight.
        """
        poses = pose_rows("q", q, len(self.bodies))
        return np.array(self._expanded(poses.ravel()), dtype=np.float64).ravel()

    @cached_property
    def tapes(self) -> Tapes:
        """Values and derivatives as lists of instructions; made at first use.

        Neither divided by the scale nor multiplied by the weight.
        """
        return derived_tapes(self._expanded, len(self.bodies), self.count)

    def document(self) -> str:
        """The function as text, one line per instruction, for files; `from_document` reads it.

        The first line says how many bodies and values there are and the function's name. Then stand the instructions
        of `geometry/expression/tape.py` by name, with the place of the result and those of the arguments (the
        constant's
        value). CasADi's own serialization is not used: reading one can load code, and many damaged ones are read.
        """
        lines = [f"{len(self.bodies)} {self.count} {self._function.name()}"]
        for operation, out, arguments in instructions(self._expanded):
            lines.append(" ".join([operation.lower(), str(out), *map(repr, arguments)]))
        return "\n".join(lines)

    @classmethod
    def from_document(
        cls,
        document: str,
        bodies: Iterable[Body],
        name: str | None = None,
        *,
        unilateral: bool = False,
        scale: float = 1.0,
        weight: float = 1.0,
    ) -> Self:
        """The expression whose `document` this is: the same numbers, bit for bit.

        Raises
        ------
        InputError, TypeError
            No such text (the message names the line), and as the class does.
        """
        if not isinstance(document, str):
            raise TypeError(f"document is {document!r}; expected the text of Expression.document()")
        header, *lines = document.splitlines() or [""]
        inputs, count, title = _read_header(header)
        given = _checked_bodies(bodies, inputs)
        function = _read_function(lines, inputs, count, title)
        return cls(function, given, name, unilateral=unilateral, scale=scale, weight=weight)


def _checked_function(function: Any) -> int:
    """Number of inputs of a function whose inputs are poses and whose output is a column."""
    import casadi as ca

    if not isinstance(function, ca.Function):
        raise TypeError(f"function is {function!r}; expected a casadi.Function of poses")
    if function.is_null():
        raise InputError("function is casadi.Function() without content; expected one of poses")
    inputs, outputs = int(function.n_in()), int(function.n_out())
    if inputs == 0:
        raise InputError(f"function is {function}, without inputs; expected one for each body, its pose (7,)")
    for k in range(inputs):
        if function.size_in(k) != (7, 1) or function.nnz_in(k) != 7:
            raise InputError(
                f"function has input {function.name_in(k)!r} of shape {function.sparsity_in(k).dim(True)}; "
                "expected a pose x y z qw qx qy qz, a dense column of 7"
            )
    if outputs != 1:
        raise InputError(f"function has {outputs} outputs; expected one, a column of values")
    if function.size2_out(0) != 1 or function.size1_out(0) == 0:
        raise InputError(f"function has an output of shape {function.size_out(0)}; expected a column of values, (m, 1)")
    if function.has_free():
        raise InputError(f"function has the free variables {function.get_free()}; expected a function of poses alone")
    return inputs


def _checked_bodies(bodies: Any, inputs: int) -> tuple[Body, ...]:
    if isinstance(bodies, str) or not isinstance(bodies, Iterable):
        raise TypeError(f"bodies is {bodies!r}; expected a sequence of bodies, one for each input of the function")
    given = tuple(bodies)
    for k, body in enumerate(given):
        if not isinstance(body, Body):
            raise TypeError(f"bodies[{k}] is {body!r}; expected a Body")
    if len(given) != inputs:
        names = [body.name for body in given]
        raise InputError(f"bodies are {names}; expected {inputs}, one for each input of the function")
    return given


def _expanded(function: ca.Function) -> ca.Function:
    """The same as one list of elementary instructions, of one column of poses."""
    import casadi as ca

    x = ca.SX.sym("x", 7 * function.n_in())
    try:
        scalar = function if function.is_a("SXFunction") else function.expand()
        (values,) = scalar.call(ca.vertsplit(x, 7), True, False)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise InputError(f"function {function} does not expand to SX ({reason}); expected one that does") from None
    expanded = compact(function.name(), x, values)
    for _ in instructions(expanded):
        pass  # names an instruction that tapes do not have
    return expanded


def derived_tapes(
    function: Callable[[ca.SX], ca.SX],
    bodies: int,
    count: int,
    symbols: ca.SX | None = None,
    numbers: Sequence[float] = (),
) -> Tapes:
    """Values and derivatives of a function of one column of poses.

    Parameters
    ----------
    function : callable
        SX (7 b,) -> SX (m,).
    bodies, count : int
        b and m.
    symbols : SX, optional
        What else the values depend on; these are the first constants of both lists.
    numbers : sequence of float
        What they are at first.
    """
    import casadi as ca

    x, y = ca.SX.sym("x", 7 * bodies), ca.SX.sym("y", count)
    t = ca.SX.sym("t", 6 * bodies)
    given = ca.SX(0, 1) if symbols is None else symbols
    moved = [_retracted(x[7 * k : 7 * k + 7], t[6 * k : 6 * k + 6]) for k in range(bodies)]
    values = function(ca.vertcat(*moved))
    jacobian = ca.jacobian(values, t)
    hessian, _ = ca.hessian(ca.dot(y, values), t)
    rows, upper = ca.substitute(
        [ca.vertcat(values, ca.vec(jacobian.T)), ca.triu(hessian)], [t], [ca.SX.zeros(6 * bodies)]
    )
    return Tapes(
        packed(compact("rows", ca.vertcat(x, given), rows), numbers),
        packed(compact("hessian", ca.vertcat(x, y, given), ca.vec(ca.triu2symm(upper))), numbers),
    )


def _retracted(pose: ca.SX, twist: ca.SX) -> ca.SX:
    """`retract` to second order: the unit quaternion of a rotation vector w is (1 - |w|^2 / 8, w / 2) + O(|w|^3)."""
    import casadi as ca

    w, u, turn = pose[3], pose[4:], twist[3:]
    c, s = 1 - ca.dot(turn, turn) / 8, turn / 2
    return ca.vertcat(pose[:3] + twist[:3], c * w - ca.dot(s, u), c * u + w * s + ca.cross(s, u))


def _read_header(line: str) -> tuple[int, int, str]:
    """Number of bodies and of values, and the function's name."""
    import casadi as ca

    words = line.split()
    try:
        inputs, count = int(words[0]), int(words[1])
        (title,) = words[2:]
    except (ValueError, IndexError):
        inputs, count, title = 0, 0, ""
    if inputs < 1 or count < 1 or not ca.Function.check_name(title):
        raise _bad_line(1, line, "the numbers of bodies and of values, and the function's name")
    return inputs, count, title


def _read_function(lines: list[str], inputs: int, count: int, title: str) -> ca.Function:
    """The function of the instructions of a document, which begin in its second line."""
    import casadi as ca

    poses = [ca.SX.sym(f"q{k}", 7) for k in range(inputs)]
    work: dict[int, Any] = {}
    values: dict[int, Any] = {}
    for k, line in enumerate(lines, 2):
        name, *words = line.split() or [""]
        name = name.upper()
        if name not in OPERATIONS:
            raise _bad_line(k, line, f"an instruction, one of {', '.join(OPERATIONS).lower()}")
        operands = 2 if name in _BINARY else 1
        try:
            out, *places = (int(word) for word in (words[:1] if name == "CONST" else words))
            if len(words) != 1 + operands:
                raise ValueError
            if name == "CONST":
                work[out] = ca.SX(float(words[1]))
            elif name == "INPUT":
                work[out] = poses[_index(places[0], 7 * inputs) // 7][places[0] % 7]
            elif name == "OUTPUT":
                values[_index(out, count)] = work[places[0]]
            else:
                apply = ca.SX.binary if name in _BINARY else ca.SX.unary
                work[out] = apply(getattr(ca, f"OP_{name}"), *(work[place] for place in places))
        except (ValueError, IndexError, KeyError, OverflowError):
            wanted = {"CONST": "a number", "INPUT": f"an input below {7 * inputs}"}
            raise _bad_line(
                k, line, f"{name.lower()}, a place, then {wanted.get(name, f'{operands} of places written before')}"
            ) from None
    if len(values) != count:
        raise InputError(f"document has {len(values)} values; expected {count}, as its first line says")
    return ca.Function(title, poses, [ca.vertcat(*(values[k] for k in range(count)))])


def _index(value: int, count: int) -> int:
    if not 0 <= value < count:
        raise IndexError
    return value


def _bad_line(number: int, line: str, expected: str) -> InputError:
    shown = line if len(line) <= 60 else line[:57] + "..."
    return InputError(f"document line {number} is {shown!r}; expected {expected}")
