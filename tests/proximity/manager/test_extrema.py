"""Roots of a look at two surfaces, from single starts: what Newton's method cannot reach the controller finds."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly._record import Store
from assembly.geometry.splines.evaluate import SURFACE_RECORD
from assembly.geometry.vec import matvec
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extrema.pairs import _key, _packed, as_face, descend, extremal_pair
from assembly.proximity.manager import extrema as roots
from tests.laws.scenes import posed, random_quaternion

# Lengths are those of a packed scene, whose size is one.
SHAPES = {
    "torus": lambda: asm.shapes.torus(0.2, 0.06),
    "ellipsoid": lambda: asm.shapes.ellipsoid(0.1, 0.2, 0.3),
}


def root_of(f, q_f, g, q_g, start):
    """What `surfaces_root` says, in plain Python, and the root that it writes."""
    table, pool, _size = _packed(*(_key(as_face("surface", side)) for side in (f, g)))
    q = np.array([q_f, q_g])
    turn, shift = relative_pose(q, 0, rotation(q, 0), 1, rotation(q, 1))
    table, pool = np.asarray(table), np.asarray(pool)
    out = np.full((1, roots.ROOT), np.nan)
    pair = posed(Store(table, pool), turn, shift, (0, SURFACE_RECORD))
    found = roots.surfaces_extremum(pair, tuple(start), roots.extremum_at(out, 0))
    return found, roots.extremum_at(out, 0), rotation(q, 0)


@pytest.mark.parametrize(("first", "second"), [("torus", "ellipsoid"), ("ellipsoid", "torus"), ("ellipsoid",) * 2])
def test_where_newton_fails_the_controller_finds_the_minimum(first, second):
    rng = np.random.default_rng(3)
    f, g = SHAPES[first](), SHAPES[second]()
    rescued = 0
    for _ in range(40):
        q_f = np.r_[rng.normal(size=3), random_quaternion(rng)]
        q_g = np.r_[q_f[:3] + 0.7 * rng.normal(size=3), random_quaternion(rng)]
        domains = np.concatenate([as_face("side", side).surface.domain for side in (f, g)])
        start = domains[:, 0] + rng.uniform(0.05, 0.95, 4) * (domains[:, 1] - domains[:, 0])
        if extremal_pair(f, q_f, g, q_g, start).status.name != "NOT_CONVERGED":
            continue
        lowest = descend(f, q_f, g, q_g, start)
        found, root, turn = root_of(f, q_f, g, q_g, start)
        if lowest.status.name != "CONVERGED" or lowest.gap < 0.0:
            continue
        assert found == roots.MINIMUM_FOUND
        rescued += 1
        # The same descent, from the same start.
        np.testing.assert_allclose(root.parameters, lowest.parameters, rtol=0, atol=1e-9)
        assert root.gap == pytest.approx(lowest.gap, abs=1e-12)
        normal = matvec(turn, tuple(root.normal))
        np.testing.assert_allclose(normal, lowest.normal, rtol=0, atol=1e-12)
        # Nothing beside it is nearer: the points of both surfaces a little off.
        ends = [as_face("side", side).surface for side in (f, g)]
        beside = root.parameters + 1e-3 * rng.normal(size=(200, 4))
        p, r = (
            asm.Pose(q[:3], q[3:] / np.linalg.norm(q[3:])).apply(end.evaluate(*beside[:, at : at + 2].T))
            for end, q, at in ((ends[0], q_f, 0), (ends[1], q_g, 2))
        )
        assert np.linalg.norm(p - r, axis=1).min() >= root.gap - 1e-12
    assert rescued > 3
