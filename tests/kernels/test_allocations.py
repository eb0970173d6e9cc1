"""Arrays that kernels make are freed: what was allocated in a call is not there any more after it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numba.core import config
from numba.core.runtime import _nrt_python, rtsys

import assembly as asm
from assembly import shapes

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="kernels run as plain Python")


@pytest.fixture
def held():
    """A function that says how many arrays more are there after some calls of another one."""
    _nrt_python.memsys_enable_stats()

    def count():
        stats = rtsys.get_allocation_stats()
        return np.array([stats.alloc - stats.free, stats.mi_alloc - stats.mi_free])

    def after(call):
        # The first one may make what later ones use.
        call()
        before = count()
        for _ in range(3):
            call()
        return (count() - before).tolist()

    yield after
    _nrt_python.memsys_disable_stats()


def test_a_linkage_holds_none(held):
    ground, crank, rocker = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rocker")
    scene = asm.Assembly([ground, crank, rocker])
    scene.constrain(
        asm.Revolute(ground.frame(), crank.frame(), "drive", angle=0.5),
        asm.Revolute(crank.frame(at=(2, 0, 0)), rocker.frame(), "elbow"),
    )
    solution = scene.solve()
    assert solution.success
    assert held(lambda: scene.solve()) == [0, 0]
    assert held(lambda: scene.solve(solution)) == [0, 0]
    assert held(lambda: scene.mobility()) == [0, 0]


def test_wires_at_folds_hold_none(held):
    """Coordinates of pairs become unknowns, and the system of a step grows."""
    wire = shapes.torus(1.0, 0.12)
    a = asm.Body("a", wire, fixed=True)
    b = asm.Body("b", wire, position=(1.1, 0.2, -0.1), quaternion=np.divide((1.0, 1.0, 0.1, 0.05), np.sqrt(2.0125)))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    scene.minimize(asm.PointDistance(b.point(1, 0, 0), b.pose.apply((1, 0, 0)) + [2.0, 2.0, 1.0]))
    solution = scene.solve()
    assert solution.success
    assert held(lambda: scene.solve()) == [0, 0]
    # By the gradient of the objective, and by second derivatives.
    assert held(lambda: scene.solve(solution).wrenches) == [0, 0]
    assert held(lambda: scene.solve(solution).second_order) == [0, 0]


def test_bounds_of_a_formula_hold_none(held):
    t = ca.SX.sym("t")
    curve = asm.FormulaCurve(ca.vertcat(t, t**2), t, (0.0, 2.0), arc_length=lambda t0, t1: 5.0 * (t1 - t0))
    assert held(lambda: curve.arc_lengths(np.zeros(3), np.ones(3))) == [0, 0]
