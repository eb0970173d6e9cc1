"""Bodies that are drawn through each other: a solve goes back to where nothing crossed, and never ends beyond."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store
from assembly.constraints.program.records import (
    CLEARANCE_ROW_NUMBER,
    CLEARANCE_ROWS,
    FIRST_CLEARANCE_ROW,
    MANAGER_RECORD,
    MINIMUM,
    ROW,
    ROW_TABLE,
    SHELL_F,
)
from assembly.proximity.manager.records import CROSSED, MEMORY_HEADER, pair_in
from assembly.solve.loop.parameters import DEEP
from assembly.solve.loop.rollback import has_sunk
from tests.laws.test_level_valleys import MINOR, circle_distance

MAJOR = 0.7


def tori(k):
    """A torus above an equal one, which does not fit through it, and is drawn down."""
    rng = np.random.default_rng([11, k])
    shape = asm.shapes.torus(MAJOR, MINOR)
    turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat(scalar_first=True)
    bodies = [asm.Body("base", shape, fixed=True), asm.Body("ring", shape, (*rng.uniform(-0.3, 0.3, 2), 1.5), turn)]
    scene = asm.Assembly(bodies if k % 2 == 0 else bodies[::-1])
    scene.constrain(asm.Clearance())
    scene.minimize(asm.PointDistance(bodies[1].point(0.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
    return scene


def test_a_torus_is_not_drawn_through_an_equal_one(cases):
    # As the ring comes to lie flat its lowest point runs around it, and steps sink one side of it. These ended SOLVED
    # on the other side.
    for k in (1, 4, 3, 5)[: cases(2, 4)]:
        solution = tori(k).solve()
        pose = solution.q[1 - k % 2]
        turn = Rotation.from_quat(pose[3:], scalar_first=True).as_matrix()
        # Where it is not SOLVED it ends at the last pose at which no contact is deeper than 1e-9 of the scene's size.
        assert circle_distance(turn, pose[:3]) - 2.0 * MINOR > -1e-8, k
        # On its side: a ring that lies on the other one is 0.2 above it; what leans on it is higher.
        assert 0.2 - 1e-8 < pose[2] < 0.25, k


def test_what_has_sunk():
    scene = tori(0)
    packed = scene.packed()
    table, pool = packed.table.copy(), packed.pool.copy()
    memory = packed.new_state()[packed.memory_at :]
    residual = np.zeros(table[CLEARANCE_ROWS] + table[FIRST_CLEARANCE_ROW])
    r = table[FIRST_CLEARANCE_ROW]
    row = table[ROW_TABLE] + ROW * r
    # Rows know no contact before a solve begins.
    table[row + MINIMUM] = pair_in(table, table[MANAGER_RECORD], 0).minimum
    flank = pool[table[row + MINIMUM] + 1]
    # Half the least radius of curvature.
    assert flank * packed.scale == pytest.approx(0.5 * MINOR, rel=0.2)
    solid, surfaces = 1, -1
    for depth, number, shell, sunk in (
        (0.99, 1, surfaces, False),
        (1.01, 1, surfaces, True),
        (1.01, 0, surfaces, False),
        (1.01, 1, solid, False),
    ):
        residual[r] = -depth * DEEP * flank
        table[row + CLEARANCE_ROW_NUMBER], table[row + SHELL_F] = number, shell
        assert has_sunk(Store(table, pool), memory, residual) == sunk
    # What is nearer than it is to be is not in the other body.
    table[row + SHELL_F], table[row + CLEARANCE_ROW_NUMBER] = surfaces, 1
    pool[table[row + MINIMUM]] = 2.0 * flank
    residual[r] = -1.5 * flank
    assert not has_sunk(Store(table, pool), memory, residual)
    residual[r] = 0.0
    for told, sunk in ((np.nan, False), (0.0, False), (1.0, True)):
        memory[MEMORY_HEADER + CROSSED] = told
        assert has_sunk(Store(table, pool), memory, residual) == sunk
