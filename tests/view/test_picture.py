"""What is drawn, where it is placed, and what the eye sees of it."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.kinematics.pose import retract
from assembly.view.commands import commands
from assembly.view.item import FIELD_OF_VIEW
from assembly.view.picture import draw

TOUCHING, PENETRATING = (1.00, 0.72, 0.10), (0.95, 0.05, 0.65)


def item(picture, *path):
    return next(i for i in picture.items if i.path == path)


def center(thing):
    return thing.matrix[:3, 3]


def moved(scene, scale=1.0, twist=(0.0,) * 6):
    """The scene in another unit and at another place."""
    bodies = []
    for body in scene.bodies:
        row = retract(np.concatenate([scale * body.q[:3], body.q[3:]]), np.array(twist))
        shape = [asm.Face(side.face.surface.transformed(scale=scale), name=side.name) for side in body.faces]
        bodies.append(asm.Body(body.name, shape, row[:3], row[3:], body.fixed))
    return asm.Assembly(bodies)


def test_bodies_stand_where_the_solution_says(balls):
    solution = balls.solve()
    assert solution.success
    picture = draw(balls, solution)
    places = np.array([center(item(picture, "bodies", name)) for name in ("red", "green", "blue")])
    scale = np.linalg.norm(places[1] - places[0]) / 2.0
    apart = np.linalg.norm(solution.q[2, :3] - solution.q[0, :3])
    # Three balls' distances after one scaling: rounding of numbers near one.
    assert np.linalg.norm(places[2] - places[0]) == pytest.approx(scale * apart, abs=1e-13)
    start = draw(balls)
    places = np.array([center(item(start, "bodies", name)) for name in ("red", "green")])
    ratio = np.linalg.norm(item(start, "bodies", "red").matrix[:3, 0])
    assert places[1] - places[0] == pytest.approx(ratio * np.array([2.3, 0.0, 0.0]), abs=1e-13)
    assert [i.path[0] for i in start.items] == ["bodies"] * 3 + ["targets"] * 3


def test_contacts_are_balls_and_arrows(balls):
    solution = balls.solve()
    picture = draw(balls, solution)
    middle = 0.5 * (center(item(picture, "bodies", "red")) + center(item(picture, "bodies", "green")))
    for label in ("point", "other point"):
        ball = item(picture, "contacts", "red-green", label)
        # The solver's tolerance, in parts of the scene, is 1e-12 or so.
        assert center(ball) == pytest.approx(middle, abs=1e-10)
        assert ball.color == TOUCHING and ball.hides and not ball.in_front
    points = item(picture, "contacts", "red-green", "normal").points
    away = (points - center(item(picture, "bodies", "red"))) @ (solution.contacts["red-green"].normal)
    tip = points[away.argmax()] - middle
    assert tip / np.linalg.norm(tip) == pytest.approx(solution.contacts["red-green"].normal, abs=1e-9)
    assert np.linalg.norm(tip) > 0.05


def test_penetration_has_its_color():
    left = asm.Body("left", asm.shapes.sphere(1.0), fixed=True)
    right = asm.Body("right", asm.shapes.sphere(1.0), position=(1.5, 0.0, 0.0))
    scene = asm.Assembly([left, right])
    scene.constrain(asm.Contact(left, right))
    # Stopped where it stands, half in the other ball.
    stopped = scene.solve(max_iterations=0)
    assert stopped.contacts["left-right"].gap == pytest.approx(-0.5, abs=1e-12)
    picture = draw(scene, stopped)
    assert {i.color for i in picture.items if i.path[0] == "contacts"} == {PENETRATING}


def test_a_target_and_its_point(balls):
    picture = draw(balls)
    scale = np.linalg.norm(item(picture, "bodies", "red").matrix[:3, 0])
    point, target = (center(item(picture, "targets", "target 1", name)) for name in ("point", "target"))
    origin = center(item(picture, "bodies", "blue"))
    assert point - origin == pytest.approx(scale * np.array([0.0, 0.0, 1.0]), abs=1e-13)
    assert target - origin == pytest.approx(scale * np.array([0.2, -0.5, 2.0]), abs=1e-13)
    line = item(picture, "targets", "target 1", "line").points
    along = (target - point) / np.linalg.norm(target - point)
    assert np.ptp((line - point) @ along) == pytest.approx(np.linalg.norm(target - point), abs=1e-13)
    balls.objectives[0][1].target = (4.8, 0.5, 1.0)
    assert not [i for i in draw(balls).items if i.path[-1] == "line"]


@pytest.mark.parametrize("direction", [(0.5, -1.0, 0.35), (0.0, 0.0, 1.0), (0.0, 0.0, -2.0), (-1.0, 0.2, -0.3)])
def test_everything_is_in_view_and_fills_it(balls, direction):
    picture = draw(balls, direction=direction)
    assert picture.eye / np.linalg.norm(picture.eye) == pytest.approx(direction / np.linalg.norm(direction), abs=1e-14)
    points = np.concatenate([i.points for i in picture.items if i.path[0] == "bodies"])
    assert 0.9 < np.linalg.norm(points, axis=1).max() < 1.0 + 1e-12
    toward = picture.eye / np.linalg.norm(picture.eye)
    side = np.cross([0.0, 0.0, 1.0], toward)
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > 0.0 else np.array([1.0, 0.0, 0.0])
    depth = np.linalg.norm(picture.eye) - points @ toward
    half = np.tan(np.deg2rad(0.5 * FIELD_OF_VIEW))
    across, upright = points @ side / depth / half, points @ np.cross(toward, side) / depth / half
    assert depth.min() > 0.1
    fill = max(np.abs(across).max() / 1.4, np.abs(upright).max())
    assert 0.75 < fill < 1.0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_picture_knows_no_unit(balls, scale):
    here, there = draw(moved(balls)), draw(moved(balls, scale))
    for a, b in zip(here.items, there.items, strict=True):
        assert b.points == pytest.approx(a.points, abs=1e-13)
    assert there.eye == pytest.approx(here.eye, abs=1e-13)


def test_a_far_scene_looks_the_same(balls):
    here, there = draw(moved(balls)), draw(moved(balls, 1.0, (1e6, -2e6, 3e5, 0.0, 0.0, 0.0)))
    for a, b in zip(here.items, there.items, strict=True):
        # Coordinates of 1e6 are rounded to 1e-10.
        assert b.points == pytest.approx(a.points, abs=1e-9)
        # What the browser rounds to single precision is small: each body about its own middle, then its place.
        assert np.abs(b.mesh.vertices).max() < 2.0 and np.abs(b.matrix).max() < 2.0


def test_colors():
    shape = asm.shapes.sphere(1.0)
    names = ["red", "part", "Green ", "other part", "blue"]
    bodies = [asm.Body(name, shape, (3.0 * k, 0, 0)) for k, name in enumerate(names)]
    picture = draw(asm.Assembly([*bodies, asm.Body("base", shape, (0, 5, 0), fixed=True)]))
    colors = [i.color for i in picture.items]
    assert [int(np.argmax(colors[k])) for k in (0, 2, 4)] == [0, 1, 2]
    assert len(set(colors)) == 6
    # More bodies than colors take them again.
    crowd = draw(asm.Assembly([asm.Body(str(k), shape, (3.0 * k, 0, 0)) for k in range(12)])).items
    assert len({i.color for i in crowd}) == 9
    free = draw(asm.Assembly([asm.Body("red", shape)])).items[0].color
    fixed = draw(asm.Assembly([asm.Body("red", shape, fixed=True)])).items[0].color
    assert np.ptp(fixed) < np.ptp(free)


def test_a_body_without_a_shape_is_a_mark():
    scene = asm.Assembly([asm.Body("a"), asm.Body("b", position=(1.0, 2.0, 3.0))])
    picture = draw(scene)
    assert center(picture.items[1]) == pytest.approx(-center(picture.items[0]), abs=1e-15)
    lonely = draw(asm.Assembly([asm.Body("a", position=(7.0, 8.0, 9.0))]))
    assert center(lonely.items[0]) == pytest.approx(np.zeros(3), abs=0)
    assert np.isfinite(lonely.eye).all()


def test_ellipsoids(balls):
    axes = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    whole = Ellipsoid((1.0, -3.0, 2.0), axes, (2.0, 0.5, 1.0))
    line = Ellipsoid((1.0, 3.0, 2.0), axes, (0.0, 1.5, 0.0), (0.9, 0.1, 0.1))
    picture = draw(balls, ellipsoids=[whole, line])
    red = item(picture, "bodies", "red")
    scale = np.linalg.norm(red.matrix[:3, 0])
    solid = item(picture, "ellipsoids", "ellipsoid 1", "solid")
    points = (solid.points - center(red)) / scale
    # The equation of the ellipsoid, with squares of 2-fold coordinates.
    assert (((points - whole.center) @ axes / whole.lengths) ** 2).sum(axis=1) == pytest.approx(1.0, abs=1e-12)
    assert 0.0 < solid.opacity < 1.0
    # Its axes end on it.
    for k in range(3):
        rod = item(picture, "ellipsoids", "ellipsoid 1", f"axis {k + 1}")
        along = ((rod.points - center(red)) / scale - whole.center) @ axes[:, k]
        assert (along.min(), along.max()) == pytest.approx((-whole.lengths[k], whole.lengths[k]), abs=1e-12)
    # What is flat has a little thickness, and no axis where it has no length.
    flat = (item(picture, "ellipsoids", "ellipsoid 2", "solid").points - center(red)) / scale - line.center
    assert np.abs(flat @ axes[:, 1]).max() == pytest.approx(1.5, abs=1e-12)
    assert 0.0 < np.abs(flat @ axes[:, [0, 2]]).max() < 0.01 / scale
    parts = [i.path[1:] for i in picture.items if i.path[0] == "ellipsoids"]
    assert parts[4:] == [("ellipsoid 2", "solid"), ("ellipsoid 2", "axis 2")]
    assert item(picture, "ellipsoids", "ellipsoid 2", "solid").color == (0.9, 0.1, 0.1) != solid.color
    # All in the frame, which is wider than that of the balls.
    assert np.linalg.norm(solid.points, axis=1).max() < 1.0 + 1e-3
    assert scale < np.linalg.norm(item(draw(balls), "bodies", "red").matrix[:3, 0])
    assert len(draw(balls, ellipsoids=whole).items) == len(draw(balls).items) + 4


def test_what_is_half_transparent_hides_nothing(balls):
    picture = draw(balls, ellipsoids=Ellipsoid((0, 0, 0), np.eye(3), (1, 1, 1)))
    materials = {c["path"].split("/")[-1]: c["object"]["materials"][0] for c in commands(picture) if "object" in c}
    assert materials["solid"]["transparent"] and not materials["solid"]["depthWrite"]
    assert materials["solid"]["opacity"] == pytest.approx(0.35, abs=0)
    assert not any("transparent" in materials[name] for name in ("red", "axis 1", "target"))


def test_the_ground_of_a_mechanism_is_gray():
    bodies = [asm.Body("base", fixed=True), asm.Body("link"), asm.Body("green", position=(1, 0, 0), fixed=True)]
    base, link, green = (i.color for i in draw(asm.Assembly(bodies)).items)
    assert np.ptp(base) < 0.1 < np.ptp(green) < np.ptp(link)
    assert int(np.argmax(green)) == 1


def test_bad_input(balls):
    with pytest.raises(TypeError, match="scene is 'x'; expected an Assembly"):
        draw("x")
    with pytest.raises(TypeError, match="solution is 3; expected a Solution"):
        draw(balls, 3)
    with pytest.raises(ValueError, match="scene has no bodies"):
        draw(asm.Assembly())
    with pytest.raises(ValueError, match=r"direction is \[0.0, 0.0, 0.0\]"):
        draw(balls, direction=(0, 0, 0))
    with pytest.raises(TypeError, match="ellipsoids is 3; expected an Ellipsoid or several"):
        draw(balls, ellipsoids=3)
    other = asm.Assembly([asm.Body("elsewhere", asm.shapes.sphere(1.0))])
    with pytest.raises(ValueError, match="expected one of 'red', 'green', 'blue'"):
        draw(other, balls.solve())
