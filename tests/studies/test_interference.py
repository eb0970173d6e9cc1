"""Reports of interference: closed forms, random pairs against samples, what is said of joints, files, bad input."""

from __future__ import annotations

import csv
import importlib
import os
import subprocess
import sys
from math import inf, nan, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.studies.interference import report as search
from assembly.studies.interference.report import interference

SHAPES = asm.shapes
# By name: what the package has under this name is the function.
command = importlib.import_module("assembly.interference")
ROOT = Path(__file__).resolve().parents[2]
FOLDER = os.environ.get("ASSEMBLY_CAD_DATA")
HERE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
PLATE = SHAPES.plate(4.0, 4.0, 0.5, [(0.0, 0.0, 0.2)])
PIN = SHAPES.solid_cylinder(0.2, 2.0)


def body(name, shape, q=HERE):
    return asm.Body(name, shape, q[:3], q[3:])


def at(x, y=0.0, z=0.0):
    return (x, y, z, 1.0, 0.0, 0.0, 0.0)


def row(a, b, q, margin=1.0, **options):
    """The only row of two shapes, the second one at a pose; the same but for its order with the bodies exchanged."""
    found = [
        interference(bodies, margin=margin, **options)
        for bodies in ([body("a", a), body("b", b, q)], [body("b", b, q), body("a", a)])
    ]
    assert [len(one) for one in found] == [1, 1]
    first, second = found[0].rows[0], found[1].rows[0]
    assert first.bodies == ("a", "b") and second.bodies == ("b", "a")
    assert (first.kind, first.gap) == (second.kind, pytest.approx(second.gap, abs=1e-9))
    return first


# Shapes, the pose of the second one, what they are, and the gap.
BALL, SMALL, BOX = SHAPES.sphere(1.0), SHAPES.sphere(0.5), SHAPES.box(1.0, 1.0, 1.0)
ACROSS = (0.8, 0.0, 0.0, sqrt(0.5), sqrt(0.5), 0.0, 0.0)
BOWL = asm.Face(SHAPES.sphere(2.0), reversed=True)
CLOSED_FORMS = {
    "balls apart": (BALL, SMALL, at(1.6), "clear", 0.1),
    "balls touch": (BALL, SMALL, at(1.5), "touching", 0.0),
    "balls cross": (BALL, SMALL, at(1.4), "crossing", -0.1),
    "balls hardly cross": (BALL, SMALL, at(1.4999), "crossing", -1e-4),
    "balls at one place": (BALL, BALL, HERE, "crossing", -2.0),
    "boxes apart": (BOX, BOX, at(1.001, 0.2, 0.3), "clear", 1e-3),
    "boxes flush": (BOX, BOX, at(1.0, 0.2, 0.3), "touching", 0.0),
    "boxes meet at an edge": (BOX, BOX, at(1.0, 1.0, 0.3), "touching", 0.0),
    "boxes cross": (BOX, BOX, at(0.9, 0.2, 0.3), "crossing", -0.1),
    "boxes hardly cross": (BOX, BOX, at(0.9999, 0.2, 0.3), "crossing", -1e-4),
    "boxes at one place": (BOX, BOX, HERE, "crossing", -1.0),
    "cylinders apart": (SHAPES.solid_cylinder(0.5, 2), SHAPES.solid_cylinder(0.4, 2), at(1.0), "clear", 0.1),
    "cylinders cross": (SHAPES.solid_cylinder(0.5, 2), SHAPES.solid_cylinder(0.4, 2), at(0.8), "crossing", -0.1),
    "crossed cylinders": (SHAPES.solid_cylinder(0.5, 4), SHAPES.solid_cylinder(0.4, 4), ACROSS, "crossing", -0.1),
    "pin through a plate": (SHAPES.box(4.0, 4.0, 0.1), PIN, at(0.3, 0.2, 0.1), "crossing", -0.95),
    "pressed in": (SHAPES.plate(4.0, 4.0, 0.5, [(0.0, 0.0, 0.19)]), PIN, HERE, "crossing", -0.01),
    "ball in a bowl": (BOWL, SMALL, at(1.4), "clear", 0.1),
    "ball through a bowl": (BOWL, SMALL, at(1.6), "crossing", -0.1),
    "ball in a box": (SHAPES.box(4.0, 4.0, 4.0), SHAPES.sphere(0.25), at(0.2, 0.1), "enclosed", -1.55),
    "ball in a ring's tube": (SHAPES.torus(3.0, 1.0), SMALL, at(3.1), "enclosed", -0.4),
    "concentric balls": (BALL, SMALL, HERE, "enclosed", -0.5),
    "ball over a sheet": (SHAPES.plane(4.0, 4.0), SMALL, at(0.2, 0.0, -0.7), "clear", 0.2),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_closed_forms(name):
    *pair, kind, gap = CLOSED_FORMS[name]
    found = row(*pair)
    assert (found.kind, found.proved) == (kind, True)
    # Points of pairs are good to rounding, some units of the coordinates; walls that conform are found to less.
    assert found.gap == pytest.approx(gap, abs=1e-12)
    assert found.points.shape == (2, 3) and all(found.faces)
    if kind == "clear":
        assert found.gap - 1e-9 * 6.0 <= found.bound <= found.gap
        assert np.linalg.norm(found.points[1] - found.points[0]) == pytest.approx(gap, abs=1e-12)
    if name not in ("pin through a plate", "ball through a bowl"):
        assert (found.witness is not None) == (kind == "crossing")
    if kind in ("touching", "crossing"):
        assert found.bound == 0.0


def slotted(width):
    """A channel along z, open above, of a width."""
    corners = [(-2, -1), (2, -1), (2, 1), (width / 2, 1), (width / 2, 0), (-width / 2, 0), (-width / 2, 1), (-2, 1)]
    points = np.array(corners, float)
    sides = [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(points, np.roll(points, -1, 0), strict=True)]
    return SHAPES.extrusion(sides, 4.0)


def test_what_no_certificate_tells_is_not_proved():
    # No map opens two bores at once that two pins of one body fill.
    plate = SHAPES.plate(3.0, 2.0, 0.5, [(-0.9, 0.0, 0.3), (0.9, 0.0, 0.3)])
    pin = SHAPES.solid_cylinder(0.3, 0.8)
    pins = [f.transformed(translation=(x, 0.0, 0.0), name=f"{f.name} {x}") for x in (-0.9, 0.9) for f in pin]
    fit = row(plate, pins, HERE)
    assert (fit.kind, fit.proved) == ("touching", False)
    # A block fills a slot.
    fit = row(slotted(1.0), SHAPES.box(1.0, 1.0, 1.0), at(0.0, 0.7, 1.5))
    assert (fit.kind, fit.gap, fit.proved) == ("touching", 0.0, True)
    # Points in a sheet are of no body: that the surfaces cross is proven.
    sheet = row(SHAPES.plane(4.0, 4.0), SMALL, at(0.2, 0.0, 0.3))
    assert (sheet.kind, sheet.proved, sheet.witness) == ("crossing", True, None)


def test_radii_tell_where_very_many_points_are_nearest():
    # Points of a great circle, about no axis of the two: a search has no room to end.
    loose = row(SHAPES.plate(4.0, 4.0, 2.0, [(0.0, 0.0, 1.0)]), SMALL, HERE)
    assert (loose.kind, loose.proved) == ("clear", True) and loose.gap == pytest.approx(0.5, abs=1e-9)
    assert 0.5 - 1e-9 * 6.0 <= loose.bound <= loose.gap


@pytest.mark.parametrize("height", [1e-3, 1e-7])
def test_a_shoulder_over_its_bearing_is_nearer_than_the_wall_of_the_bore(height):
    # Points of the wall are 0.03 apart, all around: a search that is busy with these must not end there.
    bearing = SHAPES.plate(40.0, 40.0, 15.0, [(0.0, 0.0, 6.03)])
    profile = [(0, -30), (6, -30), (6, 7.5), (9, 7.5), (9, 14), (0, 14)]
    found = row(bearing, SHAPES.revolution(asm.curves.polygon(profile)), at(0.0, 0.0, height))
    assert found.gap == pytest.approx(height, abs=1e-10) and found.proved
    assert found.kind == ("clear" if height > 1e-6 * 60.0 else "touching")


TURNED = Rotation.from_rotvec([0.3, -0.5, 0.8])


@pytest.mark.parametrize("turn", [Rotation.identity(), TURNED])
def test_pins_in_bores_are_proved_about_their_axis(turn):
    def placed(shift, tilt=0.0):
        where = turn * Rotation.from_rotvec([tilt, 0.0, 0.0])
        return (*(turn.apply(shift) + (3.0, 1.0, 2.0)), *where.as_quat(scalar_first=True))

    plate = body("plate", SHAPES.plate(4.0, 4.0, 0.5, [(0.0, 0.0, 0.21)]), placed((0.0, 0.0, 0.0)))
    for off in (0.0, 0.004):
        (loose,) = interference([plate, body("pin", PIN, placed((off, 0.0, 0.3)))], margin=0.1)
        # Radii that bound are good to rounding, the nearest points to what Newton's method leaves.
        assert (loose.kind, loose.proved) == ("clear", True) and loose.gap == pytest.approx(0.01 - off, abs=1e-9)
        assert loose.gap - 1e-9 * 6.0 <= loose.bound <= loose.gap
    (fit,) = interference([plate, body("pin", PIN, placed((0.01, 0.0, 0.0)))])
    assert (fit.kind, fit.proved, fit.bound) == ("touching", True, 0.0)
    # In the plate's material, and leaning in the bore: no radius is between the two.
    (deep,) = interference([plate, body("pin", PIN, placed((0.02, 0.0, 0.0)))])
    assert deep.kind == "crossing" and deep.gap == pytest.approx(-0.01, abs=1e-9)
    (leaning,) = interference([plate, body("pin", PIN, placed((0.0, 0.0, 0.0), 0.2))])
    assert leaning.kind == "crossing" and leaning.proved


@pytest.mark.parametrize("turn", [Rotation.identity(), TURNED])
def test_bodies_that_fill_bores_are_proved_to_touch(turn):
    """Made slimmer by less than what is called touching, about the axis of the bore or the center of the seat."""

    def placed(name, shape, shift):
        return asm.Body(name, shape, turn.apply(shift) + (3.0, 1.0, 2.0), turn.as_quat(scalar_first=True))

    plate = placed("plate", SHAPES.plate(4.0, 4.0, 0.5, [(0.0, 0.0, 0.2), (1.0, 1.0, 0.4)]), (0.0, 0.0, 0.0))
    shell = [asm.Face(SHAPES.sphere(3.0)), asm.Face(SHAPES.sphere(2.0), reversed=True)]
    seat = placed("seat", shell, (0.0, 0.0, 0.0))
    # Sizes are 5.7 and 10.4: that part of them is called touching.
    for off, kind in ((0.0, "touching"), (2e-6, "touching"), (3e-5, "crossing")):
        for more in (0.0, off):
            pin = placed("pin", SHAPES.solid_cylinder(0.2 + more, 2.0), (off, 0.0, 0.3))
            (fit,) = interference([plate, pin])
            # A pin beside the axis of a bore of its own radius is in the wall on one side.
            assert fit.kind == kind and (fit.proved or kind == "crossing")
    (ball,) = interference([seat, placed("ball", SHAPES.sphere(2.0), (0.0, 0.0, 0.0))])
    assert (ball.kind, ball.proved) == ("touching", True)
    (ball,) = interference([seat, placed("ball", SHAPES.sphere(2.0001), (0.0, 0.0, 0.0))])
    assert ball.kind != "touching"


def test_a_plug_in_a_blind_hole_crosses_where_that_ends():
    block = [face for face in SHAPES.box(4.0, 4.0, 1.0) if face.name != "top"]
    top = next(face for face in SHAPES.plate(4.0, 4.0, 1.0, [(0.0, 0.0, 0.2)]) if face.name == "top")
    wall = asm.Face(SHAPES.cylinder(0.2, 0.4).transformed(translation=(0.0, 0.0, 0.3)), reversed=True, name="hole")
    disc = next(face for face in SHAPES.solid_cylinder(0.2, 0.2) if face.name == "top")
    floor = asm.Face(disc.surface, outer=disc.outer, name="floor")
    blind = [*block, top, wall, floor]
    # The pin's end is at its middle less 1.
    assert row(blind, PIN, at(0.0, 0.0, 1.1)).kind == "touching"
    for radius in (0.15, 0.2):
        pin = body("pin", SHAPES.solid_cylinder(radius, 2.0), at(0.0, 0.0, 1.05))
        (deep,) = interference([body("block", blind), pin])
        assert deep.kind == "crossing" and deep.proved
        # Where it fits tightly it is apart from the wall nowhere on its way out.
        assert deep.gap == pytest.approx(-0.05, abs=1e-9)
        assert deep.points[:, 2] == pytest.approx([0.1, 0.05], abs=1e-9)
    # In a box without a hole.
    through = row(SHAPES.box(4.0, 4.0, 2.0), PIN, at(0.0, 0.0, 1.5))
    assert through.kind == "crossing" and through.proved


def test_what_is_inside_is_told_wherever_the_margin_ends():
    box, ball = SHAPES.box(40.0, 40.0, 40.0), SHAPES.sphere(0.25)
    found = row(box, ball, at(1.0, 2.0, 3.0), margin=0.0)
    assert found.kind == "enclosed" and found.proved and found.gap == pytest.approx(-16.75, abs=1e-11)
    # In the material beside a corner that leads inward the nearest place is an edge, between whose faces it is.
    corners = np.array([(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)], float)
    sides = [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(corners, np.roll(corners, -1, 0), strict=True)]
    angle = SHAPES.extrusion(sides, 4.0)
    middle = np.mean([np.mean(face.surface.bounding_box(), axis=0) for face in angle[-2:]], axis=0)
    inside = row(angle, ball, at(1.5, 1.5, middle[2]), margin=0.0)
    assert inside.kind == "enclosed" and inside.proved and inside.gap == pytest.approx(-(sqrt(0.5) - 0.25), abs=1e-11)
    # Over an edge that stands out, near enough for their boxes, and in the corner of the angle it is outside.
    for place in ((2.2, 2.2, middle[2]), (2.2, 3.0, middle[2]), (2.3, 2.2, middle[2] + 1.0)):
        outside = row(angle, SHAPES.sphere(0.1), at(*place), margin=0.2)
        assert (outside.kind, outside.proved) == ("clear", True)
    # In a bore, and in a ring's hole, nothing is in the material.
    assert len(interference([body("a", SHAPES.plate(4.0, 4.0, 2.0, [(0, 0, 1.0)])), body("b", ball)])) == 0
    assert len(interference([body("a", SHAPES.torus(3.0, 1.0)), body("b", ball)])) == 0


def test_the_margin_is_what_pairs_are_listed_to():
    balls = [body(name, SMALL, at(x)) for name, x in (("c", 0.0), ("b", 1.2), ("a", 2.3), ("d", 3.3), ("e", 4.2))]
    wide = interference(balls, margin=0.25)
    gaps = {("d", "e"): -0.1, ("a", "d"): 0.0, ("b", "a"): 0.1, ("c", "b"): 0.2}
    # The smallest gap first.
    assert [one.bodies for one in wide] == list(gaps)
    assert [one.gap for one in wide] == pytest.approx(list(gaps.values()), abs=1e-12)
    assert [one.kind for one in wide] == ["crossing", "touching", "clear", "clear"]
    for margin, count in ((0.15, 3), (0.05, 2), (0.0, 2)):
        assert len(interference(balls, margin=margin)) == count
    assert (wide.pairs, wide.margin, wide.is_complete) == (10, 0.25, True)
    # What boxes tell to be far is not searched.
    assert interference(balls).searched == 2


def test_equal_gaps_are_listed_by_names():
    # Coordinates without rounding.
    boxes = [body(name, BOX, at(x)) for name, x in (("z", 0.0), ("b", 1.0), ("a", 2.0))]
    report = interference(boxes)
    assert [(one.bodies, one.gap) for one in report] == [(("b", "a"), 0.0), (("z", "b"), 0.0)]
    assert str(report) == str(interference(boxes))


def test_touching_is_what_is_called_so():
    # The box's diagonal, the size of the scene, is 1.73.
    deep = at(1.0 - 5e-6, 0.2, 0.3)
    assert row(BOX, BOX, deep).kind == "crossing"
    assert row(BOX, BOX, deep, touching=1e-5).kind == "touching"
    # Points in common are no distance apart.
    assert row(BOX, BOX, at(1.0 - 1e-8, 0.2, 0.3)).gap == 0.0
    assert row(BOX, BOX, at(1.0 + 1e-8, 0.2, 0.3)).kind == "touching"
    assert row(BOX, BOX, at(1.0 + 1e-8, 0.2, 0.3), touching=1e-9).kind == "clear"


# Implicit functions of shapes: negative inside.
def _in_plate(p):
    outside = np.abs(p) - (1.0, 0.75, 0.1)
    return np.maximum(outside.max(axis=1), 0.35 - np.hypot(p[:, 0] - 0.3, p[:, 1] - 0.2))


SOLIDS = {
    "box": (SHAPES.box(1.0, 0.8, 0.6), lambda p: (np.abs(p) - (0.5, 0.4, 0.3)).max(axis=1)),
    "ball": (SHAPES.sphere(0.5), lambda p: np.linalg.norm(p, axis=1) - 0.5),
    "seed": (SHAPES.sphere(0.05), lambda p: np.linalg.norm(p, axis=1) - 0.05),
    "can": (
        SHAPES.solid_cylinder(0.4, 1.2),
        lambda p: np.maximum(np.hypot(p[:, 0], p[:, 1]) - 0.4, np.abs(p[:, 2]) - 0.6),
    ),
    "ring": (SHAPES.torus(0.6, 0.2), lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - 0.6, p[:, 2]) - 0.2),
    "plate": (SHAPES.plate(2.0, 1.5, 0.2, [(0.3, 0.2, 0.35)]), _in_plate),
    "egg": (SHAPES.ellipsoid(0.7, 0.4, 0.3), lambda p: np.linalg.norm(p / (0.7, 0.4, 0.3), axis=1) - 1.0),
}


def sampled(solid, rng):
    """Points on all faces of a body."""
    points = []
    for side in solid.faces:
        (u0, u1), (v0, v1) = side.face.surface.domain
        u, v = rng.uniform(u0, u1, 600), rng.uniform(v0, v1, 600)
        within = side.face.contains(u, v)
        points.append(side.face.surface.evaluate(u[within], v[within]))
    return np.concatenate(points)


def test_random_pairs_are_what_samples_say(cases):
    rng = np.random.default_rng(3)
    kinds, proved = [], []
    for _ in range(cases(30, 600)):
        (f, in_f), (g, in_g) = (SOLIDS[name] for name in rng.choice(list(SOLIDS), 2))
        shift = rng.uniform(-1.0, 1.0, 3) * rng.choice([0.3, 0.8, 1.4])
        turn = Rotation.random(random_state=int(rng.integers(1 << 30)))
        a, b = body("a", f), asm.Body("b", g, shift, turn.as_quat(scalar_first=True))
        on_a, on_b = sampled(a, rng), turn.apply(sampled(b, rng)) + shift
        b_in_a, a_in_b = in_f(on_b), in_g(turn.inv().apply(on_a - shift))
        near = float(cKDTree(on_a).query(on_b)[0].min())
        rows = interference([a, b], margin=0.3).rows
        kind = rows[0].kind if rows else "far"
        kinds.append(kind)
        if kind in ("far", "clear", "touching"):
            # The functions are exact to rounding.
            assert min(b_in_a.min(), a_in_b.min()) > -1e-9
        if kind == "far":
            assert near > 0.3
            continue
        # No certified bound is above what two points are apart.
        assert rows[0].bound <= near
        assert rows[0].gap <= near
        proved.append(rows[0].proved)
        if rows[0].witness is not None:
            at_witness = rows[0].witness[None]
            assert in_f(at_witness)[0] < 0.0 and in_g(turn.inv().apply(at_witness - shift))[0] < 0.0
        if kind == "enclosed":
            assert max(b_in_a.max(), -inf) < 0.0 or a_in_b.max() < 0.0
    assert {"far", "clear", "crossing", "enclosed"} <= set(kinds)
    assert all(proved)


def test_depths_of_boxes_part_them_and_no_less_does(cases):
    rng = np.random.default_rng(7)
    kinds = set()
    for k in range(cases(20, 600)):
        sizes = rng.uniform(0.2, 1.0, (2, 3))
        a = body("a", SHAPES.box(*sizes[0]))
        # Some are aligned, so that faces and edges are over each other.
        turn = (
            Rotation.random(random_state=int(rng.integers(1 << 30)))
            if k % 3
            else Rotation.from_rotvec(rng.integers(0, 4) * 0.5 * np.pi * np.eye(3)[k % 2])
        )
        q = np.concatenate([rng.uniform(-0.5, 0.5, 3), turn.as_quat(scalar_first=True)])
        found = interference([a, body("b", SHAPES.box(*sizes[1]), q)]).rows
        if not found or found[0].kind != "crossing":
            continue
        (one,) = found
        way = one.points[0] - one.points[1]
        depth = float(np.linalg.norm(way))
        assert one.proved and one.gap == pytest.approx(-depth, abs=1e-13)
        # Both points are on their bodies, and what the names tell they are on is of the same kind.
        for point, name, shape, pose in zip(one.points, one.faces, (0, 1), (HERE, q), strict=True):
            at_rest = Rotation.from_quat(pose[3:], scalar_first=True).inv().apply(point - pose[:3])
            assert np.abs(at_rest / (0.5 * sizes[shape])).max() == pytest.approx(1.0, abs=1e-9)
            kinds.add(name.split()[0])
        for part, kind in ((1.0 - 1e-4, "crossing"), (1.0 + 1e-4, "clear")):
            moved = q + np.concatenate([part * way, np.zeros(4)])
            (after,) = interference([a, body("b", SHAPES.box(*sizes[1]), moved)], margin=1.0).rows
            assert after.kind == kind
            assert after.gap == pytest.approx((part - 1.0) * depth, abs=1e-9)
    assert kinds == {"face", "edge", "vertex"}


def test_what_constraints_say_of_pairs():
    balls = [body(name, SMALL, at(x)) for name, x in zip("abcde", np.arange(5.0), strict=True)]
    ground = asm.Body("ground", fixed=True)
    scene = asm.Assembly([ground, *balls])
    a, b, c, d, e = balls
    scene.constrain(asm.Spherical(a.frame((0.5, 0, 0)), b.frame((-0.5, 0, 0)), "joint"))
    scene.constrain(asm.Contact(b, c, "contact"), asm.Clearance([c, d, e], exclude=[(c, d)]))
    report = interference(scene)
    assert {row.bodies: row.relation for row in report} == {
        ("a", "b"): "joined",
        ("b", "c"): "contact",
        ("c", "d"): "excluded",
        ("d", "e"): "free",
    }
    assert report.without_shape == ("ground",)


def test_poses_are_those_of_a_solution_or_rows():
    a, b = body("a", SMALL), body("b", SMALL, at(3.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b, "touch"))
    solution = scene.solve()
    assert len(interference(scene)) == 0
    (touch,) = interference(scene, solution).rows
    assert touch.kind == "touching" and touch.relation == "contact"
    rows = solution.q.copy()
    rows[:, :3] *= 0.5
    (crossing,) = interference(scene, rows).rows
    between = float(np.linalg.norm(rows[1, :3] - rows[0, :3]))
    assert crossing.kind == "crossing" and crossing.gap == pytest.approx(between - 1.0, abs=1e-9)


def test_pairs_that_there_was_no_time_for_are_undecided(monkeypatch):
    balls = [body(name, SMALL, at(x)) for name, x in zip("abc", (0.0, 1.1, 2.2), strict=True)]
    report = interference(balls, margin=0.2, time_limit=1e-9)
    assert [row.kind for row in report] == ["undecided"] * 2 and not report.is_complete
    assert [row.gap for row in report] == [None, None] and all(0.0 <= row.bound <= 0.1 for row in report)
    assert report.searched == 0 and "undecided" in str(report)
    # Time that is over before the search for crossings.
    crossing = [body("a", SMALL), body("b", SMALL, at(0.9))]
    over = iter([False, True])
    monkeypatch.setattr(search.Interruption, "is_over", lambda self: next(over, True))
    (row,) = interference(crossing, time_limit=1e6)
    assert (row.kind, row.gap, row.bound) == ("undecided", None, 0.0)


def test_a_report_is_a_table_and_a_file(tmp_path):
    report = interference([body("left", SMALL), body("a, b", SMALL, at(1.25)), body("far", SMALL, at(9.0))], margin=0.5)
    lines = str(report).splitlines()
    assert lines[0] == "3 pairs, within 0.5: 1 clear"
    assert lines[1].split() == ["bodies", "kind", "proved", "relation", "gap", "bound", "on"]
    assert lines[2].startswith("left / a, b  clear  proved  free      0.25   0.25")
    report.to_csv(tmp_path / "report.csv")
    with open(tmp_path / "report.csv", newline="", encoding="utf-8") as file:
        (read,) = list(csv.DictReader(file))
    assert (read["a"], read["b"], read["kind"], read["proved"]) == ("left", "a, b", "clear", "true")
    # All digits.
    assert float(read["gap"]) == report.rows[0].gap and float(read["bound"]) == report.rows[0].bound
    assert [float(read[key]) for key in ("ax", "ay", "az", "bx", "by", "bz")] == report.rows[0].points.ravel().tolist()
    assert str(interference([body("alone", SMALL)])) == "0 pairs, within 0: none"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"margin": -1.0}, "margin is -1; expected a length of at least 0"),
        ({"margin": nan}, "margin is nan; expected a finite real number"),
        ({"margin": "wide"}, "margin is 'wide'; expected a finite real number"),
        ({"touching": 0.1}, "touching is 0.1; expected a number from 0 to 0.001"),
        ({"time_limit": 0.0}, "time_limit is 0; expected a number of seconds above 0"),
        ({"poses": np.zeros((3, 7))}, r"poses has shape \(3, 7\); expected \(2, 7\)"),
        ({"poses": np.zeros((2, 7))}, r"poses\[0, 3:\] is"),
        ({"poses": [[nan, *HERE[1:]], HERE]}, r"poses\[0, 0\] is nan"),
    ],
)
def test_bad_input_is_said(options, said):
    scene = asm.Assembly([body("a", SMALL), body("b", SMALL, at(2.0))])
    with pytest.raises(asm.errors.InputError, match=said):
        interference(scene, **options)


def test_solutions_of_other_scenes_and_what_is_no_scene_are_refused():
    scene, other = (asm.Assembly([body("a", SMALL), body("b", SMALL, at(2.0))]) for _ in range(2))
    with pytest.raises(asm.errors.InputError, match="poses is a solution of another scene"):
        interference(scene, other.solve())
    with pytest.raises(TypeError, match="bodies is 3; expected bodies"):
        interference(3)


def test_the_command_reads_a_file_and_says_whether_parts_cross(tmp_path, capsys):
    pytest.importorskip("OCP")
    file = tmp_path / "parts.step"
    asm.write_step(file, [body("base", BOX), body("lid", BOX, at(0.9)), body("knob", SMALL, at(2.0))])
    wanted = [str(file), "--margin", "0.5", "--csv", str(tmp_path / "rows.csv"), "--html", str(tmp_path / "rows.html")]
    assert command.main(wanted) == 1
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "3 pairs, within 0.5: 1 clear, 1 crossing"
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 3 and (tmp_path / "rows.html").exists()
    # In the file's millimeters or any other unit.
    assert command.main([str(file), "--margin", "50", "--unit", "um"]) == 1
    assert "-100" in capsys.readouterr().out
    asm.write_step(file, [body("base", BOX), body("lid", BOX, at(1.5))])
    assert command.main([str(file)]) == 0
    assert command.main([str(file), "--margin", "-1"]) == 2
    assert "margin is -1" in capsys.readouterr().err
    assert command.main([str(tmp_path / "none.step")]) == 2


def test_the_module_of_the_command_is_called_as_the_function():
    assert str(command([body("alone", SMALL)])) == "0 pairs, within 0: none"
    assert asm.Interference.__name__ == "Interference"


@pytest.mark.skipif(FOLDER is None, reason="ASSEMBLY_CAD_DATA names no folder with STEP files")
def test_an_assembly_of_a_cad_system_by_the_command(tmp_path):
    pytest.importorskip("OCP")
    file, rows = Path(FOLDER) / "as1-oc-214.stp", tmp_path / "rows.csv"
    call = [sys.executable, "-m", "assembly.interference", str(file), "--margin", "0.5", "--csv", str(rows)]
    ran = subprocess.run(call, capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert ran.returncode == 0 and ran.stderr == ""
    assert ran.stdout.splitlines()[0] == "153 pairs, within 0.5: 32 touching"
    with open(rows, newline="", encoding="utf-8") as read:
        found = {(line["a"], line["b"]): line for line in csv.DictReader(read)}
    # Bolts are in bores of their own radius, nuts and brackets lie on flat faces, as OCCT finds no volume in common.
    assert len(found) == 32 and {line["proved"] for line in found.values()} == {"true"}
    assert all(abs(float(line["gap"])) < 2.5e-4 for line in found.values())
