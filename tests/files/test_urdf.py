"""Robots from files against plain forward kinematics, written and read back, and texts that are no robots."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.errors import InputError
from assembly.files.primitives import primitives_of
from assembly.files.robot import UrdfError
from tests.files.robots import ARM, forward_kinematics

pytest.importorskip("yourdfpy")
# Poses of solves, to 1e-12 of a robot of 1,000 mm, and as much by products of matrices.
CLOSE = 1e-9


def read(tmp_path, text, name="robot.urdf", **options):
    path = tmp_path / name
    path.write_text(text)
    return asm.read_urdf(path, **options)


def driven(robot, values, unit=1000.0):
    """The solution with joints at values, slides in meters; mimics follow."""
    for name, value in values.items():
        joint = robot.joint(name)
        if isinstance(joint, asm.Revolute):
            joint.angle = value
        else:
            joint.slide = value * unit
    solution = robot.assembly().solve()
    assert solution.success
    return solution


def assert_same(robot, solution, places, unit=1000.0):
    for body in robot.bodies:
        matrix = solution.pose(body).matrix
        expected = places[body.name].copy()
        expected[:3, 3] *= unit
        np.testing.assert_allclose(matrix, expected, rtol=0, atol=CLOSE)


def test_poses_are_those_of_forward_kinematics(tmp_path):
    robot = read(tmp_path, ARM)
    assert [body.fixed for body in robot.bodies] == [True] + 5 * [False]
    zero = forward_kinematics(ARM, {})
    for body in robot.bodies[:-2]:
        expected = zero[body.name].copy()
        expected[:3, 3] *= 1000.0
        np.testing.assert_allclose(body.pose.matrix, expected, rtol=0, atol=CLOSE)
    rng = np.random.default_rng(5)
    for _ in range(5):
        values = {"shoulder": rng.uniform(-2, 2.5), "elbow": rng.uniform(-3, 3), "grip": rng.uniform(0, 0.1)}
        places = forward_kinematics(ARM, {**values, "roll": 0.1 - 0.5 * values["elbow"]})
        assert_same(robot, driven(robot, values), places)


@pytest.mark.parametrize("leader", ["continuous", "prismatic"])
@pytest.mark.parametrize("led", ["continuous", "prismatic"])
def test_what_mimics_follows(tmp_path, leader, led):
    """value = multiplier of the other one's + offset, in radians and meters; also when it is written and read again."""
    limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>'
        f'<joint name="j" type="{leader}"><parent link="a"/><child link="b"/>{limit}</joint>'
        f'<joint name="k" type="{led}"><parent link="b"/><child link="c"/><origin xyz="0 0.1 0"/>{limit}'
        '<mimic joint="j" multiplier="-0.7" offset="0.2"/></joint></robot>'
    )
    robot = read(tmp_path, text)
    places = forward_kinematics(text, {"j": 0.4, "k": -0.7 * 0.4 + 0.2})
    assert_same(robot, driven(robot, {"j": 0.4}), places)
    asm.write_urdf(tmp_path / "again.urdf", robot)
    again = asm.read_urdf(tmp_path / "again.urdf")
    assert_same(again, driven(again, {"j": 0.4}), places)


def test_limits_masses_and_shapes(tmp_path):
    robot = read(tmp_path, ARM)
    assert robot.joint("shoulder").limits == (-2.0, 2.5) and robot.joint("grip").limits == (0.0, 100.0)
    assert robot.joint("elbow").limits is None
    inertial = robot.inertials["base"]
    turn = Rotation.from_euler("x", 0.3).as_matrix()
    given = np.array([[1, 0.1, 0], [0.1, 2, 0], [0, 0, 2.5]])
    np.testing.assert_allclose(inertial.inertia, 1e6 * turn @ given @ turn.T, rtol=1e-12)
    np.testing.assert_allclose(inertial.center_of_mass, (0, 0, 100))
    assert inertial.mass == 5.0 and list(robot.inertials) == ["base"]
    assert robot.body("base").volume == pytest.approx(np.pi * 100.0**3, rel=1e-12)
    np.testing.assert_allclose(robot.body("base").center_of_mass, (0, 0, 50), atol=1e-9)
    kinds = {each.kind: each.lengths for each in primitives_of(robot.body("upper"))}
    assert kinds == {"cylinder": pytest.approx((40.0, 500.0)), "sphere": pytest.approx((50.0,))}
    # They overlap, so that their volumes do not add up.
    with pytest.raises(InputError, match="'upper' has pieces that meet"):
        _ = robot.body("upper").volume
    assert [face.name for face in robot.body("finger").faces][0].startswith("pad ")
    assert len({face.name for face in robot.body("upper").faces}) == 4
    meters = read(tmp_path, ARM, unit="m")
    assert meters.joint("grip").limits == (0.0, 0.1) and meters.body("base").volume == pytest.approx(np.pi * 1e-3)


def test_a_robot_that_is_written_is_the_same_robot(tmp_path):
    robot = read(tmp_path, ARM)
    again = tmp_path / "again.urdf"
    asm.write_urdf(again, robot)
    other = asm.read_urdf(again)
    assert other.name == "arm" and [body.name for body in other.bodies] == [body.name for body in robot.bodies]
    values = {"shoulder": 1.1, "elbow": -0.6, "grip": 0.03}
    np.testing.assert_allclose(driven(other, values).q, driven(robot, values).q, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(other.inertials["base"].inertia, robot.inertials["base"].inertia, rtol=1e-12)
    for one, two in zip(robot.bodies, other.bodies, strict=True):
        for piece, again in zip(*(primitives_of(body) if body.faces else () for body in (one, two)), strict=True):
            assert piece.kind == again.kind and again.lengths == pytest.approx(piece.lengths, rel=1e-12)
            np.testing.assert_allclose(again.center, piece.center, rtol=0, atol=1e-9)
    assert {joint.name: joint.limits for joint in robot.joints if hasattr(joint, "limits")} == {
        joint.name: pytest.approx(joint.limits) if joint.limits else None
        for joint in other.joints
        if hasattr(joint, "limits")
    }


@pytest.mark.parametrize("axes", ["aligned", "opposed"])
@pytest.mark.parametrize("backward", [False, True])
def test_scenes_are_written_whatever_way_their_joints_go(tmp_path, axes, backward):
    """Frames anywhere, joints from child to parent, axes opposed; links are where their joints' frames are."""
    rng = np.random.default_rng(7)
    ground = asm.Body("ground", fixed=True)
    link = asm.Body("link", asm.shapes.box(10.0, 20.0, 30.0), (1, 2, 3))
    slider = asm.Body("slider", asm.shapes.torus(5.0, 1.0), (4, 5, 6))
    sides = [body.frame(30.0 * rng.normal(size=3), rng.normal(size=3)) for body in (ground, link, link, slider)]
    one, two = (sides[1], sides[0]) if backward else (sides[0], sides[1])
    three, four = (sides[3], sides[2]) if backward else (sides[2], sides[3])
    hinge = asm.Revolute(one, two, "hinge", axes=axes, limits=(-1.0, 2.0))
    slide = asm.Prismatic(three, four, "slide", axes=axes, limits=(-50.0, 50.0))
    scene = asm.Assembly([slider, ground, link])
    scene.constrain(slide, hinge)
    path = tmp_path / "scene.urdf"
    asm.write_urdf(path, scene, density=1000.0)
    assert (tmp_path / "scene_slider.stl").exists() and not (tmp_path / "scene_link.stl").exists()
    text = path.read_text()
    hinge.angle, slide.slide = 0.7, -20.0
    solution = scene.solve()
    assert solution.success
    places = forward_kinematics(text[text.index("<robot") :], {"hinge": 0.7, "slide": -0.02})
    for body, frame in ((link, sides[1]), (slider, sides[3])):
        expected = places[body.name].copy()
        expected[:3, 3] *= 1000.0
        matrix = solution.pose(body).matrix.copy()
        matrix[:3, 3] = solution.pose(body).apply(frame.origin)
        np.testing.assert_allclose(matrix, expected, rtol=0, atol=CLOSE)
    # The mesh is drawn where the link's frame is, in meters.
    trimesh = pytest.importorskip("trimesh")
    center = trimesh.load(tmp_path / "scene_slider.stl").center_mass
    np.testing.assert_allclose(center, -1e-3 * sides[3].origin, rtol=0, atol=1e-7)
    robot = asm.read_urdf(path)
    assert robot.body("slider").picture is not None and not robot.body("slider").faces
    # 6 cm^3 of water weigh 6 g.
    assert robot.inertials["link"].mass == pytest.approx(6e-3, rel=1e-12)
    assert robot.inertials["slider"].mass == pytest.approx(2.0 * np.pi**2 * 5.0 * 1e-6, rel=1e-12)


def test_what_primitives_are():
    box, rod = asm.shapes.box(1.0, 2.0, 3.0), asm.shapes.solid_cylinder(1.0, 2.0)
    (found,) = primitives_of(asm.Body("box", box))
    assert found.kind == "box" and sorted(found.lengths) == pytest.approx([1.0, 2.0, 3.0], rel=1e-12)
    (found,) = primitives_of(asm.Body("rod", rod))
    assert found.kind == "cylinder" and found.lengths == pytest.approx((1.0, 2.0), rel=1e-12)
    for other in (
        asm.shapes.plate(4.0, 3.0, 1.0, [(0.0, 0.0, 0.5)]),
        asm.shapes.torus(2.0, 0.5),
        asm.shapes.extrusion(asm.NurbsCurve.polyline([(0, 0), (1, 0), (0, 1), (0, 0)]), 1.0),
        asm.shapes.cylinder(1.0, 2.0),
        asm.shapes.plane(1.0, 1.0),
    ):
        assert primitives_of(asm.Body("other", other)) is None


BAD = {
    "no xml": ("nonsense", "expected a URDF file"),
    "no links": ('<robot name="r"/>', "it has no links; expected a robot"),
    "two of a name": ('<robot name="r"><link name="a"/><link name="a"/></robot>', "two links have the same name"),
    "no name": ('<robot name="r"><link name=" "/></robot>', "a link has the name ' '; expected a nonempty string"),
    "two roots": (
        '<robot name="r"><link name="a"/><link name="b"/></robot>',
        r"links without a parent are \['a', 'b'\]",
    ),
    "no such link": (
        '<robot name="r"><link name="a"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
        "</robot>",
        "joint 'j' is on link 'b'; expected one of a",
    ),
    "two parents": (
        '<robot name="r"><link name="a"/><link name="b"/>'
        + 2 * '<joint name="{}" type="fixed"><parent link="a"/><child link="b"/></joint>'
        + "</robot>",
        "link 'b' has two parents; expected a tree",
    ),
    "a ring": (
        '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>'
        '<joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>'
        '<joint name="k" type="fixed"><parent link="c"/><child link="b"/></joint></robot>',
        r"links \['b', 'c'\] form a ring of joints",
    ),
    "type": (
        '<robot name="r"><link name="a"/><link name="b"/>'
        '<joint name="j" type="wobbly"><parent link="a"/><child link="b"/></joint></robot>',
        "joint 'j' has the type 'wobbly'; expected one of revolute",
    ),
    "axis": (
        '<robot name="r"><link name="a"/><link name="b"/>'
        '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 0"/></joint></robot>',
        "joint 'j': z is",
    ),
    "no limits": (
        '<robot name="r"><link name="a"/><link name="b"/>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>',
        "joint 'j' is revolute and has no limits",
    ),
    "limits the wrong way": (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><limit lower="1" upper="-1" effort="1" velocity="1"/></joint></robot>',
        "joint 'j': limits",
    ),
    "radius": (
        '<robot name="r"><link name="a"><collision><geometry><sphere radius="-1"/></geometry></collision></link>'
        "</robot>",
        "link 'a': radius is",
    ),
    "not finite": (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="a"/>'
        '<child link="b"/><origin xyz="nan 0 0"/></joint></robot>',
        "joint 'j' has the origin",
    ),
    "mimics by nothing": (
        '<robot name="r"><link name="a"/><link name="b"/><link name="c"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/></joint><joint name="k" type="continuous"><parent link="b"/>'
        '<child link="c"/><mimic joint="j" multiplier="0"/></joint></robot>',
        "joint 'k' mimics by 0 and 0; expected finite numbers, not by 0",
    ),
    "mimics nobody": (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
        '<child link="b"/><mimic joint="k"/></joint></robot>',
        "joint 'j' mimics 'k'; expected another joint that moves",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_name_what_is_wrong(tmp_path, case):
    text, message = BAD[case]
    if case == "two parents":
        text = text.format("j", "k")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(UrdfError, match=f"path is .*{message}"):
            read(tmp_path, text)


def test_damaged_files_end_in_an_error_or_a_robot(tmp_path):
    """A byte changed, or the rest cut off: no other exception."""
    rng = np.random.default_rng(11)
    ends = {"robot": 0, "error": 0}
    for _ in range(60):
        text = bytearray(ARM.encode())
        text[rng.integers(len(text))] = rng.integers(32, 127)
        if rng.random() < 0.3:
            del text[rng.integers(len(text)) :]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                read(tmp_path, text.decode())
                ends["robot"] += 1
            except InputError:
                ends["error"] += 1
    assert ends["robot"] > 5 and ends["error"] > 5


def test_scenes_that_are_no_robots(tmp_path):
    path = tmp_path / "robot.urdf"
    a, b, c = (asm.Body(name, asm.shapes.sphere(1.0), fixed=name == "a") for name in "abc")
    scene = asm.Assembly([a, b, c])
    scene.constrain(asm.Fixed(a, b))
    with pytest.raises(UrdfError, match=r"bodies \['c'\] are connected to the root by no joints"):
        asm.write_urdf(path, scene)
    scene.constrain(asm.Fixed(b, c), asm.Fixed(a, c))
    with pytest.raises(UrdfError, match="joint .* closes a loop at '[bc]'; expected a tree"):
        asm.write_urdf(path, scene)
    ball = asm.Assembly([a, b])
    ball.constrain(asm.Spherical(a.frame(), b.frame(), "ball"))
    with pytest.raises(UrdfError, match="'ball' is .*; expected Revolute, Prismatic"):
        asm.write_urdf(path, ball)
    slider = asm.Assembly([a, b])
    slider.constrain(asm.Prismatic(a.frame(), b.frame(), "slider"))
    with pytest.raises(UrdfError, match="joint 'slider' has limits from -inf to inf; expected finite ones"):
        asm.write_urdf(path, slider)
    with pytest.raises(InputError, match="expected a name that ends in .urdf"):
        asm.write_urdf(tmp_path / "robot.step", slider)
    with pytest.raises(TypeError, match="what is 3; expected a Robot or an Assembly"):
        asm.write_urdf(path, 3)
    planar = asm.Assembly([a, b])
    planar.constrain(asm.Planar(a.frame(), b.frame(), "table", x_limits=(-1.0, 1.0)))
    with pytest.raises(UrdfError, match="joint 'table' is planar with limits"):
        asm.write_urdf(path, planar)
    with pytest.raises(FileNotFoundError, match="no such file"):
        asm.read_urdf(tmp_path / "nothing.urdf")
    with pytest.raises(FileNotFoundError, match="a folder"):
        asm.read_urdf(tmp_path)
    with pytest.raises(InputError, match="unit is 'yard'"):
        asm.read_urdf(path, unit="yard")
    assert not path.exists()


@pytest.mark.parametrize("offset", [0.0, 1.5])
def test_mates_are_written_as_the_joints_they_are(tmp_path, offset):
    plate = asm.Body("plate", asm.shapes.plate(20, 20, 8, [(3, 0, 2)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(2, 14), position=(1, 2, 15))
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Insert(plate.face("hole 1"), pin.faces.cylinders(), "swivel", offset=offset, limits=(-1, 1)))
    asm.write_urdf(tmp_path / "robot.urdf", scene)
    robot = asm.read_urdf(tmp_path / "robot.urdf")
    assert robot.body("plate").picture is not None
    joint = robot.joint("swivel")
    assert isinstance(joint, asm.Revolute) and joint.limits == (-1.0, 1.0)
    joint.angle = 0.0
    scene.constraints[0].angle = 0.0
    # The link's origin is at the seat, with the axes of its body.
    again, solved = robot.assembly().solve().pose("pin"), scene.solve().pose(pin)
    assert np.abs(again.position - solved.apply(scene.constraints[0].seats.shank.center)).max() < CLOSE
    assert abs(again.quaternion @ solved.quaternion) == pytest.approx(1.0, abs=1e-12)


def test_meshes_of_names_that_make_one_file_name(tmp_path):
    """Each link has its own: "a b", "a_b" and "A_b" differ by what files do not tell apart."""
    cone = asm.shapes.revolution(asm.curves.polygon([(0, 0), (3, 0), (0, 4)]))
    ring = asm.shapes.revolution(asm.curves.polygon([(1, 0), (3, 0), (2, 4)]))
    rod = asm.shapes.revolution(asm.curves.polygon([(0, 0), (1, 0), (2, 4), (0, 4)]))
    bodies = [
        asm.Body(name, shape, fixed=name == "a b") for name, shape in (("a b", cone), ("a_b", ring), ("A_b", rod))
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Fixed(bodies[0], bodies[1]), asm.Fixed(bodies[0], bodies[2]))
    asm.write_urdf(tmp_path / "robot.urdf", scene)
    files = sorted(tmp_path.glob("*.stl"))
    assert len(files) == 3 and len({file.name.lower() for file in files}) == 3
    assert len({file.read_bytes() for file in files}) == 3
    text = (tmp_path / "robot.urdf").read_text()
    # One for what is seen, and one for what collides.
    assert all(text.count(f'filename="{file.name}"') == 2 for file in files)
