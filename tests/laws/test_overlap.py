"""Whether bodies are in each other: told where they are, and only there, against center lines and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.constraints.program import records as layout
from assembly.proximity.features.solid_contact import PAIR_GAP, TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager import update as watch
from benchmarks.center_lines import ball_wire, paper_clip_wire, torus_wire
from benchmarks.wire_oracle import WireOracle
from tests.solve.test_flat_contacts import BOX, PLATE, apart

# Faces, not surfaces: all bodies of one have what was found of it.
WIRES = {
    "clip": (asm.Face(asm.shapes.paper_clip()), paper_clip_wire()),
    "ring": (asm.Face(asm.shapes.torus(5.0, 0.5)), torus_wire(5.0, 0.5)),
    "thick ring": (asm.Face(asm.shapes.torus(3.0, 1.5)), torus_wire(3.0, 1.5)),
    "ball": (asm.Face(asm.shapes.sphere(3.0)), ball_wire(3.0)),
}
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
TURNED = (0.8, 0.36, 0.48, 0.0)


def judge(f, g):
    """What a look that asks for everything says of two bodies at poses (2, 7): no contact but they cross, deepest gap.

    The deepest gap is NaN where no contact is listed.
    """
    scene = asm.Assembly([asm.Body("f", f), asm.Body("g", g)])
    scene.constrain(asm.Clearance(slots=32))
    packed = scene.packed()

    def at(q):
        memory = packed._memory.copy()
        tracked = np.full((packed.tracked, TRACK), np.nan)
        q = np.array(q, dtype=float)
        q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
        watch.update(
            packed.table, packed.pool, packed.table[layout.MANAGER_RECORD], memory, q, tracked, watch.EVERYTHING
        )
        gaps = tracked[np.isfinite(tracked[:, PAIR_GAP]), PAIR_GAP]
        crossed = memory[manager_records.MEMORY_HEADER + manager_records.CROSSED]
        assert crossed in (0.0, 1.0)
        return crossed == 1.0, packed.scale * gaps.min() if gaps.size else np.nan

    return at


def stopped(oracle, rng, gap):
    """A random pose of the second wire from which it was moved away until it has a gap from the first one."""
    turns = Rotation.random(2, random_state=int(rng.integers(1 << 30))).as_quat(scalar_first=True)
    start, way = 2.0 * rng.normal(size=3), rng.normal(size=3)
    way /= np.linalg.norm(way)

    def moved(far):
        return np.array([[0.0, 0.0, 0.0, *turns[0]], [*(start + far * way), *turns[1]]])

    low, high = 0.0, 60.0
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if oracle.gaps(moved(middle))[0] > gap else (middle, high)
    return moved(high)


def from_box(half, p):
    """The distance of a point outside a box of half widths from it."""
    return np.linalg.norm(np.maximum(np.abs(p) - half, 0.0))


def from_cylinder(half, p):
    """The distance of a point outside a cylinder about z from it: of half widths (radius, radius, half height)."""
    return np.hypot(max(np.hypot(p[0], p[1]) - half[0], 0.0), max(abs(p[2]) - half[2], 0.0))


SOLIDS = {
    "box": (asm.shapes.box(1.0, 0.8, 0.6), (0.5, 0.4, 0.3), from_box),
    "plate": (asm.shapes.box(*PLATE), 0.5 * np.array(PLATE), from_box),
    "cylinder": (asm.shapes.solid_cylinder(0.4, 1.0), (0.4, 0.4, 0.5), from_cylinder),
    "disc": (asm.shapes.solid_cylinder(1.0, 0.05), (1.0, 1.0, 0.025), from_cylinder),
}


def dented(rng, half, distance, depth):
    """A random turn, and where a ball of radius 0.5 is that a solid cuts into by a depth."""
    turn = Rotation.random(random_state=int(rng.integers(1 << 30)))
    on = np.array(half) * rng.uniform(-1.0, 1.0, 3)
    way = rng.normal(size=3)
    low, high = 0.0, 10.0
    while high - low > 1e-14:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if distance(half, on + middle * way) < 0.5 - depth else (low, middle)
    return np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [*(on + high * way), *turn.as_quat(scalar_first=True)]])


@pytest.mark.parametrize("name", SOLIDS)
def test_balls_into_which_corners_and_edges_cut_are_told_of_to_any_depth(name, cases):
    shape, half, distance = SOLIDS[name]
    judged, rng = judge(shape, asm.shapes.sphere(0.5)), np.random.default_rng(13)
    for _ in range(cases(20, 60)):
        depth = 10.0 ** rng.uniform(-8.0, -2.0)
        crossed, gap = judged(dented(rng, half, distance, depth))
        # Rounding of lengths of order one; how deep the deepest contact is says all.
        assert gap == pytest.approx(-depth, abs=1e-12)
        assert not crossed or depth > 1e-6


def test_a_ring_that_lies_in_a_plate_is_told_of_where_it_is_deepest(cases):
    # Patches of the ring are below the large flat face, and far from it by their boxes the more the deeper they are.
    judged, rng = judge(asm.shapes.box(4.0, 4.0, 0.1), asm.shapes.torus(0.7, 0.1)), np.random.default_rng(15)
    for _ in range(cases(10, 30)):
        depth, tilt = 10.0 ** rng.uniform(-4.0, -1.4), 10.0 ** rng.uniform(-2.5, -1.0)
        axis = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)]).apply([tilt, 0.0, 0.0])
        turn = Rotation.from_rotvec(axis) * Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)])
        height = 0.05 + 0.1 + 0.7 * np.sin(tilt) - depth
        place = [*rng.uniform(-0.5, 0.5, 2), height, *turn.as_quat(scalar_first=True)]
        _crossed, gap = judged(np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], place]))
        # Rounding of lengths of order one, over that of the tilt.
        assert gap == pytest.approx(-depth, abs=1e-12)


@pytest.mark.parametrize("name", SOLIDS)
def test_bodies_that_begin_in_each_other_are_pushed_apart(name, cases):
    shape, half, distance = SOLIDS[name]
    rng = np.random.default_rng(14)
    for _ in range(cases(6, 40)):
        q = dented(rng, half, distance, 10.0 ** rng.uniform(-5.0, -2.0))
        scene = asm.Assembly([asm.Body("f", shape, fixed=True), asm.Body("g", asm.shapes.sphere(0.5))])
        scene.constrain(asm.Clearance())
        solution = scene.solve(q)
        assert solution.success
        assert distance(half, solution.q[1, :3]) > 0.5 - 1e-10


@pytest.mark.parametrize("sides", [(PLATE, PLATE), (BOX, PLATE), (BOX, BOX)], ids=["plates", "on a plate", "boxes"])
def test_boxes_cross_where_no_axis_separates_them(sides, cases):
    crossed = judge(asm.shapes.box(*sides[0]), asm.shapes.box(*sides[1]))
    rng = np.random.default_rng(11)
    for _ in range(cases(6, 40)):
        turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat(scalar_first=True)
        start, way = 0.7 * rng.normal(size=3), rng.normal(size=3)
        way /= np.linalg.norm(way)

        def moved(far, turn=turn, start=start, way=way):
            return np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [*(start + far * way), *turn]])

        low, high = 0.0, 10.0
        while high - low > 1e-13:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if apart(moved(middle), sides) > 0.0 else (middle, high)
        # Touching, a hair apart, and from where they only just cross to wherever they began.
        for far in (high, high + 1e-9, high + 1e-3):
            assert not crossed(moved(far))[0]
        for far in (high - 1e-3, high - 0.05, 0.5 * high, 0.0):
            told, deepest = crossed(moved(far))
            assert apart(moved(far), sides) > -1e-4 or told or deepest < 0.0


@pytest.mark.parametrize(("angle", "tilt"), [(0.0, 0.05), (0.1, 0.05), (0.1, 0.1), (0.1, 0.2)])
def test_a_peg_that_leans_in_a_bore_does_not_cross_it(angle, tilt):
    # Its edges cut facets of the bore, which stand out into it by four thousandths, and enter at the flat faces' holes.
    side, length = 0.8 * np.sqrt(2.0), 6.0
    crossed = judge(asm.shapes.plate(4.0, 4.0, 1.0, [(0.0, 0.0, 1.0)]), asm.shapes.box(side, side, length))
    turn = (
        Rotation.from_rotvec([0, 0, angle])
        * Rotation.from_rotvec([0, tilt, 0])
        * Rotation.from_rotvec([0, 0, np.pi / 4])
    )
    along = np.linspace(-0.5 * length, 0.5 * length, 6001)

    def workspace(far):
        least = np.inf
        for x, y in ((0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)):
            points = turn.apply(np.stack([np.full_like(along, x * side), np.full_like(along, y * side), along], axis=1))
            points += far * np.array([np.cos(angle), np.sin(angle), 0.0])
            points = points[np.abs(points[:, 2]) <= 0.5]
            least = min(least, (1.0 - np.hypot(points[:, 0], points[:, 1])).min())
        return least

    low, high = 0.0, 1.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if workspace(middle) > 1e-3 else (low, middle)
    place = low * np.array([np.cos(angle), np.sin(angle), 0.0])
    q = np.array([[0.0, 0.0, 0.0, *UPRIGHT], [*place, *turn.as_quat(scalar_first=True)]])
    assert workspace(low) > 0.9e-3 and not crossed(q)[0]


@pytest.mark.parametrize(
    ("f", "g"),
    [("clip", "clip"), ("ring", "clip"), ("thick ring", "clip"), ("ball", "clip"), ("ball", "ring")],
)
def test_wires_cross_where_their_center_lines_say_so(f, g, cases):
    oracle = WireOracle([WIRES[f][1], WIRES[g][1]])
    crossed = judge(WIRES[f][0], WIRES[g][0])
    rng = np.random.default_rng(5)
    for gap in (1e-3, 1e-2, 0.1, -1e-3, -0.1) * cases(1, 6):
        q = stopped(oracle, rng, gap)
        true = oracle.gaps(q)[0]
        told, deepest = crossed(q)
        assert not (told and true > 0.0)
        assert true > -1e-4 or told or deepest < 0.0


def test_clips_that_touch_are_not_told_to_cross():
    # Here a foot that Newton's method had not reached yet had a patch of one clip in another one.
    q = np.array(
        [
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [
                -6.480574335054459,
                4.258737211843085,
                -22.668945325643914,
                0.9038431043908197,
                0.2810754438430033,
                0.14443553334232795,
                0.28844863359312656,
            ],
            [
                5.735783795112681,
                1.784657687220835,
                -26.55188289106474,
                0.6522427133881731,
                -0.10842937807660974,
                -0.19993123735944185,
                0.7230836833519864,
            ],
        ]
    )
    crossed = judge(WIRES["clip"][0], WIRES["clip"][0])
    assert abs(WireOracle([paper_clip_wire()] * 3).deepest(q)) < 1e-9
    assert not any(crossed(q[[i, j]])[0] for i, j in ((0, 1), (0, 2), (1, 2)))


@pytest.mark.parametrize("turn", [UPRIGHT, TURNED])
@pytest.mark.parametrize("thickness", [0.3, 0.1, 0.03])
@pytest.mark.parametrize("ball", [asm.shapes.sphere(1.0), asm.shapes.sphere(5.0)], ids=["small", "large"])
def test_what_is_beside_a_thin_plate_is_not_in_it(thickness, ball, turn):
    # Feet on the far side of the plate have it between them and what is beside the near one.
    crossed = judge(asm.shapes.box(10.0, 8.0, thickness), ball)
    radius = 5.0 if ball.control_points[..., :3].max() > 2.0 else 1.0
    for gap in (1e-3, 0.02):
        for x in (0.0, 1.3, 4.9):
            pose = (x, 0.7, -0.5 * thickness - radius - gap, *turn)
            told, deepest = crossed([(0.0, 0.0, 0.0, *UPRIGHT), pose])
            assert not told and not deepest < 0.0
        # Half way into it; the gap of the one contact there says so, or the look.
        told, deepest = crossed([(0.0, 0.0, 0.0, *UPRIGHT), (0.3, 0.7, -radius, *turn)])
        assert told or deepest < -1e-3


INNER = {
    "box": asm.shapes.box(0.5, 0.4, 0.3),
    "ball": asm.Face(asm.shapes.sphere(0.25)),
    "ring": asm.Face(asm.shapes.torus(0.3, 0.1)),
}


# Of each a place in it and one that is not; the ring's is in its tube, and in its hole.
OUTER = {
    "box": (asm.shapes.box(4.0, 4.0, 4.0), (0.2, 0.1, 0.0), (7.0, 0.0, 0.0)),
    "ball": (asm.Face(asm.shapes.sphere(2.0)), (0.2, 0.1, 0.0), (0.0, 0.0, 3.0)),
    "ring": (asm.Face(asm.shapes.torus(3.0, 1.0)), (3.0, 0.1, 0.0), (0.0, 0.1, 0.0)),
}


@pytest.mark.parametrize("inner", list(INNER))
@pytest.mark.parametrize("outer", list(OUTER))
def test_a_body_wholly_inside_another_one_is_in_it(outer, inner):
    shape, *places = OUTER[outer]
    inner_in, outer_around = judge(shape, INNER[inner]), judge(INNER[inner], shape)
    for turn in (UPRIGHT, TURNED):
        for place, inside in zip(places, (True, False), strict=True):
            q = np.array([(0.0, 0.0, 0.0, *UPRIGHT), (*place, *turn)])
            for told, deepest in (inner_in(q), outer_around(q[::-1])):
                # The gap of a contact of round wires says so, or the look.
                assert (told or deepest < -0.1) == inside
                assert inside or not deepest < 0.0


def test_rays_that_leave_a_tube_by_its_open_end_do_not_put_a_body_inside():
    tube = asm.shapes.cylinder(1.0, 6.0)
    crossed = judge(tube, asm.shapes.sphere(0.3))
    rng = np.random.default_rng(8)
    for _ in range(60):
        # All around the ends, and never within.
        place = rng.uniform((-3.0, -3.0, 3.4), (3.0, 3.0, 5.0))
        place[2] *= rng.choice([-1.0, 1.0])
        assert not crossed([(0.0, 0.0, 0.0, *UPRIGHT), (*place, *UPRIGHT)])[0]


@pytest.mark.parametrize("x", [0.0, 0.5, 3.0])
def test_plates_with_flush_sides_are_not_in_each_other(x):
    # Segments between far sides run along the sides, through the borders of faces.
    plate = asm.shapes.box(3.0, 3.0, 0.03)
    told, deepest = judge(plate, plate)([(0.0, 0.0, 0.0, *UPRIGHT), (x, 0.0, 0.04, *UPRIGHT)])
    assert not told and deepest == pytest.approx(0.01, abs=1e-9)


def test_what_is_behind_a_sheet_is_not_in_it():
    sheet = asm.Face(asm.shapes.plane(10.0, 10.0))
    tilted = Rotation.from_rotvec([0.1, 0.17, 0.3]).as_quat(scalar_first=True)
    told, deepest = judge(sheet, asm.shapes.box(1.0, 1.0, 0.1))([(0.0, 0.0, 0.0, *UPRIGHT), (0.1, 0.2, -0.3, *tilted)])
    assert not told and not deepest < 0.0


@pytest.mark.parametrize("inner", list(INNER))
def test_what_is_in_a_bore_is_not_in_its_wall(inner):
    bore = asm.Face(asm.shapes.cylinder(1.0, 6.0), reversed=True)
    for turn in (UPRIGHT, TURNED):
        told, deepest = judge(bore, INNER[inner])([(0.0, 0.0, 0.0, *UPRIGHT), (0.2, 0.1, 0.4, *turn)])
        assert not told and not deepest < 0.0


def placed(rng, off):
    """One random pose, and the same one moved in its own axes."""
    turn, at = Rotation.random(random_state=int(rng.integers(1 << 30))), rng.normal(size=3)
    e = turn.as_quat(scalar_first=True)
    return np.array([[*at, *e], [*(at + turn.apply(off)), *e]])


@pytest.mark.parametrize("error", [1e-8, 1e-7])
def test_seams_that_faces_leave_open_hide_no_contact(error, cases):
    rng = np.random.default_rng(16)
    sides = [asm.shapes.box(*np.multiply([1.0, 0.8, 0.6], 1.0 + error * rng.uniform(-1, 1, 3))) for _ in range(6)]
    judged = judge(tuple(box[k] for k, box in enumerate(sides)), asm.shapes.sphere(0.5))
    for _ in range(cases(20, 60)):
        depth = 10.0 ** rng.uniform(-4.5, -2.0)
        crossed, gap = judged(dented(rng, (0.5, 0.4, 0.3), from_box, depth))
        # As far off as the faces are.
        assert crossed or gap == pytest.approx(-depth, abs=2.0 * error)


@pytest.mark.parametrize("shape", [asm.shapes.box(1.0, 1.0, 1.0), asm.shapes.solid_cylinder(0.4, 1.0)])
def test_bodies_at_one_place_are_in_each_other(shape):
    judged, rng = judge(shape, shape), np.random.default_rng(17)
    assert all(judged(placed(rng, np.zeros(3)))[0] for _ in range(20))


@pytest.mark.parametrize("side", [1.0, 0.5, 0.01])
def test_far_sides_of_parts_that_are_aligned_are_none(side):
    # The segments between them pass through diagonals and sides of facets.
    judged, rng = judge(asm.shapes.box(1.0, 1.0, 0.01), asm.shapes.box(side, side, 0.01)), np.random.default_rng(18)
    for _ in range(30):
        crossed, gap = judged(placed(rng, np.array([0.0, 0.0, 0.02])))
        assert not crossed and not gap < 0.0
