"""Contacts at folds: what a gap gains by tangency, valleys, given contacts and their extrema."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import assembly as asm
from assembly._record import Store
from assembly.constraints.program.records import FREE_COLUMN, MANAGER_RECORD, ROWS, Iterate, LiftedPairs
from assembly.geometry.splines.evaluate import SURFACE_RECORD
from assembly.kinematics.motion import RelativePose, relative_pose, rotation
from assembly.proximity.extrema.face_face import SINGULAR, solve_pair
from assembly.proximity.extrema.lifted_pair import VARIABLES, VECTORS, LiftedPair, free_rows
from assembly.proximity.extrema.pairs import _key, _packed, as_face, extremal_pair
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK
from assembly.proximity.manager import extrema as roots
from assembly.proximity.manager import motion_bounds
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager import update as watch
from assembly.proximity.manager.motion_bounds import MotionBall, allow_ball, mover
from assembly.solve.loop.clearances import place_clearance_rows, update_again, update_around
from assembly.solve.loop.violation import untouched
from assembly.solve.loop.workspace import new_rows
from benchmarks.center_lines import torus_wire
from benchmarks.running import example
from benchmarks.scenes import MAJOR, MINOR
from benchmarks.watching import Watch
from benchmarks.wire_oracle import WireOracle
from tests.laws.scenes import list_of, posed

IDENTITY = [1.0, 0.0, 0.0, 0.0]


def packed_pair(f, g):
    """Two shapes as a table and a pool."""
    table, pool, _size = _packed(*(_key(as_face("surface", side)) for side in (f, g)))
    return np.asarray(table), np.asarray(pool)


def test_what_a_gap_gains_by_tangency():
    """|j T^-1 t| is twice what the gap changes by on the way to the pair, to leading order."""
    rng = np.random.default_rng(1)
    f, g = asm.shapes.ellipsoid(0.2, 0.3, 0.4), asm.shapes.torus(0.3, 0.1)
    table, pool = packed_pair(f, g)
    q = np.array([[0.0, 0.0, 0.0, *IDENTITY], [0.5, 0.3, 0.2, 0.9, 0.1, -0.3, 0.2]])
    q[1, 3:] /= np.linalg.norm(q[1, 3:])
    pair = extremal_pair(f, q[0], g, q[1])
    residual, jacobian = np.zeros(5), np.zeros((5, VARIABLES))
    work, square = np.empty((VECTORS, 3, VARIABLES)), np.empty((VARIABLES, VARIABLES))
    for size in (1e-3, 1e-4):
        for _ in range(20):
            x = tuple(pair.parameters + size * rng.normal(size=4))
            lifted = LiftedPair((0, SURFACE_RECORD), (0, 1), x, (1.0,) * 4)
            free_rows(Store(table, pool), lifted, q, work, residual, jacobian, 0, 1)
            gained = untouched(residual, jacobian, 0, 1, square)
            # The next order is smaller by the step, times third derivatives of some tens.
            assert gained == pytest.approx(2.0 * abs(pair.gap - residual[0]), rel=60.0 * size, abs=1e-15)
    # A singular system says nothing.
    jacobian[2] = jacobian[1]
    jacobian[2, FREE_COLUMN:] = jacobian[1, FREE_COLUMN:]
    assert untouched(residual, jacobian, 0, 1, square) > 1.0


def root_at(table, pool, q, start):
    """A root, and the posed pair it is of."""
    turn, shift = relative_pose(q, 0, rotation(q, 0), 1, rotation(q, 1))
    pair = posed(Store(table, pool), turn, shift, surfaces=(0, SURFACE_RECORD))
    out = np.full((1, roots.ROOT), np.nan)
    assert roots.surfaces_extremum(pair, tuple(start), roots.extremum_at(out, 0)) != roots.NOTHING
    return pair, roots.extremum_at(out, 0)


def test_a_valley_of_fourth_order_is_a_pair_after_few_steps():
    """A plane under z = x^4 + y^2: Newton's method gains a third a step there, for ever."""
    quartic = np.array([1.0, -1.0, 1.0, -1.0, 1.0])  # x^4 over [-1, 1] in Bezier's form
    square = np.array([1.0, -1.0, 1.0])
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 1.0, 3), indexing="ij")
    bowl = asm.NurbsSurface(
        np.dstack([x, y, quartic[:, None] + square[None, :]]), ([-1.0] * 5 + [1.0] * 5, [-1.0] * 3 + [1.0] * 3), (4, 2)
    )
    ends = np.array([-2.0, 2.0])
    a, b = np.meshgrid(ends, ends, indexing="ij")
    plane = asm.NurbsSurface(np.dstack([a, b, 0.0 * a]), ([-2, -2, 2, 2], [-2, -2, 2, 2]), (1, 1))
    table, pool = packed_pair(plane, bowl)
    identity = rotation(np.array([[0.0, 0.0, 0.0, *IDENTITY]]), 0)
    for start in (0.3, 0.02):
        x = (start, 0.1, start, 0.1)
        pose = RelativePose(identity, (0.0, 0.0, 0.01))
        found = solve_pair(Store(table, pool), (0, SURFACE_RECORD), pose, x, 1.0, np.inf, 0.0, False)
        assert found.status == SINGULAR
        # x^4 where the slope 4 x^3 is 1e-9.
        assert found.frame.gap == pytest.approx(0.01, abs=2e-13)
        assert found.steps <= 25


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-3, 0.2])
@pytest.mark.parametrize("swapped", [0, 1])
def test_a_given_contact_stands_only_for_the_root_it_is_at(off, swapped):
    f, g = asm.shapes.ellipsoid(0.2, 0.3, 0.4), asm.shapes.sphere(0.3)
    table, pool = packed_pair(f, g)
    q = np.array([[0.0, 0.0, 0.0, *IDENTITY], [0.5, 0.3, 0.2, *IDENTITY]])
    pair = extremal_pair(f, q[0], g, q[1])
    near_pair, root = root_at(table, pool, q, pair.parameters)
    tracked = np.zeros((1, TRACK))
    tracked[0, :4] = np.roll(pair.parameters + [off, 0.0, 0.0, 0.0], 2 * swapped)
    listed = len(table)
    found = np.full((4, roots.ROOT), np.nan)
    near_pair = near_pair._replace(store=Store(np.append(table, [0, swapped, 0, -1, -1, -1, -1]), pool))
    extrema = list_of(found, 0)
    roots.add_given(near_pair, tracked, listed, 1, 1e-6, extrema)
    count = extrema.count[0]
    # A parameter of the ellipsoid is some tenth of a length long.
    assert count == (off < 1e-6)
    if count:
        assert roots.extremum_at(found, 0).origin == roots.GIVEN_CONTACT
        assert np.allclose(found[0, :4], root.parameters, atol=1e-9)


@pytest.mark.parametrize(("reach", "depth"), [(0.05, 1.2 * MINOR), (0.005, 0.25 * MINOR)])
def test_contacts_of_rings_that_are_deep_in_each_other_are_listed(reach, depth, cases):
    # By a first look, and by one whose reach is as short as that of later ones may be: to twice the reach, and what is
    # deeper is told apart from contacts.
    rng = np.random.default_rng(3)
    rings = Watch([asm.shapes.torus(MAJOR, MINOR)] * 2)
    oracle = WireOracle([torus_wire(MAJOR, MINOR)] * 2)
    listed, count = 0, cases(70, 600)
    for _ in range(count):
        e = rng.normal(size=4)
        q = np.array([[0.0, 0.0, 0.0, *IDENTITY], [*rng.uniform(-1.8, 1.8, 3), *e / np.linalg.norm(e)]])
        extrema = oracle.extrema(q)
        deep = extrema.gap[(extrema.index == 0) & (extrema.gap < -1e-3) & (extrema.gap > -1.2 * MINOR)]
        if len(deep):
            rings.forget()
            rings.memory[manager_records.MEMORY_HEADER + manager_records.QUERY_MARGIN] = reach
            found = rings.look(q).gap
            crossed = rings.memory[manager_records.MEMORY_HEADER + manager_records.CROSSED] == 1.0
            assert len(found) or crossed
            for gap in deep[deep > -depth]:
                # Newton's method on lengths of order one.
                assert np.abs(found - gap).min() < 1e-12
                listed += 1
    assert listed > count / 600 * (80 if depth > MINOR else 15)


@pytest.mark.parametrize("off", [1e-9, 1e-3])
def test_a_free_contact_of_a_clearance_goes_to_its_extremum_if_it_is_off_it(off):
    ring = asm.shapes.torus(MAJOR, MINOR)
    place = (1.4, 0.05, 0.1), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    scene = asm.Assembly([asm.Body("first", ring, fixed=True), asm.Body("second", ring, *place)])
    scene.constrain(asm.Clearance(minimum=0.5))
    packed = scene.packed()
    table, memory = packed.table.copy(), packed.new_state()[packed.memory_at :]
    q = np.array([body.q for body in scene.bodies])
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    rows = int(table[ROWS])
    tracked, free = np.full((packed.tracked, TRACK), np.nan), np.full(rows, -1)
    point = Iterate(q, tracked, np.zeros((rows, CONTACT_RECORD)), np.zeros(rows), None)
    assert update_around(Store(table, packed.pool), memory, point, watch.EVERYTHING)
    lifted = LiftedPairs(free, None, None, None, np.empty_like(tracked), memory)
    place_clearance_rows(table, lifted, point, new_rows(rows, 1.0), True)
    row = int(np.flatnonzero(~np.isnan(tracked[:, 0]))[0])
    extremum = tracked[row].copy()
    free[row] = 0
    # A pair is looked at again where it moved; here by less than what Newton's method leaves.
    q[1, 0] += 1e-15
    tracked[row, :4] += off
    moved = tracked[row].copy()
    changed = update_again(Store(table, packed.pool), lifted, point, watch.EVERYTHING)
    assert changed == (off > 1e-6)
    assert np.array_equal(tracked[row], moved) if off < 1e-6 else np.abs(tracked[row, :4] - extremum[:4]).max() < 1e-9


@cache
def chain_under_watch():
    """The chain of the example with a clearance, packed."""
    chain = example("paper_clips").paper_clips()
    chain.constrain(asm.Clearance())
    return chain, chain.packed()


class Clips:
    """Three clips under watch."""

    def __init__(self):
        chain, packed = chain_under_watch()
        self.table, self.pool = packed.table.copy(), packed.pool
        self.memory = packed.new_state()[packed.memory_at :]
        self.q = np.array([body.q for body in chain.bodies])
        self.q[:, :3] = (self.q[:, :3] - packed.reference) / packed.scale
        self.tracked = np.full((packed.tracked, TRACK), np.nan)
        self.count = int(self.table[self.table[MANAGER_RECORD] + manager_records.PAIRS])

    @property
    def pairs(self):
        """What is known of each pair."""
        known = self.memory[manager_records.MEMORY_HEADER :][: self.count * manager_records.PAIR_MEMORY]
        return known.reshape(self.count, -1)

    def looked(self, how):
        """How many pairs a look looks at."""
        before = manager_records.memory_header_at(self.memory, 0).updates
        watch.update(self.table, self.pool, self.table[MANAGER_RECORD], self.memory, self.q, self.tracked, how)
        return manager_records.memory_header_at(self.memory, 0).updates - before


def test_the_final_update_asks_of_every_pair_whether_it_crosses():
    clips = Clips()

    def unasked():
        return np.isnan(clips.pairs[:, manager_records.CROSSED])

    # A first look asks; one that a motion calls for does not; the last one asks where nothing moved since, and once.
    assert clips.looked(watch.AS_NEEDED) == clips.count and not unasked().any()
    clips.q[1:, 0] += 0.05 * np.arange(1, len(clips.q))
    assert clips.looked(watch.AS_NEEDED) > 0.0 and unasked().any()
    assert clips.looked(watch.EVERYTHING) == clips.count and not unasked().any()
    assert clips.looked(watch.EVERYTHING) == 0.0


@pytest.mark.parametrize(
    ("part", "as_needed", "in_turns", "careful"),
    [(0.9, 2, 2, 2), (0.8, 0, 1, 2), (0.4, 0, 0, 2), (1e-7, 0, 0, 2), (1e-9, 0, 0, 0)],
)
@pytest.mark.parametrize("by_spines", [True, False])
def test_pairs_are_looked_at_that_need_it(by_spines, part, as_needed, in_turns, careful):
    # The middle clip goes a part of what its pairs allow; of neither it is sure how far it may. Looks of wires are
    # cheap, and earlier.
    if by_spines and part == 0.8:
        as_needed = in_turns = 2
    for how, count in ((watch.AS_NEEDED, as_needed), (watch.IN_TURNS, in_turns), (watch.CAREFUL, careful)):
        clips = Clips()
        table, watch_at = clips.table, clips.table[MANAGER_RECORD]
        if not by_spines:
            for p in range(clips.count):
                manager_records.pair_in(table, watch_at, p).centerline_f = -1
        assert clips.looked(how) == clips.count == 3
        clips.pairs[:, manager_records.MOTION_BOUND] = 1e-3
        for p in range(clips.count):
            # A ball of no size: it goes where the body's origin does.
            manager = manager_records.ContactManager(Store(table, clips.pool), watch_at, clips.memory)
            place = mover(manager_records.pair_of(manager, p), clips.q).shift
            ball = MotionBall((0.0, 0.0, 0.0), place, 0.0)
            allow_ball(manager_records.pair_state_of(manager, p), ball, np.inf, motion_bounds.UNMOVED * 1e-3)
        clips.q[1, 2] += 1e-3 * part
        assert clips.looked(how) == count
