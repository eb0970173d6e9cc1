"""What makes a script short, and a slip of one clear."""

import warnings

import numpy as np
import pytest

import assembly as asm


@pytest.fixture
def crank():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground.frame(), arm.frame(), angle=0.3, name="hinge"))
    return scene


def test_bodies_and_constraints_by_name(crank):
    assert crank["arm"] is crank.bodies[1] is crank.body("arm")
    assert crank.constraint("hinge") is crank.constraints[0]
    assert "arm" in crank and crank["arm"] in crank and "hinge" not in crank and asm.Body("arm") not in crank


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda scene: scene["elbow"], "name is 'elbow'; expected one of 'ground', 'arm'"),
        (lambda scene: scene["hinge"], r"that of a constraint; expected a body, or scene.constraint\('hinge'\)"),
        (lambda scene: scene[0], "name is 0; expected one of 'ground'"),
        (lambda scene: scene.constraint("arm"), "name is 'arm'; expected one of 'hinge'"),
        (lambda scene: asm.Assembly().constraint("arm"), "expected a constraint, but there is none"),
    ],
)
def test_unknown_names_are_told_the_known_ones(crank, ask, message):
    with pytest.raises(asm.errors.InputError, match=message):
        ask(crank)


def test_a_scene_is_not_gone_through_by_numbers(crank):
    with pytest.raises(TypeError, match="not iterable"):
        list(crank)


def test_a_list_of_constraints_is_told_the_star(crank):
    with pytest.raises(TypeError, match=r"expected separate arguments: constrain\(\*constraints\)"):
        crank.constrain([asm.Fixed(crank["ground"].frame(), crank["arm"].frame())])


def test_results_by_name_list_the_names_there_are(crank):
    solution = crank.solve()
    assert solution.values["hinge.angle"] == pytest.approx(0.3, abs=1e-14)
    for table, known in (
        (solution.values, "'hinge.angle'"),
        (solution.violations, "'hinge'"),
        (solution.multipliers, "'hinge'"),
        (solution.wrenches, "'hinge'"),
    ):
        with pytest.raises(KeyError) as raised:
            table["hinge.angel"]
        assert str(raised.value) == f"name is 'hinge.angel'; expected perhaps {known}"
        assert "hinge.angel" not in table and table.get("hinge.angel") is None
    with pytest.raises(asm.errors.InputError, match="expected a name, but there is none"):
        solution.contacts["ball"]


def test_poses_of_matrices():
    rng = np.random.default_rng(5)
    for _ in range(20):
        pose = asm.Pose(rng.normal(size=3), (e := rng.normal(size=4)) / np.linalg.norm(e))
        again = asm.Pose.from_matrix(pose.matrix)
        # Rounding of a rotation's nine numbers, and of an eigenvector of a matrix of them.
        assert np.allclose(again.matrix, pose.matrix, rtol=0.0, atol=4e-15)
        turned = asm.Pose.from_matrix(pose.matrix[:3, :3])
        assert np.allclose(turned.matrix[:3, :3], pose.matrix[:3, :3], rtol=0.0, atol=4e-15)
        assert not turned.position.any()
        other = asm.Pose(rng.normal(size=3))
        assert np.allclose((pose @ other).matrix, pose.matrix @ other.matrix, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(4).T + np.eye(4, k=-3), "matrix has the last row .* the position in the last column"),
        (-np.eye(3), "expected a rotation matrix"),
        (np.ones((4, 3)), "matrix"),
        (np.full((4, 4), np.nan), "matrix"),
    ],
)
def test_matrices_that_are_no_poses(matrix, message):
    with pytest.raises(asm.errors.InputError, match=message):
        asm.Pose.from_matrix(matrix)


def test_a_body_takes_a_pose():
    pose = asm.Pose.from_axis_angle((1, 2, 3), 90 * asm.deg, (4, 5, 6))
    assert asm.Body("a", pose=pose).pose is pose
    assert asm.deg * 180.0 == np.pi
    with pytest.raises(asm.errors.InputError, match="pose is given beside position or quaternion"):
        asm.Body("a", position=(1, 0, 0), pose=pose)
    with pytest.raises(TypeError, match="expected a Pose"):
        asm.Body("a", pose=(0, 0, 0))


def test_a_quaternion_in_the_order_of_scipy_is_asked_about():
    with pytest.warns(UserWarning, match="scipy has w last"):
        asm.Body("a", quaternion=(0, 0, 0, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        asm.Body("a", pose=asm.Pose.from_axis_angle((0, 0, 1), np.pi))
        asm.Body("a", quaternion=np.array([0.0, 0.0, 0.0, 1.0]))


def test_a_tracker_says_what_it_follows(crank):
    tracker = crank.tracker(crank["arm"].point(1, 0, 0), stiffness=3.0)
    assert repr(tracker) == "Tracker(Assembly(2 bodies, 1 constraints), follow=arm.point(1, 0, 0), stiffness=3)"


def test_rooms_show_their_public_names_alone():
    assert dir(asm.proximity) == sorted(asm.proximity.__all__)
    assert "annotations" not in dir(asm) and "lazy_names" not in dir(asm)
