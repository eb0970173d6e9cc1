"""Shafts that lean in bores: sections by dense angles, rooms by samples of both bodies, and what ways take of them.

Kernels are run as plain Python.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store
from assembly.kinematics.motion import RelativePose
from assembly.proximity.clearance.front import Parted
from assembly.proximity.clearance.records import BY_SLEEVE, NONE, Forest, node_at
from assembly.proximity.clearance.separation import farthest_of_section
from assembly.proximity.clearance.sleeves import best_sleeve, cosine_of_rulings, sleeve_room, slope_of
from assembly.proximity.clearance.way import pose_at, sleeve_sag, stays_apart, way_of
from tests.proximity.clearance.nodes import forest_of, tree_of
from tests.proximity.clearance.scenes import direction, faces_of

BORE, HEIGHT, SHAFT = 1.03, 2.0, 1.0
PLATE = asm.shapes.plate(6, 6, HEIGHT, [(0, 0, BORE)])


def scene(length):
    """The packed trees of a plate and a shaft, the root of one and the node of the other's wall."""
    forest = forest_of(faces_of(PLATE), faces_of(asm.shapes.solid_cylinder(SHAFT, length)))
    table, pool, faces, links, nodes, used = forest.arrays
    kinds, rows = tree_of(forest)
    is_wall = (kinds.face == NONE) & (rows.disc > 0.0) & (rows.half[:, 0] > 0.0) & (rows.rho == 0.0)
    # The caps of the shaft are discs, and cells of other faces have some thickness.
    wall = max(np.flatnonzero(is_wall & (np.abs(rows.disc - SHAFT) < 1e-9)), key=lambda k: rows.half[k, 0])
    return Forest(Store(table, pool), faces, links, nodes, used), int(forest.roots[0]), int(wall)


def relative(turn, shift):
    return RelativePose(tuple(turn.as_matrix().ravel().tolist()), tuple(map(float, shift)))


def leaning(rng, most):
    """A turn by up to so much, from the bore's axis, after one about it."""
    about = Rotation.from_rotvec((0.0, 0.0, rng.uniform(0.0, 6.28)))
    across = rng.normal(size=2)
    across *= most * rng.random() / np.linalg.norm(across)
    return Rotation.from_rotvec((*across, 0.0)) * about


def test_the_farthest_point_of_a_section(cases):
    """It is what dense angles find: where the shaft leans along its offset, across it, and without one."""
    rng = np.random.default_rng(0)
    for k in range(cases(40, 2000)):
        e, lean = (scale * np.array([*rng.normal(size=2), 0.0]) for scale in (10.0 ** -rng.uniform(0, 8), 0.1))
        e, lean = e * (k % 5 > 0), lean * 10.0 ** -rng.uniform(0, 6) * (k % 7 > 0)
        if k % 3 == 0:
            lean = np.array([-e[1], e[0], 0.0]) * (0.1 / max(np.linalg.norm(e), 1.0))
        slope = np.linalg.norm(lean)
        along = lean / slope if slope > 0.0 else np.array([1.0, 0.0, 0.0])
        beside = np.array([-along[1], along[0], 0.0])

        longer = np.hypot(1.0, slope)

        def off(angle, e=e, along=along, beside=beside, longer=longer):
            return -np.linalg.norm(e + SHAFT * (longer * np.cos(angle) * along + np.sin(angle) * beside))

        angles = np.linspace(0.0, 2.0 * np.pi, 200)
        best = angles[int(np.argmin([off(angle) for angle in angles]))]
        found = minimize_scalar(off, bounds=(best - 0.05, best + 0.05), method="bounded", options={"xatol": 1e-10})
        told = farthest_of_section(tuple(e), tuple(lean), SHAFT, 0.0)
        assert told >= -found.fun - 1e-14
        # Six steps of Newton's method are exact unless the offset is about what leaning adds to the radius.
        is_far = np.linalg.norm(e) > 10.0 * SHAFT * slope * slope
        assert told == pytest.approx(-found.fun, rel=1e-13 if is_far else 1e-6)


def test_an_end_that_just_fits_has_room(cases):
    """A shaft that ends in its bore and touches this with its end's rim and at its mouth is decided to rounding."""
    rng = np.random.default_rng(3)
    forest, plate, wall = scene(3.0)
    play = BORE - SHAFT
    for _ in range(cases(20, 500)):
        lean, azimuth, inner = rng.uniform(0.005, 0.02), rng.uniform(0.0, 6.28), rng.uniform(-0.5, 0.5)
        # Seen along the lean: the end's rim at one side, the section at the mouth (height 1) at the other one.
        cosine = np.cos(lean)
        off = play + SHAFT * (1.0 - cosine)
        mouth = (1.0 - inner) * np.tan(lean) - off
        # The section reaches r / cos(lean) from its middle; what is beside the bore's wall is the play of the pose.
        gap = BORE - mouth - SHAFT / cosine
        if not 1e-3 < gap:
            continue
        turn = Rotation.from_rotvec(lean * np.array([-np.sin(azimuth), np.cos(azimuth), 0.0]))
        way = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        end = -off * way + (0.0, 0.0, inner)
        shift = end + 1.5 * turn.apply((0.0, 0.0, 1.0))
        for opened in (0.0, 1e-9):
            how, room = best_sleeve(forest, plate, wall, relative(turn, shift + opened * way))
            assert how >= BY_SLEEVE and room == pytest.approx(np.cos(lean) * opened, abs=1e-13)


@pytest.mark.parametrize("length", [6.0, 2.4])
def test_the_room_is_less_than_the_distance_of_samples(cases, length):
    """Of a shaft longer than its bore, and of one that ends in it; and a shaft that just fits has a little of it."""
    rng, roomy = np.random.default_rng(1), 0
    forest, plate, wall = scene(length)
    angle, z = rng.uniform(0.0, 2.0 * np.pi, 4000), rng.uniform(-0.5 * HEIGHT, 0.5 * HEIGHT, 4000)
    of_bore = np.column_stack([BORE * np.cos(angle), BORE * np.sin(angle), np.where(z > 0.9, 1.0, z)])
    for _ in range(cases(30, 1000)):
        turn = leaning(rng, 0.03)
        shift = np.array([*rng.normal(scale=0.01, size=2), rng.uniform(-1.5, 1.5)])
        how, room = best_sleeve(forest, plate, wall, relative(turn, shift))
        seen = turn.inv().apply(of_bore - shift)
        beyond = np.abs(seen[:, 2]) - 0.5 * length
        off = np.hypot(seen[:, 0], seen[:, 1]) - SHAFT
        least = np.where(beyond > 0.0, np.hypot(np.maximum(off, 0.0), np.maximum(beyond, 0.0)), off).min()
        if room > 0.0:
            assert how >= BY_SLEEVE and room <= least + 1e-12
            roomy += 1
        elif length > 5.0:
            # Samples miss little of where a long shaft is in the wall.
            assert least < 2e-3
    assert roomy > 3


def test_no_way_takes_more_of_the_room_than_told(cases):
    """At any part of a way, with any rotation and slide, the room is what it is at both ends less the sag at least."""
    rng = np.random.default_rng(2)
    forest, plate, wall = scene(6.0)
    closest = 0.0
    for k in range(cases(12, 400)):
        size = 10.0 ** -rng.uniform(0, 2)
        before = leaning(rng, 0.02), np.array([*rng.normal(scale=0.01, size=2), rng.uniform(-1.0, 1.0)])
        spin = Rotation.from_rotvec((0.0, 0.0, size * rng.normal() * (k % 2)))
        after = leaning(rng, 0.02 * size) * before[0] * spin, before[1] + size * rng.normal(scale=(0.01, 0.01, 0.3))
        poses = relative(*before), relative(*after)
        way = way_of(*poses, (0.0, 0.0, 0.3 * rng.normal()), 4.0, True)
        for how in range(BY_SLEEVE, BY_SLEEVE + 3):
            sag, _ = sleeve_sag(way, forest, plate, wall, how)
            ends = min(sleeve_room(forest, plate, wall, pose, how) for pose in poses)
            rooms = [sleeve_room(forest, plate, wall, pose_at(way, s), how) for s in np.linspace(0.0, 1.0, 9)]
            assert min(rooms) >= ends - sag - 1e-13
            closest = max(closest, (ends - min(rooms)) / sag if sag < np.inf else 0.0)
    # Not a bound that nothing comes near.
    assert closest > 0.01


# Radii of a seat's bore at heights of -1 and 1, and of what is in it at -half and half of its length.
TAPERED = {
    "plug in a seat": ((0.7, 1.3), (0.4, 1.6), 4.0),
    "plug that ends in it": ((0.7, 1.3), (0.82, 1.25), 1.5),
    "plug the other way up": ((1.3, 0.7), (1.6, 0.4), 4.0),
    "pin in a seat": ((1.03, 1.6), (1.0, 1.0), 5.0),
    "cone in a bore": ((1.03, 1.03), (0.55, 1.0), 2.5),
    "head in a countersink": ((0.5, 2.5), (0.1, 2.9), 2.8),
    "pin in a steep seat": ((1.03, 3.13), (1.0, 1.0), 5.0),
}
# What leans far, and by how much [rad].
LOOSE = {
    "pin in a wide bore": ((1.5, 1.5), (0.3, 0.3), 8.0, 0.9),
    "plug in a wide seat": ((0.9, 2.1), (0.2, 0.8), 4.0, 0.6),
    "pin in a funnel": ((0.5, 3.5), (0.3, 0.3), 6.0, 0.3),
    "head in a wide countersink": ((0.4, 3.8), (0.1, 3.1), 1.8, 0.1),
    "plug that ends in a wide seat": ((0.9, 2.1), (0.4, 0.8), 1.5, 0.9),
}


def tapered_scene(name):
    """The packed trees of a seat and of what is in it, the root of one and the node of the other's wall."""
    (low, high), (narrow, wide), length = (TAPERED | LOOSE)[name][:3]
    profile = [(low, -1), (4, -1), (4, 1), (high, 1)], [(0, -length / 2), (narrow, -length / 2), (wide, length / 2)]
    seat, plug = asm.curves.polygon(profile[0]), asm.curves.polygon([*profile[1], (0, length / 2)])
    return walls_of(seat, plug, 0.4 * length)


def walls_of(seat, plug, half):
    """The packed trees of revolutions of two profiles, the root of one and the wall of the other, longer than that."""
    forest = forest_of(*(faces_of(asm.shapes.revolution(each)) for each in (seat, plug)))
    table, pool, faces, links, nodes, used = forest.arrays
    kinds, rows = tree_of(forest)
    second = np.arange(len(kinds)) >= forest.roots[1]
    is_wall = second & (kinds.face == NONE) & (rows.disc > 0.0) & (rows.half[:, 0] > half)
    (wall,) = np.flatnonzero(is_wall & (rows.rho == 0.0))
    return Forest(Store(table, pool), faces, links, nodes, used), int(forest.roots[0]), int(wall)


def distance_from_plug(points, name):
    """Of points from a plug about the z axis, negative inside of its wall."""
    _, (narrow, wide), length = (TAPERED | LOOSE)[name][:3]
    off, slope = np.hypot(points[:, 0], points[:, 1]), (wide - narrow) / length
    beyond = off - (0.5 * (narrow + wide) + slope * points[:, 2])
    wall = beyond / np.hypot(1.0, slope)
    # Where the nearest place on a ruling is beyond an end, the end's disc is nearer to the point than told by the wall.
    along = points[:, 2] + slope * beyond / (1.0 + slope * slope)
    end = np.clip(along, -0.5 * length, 0.5 * length)
    radius = 0.5 * (narrow + wide) + slope * end
    beside = np.hypot(np.maximum(off - radius, 0.0), points[:, 2] - end)
    return np.where(np.abs(along) > 0.5 * length, beside, wall)


@pytest.mark.parametrize("slope", [-1.0, -0.3, 1e-6, 0.6])
def test_the_section_of_a_cone(slope, cases):
    """All its points are within what is told, and one is nearly there: points of rulings in the plane."""
    rng = np.random.default_rng(4)
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    for _ in range(cases(20, 1000)):
        lean = 0.28 * rng.random() * np.append(direction(rng)[:2], 0.0)
        e, radius = np.append(rng.normal(scale=0.3, size=2), 0.0), rng.uniform(0.3, 1.0)
        axis = (lean + (0.0, 0.0, 1.0)) / np.hypot(1.0, np.linalg.norm(lean))
        first = np.cross(axis, (1.0, 0.0, 0.0))
        first /= np.linalg.norm(first)
        out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * np.cross(axis, first)
        # e + t axis + (radius + slope t) out is at height zero.
        t = -radius * out[:, 2] / (axis[2] + slope * out[:, 2])
        points = e + t[:, None] * axis + (radius + slope * t)[:, None] * out
        assert np.abs(points[:, 2]).max() < 1e-12
        far = np.linalg.norm(points, axis=1).max()
        told = farthest_of_section(tuple(e), tuple(lean), radius, slope)
        assert far - 1e-14 <= told <= far * (1.0 + 1e-4)


@pytest.mark.parametrize("name", TAPERED)
def test_the_room_of_tapered_shafts_is_less_than_the_distance(name, cases):
    """By samples of the seat's wall and rims, seen from the plug; only where it is near the seat none is told."""
    rng, roomy = np.random.default_rng(5), 0
    forest, seat, wall = tapered_scene(name)
    (low, high), (narrow, wide), length = TAPERED[name]
    angle, z = rng.uniform(0.0, 2.0 * np.pi, 8000), np.clip(rng.uniform(-1.3, 1.3, 8000), -1.0, 1.0)
    radius = 0.5 * (low + high) + 0.5 * z * (high - low)
    of_bore = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    lean = 0.06 if "end" in name else 0.03
    for _ in range(cases(60, 2000)):
        turn = leaning(rng, lean)
        # Toward where the seat gets wider.
        shift = np.array([*rng.normal(scale=0.01, size=2), rng.uniform(-0.05, 0.3) * (1.0 if high >= low else -1.0)])
        how, room = best_sleeve(forest, seat, wall, relative(turn, shift))
        least = distance_from_plug(turn.inv().apply(of_bore - shift), name).min()
        if room > 0.0:
            assert how >= BY_SLEEVE and room <= least + 1e-12
            roomy += 1
        else:
            # What is not told is near, or in the wall.
            assert least < 0.05
    assert roomy > 3


@pytest.mark.parametrize("name", TAPERED)
def test_no_way_takes_more_of_a_tapered_room_than_told(name, cases):
    """As of shafts: at any part of a way."""
    rng = np.random.default_rng(6)
    forest, seat, wall = tapered_scene(name)
    told = 0
    for k in range(cases(12, 400)):
        size = 10.0 ** -rng.uniform(0, 2)
        before = leaning(rng, 0.1), np.array([*rng.normal(scale=0.01, size=2), rng.uniform(-0.3, 0.3)])
        spin = Rotation.from_rotvec((0.0, 0.0, size * rng.normal() * (k % 2)))
        after = leaning(rng, 0.04 * size) * before[0] * spin, before[1] + size * rng.normal(scale=(0.05, 0.05, 0.3))
        poses = relative(*before), relative(*after)
        way = way_of(*poses, (0.0, 0.0, 0.3 * rng.normal()), 4.0, True)
        sag, _ = sleeve_sag(way, forest, seat, wall, BY_SLEEVE + 1)
        for how in range(BY_SLEEVE, BY_SLEEVE + 3):
            ends = min(sleeve_room(forest, seat, wall, pose, how) for pose in poses)
            if sag == np.inf or ends == -np.inf:
                continue
            rooms = [sleeve_room(forest, seat, wall, pose_at(way, s), how) for s in np.linspace(0.0, 1.0, 9)]
            assert min(rooms) >= ends - sag - 1e-13
            told += 1
    assert told > 5


@pytest.mark.parametrize("name", LOOSE)
def test_the_room_of_what_leans_far_is_less_than_the_distance(name, cases):
    """By samples, at leans up to where rulings all but lie across the bore; and it is told of what is in the seat."""
    rng, roomy, farthest = np.random.default_rng(7), 0, 0.0
    forest, seat, wall = tapered_scene(name)
    (low, high), _, _, lean = LOOSE[name]
    angle, z = rng.uniform(0.0, 2.0 * np.pi, 8000), np.clip(rng.uniform(-1.3, 1.3, 8000), -1.0, 1.0)
    radius = 0.5 * (low + high) + 0.5 * z * (high - low)
    of_bore = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    for _ in range(cases(100, 3000)):
        turn = leaning(rng, lean)
        shift = np.array([*rng.normal(scale=0.1, size=2), rng.uniform(-0.2, 0.4)])
        how, room = best_sleeve(forest, seat, wall, relative(turn, shift))
        if room > 0.0:
            least = distance_from_plug(turn.inv().apply(of_bore - shift), name).min()
            assert how >= BY_SLEEVE and room <= least + 1e-12
            roomy += 1
            farthest = max(farthest, turn.apply((0.0, 0.0, 1.0)) @ (0.0, 0.0, -1.0) + 1.0)
    assert roomy > 3 and farthest > 0.5 * (1.0 - np.cos(lean))


@pytest.mark.parametrize("name", LOOSE)
def test_no_way_takes_more_of_the_room_of_what_leans_far_than_told(name, cases):
    """The room over the cosine by which it is multiplied, along ways of any length."""
    rng, told, closest = np.random.default_rng(8), 0, 0.0
    forest, seat, wall = tapered_scene(name)
    node = node_at(forest.nodes, wall)
    axis, slope = np.array(node.axes[0]), abs(slope_of(node))

    def spare(pose, how):
        cosine = np.array(pose.rotation).reshape(3, 3)[2] @ axis
        return sleeve_room(forest, seat, wall, pose, how) / cosine_of_rulings(cosine, slope)

    for k in range(cases(40, 600)):
        size = 10.0 ** -rng.uniform(0.5, 3)
        before = leaning(rng, LOOSE[name][3]), np.array([*rng.normal(scale=0.1, size=2), rng.uniform(-0.3, 0.3)])
        spin = Rotation.from_rotvec((0.0, 0.0, size * rng.normal() * (k % 2)))
        after = (
            Rotation.from_rotvec(size * direction(rng)) * before[0] * spin,
            before[1] + size * rng.normal(scale=(0.1, 0.1, 0.3)),
        )
        poses = relative(*before), relative(*after)
        way = way_of(*poses, (0.0, 0.0, 0.3 * rng.normal()), 4.0, True)
        for how in range(BY_SLEEVE, BY_SLEEVE + 3):
            sag, _ = sleeve_sag(way, forest, seat, wall, how)
            if sag == np.inf or min(sleeve_room(forest, seat, wall, pose, how) for pose in poses) == -np.inf:
                continue
            # Not only the lesser of both ends, but their chord.
            start, end = (spare(pose, how) for pose in poses)
            parts = np.linspace(0.0, 1.0, 9)
            below = max((1.0 - s) * start + s * end - spare(pose_at(way, s), how) for s in parts)
            assert below <= sag + 1e-12
            closest = max(closest, below / sag)
            told += 1
    # Not a bound that nothing comes near; of what is as steep as its countersink, it is one of products of bounds.
    assert told > 5 and (closest > 0.01 or "countersink" in name)


def test_a_least_gap_is_kept_on_ways_that_lean_more_than_at_their_ends():
    """The cosine by which the room is multiplied falls in between: a wide bore's room times that is less than asked."""
    wide, length, shaft = 300.0, 2.2, 0.3
    seat = asm.curves.polygon([(wide, -1), (wide + 10, -1), (wide + 10, 1), (wide, 1)])
    pin = asm.curves.polygon([(0, -length / 2), (shaft, -length / 2), (shaft, length / 2), (0, length / 2)])
    forest, plate, wall = walls_of(seat, pin, 0.4 * length)
    kept, asked = 0, 0
    for size in (0.02, 0.05, 0.1, 0.2, 0.4):
        # The axis goes around a fixed one, and leans most in the middle of the way.
        around = np.array([np.sin(0.5), 0.0, np.cos(0.5)])
        most = Rotation.from_rotvec((0.0, 0.9, 0.0))
        turns = [Rotation.from_rotvec(part * size * around) * most for part in (-0.5, 0.5)]
        poses = [relative(turn, (0.0, 0.0, 0.0)) for turn in turns]
        way = way_of(*poses, (0.0, 0.0, 0.0), length, True)
        for how in range(BY_SLEEVE, BY_SLEEVE + 3):
            ends = [sleeve_room(forest, plate, wall, pose, how) for pose in poses]
            least = min(sleeve_room(forest, plate, wall, pose_at(way, s), how) for s in np.linspace(0.0, 1.0, 33))
            for gap in min(ends) * (1.0 - 10.0 ** -np.linspace(0.5, 6.0, 12)):
                asked += 1
                nodes, gaps = Parted(plate, wall, how), (ends[0] - gap, ends[1] - gap)
                if stays_apart(forest, nodes, way, (0.0, 0.0, 1.0), gaps):
                    assert least >= gap - 1e-12 * wide
                    kept += 1
    # Small gaps are proven, and gaps as large as the room is at the ends are not.
    assert 0.1 * asked < kept < 0.9 * asked
