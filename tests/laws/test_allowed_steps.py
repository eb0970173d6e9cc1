"""How much of a step looks allow, and which roots stand for what is around them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store, place_of, rows_of
from assembly.constraints.program.records import MANAGER_RECORD, MOVING, Iterate
from assembly.proximity.brep.borders import feature_kind
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.tree import ELEMENT, ELEMENT_DTYPE, tree_at
from assembly.proximity.features.holding import FEATURES, NOTHING, POINT
from assembly.proximity.features.solid_contact import TRACK
from assembly.proximity.manager import update as watch
from assembly.proximity.manager.extrema import ROOT, extremum_at
from assembly.proximity.manager.motion_bounds import part_used, went
from assembly.proximity.manager.newton_regions import known_in_region
from assembly.proximity.manager.records import (
    PAIR_MEMORY,
    PAIR_STATE,
    PAIRS,
    ContactManager,
    memory_places,
    pair_in,
)
from assembly.solve.loop.clearances import allowed_share
from assembly.solve.loop.residuals import move
from tests.laws.scenes import list_of, posed

RINGS = 4
# Of an element, where its feature is.
FEATURE = place_of(ELEMENT_DTYPE, "feature")


class Looked:
    """A chain of rings, looked at where they stand."""

    def __init__(self, rng):
        rings = []
        for k in range(RINGS):
            turn = Rotation.random(rng=rng).as_quat(scalar_first=True)
            rings.append(asm.Body(f"ring {k}", asm.shapes.torus(5.0, 0.5), (7.0 * k, 0.0, 0.0), turn))
        scene = asm.Assembly(rings)
        scene.constrain(asm.Clearance())
        self.packed = packed = scene.packed()
        self.table, self.pool, self.watch = packed.table, packed.pool, packed.table[MANAGER_RECORD]
        self.memory = packed._memory.copy()
        self.q = scene.q.copy()
        self.q[:, :3] = (self.q[:, :3] - packed.reference) / packed.scale
        tracked = np.full((packed.tracked, TRACK), np.nan)
        watch.update(self.table, self.pool, self.watch, self.memory, self.q, tracked, watch.EVERYTHING)
        self.pairs = range(int(self.table[self.watch + PAIRS]))

    def parts(self, q):
        """Which parts of their motion bounds pairs have used."""
        manager = ContactManager(Store(self.table, self.pool), self.watch, self.memory)
        return np.array([part_used(manager, p, q) for p in self.pairs])

    def moved(self, q, step, share):
        out = q.copy()
        move(self.table, q, step, share, out)
        return out

    def allowed(self, q, step, share):
        trial = q.copy()
        return allowed_share(
            Store(self.table, self.pool), self.memory, Iterate(q, *[None] * 4), Iterate(trial, *[None] * 4), step, share
        )

    def known(self):
        """What is known of all pairs, a record each."""
        pairs = self.memory[memory_places(self.table, self.watch)[0] :][: PAIR_MEMORY * len(self.pairs)]
        return rows_of(PAIR_STATE, pairs.reshape(len(self.pairs), -1))


def test_steps_end_within_what_looks_allow(cases):
    rng = np.random.default_rng(8)
    cuts, scenes = 0, cases(2, 10)
    for _ in range(scenes):
        looked = Looked(rng)
        n = 6 * int(looked.table[MOVING])
        for size in (1e-4, 1e-2, 0.03, 0.1):
            before = looked.moved(looked.q, 1e-4 * rng.normal(size=n), 1.0)
            step = size * rng.normal(size=n)
            begin, end = looked.parts(before), looked.parts(looked.moved(before, step, 1.0))
            if begin.max() > 0.9:
                continue
            share, all_of_it = looked.allowed(before, step, 1.0)
            cut = end.max() > 1.0
            assert all_of_it == (not cut)
            assert share == 1.0 if not cut else 0.0 < share < 1.0
            # Norms of what moves are below their chords; of turns by some tenths of a radian hardly above.
            assert looked.parts(looked.moved(before, step, share)).max() <= (0.98 if cut else 1.0)
            if cut:
                cuts += 1
                # What is asked of the next looks: as far as each pair was to go.
                np.testing.assert_allclose(looked.known().cut_short, end * looked.known().motion_bound, rtol=1e-12)
    assert cuts > scenes


def test_a_pair_that_is_nearly_spent_and_hardly_moves_is_not_in_the_way():
    looked = Looked(np.random.default_rng(9))
    pairs = (pair_in(looked.table, looked.watch, p) for p in looked.pairs)
    bodies = np.array([(pair.body_f, pair.body_g) for pair in pairs])
    # Of balls, which have motion bounds of their own, there are none.
    looked.known().ball_bound[:] = np.inf
    looked.known().sure[:] = np.inf
    motion_bounds = looked.known().motion_bound.copy()
    # Of the pair with the least motion bound nearly all is used by one body; others of that body have more.
    spent = int(np.argmin(motion_bounds))
    apart = next(p for p in looked.pairs if not set(bodies[p]) & set(bodies[spent]))
    q, step = looked.q.copy(), np.zeros(6 * int(looked.table[MOVING]))
    q[bodies[spent, 1], 2] += 0.99 * motion_bounds[spent]
    assert looked.parts(q).max() == pytest.approx(0.99, abs=1e-9)
    # Another pair is to go five times as far as it may.
    step[6 * bodies[apart, 1] + 2] = 5.0 * motion_bounds[apart]
    step[6 * bodies[spent, 1] + 2] = 1e-4 * motion_bounds[spent]
    begin, end = looked.parts(q), looked.parts(looked.moved(q, step, 1.0))
    assert begin[spent] > 0.98 and 0.98 < end[spent] < 1.0
    # As if each pair were alone; together the spent one would leave them a twentieth.
    asked = [(0.95 - b) / (e - b) for b, e in zip(begin, end, strict=True) if e > 1.0]
    assert looked.allowed(q, step, 1.0)[0] == pytest.approx(min(asked), rel=1e-9)
    assert min(asked) > 1.5 * 0.05 / (end.max() - begin.max())
    # One that goes on is allowed a twentieth.
    step[:] = 0.0
    step[6 * bodies[spent, 1] + 2] = motion_bounds[spent]
    assert looked.allowed(q, step, 1.0)[0] == pytest.approx(0.05, rel=1e-9)


def test_a_point_that_stays_on_an_edge_is_no_root():
    can = asm.Body("can", asm.shapes.solid_cylinder(0.4, 1.0), (0.0, 0.0, 0.55))
    scene = asm.Assembly([asm.Body("plate", asm.shapes.box(4.0, 4.0, 0.1), fixed=True), can])
    scene.constrain(asm.Clearance())
    packed = scene.packed()
    table, pool = packed.table, packed.pool
    pair = pair_in(table, table[MANAGER_RECORD], 0)
    trees, shells = (pair.tree_f, pair.tree_g), (pair.shell_f, pair.shell_g)
    looked_into = posed(Store(table, pool), None, None, (pair.surface_f, pair.surface_g), shells, trees)
    elements = [
        [(k, *pool[tree.element_pool + ELEMENT * k :][:ELEMENT]) for k in range(tree.elements)]
        for tree in (tree_at(table, at) for at in trees)
    ]
    seen = 0
    for e in elements[0]:
        for d in elements[1]:
            kinds = (
                feature_kind(table, shells[0], int(e[1 + FEATURE])),
                feature_kind(table, shells[1], int(d[1 + FEATURE])),
            )
            if kinds != (FACE, EDGE):
                continue
            roots = np.zeros((1, ROOT))
            roots[0, :6] = [*e[1:3], *d[1:3], e[1 + FEATURE], d[1 + FEATURE]]
            root = extremum_at(roots, 0)
            root.fold = 1.0
            for corner, known in ((NOTHING, True), (FEATURES, True), (POINT, False)):
                root.corner = corner
                assert known_in_region(looked_into, e[0], d[0], list_of(roots, 1))[2] == known
            seen += 1
    assert seen > 4


def seen(q, body, other, points):
    """Points of a body in the axes of another one, (n, 3)."""
    turns = [Rotation.from_quat(q[k, 3:], scalar_first=True) for k in (body, other)]
    return turns[1].inv().apply(turns[0].apply(points) + q[body, :3] - q[other, :3])


def test_no_point_goes_farther_than_is_told():
    rng = np.random.default_rng(2)
    # Shapes far from their bodies' origins: a small turn moves them far.
    surfaces = [asm.shapes.torus(r, 0.3).transformed(translation=(40.0, 5.0 * r, -20.0)) for r in (1.0, 2.0)]
    bodies = [asm.Body(f"ring {k}", surface, (3.0 * k, 0.0, 0.0)) for k, surface in enumerate(surfaces)]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    packed = scene.packed()
    table, pool, at = packed.table, packed.pool, packed.table[MANAGER_RECORD]
    side = int(pair_in(table, at, 0).smaller)
    (u0, u1), (v0, v1) = surfaces[side].domain
    points = surfaces[side].evaluate(*rng.uniform((u0, v0), (u1, v1), (400, 2)).T) / packed.scale
    tight = 0.0
    for size in (1e-9, 1e-6, 1e-3, 0.1, 1.0):
        for _ in range(20):
            before, after = scene.q.copy(), scene.q.copy()
            for q in (before, after):
                q[:, :3] /= packed.scale
            after[:, :3] += size * rng.normal(size=(2, 3))
            for k in range(2):
                turn = Rotation.from_rotvec(size * rng.normal(size=3))
                after[k, 3:] = rng.choice([-1.0, 1.0]) * turn.as_quat(scalar_first=True)
            bound = went(Store(table, pool), pair_in(table, at, 0), before, after)
            moved = seen(after, side, 1 - side, points) - seen(before, side, 1 - side, points)
            most = np.linalg.norm(moved, axis=1).max()
            # Rounding of places some sizes from the origin.
            assert most <= bound + 1e-14
            tight = max(tight, most / bound)
    assert tight > 0.5
    # Both together go nowhere, seen from each other.
    q = scene.q.copy()
    q[:, :3] += 1.0
    assert went(Store(table, pool), pair_in(table, at, 0), scene.q.copy(), q) <= 1e-14
