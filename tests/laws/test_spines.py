"""Spines of round wires: found from surfaces alone, and what is told of a box of two of them, by samples."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.centerline import spine_of
from assembly.geometry.shapes.path import Path
from assembly.geometry.vec import dot
from assembly.kinematics.motion import RelativePose
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.centerlines.box import (
    BARREN,
    CONVEX,
    EMPTY,
    FreeEnds,
    Lengths,
    PosedParts,
    box_of,
    difference_at,
)
from assembly.proximity.manager.centerlines.packing import pack_centerline
from assembly.proximity.manager.motion_bounds import part_used
from assembly.proximity.manager.wires import (
    PART,
    centerline_at,
    centerline_part_at,
    centerline_place,
    centerline_point,
    wire_parameters,
)
from benchmarks.center_lines import path_wire
from benchmarks.motions import HOOK, SHAPES
from benchmarks.watching import Watch
from benchmarks.wire_oracle import WireOracle
from tests.laws.test_manager import HERE

BENT = Path((0, 0, 0), (0, 0, 1)).arc(0.5, 2.9, (1, 0, 0)).arc(0.3, 1.0, (0, 1, 0)).line(0.4).arc(2.0, 0.7, (1, 1, 0))
WIRES = {name: surface for name, (_, surface, _) in SHAPES.items()} | {"bent": asm.shapes.pipe(BENT, 0.1)}
SPINES = {name: spine_of(Face(surface)) for name, surface in WIRES.items()}
VIEWS = {
    "as it is": lambda s: Face(s),
    "transposed": lambda s: Face(s.transposed(), reversed=True),
    "along, reversed": lambda s: Face(s.reversed(0), reversed=True),
    "around, reversed": lambda s: Face(s.reversed(1), reversed=True),
    "raised": lambda s: Face(s.elevate((3, 4))),
}


def part_at(table, at, k):
    """Where part k of the spine at `at` is in the pool."""
    return int(centerline_at(table, at).part_pool) + PART * k


def half_of(pool, o):
    """Half the length of the part at o."""
    return centerline_part_at(pool, o).half


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", WIRES)
def test_points_of_a_wire_are_around_its_spine(name, view, cases):
    rng = np.random.default_rng(1)
    face = VIEWS[view](WIRES[name])
    spine = spine_of(face)
    assert spine is not None
    record, pool = face.packed()
    table, more, at = pack_centerline(spine, 1.0, record.size, pool.size)
    table, pool = np.append(record, table), np.append(pool, more)
    (u0, u1), (v0, v1) = face.surface.domain
    size = face.surface.size
    beyond = 0
    # Ends of the domain, its middles and anything between: poles, seams and joints are among these.
    for u in np.concatenate([face.surface.breaks()[0], rng.uniform(u0, u1, cases(20, 60))]):
        for v in np.concatenate([face.surface.breaks()[1], rng.uniform(v0, v1, 8)]):
            point = face.surface.evaluate(u, v)
            part, s = centerline_place(Store(table, pool), at, 0, u, v)
            center, along, _bend = (np.array(row) for row in centerline_point(pool, part_at(table, at, part), s))
            way = (point - center) / spine.radius
            assert np.linalg.norm(way) == pytest.approx(1.0, abs=1e-11 * size / spine.radius)
            free = abs(way @ along) > 1e-9
            beyond += free
            # Only at a free end does a wire go beyond its spine.
            ends = (0, centerline_at(table, at).parts - 1)
            assert not free or (not spine.closed and part in ends and abs(s) == half_of(pool, part_at(table, at, part)))
            back = face.surface.evaluate(*wire_parameters(Store(table, pool), at, 0, part, s, way))
            assert np.abs(back - point).max() < 1e-11 * size
    assert (beyond > 0) == (not spine.closed)


@pytest.mark.parametrize("name", WIRES)
def test_frames_of_a_spine_are_its_derivatives(name):
    table, pool, at = pack_centerline(spine_of(Face(WIRES[name])), 1.0)
    for part in range(centerline_at(table, at).parts):
        o = part_at(table, at, part)
        for s in np.linspace(-1.5, 1.5, 7) * half_of(pool, o):
            h = 1e-3 * half_of(pool, o)
            p, t, c = (np.array(row) for row in centerline_point(pool, o, s))
            rows = [[np.array(row) for row in centerline_point(pool, o, s + k * h)] for k in (-2, -1, 1, 2)]
            slopes = [(rows[0][k] - 8.0 * rows[1][k] + 8.0 * rows[2][k] - rows[3][k]) / (12.0 * h) for k in range(2)]
            # Rounding of points of size one over steps, that are short for short parts.
            assert np.linalg.norm(t) == pytest.approx(1.0, abs=1e-14)
            np.testing.assert_allclose(slopes[0], t, atol=1e-14 * (1.0 + np.abs(p).max()) / h)
            np.testing.assert_allclose(slopes[1], c, atol=1e-13 / h)


def test_what_is_no_round_wire_has_no_spine():
    torus = asm.shapes.torus(1.0, 0.2)
    points = torus.control_points.copy()
    points[2, 3] += 1e-9
    dented = asm.NurbsSurface(points, torus.knots, torus.degree, torus.weights)
    oval = asm.NurbsSurface(torus.control_points * [1.0, 1.1, 1.0], torus.knots, torus.degree, torus.weights)
    weights = torus.weights.copy()
    weights[:, 1] *= 1.001
    uneven = asm.NurbsSurface(torus.control_points, torus.knots, torus.degree, weights)
    others = [
        *(dented, oval, uneven),
        *(asm.shapes.sphere(1.0), asm.shapes.ellipsoid(1.0, 0.5, 0.5), asm.shapes.plane(1.0, 1.0)),
        *(asm.shapes.cylinder(1.0, 2.0), asm.shapes.cone(1.0, 2.0), asm.shapes.pipe(HOOK, 0.2, caps=False)),
    ]
    assert [spine_of(Face(surface)) for surface in others] == [None] * len(others)
    # The wall of a bore that runs around.
    assert spine_of(Face(torus, reversed=True)) is None


@cache
def packed_pair(*names):
    """Two spines in one table and pool, and where their records are."""
    spines = [SPINES[name] for name in names]
    sizes = [float(np.ptp(spine.start, axis=0).max() + spine.length.max()) for spine in spines]
    table, pool, f = pack_centerline(spines[0], sizes[0])
    more, doubles, g = pack_centerline(spines[1], sizes[1], table.size, pool.size)
    return np.append(table, more), np.append(pool, doubles), f, g


class Two:
    """A box of two random spines in one table and pool, near each other."""

    shift = np.zeros(3)

    def __init__(self, rng):
        names = rng.choice(list(WIRES), 2).tolist()
        self.table, self.pool, self.f, self.g = packed_pair(*names)
        self.o, self.p = (
            part_at(self.table, at, rng.integers(centerline_at(self.table, at).parts)) for at in (self.f, self.g)
        )
        halves = half_of(self.pool, self.o), half_of(self.pool, self.p)
        ends = [np.sort(rng.uniform(-half, half, 2)) for half in halves]
        self.box = tuple(x for end in ends for x in end * 10.0 ** rng.uniform(-1.5, 0.0))
        self.turn = Rotation.random(random_state=int(rng.integers(1 << 30)))
        if rng.random() < 0.5:
            # Nearly along each other, where folds are.
            middles = self.frames(0.5 * (self.box[0] + self.box[1]), 0.5 * (self.box[2] + self.box[3]))
            axis = np.cross(middles[1][1], middles[0][1])
            angle = np.arctan2(np.linalg.norm(axis), middles[1][1] @ middles[0][1])
            self.turn = Rotation.from_rotvec(angle * axis / max(np.linalg.norm(axis), 1e-12)) * self.turn
        (p, f, _), (q, g, _) = self.frames(rng.uniform(*self.box[:2]), rng.uniform(*self.box[2:]))
        far = rng.normal(size=3)
        if rng.random() < 0.7:
            # F has no slope in the box.
            axes = np.linalg.svd(np.array([f, g]))[2]
            far = rng.normal() * axes[2] + (np.linalg.norm(np.cross(f, g)) < 1e-9) * rng.normal() * axes[1]
        self.shift = p - q + 10.0 ** rng.uniform(-2.0, 0.0) * far
        self.rho = rng.uniform(0.1, 2.0)

    def frames(self, s, t):
        """Point, tangent and curvature vector of both, in the axes of f."""
        mine = [np.array(row) for row in centerline_point(self.pool, self.o, s)]
        other = [self.turn.apply(np.array(row)) for row in centerline_point(self.pool, self.p, t)]
        return mine, [other[0] + self.shift, *other[1:]]

    def pose(self):
        return RelativePose(tuple(self.turn.as_matrix().ravel().tolist()), tuple(self.shift.tolist()))

    def parts(self, pose=None):
        return PosedParts(self.pool, self.o, self.p, pose or self.pose())

    def told(self, ends=(False, False, False, False)):
        return box_of(self.parts(), Lengths(*self.box), FreeEnds(*ends), np.inf, self.rho)

    def at(self, s, t):
        """Distances, slopes F_s, F_t and second derivatives F_ss, F_st, F_tt at arrays of places."""
        # Plain Python of a kernel, which takes arrays for numbers.
        d, f, c, g, e = difference_at(self.parts(), s, t)
        rows = np.sqrt(dot(d, d)), -dot(d, f), dot(d, g), 1.0 - dot(d, c), -dot(f, g), 1.0 + dot(d, e)
        return np.array(np.broadcast_arrays(*rows))

    def samples(self, count=9):
        """The same on a net over the box."""
        ends = np.linspace(*self.box[:2], count), np.linspace(*self.box[2:], count)
        return self.at(*(x.ravel() for x in np.meshgrid(*ends, indexing="ij")))

    def move(self, rng, m):
        """A motion of g seen from f: no tangent turns by more than m / rho, no point of the box's part goes farther."""
        angle = rng.uniform(0.0, 1.0) * m / self.rho
        axis = rng.normal(size=3)
        step = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        points = [self.frames(0.0, t)[1][0] for t in np.linspace(*self.box[2:], 5)]
        middle = points[2]
        reach = max(np.linalg.norm(point - middle) for point in points) * 2.0 * np.sin(0.5 * angle)
        way = rng.normal(size=3)
        way *= max(m - reach, 0.0) * rng.uniform(0.5, 1.0) / np.linalg.norm(way)
        if reach > m:
            step = Rotation.identity()
        self.shift = step.apply(self.shift - middle) + middle + way
        self.turn = step * self.turn


def has_critical_point(two):
    """Whether Newton's method finds a point of slope zero in the box, from 25 places."""
    low, high = np.array(two.box[::2]), np.array(two.box[1::2])
    x = np.stack(np.meshgrid(*np.linspace(low, high, 5).T), axis=-1).reshape(-1, 2)
    for _ in range(12):
        _, a, b, ss, st, tt = two.at(*x.T)
        slope = np.stack([a, b], axis=1)
        inverse = np.linalg.pinv(np.stack([ss, st, st, tt], axis=1).reshape(-1, 2, 2), rcond=1e-12)
        step = np.einsum("kij,kj->ki", inverse, -slope)
        x = np.clip(x + step, low - (high - low), high + (high - low))
    return bool(((np.abs(slope) < 1e-13) & (x > low) & (x < high)).all(axis=1).any())


def agrees(two, what):
    """Whether samples bear out what a box is told to be."""
    _, a, b, ss, st, tt = two.samples()
    if what == EMPTY:
        return not has_critical_point(two)
    det = ss * tt - st * st
    # Of two lines along each other the determinant is zero, to rounding.
    slack = 1e-15
    if what == CONVEX:
        return bool((det > -slack).all() and (ss > 0.0).all() and (tt > 0.0).all())
    if what == BARREN:
        return bool(((det < slack) | (ss < 0.0) | (tt < 0.0)).all())
    return True


def test_what_is_told_of_boxes_holds_now_and_after_motions(cases):
    rng = np.random.default_rng(7)
    told = np.zeros(4, dtype=int)
    moved = 0
    count = cases(300, 1500)
    for _ in range(count):
        two = Two(rng)
        least, what, margin = two.told()
        distances = two.samples()[0]
        assert least <= distances.min() + 1e-13
        assert agrees(two, what)
        told[what] += 1
        if what and 0.0 < margin:
            m = min(margin, 0.5 * two.rho)
            turn, shift = two.turn, two.shift
            for _ in range(2):
                two.turn, two.shift = turn, shift
                two.move(rng, m)
                if what != EMPTY:
                    # What comes into a box that is EMPTY by its shape alone is known beside it.
                    assert agrees(two, what)
                    moved += 1
    assert (told > count / 30).all() and moved > count / 5


@cache
def watch_of(f, g):
    return Watch([SHAPES[f][1], SHAPES[g][1]])


@pytest.mark.parametrize(
    ("f", "g", "place", "turn", "gap"),
    [
        # Rods side by side, end to end, across each other, end beside end, and an end over a side.
        ("rod", "rod", (0.35, 0.0, 0.1), (0.0, 0.0, 0.0), 0.05),
        ("rod", "rod", (0.0, 0.0, 2.35), (0.0, 0.0, 0.0), 0.05),
        ("rod", "rod", (0.35, 0.0, 0.0), (0.5 * np.pi, 0.0, 0.0), 0.05),
        ("rod", "rod", (0.21, 0.0, 2.28), (0.0, 0.0, 0.0), 0.05),
        ("rod", "rod", (1.35, 0.0, 1.0), (0.0, 0.5 * np.pi, 0.0), 0.05),
        # Spines that cross.
        ("rod", "rod", (0.0, 0.0, 0.0), (0.5 * np.pi, 0.0, 0.0), -0.3),
        # Rings about one axis, turned over or not, linked, and side by side.
        ("torus", "torus", (0.0, 0.0, 0.3), (0.0, 0.0, 0.0), 0.06),
        ("torus", "torus", (0.0, 0.0, 0.3), (np.pi, 0.0, 0.0), 0.06),
        ("torus", "torus", (0.3, 0.0, 0.0), (0.5 * np.pi, 0.0, 0.0), 0.06),
        ("torus", "torus", (2.3, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06),
    ],
)
def test_the_least_gap_of_wires_in_special_places_is_listed(f, g, place, turn, gap):
    watch = watch_of(f, g)
    watch.forget()
    q = np.array([HERE, [*place, *Rotation.from_rotvec(turn).as_quat(scalar_first=True)]])
    assert watch.look(q).gap.min() == pytest.approx(gap, abs=1e-12)


@pytest.mark.parametrize("names", [("hook", "hook"), ("bent", "ring"), ("torus", "hook"), ("wide torus", "wide torus")])
def test_first_looks_find_all_minima(names, cases):
    # Wherever wires are, also through each other: every minimum that is near enough for a place, and nothing else.
    wires = {name: wire for name, (wire, _, _) in SHAPES.items()} | {"bent": path_wire(BENT, 0.1)}
    watch, oracle = Watch([WIRES[name] for name in names]), WireOracle([wires[name] for name in names])
    rng = np.random.default_rng(3)
    due = 0
    count = cases(30, 150)
    for _ in range(count):
        e = rng.normal(size=(2, 4))
        q = np.column_stack([np.zeros((2, 3)), e / np.linalg.norm(e, axis=1, keepdims=True)])
        q[1, :3] = rng.normal(size=3)
        try:
            extrema = oracle.extrema(q)
        except ArithmeticError:
            continue
        watch.forget()
        listed = watch.look(q)
        minima = extrema.take((extrema.index == 0) & (extrema.curvature > 1e-6))
        wanted = minima.take(minima.gap < listed.take[0] - 1e-6)
        off = np.linalg.norm(wanted.points[:, None] - listed.points[None], axis=3).max(axis=2)
        assert (off.min(axis=1, initial=np.inf) < 1e-7).all() if wanted.gap.size else True
        found = np.linalg.norm(listed.points[:, None] - minima.points[None], axis=3).max(axis=2)
        assert (found.min(axis=1, initial=np.inf) < 1e-7).all() if listed.gap.size else True
        due += wanted.gap.size
    assert due > 20 / 150 * count


@pytest.mark.parametrize("tilt", [1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-2])
def test_lines_that_are_all_but_parallel_have_a_contact(tilt, cases):
    # Along no axis, so that nothing is exact: Newton's steps along the valley do not shrink.
    along = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    rod = asm.shapes.pipe(Path(tuple(-along), tuple(along)).line(2.0), 0.15)
    watch, rng = Watch([rod, rod]), np.random.default_rng(0)
    across = np.cross(along, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    for k in range(cases(33, 100)):
        base, way = Rotation.random(random_state=k), Rotation.from_rotvec(rng.uniform(0.0, 6.0) * along).apply(across)
        turn = Rotation.from_rotvec(tilt * way) * Rotation.from_rotvec(rng.uniform(0.0, 6.0) * along)
        s, t = rng.uniform(-0.9, 0.9, 2)
        place = s * along + 0.31 * way - t * turn.apply(along)
        e, there = base.as_quat(scalar_first=True), (base * turn).as_quat(scalar_first=True)
        watch.forget()
        gaps = watch.look(np.array([[0.0, 0.0, 0.0, *e], [*base.apply(place), *there]])).gap
        # Where they cross: a gap of 0.01. All along the valley it is as good, to the square of the tilt.
        assert gaps.min() == pytest.approx(0.01, abs=1e-12 + 4.0 * tilt**2)


@cache
def rods():
    """Two rods under watch, and who judges them."""
    return Watch([WIRES["rod"]] * 2), WireOracle([SHAPES["rod"][0]] * 2)


@pytest.mark.parametrize("along", [0.0, 1e-9, 1e-3, 0.3])
@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-10, 3e-10, 1e-9, 3e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4])
def test_lines_that_lean_toward_each_other_have_a_contact_at_an_end(tilt, along):
    # The valley falls all the way: steps of Newton's method end before its bottom, once without a word.
    watch, oracle = rods()
    watch.forget()
    turn = Rotation.from_rotvec([tilt, 0.0, 0.0]).as_quat(scalar_first=True)
    q = np.array([HERE, [1e-9, 0.35, along, *turn]])
    gaps = watch.look(q).gap
    # Of less than rounding, over the length, any place is as good.
    assert gaps.min() == pytest.approx(oracle.deepest(q), abs=1e-12 + (tilt if tilt < 1e-10 else 0.0))


def test_rods_that_lean_toward_each_other_do_not_pass_through_each_other():
    rod, oracle = WIRES["rod"], WireOracle([SHAPES["rod"][0]] * 2)
    for tilt in (1e-9, 1e-6, 1e-3):
        turn = Rotation.from_rotvec([tilt, 0.0, 0.0]).as_quat(scalar_first=True)
        bodies = [asm.Body("fixed", rod, fixed=True), asm.Body("drawn", rod, (1e-9, 0.35, 1e-9), turn)]
        scene = asm.Assembly(bodies)
        scene.constrain(asm.Clearance())
        tracker = scene.tracker(follow=bodies[1])
        for k in range(30):
            step = tracker.step(np.array([1e-9, 0.35 - 0.01 * k, 1e-9, *turn]))
            # Lines within 1e-7 rad are as near all along: their contact stays where it is, and an end may dip by that.
            assert oracle.deepest(step.q) > -3e-7
        scene.minimize(asm.PointDistance(bodies[1].point(0, 0, 0), (0.0, 0.2, 0.0)))
        solution = scene.solve()
        assert solution.success and oracle.deepest(solution.q) > -1e-12


@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_rods_with_one_spine_do_not_stay_in_each_other(shift):
    bodies = [asm.Body(name, WIRES["rod"], (0.0, 0.0, shift * k)) for k, name in enumerate("ab")]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    wire = SHAPES["rod"][0]
    assert not solution.success or WireOracle([wire, wire]).deepest(solution.q) > -1e-9


def test_contacts_that_are_born_where_the_curvature_jumps_are_within_what_looks_allow(cases):
    # A rod beside a line that bends up, and then down: as it leans a minimum comes from the joint onto the line.
    bent = Path((-1, 0, 0), (1, 0, 0)).line(1.0).arc(0.5, 0.06, (0, 0, 1)).arc(0.5, 0.5, (0, 0, -1)).line(0.3)
    rod = Path((-0.6, 0, 0), (1, 0, 0)).line(1.2)
    watch = Watch([asm.shapes.pipe(path, 0.1) for path in (bent, rod)])
    oracle = WireOracle([path_wire(path, 0.1) for path in (bent, rod)])
    rng = np.random.default_rng(0)
    packed, born = watch._packed, 0
    manager = manager_records.ContactManager(Store(packed.table, packed.pool), watch._at, watch.memory)
    count = cases(150, 1500)
    for _ in range(count):
        high = 0.2 + 10.0 ** rng.uniform(-3.6, -2.5)
        turn = Rotation.from_rotvec((0.0, 0.0, np.arcsin(np.sqrt(rng.uniform(0.3, 0.7) * high / 0.5))))
        q = np.array([HERE, [10.0 ** rng.uniform(-3.5, -1.8), 0.0, high, *turn.as_quat(scalar_first=True)]])
        watch.forget()
        listed = watch.look(q)
        if listed.gap.min(initial=np.inf) < 0.0 or (np.abs(listed.points[:, 0, 0] + 0.4) < 0.4).any():
            continue
        for _ in range(3):
            middle = np.array([rng.uniform(0.015, 0.06), 0.0, 0.2])
            lean = Rotation.from_rotvec((0.0, -rng.uniform(0.0, 0.06), 0.0))
            after = q.copy()
            after[1, :3] = lean.apply(q[1, :3] - middle) + middle
            after[1, 3:] = (lean * turn).as_quat(scalar_first=True)
            scaled = after.copy()
            scaled[:, :3] = (after[:, :3] - packed.reference) / packed.scale
            try:
                minima = oracle.minima(after, 0.0)
            except ArithmeticError:
                continue
            if (np.abs(minima.points[:, 0, 0] + 0.4) < 0.4).any():
                # It is in the rod already: the look did not allow as much, or not without another one.
                part = part_used(manager, 0, scaled)
                doubt = manager_records.pair_state_of(manager, 0).doubt
                assert max(part, doubt) >= 1.0
                born += 1
    assert born > count / 75
