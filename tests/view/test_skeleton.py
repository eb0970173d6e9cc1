"""Links and joints: rods between the places that are held, arrows where an axis matters."""

from __future__ import annotations

import colorsys
from itertools import combinations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.joints import (
    Cylindrical,
    Fixed,
    Parallel,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from assembly.constraints.model.placements import Angle, Distance, PointOnLine, PointOnPlane
from assembly.view.item import Stations
from assembly.view.marks import ball, stick
from assembly.view.picture import draw
from assembly.view.skeleton import held_points, joint_tips, link_mesh

ROD = 0.014
SIDEWAYS = {"z": (0.0, 1.0, 0.0)}


def item(picture, *path):
    return next(i for i in picture.items if i.path == path)


def parts(picture, name):
    return {i.path[2] for i in picture.items if i.path[:2] == ("joints", name)}


def center(thing):
    return thing.matrix[:3, 3]


def is_covered(points, start, end, radius):
    """Whether points (n, 3) lie on the rod of that radius with round ends, from one end to the other."""
    way = end - start
    along = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    off = np.linalg.norm(points - start - along[:, None] * way, axis=1)
    # Its ends are the middles of balls, so vertices lie beside both, and none is farther off than the radius.
    return abs(off.max() - radius) < 1e-9 * radius and np.ptp(along) > 1.0 - 1e-9


def test_bodies_are_rods_between_their_joints(four_bar):
    picture = draw(four_bar)
    at = {name: center(item(picture, "joints", name, "ball")) for name in ("crank", "cross", "ball", "rocker")}
    scale = np.linalg.norm(at["rocker"] - at["crank"]) / 5.0
    for body, ends in {"blue": "crank cross", "green": "rocker ball", "ground": "crank rocker"}.items():
        start, end = (at[name] for name in ends.split())
        assert is_covered(item(picture, "bodies", body).points, start, end, ROD)
    # The coupler's grasp point is on the rod between its joints: three places in a line.
    assert is_covered(item(picture, "bodies", "orange").points, at["cross"], at["ball"], ROD)
    grasp = center(item(picture, "targets", "target 1", "point"))
    assert grasp == pytest.approx(0.5 * (at["cross"] + at["ball"]), abs=1e-13)
    # Where the world has them: the ball is at (5, 0, 3).
    assert (at["ball"] - at["crank"]) / scale == pytest.approx([5.0, 0.0, 3.0], abs=1e-13)
    # The ground is gray.
    assert np.ptp(item(picture, "bodies", "ground").color) < 0.1


def test_arrows_of_the_four_bar(four_bar):
    picture = draw(four_bar)
    assert parts(picture, "crank") == parts(picture, "rocker") == {"ball", "axis"}
    assert parts(picture, "cross") == {"ball", "axis", "other axis"}
    assert parts(picture, "ball") == {"ball"}
    ways = {("crank", "axis"): 2, ("rocker", "axis"): 1, ("cross", "axis"): 2, ("cross", "other axis"): 1}
    for (name, which), k in ways.items():
        arrow = item(picture, "joints", name, which)
        points = arrow.points - center(arrow)
        assert np.abs(np.delete(points, k, axis=1)).max() < 0.02
        # Longer before its origin than behind it.
        assert points[:, k].max() == pytest.approx(0.14, abs=1e-12)
        assert points[:, k].min() == pytest.approx(-0.07, abs=1e-12)


def joined(joint, apart=(0.0, 0.0, 0.0), a=None, b=None, shape=None, style=None):
    """Names of what is drawn of a joint between two bodies whose frames are apart, and the picture."""
    one = asm.Body("one", shape, (-3, 0, 0), fixed=True)
    two = asm.Body("two", shape, np.array([3.0, 0, 0]) + apart)
    scene = asm.Assembly([one, two])
    scene.constrain(joint(one.frame(at=(3, 0, 0), **(a or {})), two.frame(at=(-3, 0, 0), **(b or {}))))
    picture = draw(scene, style=style)
    return parts(picture, scene.constraints[0].name), picture


@pytest.mark.parametrize(
    ("joint", "options", "expected"),
    [
        (Fixed, {}, {"ball", "axis"}),
        (Revolute, {}, {"ball", "axis"}),
        (lambda a, b: Revolute(a, b, axes="opposed"), {"b": {"z": (0, 0, -1)}}, {"ball", "axis"}),
        # Not yet together: both ends, both axes, and what is to vanish.
        (Revolute, {"apart": (0, 0, 1), "b": SIDEWAYS}, {"ball", "axis", "other ball", "other axis", "line"}),
        (Prismatic, {"apart": (0, 0, 1)}, {"ball", "axis", "other ball", "line"}),
        (Cylindrical, {}, {"ball", "axis"}),
        # Anywhere in one plane is together; off it is not.
        (Planar, {"apart": (1, 1, 0)}, {"ball", "axis"}),
        (Planar, {"apart": (1, 1, 1)}, {"ball", "axis", "other ball", "line"}),
        (Spherical, {"b": SIDEWAYS}, {"ball"}),
        (lambda a, b: Spherical(a, b, swing=0.5), {"b": SIDEWAYS}, {"ball", "axis", "other axis"}),
        (Universal, {"b": SIDEWAYS}, {"ball", "axis", "other axis"}),
        (lambda a, b: Distance(a, b, 1.0), {"apart": (0, 1, 0)}, {"ball", "other ball", "line"}),
        (lambda a, b: Distance(a, b, limits=(None, 2.0)), {"apart": (0, 1, 0)}, {"ball", "other ball", "line"}),
        # Directions without places: no line.
        (lambda a, b: Angle(a, b, 1.0), {"apart": (0, 1, 0)}, {"ball", "axis", "other ball", "other axis"}),
        (Parallel, {"apart": (0, 1, 0)}, {"ball", "axis", "other ball", "other axis"}),
        (lambda a, b: PointOnLine(b, a), {"apart": (0, 0, 1), "b": SIDEWAYS}, {"ball", "axis", "other ball", "line"}),
        (
            lambda a, b: PointOnLine(b, a, distance=1.0),
            {"apart": (1, 0, 0), "b": SIDEWAYS},
            {"ball", "axis", "other ball", "line"},
        ),
        (lambda a, b: PointOnPlane(b, a), {"b": SIDEWAYS}, {"ball", "axis"}),
    ],
)
def test_what_is_drawn_of_a_joint(joint, options, expected):
    assert joined(joint, **options)[0] == expected


def test_a_line_joins_what_is_apart():
    _, picture = joined(Prismatic, apart=(0.0, 0.0, 1.5))
    name = "prismatic one-two"
    a, b = (center(item(picture, "joints", name, which)) for which in ("ball", "other ball"))
    assert b - a == pytest.approx([0.0, 0.0, np.linalg.norm(b - a)], abs=1e-13)
    points = item(picture, "joints", name, "line").points
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((a[2], b[2]), abs=1e-13)
    assert np.abs(points[:, :2] - a[:2]).max() < ROD


def test_joints_hide_in_shapes_unless_asked_for():
    # A shape is no rod, and hides its joints.
    shape = asm.shapes.box(6.0, 1.0, 1.0)
    in_front = asm.view.Style(glyphs="in front")
    _, picture = joined(Revolute, shape=shape)
    assert not any(i.in_front for i in picture.items)
    assert all(i.hides == (i.kind == "joints") for i in picture.items)
    assert len(item(picture, "bodies", "one").mesh.vertices) == 24
    _, picture = joined(Revolute, shape=shape, style=in_front)
    assert all(i.in_front == (i.kind == "joints") for i in picture.items)
    assert not any(i.in_front for i in joined(Revolute, style=in_front)[1].items)
    assert not [i for i in joined(Revolute, style=asm.view.Style(glyphs="none"))[1].items if i.kind == "joints"]


def test_places_of_a_body():
    ground, body, other = asm.Body("ground", fixed=True), asm.Body("body"), asm.Body("other")
    solid = asm.Body("solid", asm.shapes.sphere(1.0))
    scene = asm.Assembly([ground, body, other, solid])
    scene.constrain(
        Revolute(ground.frame(), body.frame(at=(1, 2, 3)), "a"), Revolute(solid.frame(), other.frame(), "b")
    )
    held = held_points(scene)
    assert set(held) == {ground, body, other}
    # A single place is joined with the origin of the body.
    assert held[body].tolist() == [[1, 2, 3], [0, 0, 0]]
    assert (held[ground] == 0.0).all() and (held[other] == 0.0).all()
    scene.minimize(asm.PointDistance(body.point(4, 4, 4), target=(0, 0, 0)))
    assert held_points(scene)[body].tolist() == [[1, 2, 3], [4, 4, 4]]


def rods_of(points):
    """Pairs of points that a link's mesh joins: a rod's box has its middle halfway between its ends."""
    vertices = link_mesh(points, 1.0).vertices
    count = (len(vertices) - len(points) * len(ball().vertices)) // len(stick().vertices)
    boxes = vertices[: count * len(stick().vertices)].reshape(count, -1, 3)
    middles = 0.5 * (boxes.min(axis=1) + boxes.max(axis=1))
    every = list(combinations(range(len(points)), 2))
    halfway = np.array([0.5 * (points[i] + points[j]) for i, j in every])
    distance = np.linalg.norm(middles[:, None] - halfway, axis=2)
    # Rods have an even number of sides.
    assert distance.min(axis=1).max() < 1e-12
    return {every[k] for k in distance.argmin(axis=1)}


def test_links_with_three_and_more_places():
    triangle = np.array([[0, 0, 0], [0.5, 0, 0], [0.2, 0.6, 0.0]])
    assert rods_of(triangle) == {(0, 1), (0, 2), (1, 2)}
    # A comb: all hang together by the shortest rods.
    comb = np.array([[0, 0, 0], [0.31, 0, 0], [0.64, 0, 0], [0.99, 0, 0], [0.33, 0.2, 0], [0.61, -0.25, 0.1]])
    assert rods_of(comb) == {(0, 1), (1, 2), (2, 3), (1, 4), (2, 5)}
    # Twice the same place is one place, and a single one a ball.
    double = link_mesh(np.array([[0.1, 0, 0], [0.1, 0, 0]]), 0.5)
    assert np.linalg.norm(double.vertices - [0.1, 0, 0], axis=1) == pytest.approx(0.5 * ROD, abs=1e-15)


def test_short_links_have_small_joints():
    bodies = [asm.Body(str(k), position=(k, 0, 0), fixed=k == 0) for k in range(41)]
    scene = asm.Assembly(bodies)
    pairs = zip(bodies[:-1], bodies[1:], strict=True)
    scene.constrain(*(Revolute(a.frame(at=(0.5, 0, 0)), b.frame(at=(-0.5, 0, 0))) for a, b in pairs))
    picture = draw(scene)
    arrow = item(picture, "joints", "revolute 0-1", "axis")
    length = np.ptp((arrow.points - center(arrow))[:, 2])
    # A link is 1/20 of the scene's radius, 0.05; an arrow of full size would be 0.21.
    assert 0.05 < length < 0.11


def test_arrows_are_in_the_picture(four_bar):
    stations = Stations(four_bar.bodies, four_bar.q[None])
    tips = joint_tips(four_bar, stations, 10.0)
    assert len(tips) == 16
    # Those of the crank, on the world's z axis.
    assert tips[:2] == pytest.approx(np.array([[0, 0, -0.7], [0, 0, 1.4]]), abs=1e-14)
    lonely = asm.Assembly([asm.Body("a", fixed=True), asm.Body("b")])
    lonely.constrain(Revolute(lonely.bodies[0].frame(), lonely.bodies[1].frame()))
    assert np.isfinite(draw(lonely).eye).all()


def test_a_browser_shows_the_four_bar(four_bar, photo, tmp_path):
    asm.view.save_html(tmp_path / "four_bar.html", four_bar)
    pixels = photo(tmp_path / "four_bar.html", 600, 450)
    strong = np.ptp(pixels.astype(int), axis=2) > 70
    hues = np.array([360.0 * colorsys.rgb_to_hsv(*color)[0] for color in pixels[strong] / 255.0])
    rows, columns = np.nonzero(strong)
    middles = {}
    for name, hue in {"blue": 217.0, "orange": 30.0, "green": 145.0}.items():
        near = np.abs(hues - hue) < 20.0
        assert near.sum() > 150
        middles[name] = (np.median(columns[near]), np.median(rows[near]))
    # The crank is at the lower left, the coupler in the middle and higher, the rocker at the right.
    assert middles["blue"][0] < middles["orange"][0] < middles["green"][0]
    assert middles["orange"][1] < middles["blue"][1]
    # Joints are dark, and there are some.
    assert (pixels.max(axis=2) < 90).sum() > 100
