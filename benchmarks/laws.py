"""Whether figures are true: derivatives against pairs solved again, and poses against CasADi with IPOPT."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.solve.oracle.reference import ReferenceSolver
from benchmarks.figures import figure
from benchmarks.scenes import linked_wires, torus_pairs

ABOUT = """\
Derivatives: pairs of tori from interpenetrating to well apart, against central differences of sixth order of pairs
that are solved again; relative to the largest entry plus one; without pairs near a fold, where contact points run
more than 30 times as fast as bodies. Poses: the three wires, drawn to nothing: the objective is the least move
(`Posture`), whose minimum near a start is isolated. Both solvers start from the same poses and contacts; where their
objectives differ, they ended in different minima, and poses cannot be compared."""

Array = NDArray[np.float64]
# Of tubes with radii of 0.2 to 0.6: to three radii of the thinnest.
GAPS = (-0.06, -0.01, -1e-3, -1e-6, 0.0, 1e-6, 1e-3, 0.05, 0.2, 0.6)
# Central differences from the values at -3h, ... 3h: error h^6/140 times the seventh derivative.
OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
SLOPE = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
# For unit rates: the formula's error and that of rounding over the step are then both near 1e-10.
STEP = 8e-4
# Rates of contact points for unit rates of poses; they grow without bound toward folds, where differences fail.
TAME = 30.0
# Two different minima differ by more, and the two solvers in one minimum by far less.
SAME = 1e-9


def deviation(a: Array, b: Array) -> float:
    """Largest difference of two configurations (n, 7); a quaternion and its negative are one rotation."""
    signs = np.sign((a[:, 3:] * b[:, 3:]).sum(axis=1, keepdims=True))
    return float(max(np.abs(a[:, :3] - b[:, :3]).max(), np.abs(a[:, 3:] - signs * b[:, 3:]).max()))


def compared(scene: asm.Assembly, solver: ReferenceSolver, q: Array, starts: Any) -> float | None:
    """Deviation of the two solutions from one start; infinite where one failed, None in different minima."""
    ours, theirs = scene.solve(q, starts=starts), solver.solve(q, starts=starts)
    if not (ours.success and theirs.success):
        return float("inf")
    if abs(ours.objective - theirs.objective) > SAME * (1.0 + abs(theirs.objective)):
        return None
    return deviation(ours.q, theirs.q)


def _relative(found: Array, expected: Array) -> float:
    return float(np.abs(found - expected).max() / (1.0 + np.abs(expected).max()))


def _moved(q: Array, twist: Array, t: float) -> tuple[Array, Array]:
    """Poses (2, 7) after moving along twists (2, 6) for a time t, and their rates."""
    there, rate = np.empty((2, 7)), np.empty((2, 7))
    for k in range(2):
        there[k, :3] = q[k, :3] + t * twist[k, :3]
        turn = Rotation.from_rotvec(t * twist[k, 3:]) * Rotation.from_quat(q[k, 3:], scalar_first=True)
        w, *u = there[k, 3:] = turn.as_quat(scalar_first=True)
        rate[k, :3] = twist[k, :3]
        rate[k, 3] = -0.5 * np.dot(twist[k, 3:], u)
        rate[k, 4:] = 0.5 * (w * twist[k, 3:] + np.cross(twist[k, 3:], u))
    return there, rate


def derivatives(count: int) -> tuple[int, float, float]:
    """How many of `count` pairs at each gap are away from folds, and the largest errors of Jacobian and Hessian."""
    rng = np.random.default_rng(9)
    tame, worst_jacobian, worst_hessian = 0, 0.0, 0.0
    proximity = asm.proximity
    for k, gap in enumerate(GAPS):
        pairs = torus_pairs(count, gap, seed=20 + k)
        for (f, g), q, x in zip(pairs.surfaces, pairs.q, pairs.parameters, strict=True):
            periods = np.array([high - low for surface in (f, g) for low, high in surface.domain])
            found = proximity.contact_jacobian(f, q[0], g, q[1], x)
            if np.abs(found).max() >= TAME:
                continue
            tame += 1
            step = STEP / (1.0 + np.abs(found).max())
            expected = np.zeros((4, 14))
            for column in range(14):
                for offset, weight in zip(OFFSETS, SLOPE, strict=True):
                    there = q.copy()
                    there.ravel()[column] += offset * step
                    change = proximity.extremal_pair(f, there[0], g, there[1], x).parameters - x
                    # The shorter way around.
                    change -= periods * np.round(change / periods)
                    expected[:, column] += weight * change / step
            worst_jacobian = max(worst_jacobian, _relative(found, expected))
            twist = rng.normal(size=(2, 6)) / 3.0
            curvature = 0.0
            for offset, weight in zip(OFFSETS, SLOPE, strict=True):
                there, rate = _moved(q, twist, offset * step)
                at = proximity.extremal_pair(f, there[0], g, there[1], x).parameters
                slope = proximity.gap_gradient(f, there[0], g, there[1], at) @ rate.ravel()
                curvature += weight * slope / step
            hessian = proximity.gap_hessian(f, q[0], g, q[1], x)
            second = np.array(twist.ravel() @ hessian @ twist.ravel())
            worst_hessian = max(worst_hessian, _relative(second, np.array(curvature)))
    return tame, worst_jacobian, worst_hessian


def run(quick: bool) -> dict[str, Any]:
    """Deviations of derivatives and of poses."""
    count = 3 if quick else 100
    tame, jacobian, hessian = derivatives(count)
    pairs = f"{tame} of {count * len(GAPS)} pairs"
    wires = linked_wires(8 if quick else 50, grasped=False)
    solver = ReferenceSolver(wires.scene)
    found = [compared(wires.scene, solver, q, starts) for q, starts in zip(wires.q, wires.starts, strict=True)]
    same = [value for value in found if value is not None]
    worst = max(same, default=float("nan"))
    return {
        "about": ABOUT,
        "figures": [
            figure(f"contact Jacobian over {pairs}", "error", jacobian, reach=1e-8),
            figure(
                f"gap Hessian along a motion of each, {pairs}",
                "error",
                hessian,
                reach=1e-8,
            ),
            figure("starts from which both end in one minimum", "count", len(same), of=len(found)),
            figure("there, largest difference of a component of q", "error", worst, reach=1e-8),
        ],
    }
