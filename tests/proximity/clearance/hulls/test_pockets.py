"""Pockets and bores in shafts: no sample of the shaft is in what goes into them, and what fits is told to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.hulls import pockets
from assembly.proximity.clearance.hulls.body_hulls import hulls_of_body, with_pockets
from assembly.proximity.clearance.hulls.prism import Prism
from assembly.proximity.clearance.hulls.scene import HullAnswers
from tests.proximity.clearance.hulls.test_face_hulls import polygon, ring, samples
from tests.proximity.clearance.scenes import at, direction, faces_of
from tests.studies.machined import turned_part

TOUCHING = 1e-7
RADIUS = 12.0


def wall_with(hole, length=80.0):
    """The wall of a shaft between two rings, with a hole in it; `hole` makes its loop of a map to (u, v)."""
    surface = asm.shapes.cylinder(RADIUS, length)
    middle = 0.5 * sum(surface.domain[1])

    def place(angle, height):
        """Where the surface is at an angle and a height."""
        low, high = surface.domain[0]

        def off(u):
            x, y, _ = surface.evaluate(u, middle)
            return (np.arctan2(y, x) - angle + np.pi) % (2.0 * np.pi) - np.pi

        guess = low + (high - low) * (angle / (2.0 * np.pi))
        step = (high - low) / 16.0
        return brentq(off, guess - step, guess + step, xtol=1e-15), middle + height

    low, high = middle - 0.5 * length + 2.0, middle + 0.5 * length - 2.0
    return asm.Face(surface, ring(surface, low), [*hole(place), ring(surface, high, up=False)], name="wall")


def keyway(half=3.0, low=-8.0, high=10.0):
    """A pocket between two planes x = -half and half, from one height to another, around the y axis."""

    def hole(place):
        angles = np.arccos(np.array([half, -half]) / RADIUS)
        return [polygon([place(angles[0], low), place(angles[0], high), place(angles[1], high), place(angles[1], low)])]

    return hole


def keyed_shaft(half=3.0, low=-8.0, high=10.0, floor=8.5):
    """The wall and the walls and the floor of its pocket, which reach above the shaft."""
    width, length, depth = 2.0 * half, high - low, RADIUS - floor
    box = asm.shapes.box(width, depth, length)
    pocket = [face for face in faces_of(box) if not (samples(face)[:, 1] > 0.49 * depth).all()]
    shift = np.array([0.0, floor + 0.5 * depth, 0.5 * (low + high)])
    inner = [
        asm.Face(face.surface.transformed(np.eye(3), shift), face.outer, face.holes, reversed=not face.reversed)
        for face in pocket
    ]
    ends = turned_part([(0, -38), (RADIUS, -38), (RADIUS, 38), (0, 38)])
    return (wall_with(keyway(half, low, high)), *inner, ends[0], ends[2])


def bored_shaft(radius=1.6, height=5.0):
    """The wall of a shaft with a bore along x through both sides, and the wall of the bore."""

    def hole(place):
        loops = []
        for side in (0.0, np.pi):
            t = np.linspace(0.0, 2.0 * np.pi, 81)
            angles = np.arcsin(radius * np.cos(t) / RADIUS) * (1.0 if side == 0.0 else -1.0)
            heights = height + radius * np.sin(t)
            uv = np.array([place(side + angle, z) for angle, z in zip(angles, heights, strict=True)])
            uv[-1] = uv[0]
            spline = make_interp_spline(np.linspace(0.0, 1.0, 81), uv, k=5)
            net = spline.c.copy()
            net[-1] = net[0]
            loops.append([asm.NurbsCurve(net if side else net[::-1], spline.t, 5)])
        return loops

    bore = asm.shapes.cylinder(radius, 2.0 * RADIUS)
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    inner = asm.Face(bore.transformed(turn, (0.0, 0.0, height)), name="bore", reversed=True)
    ends = turned_part([(0, -38), (RADIUS, -38), (RADIUS, 38), (0, 38)])
    return wall_with(hole), inner, ends[0], ends[2]


def piston(radius, height):
    """The same with a bore that ends in the shaft's wall."""
    wall, bore, *ends = bored_shaft(radius, height)
    surface = bore.surface

    def edge(side):
        """Where the bore comes to the shaft's wall."""
        low, high = surface.domain[0]
        u = np.linspace(low, high, 161)
        middle = 0.5 * sum(surface.domain[1])
        across = surface.evaluate(u, np.full(161, middle))[:, 1]
        v = middle + side * np.sqrt(RADIUS**2 - across**2)
        spline = make_interp_spline(u, v, k=5)
        spots = np.array([spline.t[k + 1 : k + 6].mean() for k in range(161)])
        return asm.NurbsCurve(np.column_stack([spots, spline.c]), spline.t, 5)

    loop = edge(-1.0), edge(1.0).reversed()
    return (wall, asm.Face(surface, [loop[0]], [[loop[1]]], name="bore", reversed=True), *ends)


def answer(first, second, pose):
    shapes = [faces_of(first), faces_of(second)]
    return HullAnswers(shapes, [(0, 1)], [0.0], np.array([at(0, 0, 0), pose]), TOUCHING).held(0)


def prisms_of(faces):
    hulls = with_pockets(faces_of(faces))
    assert hulls is not None
    return [prism for part, prism in hulls.hollows if isinstance(prism, Prism) and hulls.part_of[part] == 0]


def test_nothing_of_a_shaft_is_in_its_pocket(cases):
    rng = np.random.default_rng(3)
    for _ in range(cases(4, 100)):
        half, low, high = rng.uniform(0.5, 9.0), *rng.uniform((-30.0, 1.0), (-1.0, 30.0))
        shaft = keyed_shaft(half, low, high)
        (pocket,) = prisms_of(shaft)
        assert pocket.depth_of(samples(shaft[0])).max() <= 1e-9
        # All of the walls' sides, and its middle is deep within.
        inside = np.array([[0.0, RADIUS, 0.5 * (low + high)]])
        assert pocket.depth_of(inside)[0] == pytest.approx(min(half, 0.5 * (high - low)), abs=1e-6)
        # Beyond the axis it ends.
        assert pocket.depth_of(inside * (1.0, -1.0, 1.0))[0] < 0.0


def test_nothing_of_a_shaft_is_in_its_bore(cases):
    rng = np.random.default_rng(4)
    for _ in range(cases(2, 40)):
        radius, height = rng.uniform(0.5, 8.0), rng.uniform(-20.0, 20.0)
        shaft = bored_shaft(radius, height)
        found = prisms_of(shaft)
        # One on either side, and one through both.
        assert len(found) == 3
        for prism in found:
            assert prism.depth_of(samples(shaft[0])).max() <= 1e-9
        through = max(found, key=lambda prism: prism.depth_of(np.array([[0.0, 0.0, height]]))[0])
        assert through.depth_of(np.array([[0.0, 0.0, height]]))[0] == pytest.approx(radius, rel=1e-4)
        for side in (-1.0, 1.0):
            assert max(prism.depth_of(np.array([[side * RADIUS, 0.0, height]]))[0] for prism in found) > 0.99 * radius


def test_a_key_in_its_pocket_and_a_pin_across_a_shaft_are_told_of():
    shaft, key = keyed_shaft(), asm.shapes.box(6.0, 6.0, 18.0)
    told = answer(shaft, key, at(0, 8.5 + 3.0, 1.0))
    assert told is not None and told.verdict is Verdict.TOUCHING and told.depth <= TOUCHING
    smaller = answer(shaft, asm.shapes.box(5.9, 5.9, 17.9), at(0, 8.5 + 3.0, 1.0))
    assert smaller is not None and smaller.verdict is Verdict.CLEAR and smaller.bound <= 0.05 + 1e-12
    # Wider than the pocket, deeper than its floor, or in the shaft beside it, it is not.
    assert answer(shaft, asm.shapes.box(6.01, 6.0, 18.0), at(0, 8.5 + 3.0, 1.0)) is None
    assert answer(shaft, key, at(0, 8.49 + 3.0, 1.0)) is None
    assert answer(shaft, key, at(0, 8.5 + 3.0, 20.0)) is None
    across = np.r_[0.0, 0.0, 5.0, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]
    told = answer(bored_shaft(), asm.shapes.solid_cylinder(1.5, 40), across)
    assert told is not None and told.verdict is Verdict.CLEAR and 0.0 < told.bound <= 0.1
    assert answer(bored_shaft(), asm.shapes.solid_cylinder(1.61, 40), across) is None
    # A pin that ends within the shaft, too, and one beside the bore not.
    short = answer(bored_shaft(), asm.shapes.solid_cylinder(1.5, 20), across + np.r_[8.0, np.zeros(6)])
    assert short is not None and short.verdict is Verdict.CLEAR
    assert answer(bored_shaft(), asm.shapes.solid_cylinder(1.5, 40), across + np.r_[0, 0, 0.2, np.zeros(4)]) is None


def test_a_bore_across_a_shaft_reaches_no_farther_than_that():
    """Its ends counted as if they were flat: a piston with a bore for its pin seemed to be in its cylinder."""
    rng = np.random.default_rng(5)
    shaft = piston(3.0, 5.0)
    hulls, known = with_pockets(faces_of(shaft)), hulls_of_body(faces_of(shaft))
    bore = [part for part, face in enumerate(hulls.part_of) if shaft[face].name == "bore"]
    normals = np.array([*np.eye(3), *-np.eye(3), *(direction(rng) for _ in range(60))])
    points = samples(shaft[1])
    assert len(points) > 100 and np.hypot(*points[:, :2].T).max() <= RADIUS + 1e-6
    reach = hulls.reach(normals)[bore].max(axis=0)
    assert (points @ normals.T <= reach + 1e-9).all()
    # Where it is widest it is as wide as the shaft.
    along = np.array([(np.cos(0.2), np.sin(0.2), 0.0)])
    assert hulls.reach(along)[bore].max() < RADIUS + 1e-3 < RADIUS + 0.1 < known.reach(along)[bore].max()
    tube = turned_part([(RADIUS + 0.02, -50), (20, -50), (20, 50), (RADIUS + 0.02, 50)])
    told = answer(tube, shaft, at(0, 0, 3.0))
    assert told is not None and told.verdict is Verdict.CLEAR


def test_of_a_boundary_with_a_point_in_it_nothing_is_told(monkeypatch):
    """A curve that is a point is in no parts, however often these are halved."""
    whole = pockets.boundary_patches
    shaft = faces_of(bored_shaft(2.5, -7.0))

    def without_one(face, patches):
        return (block for block in whole(face, patches) if block.curve != 1)

    monkeypatch.setattr(pockets, "boundary_patches", without_one)
    assert with_pockets(shaft) is None


def test_what_is_no_pocket_is_none():
    """Without the walls nobody knows what a hole is; a shaft without holes has none."""
    wall, *walls = keyed_shaft()
    assert with_pockets((wall,)) is None
    assert with_pockets((wall, walls[0])) is None
    assert with_pockets(faces_of(asm.shapes.solid_cylinder(4.0, 40))) is None
