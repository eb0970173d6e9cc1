"""Gaps of nodes are lower bounds of distances of samples, along any direction; so is the room in a bore.

Kernels are run as plain Python. Samples are points of the true faces below a node.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store
from assembly.geometry.shapes.path import Path
from assembly.kinematics.motion import RelativePose
from assembly.proximity.clearance.directions import best_direction
from assembly.proximity.clearance.front import Front, Parted
from assembly.proximity.clearance.pair_looks import gap_along
from assembly.proximity.clearance.records import BY_BORE_A, BY_PLANE, BY_PLANE_OF_B, BY_SLEEVE, Forest
from assembly.proximity.clearance.separation import farthest_of_disc, highest, level_of_disc, room_in_bore, separation
from assembly.proximity.clearance.sleeves import best_bore, gap_of
from assembly.proximity.clearance.way import (
    Way,
    part_along,
    pose_at,
    sag_of,
    sag_of_carried,
    sag_of_disc,
    stays_apart,
    way_of,
)
from tests.proximity.clearance.nodes import forest_of, halve_all, tree_of
from tests.proximity.clearance.scenes import direction, faces_of
from tests.proximity.clearance.splines import points_of, shapes

ROUNDING = 1e-13
SHAPES = {name: shape for name, shape in shapes().items() if name not in ("clip", "slot", "over the seam")}


def packed(forest):
    table, pool, faces, links, nodes, used = forest.arrays
    return Forest(Store(table, pool), faces, links, nodes, used)


def relative(turn, shift):
    return RelativePose(tuple(turn.as_matrix().ravel().tolist()), tuple(map(float, shift)))


def random_turn(rng):
    return Rotation.random(random_state=int(rng.integers(1 << 30)))


def distances(points, others):
    return np.linalg.norm(points[:, None] - others, axis=-1)


def test_gaps_along_any_direction(cases):
    rng, names, above = np.random.default_rng(0), list(SHAPES), 0
    for _ in range(cases(20, 2000)):
        one, other = (SHAPES[names[rng.integers(len(names))]] for _ in range(2))
        forest = forest_of(faces_of(one), faces_of(other))
        turn, shift, n = random_turn(rng), 2.5 * direction(rng), direction(rng)
        if rng.random() < 0.7:
            n = shift / np.linalg.norm(shift)
        gap = gap_along(forest.arrays, tuple(forest.roots), turn.as_matrix().ravel(), shift, n)
        points = points_of(one, 150, rng), turn.apply(points_of(other, 150, rng)) + shift
        # Heights, and so distances.
        assert gap <= (points[1] @ n).min() - (points[0] @ n).max() + ROUNDING
        assert gap <= distances(*points).min() + ROUNDING
        assert gap == pytest.approx(separation(packed(forest), *forest.roots, relative(turn, shift), n), abs=ROUNDING)
        above += gap > 0.0
    assert above > 3


def nodes_below(forest, k):
    links, _ = tree_of(forest)
    found, waiting = [], [k]
    while waiting:
        k = waiting.pop()
        if links.child[k] < 0:
            found.append(k)
        else:
            waiting += [links.child[k], links.child[k] + 1]
    return found


@pytest.mark.parametrize("name", ["plate", "ellipsoid", "wire", "pin", "trimmed sheet"])
def test_gaps_of_all_nodes(name, cases):
    """Of corners of cells below them, which are points of the faces, or of the spine."""
    rng, forest = np.random.default_rng(1), forest_of(faces_of(SHAPES[name]), faces_of(SHAPES["torus"]))
    halve_all(forest, rng, 0.3)
    _, nodes = tree_of(forest)
    for _ in range(cases(40, 2000)):
        turn, shift, n = random_turn(rng), 2.0 * direction(rng), direction(rng)
        a, b = forest.roots
        for _ in range(int(rng.integers(0, 12))):
            links, _ = tree_of(forest)
            a, b = (k if links.child[k] < 0 else links.child[k] + int(rng.integers(2)) for k in (a, b))
        below = (nodes.corner[nodes_below(forest, k)].reshape(-1, 3) for k in (a, b))
        first, second = next(below), turn.apply(next(below)) + shift
        gap = separation(packed(forest), a, b, relative(turn, shift), n)
        assert gap <= (second @ n).min() - (first @ n).max() + ROUNDING


@pytest.mark.parametrize("is_ball", [False, True])
def test_the_farthest_of_a_disc_in_a_bore(is_ball, cases):
    """No sample of the disc's border is farther from the axis, or the center, and one nearly is, however it leans."""
    rng, turns = np.random.default_rng(6), np.linspace(0.0, 2.0 * np.pi, 4001)
    for k in range(cases(200, 20000)):
        axis, radius = direction(rng), rng.uniform(0.1, 2.0)
        side = np.cross(axis, direction(rng))
        side /= np.linalg.norm(side)
        lean = 0.0 if k % 5 == 0 else 10.0 ** rng.uniform(-9.0, 0.2)
        ruling = np.cos(lean) * axis + np.sin(lean) * np.cross(axis, side)
        center = 10.0 ** rng.uniform(-9.0, 0.0) * direction(rng)
        if k % 3 == 0:
            # Where the middle is off along the lean, or across it, or not at all.
            center = (k % 2) * 10.0 ** rng.uniform(-9.0, 0.0) * (side if k % 4 < 2 else np.cross(axis, side))
        line = np.zeros(3) if is_ball else axis
        first = np.cross(ruling, side)
        points = center + radius * (np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * first)
        far = np.linalg.norm(points - np.outer(points @ line, line), axis=1).max()
        bound = farthest_of_disc(tuple(center), tuple(line), tuple(ruling), radius)
        # Samples are 0.0016 rad apart, which leaves the squares of half of it of what is farthest.
        assert far <= bound + ROUNDING
        assert bound - far <= 1e-6 * (radius + np.linalg.norm(center))


def test_a_disc_upright_but_for_rounding(cases):
    """Across its axis it reaches its radius beyond its middle, whichever way the rounding of both axes points."""
    rng = np.random.default_rng(11)
    for _ in range(cases(500, 20000)):
        axis, radius = direction(rng), rng.uniform(0.1, 2.0)
        ruling = axis + 10.0 ** rng.uniform(-18.0, -14.0) * rng.normal(size=3)
        ruling /= np.linalg.norm(ruling)
        center = 10.0 ** rng.uniform(-9.0, 0.0) * direction(rng)
        far = np.linalg.norm(center - (center @ axis) * axis) + radius
        assert farthest_of_disc(tuple(center), tuple(axis), tuple(ruling), radius) == pytest.approx(far, abs=ROUNDING)


def test_the_level_of_a_disc_in_a_cone(cases):
    """No sample of the disc's border has a higher level, and one nearly has it, however the disc leans."""
    rng, turns = np.random.default_rng(8), np.linspace(0.0, 2.0 * np.pi, 4001)
    for k in range(cases(200, 20000)):
        axis, radius, half_angle = direction(rng), rng.uniform(0.1, 2.0), rng.uniform(0.02, 1.4)
        side = np.cross(axis, direction(rng))
        side /= np.linalg.norm(side)
        # Turned over, too; no farther than that a line of the cone is across it.
        lean = 0.0 if k % 5 == 0 else min(10.0 ** rng.uniform(-9.0, 0.2), 0.9 * (0.5 * np.pi - half_angle))
        ruling = (1 - 2 * (k % 2)) * (np.cos(lean) * axis + np.sin(lean) * np.cross(axis, side))
        center = 10.0 ** rng.uniform(-9.0, 0.0) * direction(rng) + rng.uniform(-2.0, 2.0) * axis
        points = center + radius * (np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * np.cross(ruling, side))
        heights = points @ axis
        flat = np.linalg.norm(points - heights[:, None] * axis, axis=1)
        most = (np.cos(half_angle) * flat - np.sin(half_angle) * heights).max()
        told = level_of_disc(np.sin(half_angle), tuple(center), tuple(axis), tuple(ruling), radius)
        assert most <= told + ROUNDING
        # Upright it is exact, but for the samples; else tangents come near, to a part of what the lean is.
        assert told - most <= 1e-5 + 0.5 * radius * lean


def test_planes_that_move_along_with_a_body(cases):
    """Of a box that turns as it goes: on its way gaps along what is fixed to it fall by no more than the sag."""
    rng, stay, tight = np.random.default_rng(12), 0, 0.0
    for k in range(cases(60, 4000)):
        forest = forest_of(faces_of(SHAPES["plate"]), faces_of(asm.shapes.box(1.0, 0.7, 0.5)))
        a, b = (int(root) for root in forest.roots)
        size = 10.0 ** rng.uniform(-3.0, -0.3)
        turn, shift, n = random_turn(rng), 2.5 * direction(rng), direction(rng)
        if k % 2:
            n = turn.inv().apply(shift / np.linalg.norm(shift))
        axis = n if k % 4 == 0 else direction(rng)
        # Also about an axis across the way, or along it, and on a straight way without a turn.
        part = [0.0, 1.0, rng.uniform()][k % 3]
        after = turn * Rotation.from_rotvec(part * size * axis)
        way = rng.uniform() * size * direction(rng)
        way = way if k % 5 else np.cross(turn.apply(axis), way)
        begin, end = relative(turn, shift), relative(after, shift + way)
        way, nodes = way_between(begin, end, np.zeros(3), 1.0), Parted(a, b, BY_PLANE_OF_B)
        gaps = tuple(gap_of(packed(forest), nodes, pose, tuple(n)) for pose in (begin, end))
        assert gaps[1] == pytest.approx(separation(packed(forest), a, b, end, tuple(after.apply(n))), abs=ROUNDING)
        sag = sag_of_carried(way, packed(forest), a, tuple(n))
        parts = np.linspace(0.0, 1.0, 17)
        between = np.array([gap_of(packed(forest), nodes, pose_at(way, float(s)), tuple(n)) for s in parts])
        below = (gaps[0] + parts * (gaps[1] - gaps[0]) - between).max()
        assert below <= sag + ROUNDING
        if sag > 1e-9:
            tight = max(tight, below / sag)
        if stays_apart(packed(forest), nodes, way, tuple(n), gaps):
            stay += 1
            assert between.min() > 0.0
    assert stay > 3 and tight > 0.5


def test_room_in_a_cone(cases):
    """Of a plug in its seat: what is told is less than the distance of samples, on the way as well, and not by much."""
    rng, stay = np.random.default_rng(9), 0
    slope = np.tan(0.5)
    plug = faces_of(asm.shapes.revolution(asm.curves.polygon([(0, 1), (slope, 1), (3 * slope, 3), (0, 3)])))
    seat = faces_of(asm.shapes.revolution(asm.curves.polygon([(slope, 1), (3, 1), (3, 3), (3 * slope, 3)])))
    forest = forest_of(seat, plug)
    _, nodes = tree_of(forest)
    cone = int(np.flatnonzero(nodes.less.any(axis=1))[0])
    assert nodes.slant[0] == pytest.approx(np.sin(0.5), abs=1e-14)
    around, z = rng.uniform(0.0, 2.0 * np.pi, 3000), np.append(rng.uniform(1.0, 3.0, 2000), np.repeat([1.0, 3.0], 500))
    points = np.column_stack([z * slope * np.cos(around), z * slope * np.sin(around), z])
    for k in range(cases(40, 2000)):
        size = 10.0 ** rng.uniform(-4.0, -1.3)
        ends = []
        for _ in range(2):
            spin = Rotation.from_rotvec((0.0, 0.0, 0.3 * rng.normal() * (k % 2)))
            turn = Rotation.from_rotvec((*(0.1 * size * rng.normal(size=2)), 0.0)) * spin
            ends.append(relative(turn, (*(0.2 * size * rng.normal(size=2)), 2.0 * size)))
        rooms = tuple(room_in_bore(packed(forest), 0, cone, pose, False) for pose in ends)
        for pose, room in zip(ends, rooms, strict=True):
            here = posed(pose, points)
            level = np.cos(0.5) * np.hypot(here[:, 0], here[:, 1]) - np.sin(0.5) * here[:, 2]
            assert room <= -level.max() + ROUNDING
            assert room >= -level.max() - 0.01 * size
        way, parted = way_between(*ends, np.array([0.0, 0.0, 2.0]), 2.0), Parted(0, cone, BY_BORE_A)
        if not stays_apart(packed(forest), parted, way, (0.0, 0.0, 0.0), rooms):
            continue
        stay += 1
        sag = sag_of(way, packed(forest), cone) + sag_of_disc(way, packed(forest), 0, cone)
        for s in np.linspace(0.0, 1.0, 9):
            room = room_in_bore(packed(forest), 0, cone, pose_at(way, float(s)), False)
            assert room > 0.0 and room >= min(rooms) - sag - ROUNDING
    assert stay > cases(10, 500)


def test_room_in_a_bore(cases):
    """What is told is less than the distance of any sample of the other body from the wall."""
    rng, roomy = np.random.default_rng(2), 0
    plate = shapes()["plate"]
    walls = [face for face in faces_of(plate) if max(face.surface.degree) > 1]
    wire = asm.shapes.pipe(Path().line(0.3).arc(0.2, 1.0, toward=(1, 0, 0)), 0.05)
    small = [asm.shapes.sphere(0.15), asm.shapes.solid_cylinder(0.1, 0.3), wire, asm.shapes.box(0.3, 0.2, 0.1)]
    for shape in [*small, shapes()["cone"]]:
        forest = forest_of(faces_of(plate), faces_of(shape))
        _, nodes = tree_of(forest)
        bores = np.flatnonzero(nodes.bore > 0.0)
        for _ in range(cases(10, 300)):
            wall = int(rng.choice(bores))
            face = walls[int(abs(nodes.bore[wall] - 0.5) > 0.05)]
            turn, place = random_turn(rng), nodes.spine[wall] + 0.15 * rng.normal(size=3)
            points = turn.apply(points_of(shape, 60, rng)) + place
            room = room_in_bore(packed(forest), wall, forest.roots[1], relative(turn, place), False)
            surface = face.surface.evaluate(*(rng.uniform(*ends, 800) for ends in face.surface.domain))
            assert room <= distances(points, surface).min() + ROUNDING
            off = points[:, :2] - nodes.spine[wall, :2]
            assert room <= nodes.bore[wall] - np.hypot(*off.T).max() + ROUNDING
            how, best = best_bore(packed(forest), wall, forest.roots[1], relative(turn, place))
            # What leans beyond its bore may have more room in a sleeve.
            assert how != BY_PLANE and (best == room or how >= BY_SLEEVE and room < best)
            # That is of what is in the node, between its ends.
            top, bottom = (sign * highest(packed(forest), wall, (0.0, 0.0, sign)) for sign in (1.0, -1.0))
            inside = surface[(surface[:, 2] <= top) & (surface[:, 2] >= bottom)]
            assert not len(inside) or best <= distances(points, inside).min() + ROUNDING
            roomy += room > 0.0
    assert roomy > 3


def way_between(before, after, center, radius):
    return way_of(before, after, tuple(center), radius, True)


def posed(pose, points):
    return points @ np.reshape(pose.rotation, (3, 3)).T + pose.shift


def test_ways_go_straight_and_turn_about_one_axis(cases):
    """Ends are the poses, rates are constant; no point goes farther than is said, none is farther off its chord."""
    rng, forest = np.random.default_rng(3), forest_of(faces_of(shapes()["wire"]))
    _, nodes = tree_of(forest)
    root = nodes[0]
    points = points_of(shapes()["wire"], 60, rng)
    for _ in range(cases(40, 2000)):
        before = relative(random_turn(rng), rng.normal(size=3))
        step = 10.0 ** rng.uniform(-8.0, 0.3)
        turn = Rotation.from_rotvec(step * rng.normal(size=3)) * Rotation.from_matrix(
            np.reshape(before.rotation, (3, 3))
        )
        after = relative(turn, np.array(before.shift) + step * rng.normal(size=3))
        way = way_between(before, after, root.center.tolist(), float(root.radius))
        start, end = posed(before, points), posed(after, points)
        length = np.zeros(len(points))
        last, parts = start, np.linspace(0.0, 1.0, 9)
        for s in parts[1:]:
            here = posed(pose_at(way, float(s)), points)
            length += np.linalg.norm(here - last, axis=1)
            last = here
            off = np.linalg.norm(here - (1.0 - s) * start - s * end, axis=1).max()
            assert off <= way.sag + 1e-14
            assert off <= sag_of(way, packed(forest), 0) + 1e-14
            # Of a plane all but across the axis of rotation next to nothing of that counts.
            axis = np.reshape(after.rotation, (3, 3)) @ way.axis
            n = axis + 10.0 ** rng.uniform(-12.0, 0.0) * rng.normal(size=3)
            n /= np.linalg.norm(n)
            along = np.abs((here - (1.0 - s) * start - s * end) @ n).max()
            assert along <= part_along(way, tuple(n)) * sag_of(way, packed(forest), 0) + 2e-15
        assert np.abs(last - end).max() < 1e-14
        assert length.max() <= way.moved + 1e-14
        middle = posed(pose_at(way, 0.25), root.center[None])
        assert middle[0] == pytest.approx(
            0.75 * posed(before, root.center) + 0.25 * posed(after, root.center), abs=1e-14
        )
        turned = [Rotation.from_matrix(np.reshape(pose_at(way, s).rotation, (3, 3))) for s in (0.0, 0.25, 0.5, 1.0)]
        angles = [(turned[0].inv() * r).magnitude() for r in turned]
        assert angles[1:3] == pytest.approx([0.25 * angles[3], 0.5 * angles[3]], abs=1e-7)


def test_what_leans_in_a_bore_stays_in_it_all_the_way(cases):
    """A thin disc that leans has room beside it, which it has not where it stands upright on its way."""
    rng, stay = np.random.default_rng(7), 0
    radius = 0.499
    plate, disc = faces_of(asm.shapes.plate(3.0, 3.0, 2.0, [(0.0, 0.0, 0.5)])), asm.shapes.solid_cylinder(radius, 0.002)
    forest = forest_of(plate, faces_of(disc))
    _, nodes = tree_of(forest)
    wall = int(np.flatnonzero(np.abs(nodes.bore - 0.5) < 1e-6)[0])
    # The exact hull of the cylinder's wall.
    below = range(forest.roots[1], len(nodes.disc))
    inner = next(k for k in below if abs(nodes.disc[k] - radius) < 1e-9 and nodes.half[k, 0] > 0.0009)
    around = np.linspace(0.0, 2.0 * np.pi, 721)
    rims = radius * np.column_stack([np.cos(around), np.sin(around), 0.0 * around])
    points = np.concatenate([rims + (0.0, 0.0, h) for h in (-0.001, 0.001)])
    for _ in range(cases(60, 3000)):
        azimuth, side = rng.uniform(0.0, 6.3), 10.0 ** rng.uniform(-4.0, -1.7)
        axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        leans = rng.choice([0.3, 0.03]) * rng.uniform(-1.0, 1.0, 2)
        ends = [relative(Rotation.from_rotvec(lean * axis), side * np.cross(axis, [0.0, 0.0, 1.0])) for lean in leans]
        way, parted = way_between(*ends, np.zeros(3), 0.6), Parted(wall, inner, BY_BORE_A)
        gaps = tuple(room_in_bore(packed(forest), wall, inner, pose, False) for pose in ends)
        if not stays_apart(packed(forest), parted, way, (0.0, 0.0, 0.0), gaps):
            continue
        stay += 1
        for s in np.linspace(0.0, 1.0, 21):
            here = posed(pose_at(way, float(s)), points)
            assert np.hypot(here[:, 0], here[:, 1]).max() <= 0.5 + 1e-12
    assert stay > cases(5, 300)


def test_directions_part_what_is_apart(cases):
    """Of two balls, and of a ball and a face: the best direction is that of the nearest points."""
    rng = np.random.default_rng(4)
    forest = forest_of(faces_of(asm.shapes.sphere(0.4)), faces_of(asm.shapes.sphere(0.3)))
    pair = np.zeros((1, 64))
    front = Front(pair[0], None, None, None, None, None, None, None, np.zeros((3, 64)))
    for _ in range(cases(20, 500)):
        shift, turn = (0.7 + 10.0 ** rng.uniform(-9.0, 0.0)) * direction(rng), random_turn(rng)
        pose = relative(turn, shift)
        way = Way(False, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), pose, pose)
        found, _ = best_direction(packed(forest), front, Parted(*forest.roots, BY_PLANE), way, (0.0, 0.0, 0.0), 0.0)
        assert found.after == pytest.approx(np.linalg.norm(shift) - 0.7, abs=1e-14)
        assert math.isinf(found.before)
        assert np.linalg.norm(found.n) == pytest.approx(1.0, abs=1e-15)
