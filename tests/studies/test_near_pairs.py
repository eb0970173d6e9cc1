"""Rows of reports held against closed forms: random boxes, balls, pins in holes, nested bodies, thin plates.

Kinds, gaps and depths are those of the closed form, and what is not is not called proved; points lie on the named faces
and are as far apart as the gap says.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.studies.interference.report import interference

SHAPES = asm.shapes
# Nearest points are sought to 1e-9 of the size, which is 5 at most; those that are apart are good to rounding.
SAME, COMMON = 1e-9, 5e-9


def placed(name, shape, turn, shift):
    """A body at a place in a frame that is turned and moved."""
    return asm.Body(name, shape, turn.apply(shift) + (0.3, -0.2, 0.5), turn.as_quat(scalar_first=True))


TINY = 1e-10
DOT = asm.Face(SHAPES.sphere(TINY))


def check(a, b, expected, kind, always=True):
    """The row of two bodies is what a closed form says; where a search may have no room, by bounds at least."""
    report = interference([a, b], margin=10.0)
    (row,) = report.rows
    assert row.kind == kind
    if not row.proved and not always and kind == "clear":
        assert 0.4 * expected <= row.bound <= expected <= row.gap
        return row
    assert row.proved
    # Where a line of points touches the search has no room to end.
    assert row.gap == pytest.approx(expected, abs=SAME if always else 2e-6)
    between = np.linalg.norm(row.points[1] - row.points[0])
    same = COMMON if kind == "touching" else SAME
    assert between == pytest.approx(abs(row.gap), abs=same)
    for body, name, point in zip((a, b), row.faces, row.points, strict=True):
        # What is as near to an edge as edges of faces are to each other is on it.
        assert off_feature(body, name, point) < 1e-7
    if kind == "clear":
        assert expected - 1e-8 <= row.bound <= expected + 1e-14
    return row


def off_feature(body, name, point):
    """How far a point is from what a row calls its feature, at most: from a face, from both of an edge, from a body."""
    numbers = {side.face.name or f"face {k + 1}": side.face for k, side in enumerate(body.faces)}
    named = [body] if name.startswith("vertex") else [numbers[one] for one in re.findall(r"'([^']*)'", name)]
    at = np.array([*point, 1.0, 0.0, 0.0, 0.0])
    # To a ball about it; of points in the surface that is zero.
    return max(asm.proximity.distance(one, DOT, poses=(body.q, at)).upper for one in named)


def directions(rng):
    return Rotation.random(random_state=int(rng.integers(1 << 30)))


def test_random_boxes(cases):
    """Along the axes of both: the distance of corners, the least overlap, the least wall of a nested one."""
    rng, kinds = np.random.default_rng(7), set()
    for _ in range(cases(12, 1000)):
        turn, (one, other) = directions(rng), rng.uniform(0.3, 2.0, (2, 3))
        middle = rng.uniform(-1.0, 1.0, 3) * rng.choice([0.2, 1.0, 2.0])
        apart = np.abs(middle) - 0.5 * (one + other)
        walls = np.abs(0.5 * (one - other)) - np.abs(middle)
        is_nested = ((one > other).all() or (one < other).all()) and walls.min() > 0.0
        if is_nested:
            kind, gap = "enclosed", -float(walls.min())
        elif apart.max() > 0.0:
            kind, gap = "clear", float(np.linalg.norm(np.maximum(apart, 0.0)))
        else:
            kind, gap = "crossing", float(apart.max())
        kinds.add(kind)
        a = placed("a", SHAPES.box(*one), turn, np.zeros(3))
        check(a, placed("b", SHAPES.box(*other), turn, middle), gap, kind)
    assert kinds == {"clear", "crossing", "enclosed"}


def test_random_boxes_that_lie_on_each_other(cases):
    rng = np.random.default_rng(1)
    for _ in range(cases(5, 500)):
        turn, (one, other) = directions(rng), rng.uniform(0.3, 2.0, (2, 3))
        middle = rng.uniform(-0.5, 0.5, 3) * (one + other)
        k = rng.integers(3)
        middle[k] = 0.5 * (one + other)[k] * rng.choice([-1.0, 1.0])
        a = placed("a", SHAPES.box(*one), turn, np.zeros(3))
        check(a, placed("b", SHAPES.box(*other), turn, middle), 0.0, "touching")


def test_random_balls(cases):
    rng, kinds = np.random.default_rng(2), set()
    radii = rng.uniform(0.2, 1.0, 4)
    balls = [asm.Face(SHAPES.sphere(r)) for r in radii]
    for _ in range(cases(30, 1000)):
        (one, other), turn, way = rng.choice(4, 2, replace=False), directions(rng), rng.normal(size=3)
        r, s = radii[[one, other]]
        distance = rng.choice([rng.uniform(0.0, abs(r - s)), rng.uniform(abs(r - s), r + s), rng.uniform(r + s, 3.0)])
        way *= distance / np.linalg.norm(way)
        kind = "clear" if distance > r + s else "enclosed" if distance < abs(r - s) else "crossing"
        kinds.add(kind)
        gap = distance - (abs(r - s) if kind == "enclosed" else r + s)
        a = placed("a", balls[one], turn, np.zeros(3))
        check(a, placed("b", balls[other], turn, way), gap, kind)
        check(a, placed("b", balls[other], turn, way * (r + s) / distance), 0.0, "touching")
    assert kinds == {"clear", "crossing", "enclosed"}


def test_random_pins_in_holes(cases):
    """Off the middle by less than the play they are clear, by as much they touch along a line, by more they cross."""
    rng, proved, rows = np.random.default_rng(3), 0, 0
    for _ in range(cases(4, 300)):
        turn, r = directions(rng), rng.uniform(0.1, 0.6)
        play = r * 10.0 ** rng.uniform(-2.0, -0.7)
        plate = placed(
            "plate", SHAPES.plate(4.0, 3.0, 0.3, [(0.4, -0.2, r + play), (-1.3, 0.5, 0.3)]), turn, np.zeros(3)
        )
        angle, high = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.2, 0.2)
        for part, kind in ((0.0, "clear"), (0.6, "clear"), (1.0, "touching"), (1.4, "crossing")):
            off = part * play * np.array([np.cos(angle), np.sin(angle)])
            pin = placed("pin", SHAPES.solid_cylinder(r, 1.5), turn, np.array([0.4 + off[0], off[1] - 0.2, high]))
            # Lines all along which a pin is as near leave the search no room to end.
            proved += check(plate, pin, (1.0 - part) * play, kind, always=kind == "crossing").proved
            rows += 1
    assert proved > 0.8 * rows


def test_thin_plates(cases):
    """A ball over a plate of 0.01 or in it: as deep as the ball is below its nearer side."""
    rng = np.random.default_rng(4)
    thin = [side.face for side in asm.Body("plate", SHAPES.box(3.0, 2.0, 0.01)).faces]
    radii = rng.uniform(0.1, 0.5, 2)
    balls = [asm.Face(SHAPES.sphere(r)) for r in radii]
    for _ in range(cases(12, 400)):
        turn, k = directions(rng), rng.integers(2)
        height = rng.uniform(-2.0, 2.0) * radii[k]
        gap = abs(height) - 0.005 - radii[k]
        ball = placed("ball", balls[k], turn, np.array([0.3, 0.1, height]))
        check(placed("plate", thin, turn, np.zeros(3)), ball, gap, "clear" if gap > 0.0 else "crossing")


def test_nested_shells(cases):
    """A ball in the hollow of another one is outside of its material, and in its wall it is inside."""
    rng = np.random.default_rng(5)
    shell = [asm.Face(SHAPES.sphere(2.0), name="out"), asm.Face(SHAPES.sphere(1.5), reversed=True, name="in")]
    radii = rng.uniform(0.02, 0.15, 2)
    balls = [asm.Face(SHAPES.sphere(r)) for r in radii]
    for _ in range(cases(8, 400)):
        turn, k = directions(rng), rng.integers(2)
        r, way = radii[k], rng.normal(size=3)
        way /= np.linalg.norm(way)
        a = placed("a", shell, turn, np.zeros(3))
        for distance, kind in (
            (rng.uniform(0.1, 1.49 - r), "clear"),
            (rng.uniform(1.51 + r, 1.99 - r), "enclosed"),
            (1.5 - 0.5 * r, "crossing"),
            (1.5 + 0.5 * r, "crossing"),
        ):
            walls = [1.5 - distance - r, min(distance - 1.5, 2.0 - distance) - r]
            gap = {"clear": walls[0], "enclosed": -walls[1], "crossing": walls[0]}[kind]
            check(a, placed("b", balls[k], turn, distance * way), gap, kind)


def test_a_shaft_in_a_blind_bore_is_as_deep_as_it_is_in_the_floor(cases):
    rng = np.random.default_rng(6)
    for _ in range(cases(2, 60)):
        r, deep, turn = rng.uniform(0.1, 0.5), rng.uniform(0.01, 0.2), directions(rng)
        block = [face for face in SHAPES.box(4.0, 4.0, 1.0) if face.name != "top"]
        block += [face for face in SHAPES.plate(4.0, 4.0, 1.0, [(0.0, 0.0, r)]) if face.name == "top"]
        wall = SHAPES.cylinder(r, 0.4).transformed(translation=(0.0, 0.0, 0.3))
        disc = next(face for face in SHAPES.solid_cylinder(r, 0.2) if face.name == "top")
        block += [asm.Face(wall, reversed=True, name="hole"), asm.Face(disc.surface, outer=disc.outer, name="floor")]
        a = placed("block", block, turn, np.zeros(3))
        row = check(
            a, placed("pin", SHAPES.solid_cylinder(r, 2.0), turn, np.array([0.0, 0.0, 1.1 - deep])), -deep, "crossing"
        )
        assert "'floor'" in row.faces[0] and "'bottom'" in row.faces[1]
