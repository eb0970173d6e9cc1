"""A solution in words: its message, its history and the table that `print` shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._html import Table, as_html
from assembly.errors import InputError
from assembly.solve.loop.settings import CULPRIT, IMPROPER
from assembly.solve.result import Iteration
from assembly.solve.scene import Status

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["iteration_table", "message", "table"]

# Moving bodies whose degrees of freedom are printed: counting takes a second for some 300, and grows with the cube.
MOST_COUNTED = 200
# Bodies with shapes all pairs of which are searched for crossings when a solution is printed; their number grows with
# the square.
MOST_SEARCHED = 40


def message(solution: Solution) -> str:
    """The status in a sentence; what is violated, worst first, and what contradicts what."""
    text = solution.status.value
    culprit = int(solution._result(CULPRIT))
    if solution.status is Status.CONTACT_LOST and culprit >= 0:
        return f"{solution._packed.pair_name(culprit)!r}: {text}"
    if solution.restarted:
        text += "; found from another start: near the given one the constraints did not hold"
    if solution.put_together:
        text += "; bodies were put together without clearances first, and may have passed through each other"
    scale = solution._scene.scale
    # Of a contact that was lost there are lengths alone.
    parts = {k: v / scale for k, v in solution.violations.items()} if solution._is_lost else solution._largest(scale)
    held_off = sorted((name for name, part in parts.items() if not part <= 1e-9), key=lambda name: -parts[name])
    # Of what ran away rounding of its coordinates alone is violated.
    if held_off and not solution.success and solution.status is not Status.UNBOUNDED:
        named = ", ".join(f"{name!r} ({solution.violations[name]:.3g})" for name in held_off)
        text += f"; violated: {named}"
    doubtful = [pair for pair in solution._clear if not pair.holds]
    if doubtful:
        named = ", ".join(f"{a} and {b} ({pair.answer.verdict.name})" for pair in doubtful for a, b in [pair.bodies])
        text += f"; not clear: {named}"
    if solution.way is not None and solution.way.reason:
        text += f"; {solution.way.part:.6g} of the way is clear: {solution.way.reason}"
    if solution.status is Status.FITTED:
        text += "; disagreeing: " + ", ".join(f"{name!r} ({off:.3g})" for name, off in solution.disagreeing.items())
    if solution.status is Status.INFEASIBLE:
        named = " and ".join(", ".join(map(repr, names)) for names in solution.conflicting_sets)
        text += f"; conflicting: {named or 'no set was found'}"
    if solution._result(IMPROPER) > 0.0:
        text += "; at a contact the surfaces cross beside the point (indefinite relative curvature)"
    return text


def iteration_table(solution: Solution) -> str:
    """The history as text, one line per iteration."""
    lines = ["   " + "".join(f"{name:>15}" for name in Iteration.COLUMNS)]
    lines += [f"{k:>3}" + "".join(f"{value:>15.6e}" for value in row) for k, row in enumerate(solution.history)]
    return "\n".join(lines)


def _crossing_lines(solution: Solution) -> list[str]:
    """What it says of bodies that cross."""
    shaped = sum(bool(body.faces) for body in solution._scene.bodies)
    if shaped > MOST_SEARCHED and not {"crossings", "crossings_of_joined"} <= solution.__dict__.keys():
        return [f"  {shaped} bodies were not searched for crossings; read `crossings` and `crossings_of_joined`"]
    try:
        apart, joined = solution.crossings, solution.crossings_of_joined
    except InputError as error:
        return [f"  crossings are not known: {error}"]
    lines = [f"  {a} and {b} cross; asm.Clearance() keeps them apart" for a, b in apart]
    return lines + [f"  {a} and {b} cross, which are connected by a joint or a coupling" for a, b in joined]


def _first_lines(solution: Solution) -> list[str]:
    """Status, figures, degrees of freedom, axes that were chosen, bodies that cross."""
    lines = [
        f"{solution.status.name}: {solution.message}",
        f"objective {solution.objective:.6g}   feasibility {solution.feasibility:.1e}   "
        f"stationarity {solution.stationarity:.1e}   {solution.iterations} iterations   "
        f"{1e6 * solution.seconds:.0f} us",
    ]
    if sum(not body.fixed for body in solution._scene.bodies) <= MOST_COUNTED:
        try:
            freedoms = solution.mobility.dof
        except InputError:
            # A contact without a pair has no rows to count.
            pass
        else:
            lines[1] += f"   {freedoms} degree{'' if freedoms == 1 else 's'} of freedom"
    lines += [f"  {name:<24} axes {sense}, which was nearest" for name, sense in solution.axes.items()]
    return lines + _crossing_lines(solution)


def _worst(solution: Solution) -> list[tuple[str, float]]:
    """The constraints that are violated most."""
    return sorted(solution.violations.items(), key=lambda item: -item[1])[:5]


def html_table(solution: Solution) -> str:
    """What a notebook shows of a solution."""
    rows = zip(solution._scene.bodies, solution.q.tolist(), strict=True)
    return as_html(
        *_first_lines(solution),
        Table(("constraint", "violation"), [(name, f"{value:.1e}") for name, value in _worst(solution)]),
        Table(
            ("body", "x", "y", "z", "qw", "qx", "qy", "qz", ""),
            [(body.name, *row, "fixed" if body.fixed else "") for body, row in rows],
        ),
    )


def table(solution: Solution) -> str:
    """What `print` shows of a solution."""
    lines = _first_lines(solution)
    lines += [f"  {name:<24} violation {value:.1e}" for name, value in _worst(solution)]
    for body, row in zip(solution._scene.bodies, solution.q, strict=True):
        place = " ".join(f"{value:9.4f}" for value in row)
        lines.append(f"  {body.name:<24} {place}{'   fixed' if body.fixed else ''}")
    return "\n".join(lines)
