"""OndselSolver: a crank and slider at the poses that it wrote, and mechanisms of its example files in closed form.

`testapp/MBDyn/CrankSlider2`: bodies, markers and joints as in its .asmt file, poses as in its .mov file (a row a
hundredth of a second). The crank's turn is integrated there, to some 1e-8: it is read off the crank's own matrix, and
everything else is compared at that turn, to what its solver leaves with an error tolerance of 1e-8: 2e-8 m, 1e-7 rad.

Of `Schmidt_Coupling`, `Gears`, `rackscrew` and of cams with followers the mechanism is meant; dimensions are ours.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest

import assembly as asm

CLOSE = 1e-12

# Time [s]; of the crank (node 3) cosine and sine; its place; the rod's place (node 2), cosine and sine of its turn
# backward; x of the slider (node 4). Rows of CrankSlider2.mov.
MOV = (
    (
        0.01,
        (0.99999987500000265, 0.00049999997915400895),
        (0.21112813405423275, 0.16001056406790645),
        (0.011666019357952221, 0.15997090012001136),
        (0.99999998380000121, 0.00017999999248361696),
        -0.18122391220152129,
    ),
    (
        0.05,
        (0.99992187602318272, 0.012499674006899933),
        (0.21112648608248349, 0.16026409479097811),
        (0.011673932166186922, 0.1592725220255464),
        (0.99998987547885754, 0.0044998821961138077),
        -0.18121436522601106,
    ),
    (
        0.10,
        (0.99875026043296211, 0.049979168511395319),
        (0.21110173203866725, 0.16105596665658747),
        (0.011792782506125263, 0.15709122439871931),
        (0.99983812187052157, 0.017992499949371181),
        -0.18107098152384296,
    ),
    (
        0.14,
        (0.99520184206971907, 0.097843208967398218),
        (0.21102676059471892, 0.16206724463312316),
        (0.012152655612960793, 0.15430554865232451),
        (0.9993794580759745, 0.035223554275108232),
        -0.18063695815892758,
    ),
    (
        0.60,
        (-0.22720209761087376, 0.97384763019746523),
        (0.18519964103333356, 0.18057558730249249),
        None,
        (0.93653086444508649, 0.35058513936237934),
        -0.05490845542802518,
    ),
    (
        0.61,
        (-0.28566826154665265, 0.95832856805216515),
        (0.18396436012898068, 0.18024769825222792),
        (0.13279956883084937, 0.10422550154333096),
        (0.93860331848981737, 0.34499827611149364),
        -0.050164614645909836,
    ),
    (
        0.64,
        (-0.45929704944370109, 0.88828273672987157),
        (0.18029590652457461, 0.1787677598824251),
        (0.14764105171664899, 0.10830215358023344),
        (0.94749123644970024, 0.31978173314155728),
        -0.036760017522214354,
    ),
    (
        0.67,
        (-0.62388474369956393, 0.78151636360279075),
        (0.17681847574810661, 0.17651198451945418),
        (0.16138375898080673, 0.11451593343477875),
        (0.95960643635671583, 0.28134584998319129),
        -0.024975924398695219,
    ),
    (
        0.70,
        (-0.77023125640274925, 0.63776469928982604),
        (0.17372644708214563, 0.17347477919202628),
        (0.17334655839325203, 0.12288224755784545),
        (0.97328619135013816, 0.2295952737473973),
        -0.015224671568103438,
    ),
    (
        0.74,
        (-0.91965600951286686, 0.39272487082800056),
        (0.17056938042900929, 0.16829754348557252),
        (0.18532234187060886, 0.13714350932284905),
        (0.98995526471689155, 0.14138095295798916),
        -0.0059437081892914226,
    ),
    (
        0.77,
        (-0.98436003645636216, 0.17616843822782044),
        (0.16920230459288491, 0.16372210800091044),
        (0.19043624190886321, 0.14974704658444196),
        (0.99798688406048541, 0.063420653128481483),
        -0.0021282455950523663,
    ),
)
BASE = (-0.062105733613378539, 0.048526435375479564, 0.0)


def crank_and_slider():
    base = asm.Body("base", position=BASE, fixed=True)
    rod = asm.Body("rod", position=(0.011666006676941875, 0.16, 0))
    crank = asm.Body("crank", position=(0.2111281366952498, 0.16, 0))
    slider = asm.Body("slider", position=(-0.18122392750152069, 0.16000000169909329, 0))
    turn = asm.Revolute(
        base.frame(at=(0.25210573361337851, 0.11147356462452043, 0.135)),
        crank.frame(at=(-0.021128136695249794, 0, 0.135)),
        "joint_2",
        angle=0.0,
    )
    scene = asm.Assembly([base, rod, crank, slider])
    scene.constrain(
        turn,
        asm.Revolute(rod.frame(at=(0.088333993323058121, 0, 0.065)), crank.frame(at=(-0.11112813669524979, 0, 0.065))),
        # NoRotationJoint and PointInLineJoint, joints 4 and 5.
        asm.Prismatic(
            base.frame(at=(0, 0.11147355803101042, 0), z=(-1, 0, 0), x=(0, -1, 0)),
            slider.frame(at=(0, -8.2926032821731389e-09, 0), z=(-1, 0, 0), x=(0, -1, 0)),
            "joints 4 and 5",
        ),
        asm.PointOnLine(
            slider.point(0.031223927501520705, -1.69909327e-09, 0), rod.frame(at=(-0.161666006676942, 0, 0))
        ),
    )
    return scene, turn


@pytest.mark.parametrize("row", MOV, ids=lambda row: f"t={row[0]}")
def test_crank_and_slider(row):
    time, (c, s), crank, rod, (rod_c, rod_s), slider = row
    scene, turn = crank_and_slider()
    target, solution = atan2(s, c), None
    assert abs(target - 5 * time**2) < 1e-8  # the drive: an integral of a ramp of 10 rad/s^2
    for angle in np.linspace(0.0, target, 8):
        turn.angle = angle
        solution = scene.solve(solution)
        assert solution.status is asm.Status.SOLVED, solution.message
    assert np.abs(solution.pose("crank").position[:2] - crank).max() < 2e-8
    if rod is not None:
        assert np.abs(solution.pose("rod").position[:2] - rod).max() < 2e-8
    assert np.abs(solution.pose("rod").matrix[:2, 0] - (rod_c, -rod_s)).max() < 1e-7
    assert abs(solution.pose("slider").position[0] - slider) < 2e-8


@pytest.mark.parametrize("offset", [0.0, 0.7, 1.9])
@pytest.mark.parametrize("degrees", [30, 100, 210, 330])
def test_schmidt_coupling(degrees, offset):
    # Three discs, each tied to the next by three links of length one: discs turn alike, however far the shafts are
    # apart, up to two links. Gruebler counts -16 freedoms: rows repeat each other.
    base = asm.Body("base", fixed=True)
    discs = [asm.Body(f"disc {k}", position=(x, y, 1.0 * k)) for k, (x, y) in enumerate(_centers(offset))]
    links, joints = [], []
    drive = asm.Revolute(base.frame(), discs[0].frame(), "drive", angle=0.0)
    out = asm.Revolute(base.frame(at=(offset, 0, 2)), discs[2].frame(), "out")
    for k, (first, second) in enumerate(zip(discs, discs[1:], strict=False)):
        along = second.pose.position[:2] - first.pose.position[:2]
        for n in range(3):
            pin = np.array((0.6 * cos(2 * pi * n / 3), 0.6 * sin(2 * pi * n / 3), 0.5))
            turn = asm.Pose.from_axis_angle((0, 0, 1), atan2(along[1], along[0]), first.pose.apply(pin))
            link = asm.Body(f"link {k}{n}", position=turn.position, quaternion=turn.quaternion)
            links.append(link)
            joints.append(asm.Revolute(first.frame(at=pin), link.frame(), f"near {k}{n}"))
            joints.append(asm.Revolute(link.frame(at=(1, 0, 0)), second.frame(at=pin * (1, 1, -1)), f"far {k}{n}"))
    scene = asm.Assembly([base, *discs, *links])
    scene.constrain(drive, out, *joints)
    solution = None
    for angle in np.radians(np.arange(0, degrees + 1, 10)):
        drive.angle = angle
        solution = scene.solve(solution)
        assert solution.status is asm.Status.SOLVED, solution.message
    # A free angle is read off the pose, within half a turn.
    assert abs((solution.values["out.angle"] - radians(degrees) + pi) % (2 * pi) - pi) < 1e-11
    # The middle disc turns alike and stays where it is.
    middle = solution.pose(discs[1])
    assert np.abs(middle.position[:2] - discs[1].pose.position[:2]).max() < 1e-11
    # Where the shafts are in line the middle disc may also swing around both.
    assert scene.mobility(solution, drives=False).dof == (1 if offset else 2)


def _centers(offset):
    """Of three discs whose neighbors are one apart, the last one by an offset from the first."""
    return (0, 0), (0.5 * offset, sqrt(1 - 0.25 * offset**2)), (offset, 0)


@pytest.mark.parametrize("degrees", [0, 40, 90, 135, 180, 260, 320])
@pytest.mark.parametrize("roller", [0.5, 2.0])
def test_cam_follower(degrees, roller):
    # A round cam of radius 3, its axis 1 off its middle, and a roller that touches it and slides over the axis: the
    # axes are 3 + roller apart, h = cos t + sqrt((3 + roller)^2 - sin^2 t).
    ground = asm.Body("ground", fixed=True)
    cam, follower = (
        asm.Body("cam", asm.shapes.solid_cylinder(3.0, 1.0)),
        asm.Body("follower", asm.shapes.solid_cylinder(roller, 2.0), position=(0, 4 + roller, 0)),
    )
    drive = asm.Revolute(ground.frame(x=(0, 1, 0)), cam.frame(at=(0, -1, 0), x=(0, 1, 0)), "drive", angle=0.0)
    guide = asm.Prismatic(ground.frame(z=(0, 1, 0)), follower.frame(z=(0, 1, 0)), "guide")
    scene = asm.Assembly([ground, cam, follower])
    scene.constrain(drive, guide, asm.Contact(cam.face("wall"), follower.face("wall"), "touch"))
    solution = None
    for angle in np.radians(np.arange(0, degrees + 1, 5)):
        drive.angle = angle
        solution = scene.solve(solution)
        assert solution.status is asm.Status.SOLVED, solution.message
    t = radians(degrees)
    assert abs(solution.values["guide.slide"] - (cos(t) + sqrt((3 + roller) ** 2 - sin(t) ** 2))) < CLOSE * 10


@pytest.mark.parametrize(("teeth", "turns"), [((12, 36), 3.0), ((20, 20), -1.5), ((17, 51), 0.4)])
def test_gears(teeth, turns):
    # Gears.asmt: wheels that mesh outside turn against each other, by the ratio of their teeth.
    ground, pinion, wheel = asm.Body("ground", fixed=True), asm.Body("pinion"), asm.Body("wheel", position=(3, 0, 0))
    fast = asm.Revolute(ground.frame(), pinion.frame(), "fast", angle=2 * pi * turns)
    slow = asm.Revolute(ground.frame(at=(3, 0, 0)), wheel.frame(), "slow")
    scene = asm.Assembly([ground, pinion, wheel])
    scene.constrain(fast, slow, asm.Gear(fast, slow, ratio=-teeth[0] / teeth[1]))
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED
    assert abs(solution.values["slow.angle"] + 2 * pi * turns * teeth[0] / teeth[1]) < 1e-11


@pytest.mark.parametrize("turns", [0.25, 2.0, -3.5])
def test_rack_and_screw(turns):
    # rackscrew.asmt: a pinion moves a rack by its arc, a screw a nut by its pitch.
    ground, pinion, rack, nut = (asm.Body(name, fixed=name == "ground") for name in ("ground", "pinion", "rack", "nut"))
    turn = asm.Revolute(ground.frame(), pinion.frame(), "turn", angle=2 * pi * turns)
    slide = asm.Prismatic(ground.frame(z=(1, 0, 0)), rack.frame(z=(1, 0, 0)), "slide")
    screw = asm.Screw(ground.frame(), nut.frame(), 0.8, "screw", angle=2 * pi * turns)
    scene = asm.Assembly([ground, pinion, rack, nut])
    scene.constrain(turn, slide, screw, asm.RackPinion(turn, slide, radius=1.5))
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED
    assert abs(solution.values["slide.slide"] - 1.5 * 2 * pi * turns) < 1e-11
    assert abs(solution.values["screw.slide"] - 0.8 * turns) < 1e-11


@pytest.mark.parametrize("reach", [3.5, 1.2])
def test_a_four_bar_that_cannot_close(reach):
    # fourbar.asmt with pivots too far apart, or a coupler too long: bars 1, 1 and 1 cannot reach over `reach` > 3, nor
    # can a bar of 4.5 be held by two of 1 over 1.2.
    coupler = 1.0 if reach > 3 else 4.5
    ground, first, second, third = (asm.Body(name, fixed=name == "ground") for name in ("ground", "a", "b", "c"))
    joints = [
        asm.Revolute(ground.frame(), first.frame(), "one"),
        asm.Revolute(first.frame(at=(1, 0, 0)), second.frame(), "two"),
        asm.Revolute(second.frame(at=(coupler, 0, 0)), third.frame(), "three"),
        asm.Revolute(third.frame(at=(1, 0, 0)), ground.frame(at=(reach, 0, 0)), "four"),
    ]
    scene = asm.Assembly([ground, first, second, third])
    scene.constrain(*joints)
    solution = scene.solve()
    assert solution.status is asm.Status.INFEASIBLE
    assert sorted(solution.conflicting) == ["four", "one", "three", "two"]
    assert hypot(*solution.pose(first).position[:2]) < 2
