"""What rests where it starts is the answer to the bit, with no cells and no loop; what does not rest is not."""

import numpy as np
import pytest

import assembly as asm
import assembly.studies.resting as resting_module
from assembly.solve.interruption import CTRL_C
from assembly.studies.pressed import Pressed
from assembly.studies.resting import Rest, resting_start
from tests.studies.machined import bolt

CORNERS = ((9.0, 9.0), (-9.0, 9.0), (9.0, -9.0), (-9.0, -9.0))


def drawn_slab(off=(0.0, 0.0, -3.0), at=(0.0, 0.0, 7.0)):
    """A slab on a table, four points of which are drawn from where they are by an offset."""
    table = asm.Body("table", asm.shapes.box(80, 60, 10), fixed=True)
    slab = asm.Body("slab", asm.shapes.box(20, 20, 4), at)
    scene = asm.Assembly([table, slab])
    scene.constrain(asm.Clearance())
    goals = [np.array([x, y, -2.0]) + at + off for x, y in CORNERS]
    scene.minimize(
        *(asm.PointDistance(slab.point(x, y, -2), goal) for (x, y), goal in zip(CORNERS, goals, strict=True))
    )
    return scene


def jaws(ways, drawn):
    """Blocks that slide onto a rod, which they touch along lines; each is drawn along its way by so much."""
    rod = asm.Body("rod", asm.shapes.solid_cylinder(5, 30), fixed=True)
    bodies, constraints, objectives = [rod], [asm.Clearance()], []
    for k, (angle, pull) in enumerate(zip(ways, drawn, strict=True)):
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        turn = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
        block = asm.Body(f"jaw {k}", asm.shapes.box(6, 8, 12), 8.0 * way, turn)
        bodies.append(block)
        constraints.append(
            asm.Prismatic(rod.frame((0, 0, 0), way, (0, 0, 1)), block.frame((0, 0, 0), (1, 0, 0), (0, 0, 1)))
        )
        objectives.append(asm.PointDistance(block.point(0, 0, 0), (8.0 - pull) * way))
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    scene.minimize(*objectives)
    return scene


def asked(scene):
    """The start as the solution, or None, past everything else."""
    settings = scene._settings({}, CTRL_C, warm=False)
    return resting_start(scene, scene.q, settings, None, CTRL_C)


def test_what_rests_is_returned_without_cells_and_stays_at_rest():
    scene = drawn_slab()
    first = scene.solve()
    assert first.success and first.proved and first.iterations == 0
    assert np.array_equal(first.q, scene.q) and isinstance(first._rest, Rest)
    assert not scene.packed().proofs
    # 4 points, 3 off each.
    assert first.objective == pytest.approx(36.0, rel=1e-14) and first.second_order == "minimum"
    inner = first._rest.inner
    again = scene.solve()
    assert np.array_equal(again.q, first.q) and again._rest.inner is inner
    assert len(again.contacts) >= 3 and again.stationarity < 1e-9


def test_scenes_with_joints_are_forgotten_with_what_they_were_made_of():
    scene = drawn_slab()
    inner = scene.solve()._rest.inner
    scene.minimize(asm.PointDistance(scene.bodies[1].point(0, 0, 0), (0, 0, 0)))
    other = scene.solve()
    assert other._rest.inner is not inner
    assert other.objective == pytest.approx(36.0 + 49.0, rel=1e-14)


@pytest.mark.parametrize("off", [(0.0, 0.0, 3.0), (2.0, 0.0, -3.0)], ids=["lifted", "drawn aside"])
def test_what_is_drawn_elsewhere_does_not_stay(off):
    scene = drawn_slab(off)
    assert asked(scene) is None
    solution = scene.solve()
    assert solution.success and np.linalg.norm(solution.q[1, :3] - scene.q[1, :3]) > 1.0


def test_a_ridge_is_no_place_to_rest():
    """The farthest from a point straight above is below it where it is pressed, and aside of it as well."""
    scene = drawn_slab()
    scene._objectives.clear()
    slab = scene.bodies[1]
    scene.maximize(asm.PointDistance(slab.point(0, 0, 0), (0.0, 0.0, 9.0)))
    scene.minimize(asm.PointDistance(slab.point(0, 0, 0), (0.0, 0.0, 5.0), weight=0.1))
    assert asked(scene) is None


def test_of_a_bolt_the_head_is_pressed_and_its_hole_holds_nothing():
    plate = asm.Body("plate", asm.shapes.plate(40, 30, 10, [(0, 0, 4.5)]), fixed=True)
    screw = asm.Body("bolt", bolt(4.0, 30.0, 6.5, 8.0), (0, 0, 5))
    scene = asm.Assembly([plate, screw])
    scene.constrain(asm.Clearance())
    points = ((5.0, 0.0, 0.0), (-5.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, -5.0, 0.0))
    scene.minimize(*(asm.PointDistance(screw.point(*p), (p[0], p[1], 2.0)) for p in points))
    solution = scene.solve()
    assert np.array_equal(solution.q, scene.q) and solution.proved
    assert [is_flat for _, _, is_flat in solution._rest.sides] == [True]


def test_jaws_are_pressed_along_lines_and_nothing_is_left_to_move():
    scene = jaws((0.3, 2.2, 4.4), (2.0, 1.0, 0.5))
    solution = scene.solve()
    assert isinstance(solution._rest, Pressed) and solution.success and solution.proved
    # Quaternions of any angle are of length one up to rounding.
    assert np.abs(solution.q - scene.q).max() < 1e-15
    assert solution.objective == pytest.approx(4.0 + 1.0 + 0.25, rel=1e-13)
    assert not scene.packed().proofs
    again = scene.solve(solution)
    assert isinstance(again._rest, Pressed) and np.array_equal(again.q, solution.q)
    # Each force is the objective's slope along its way, 2 * pull, shared by the two ends of a line.
    forces = np.array(solution._rest.forces)
    assert (forces > 0.0).all()
    # What is pressed is not what rows alone lead to.
    assert len(solution.contacts) >= 3


def test_a_jaw_that_is_drawn_off_is_not_pressed():
    scene = jaws((0.3, 2.2), (2.0, -1.0))
    assert asked(scene) is None
    solution = scene.solve()
    assert solution.success and solution.objective == pytest.approx(4.0, rel=1e-9)


def test_a_roller_that_may_roll_off_is_not_pressed():
    """Its top is drawn down: the line that it touches along balances that, and whichever way it rolls is downhill."""
    floor = asm.Body("floor", asm.shapes.box(80, 60, 10), fixed=True)
    lying = asm.Pose((0, 0, 10), (np.sqrt(0.5), 0, np.sqrt(0.5), 0))
    roller = asm.Body("roller", asm.shapes.solid_cylinder(5, 30), pose=lying)
    scene = asm.Assembly([floor, roller])
    scene.constrain(asm.Clearance())
    tops = (-5.0, 0.0, -14.0), (-5.0, 0.0, 14.0)
    scene.minimize(
        *(asm.PointDistance(roller.point(*top), lying.apply(np.array(top)) - (0.0, 0.0, 1.0)) for top in tops)
    )
    assert asked(scene) is None


def test_an_end_that_fails_tells_the_objective_of_the_pose_that_it_returns():
    """Driven into a block, the box stops at it; beside the last pose that held others had been tried."""
    floor = asm.Body("floor", asm.shapes.box(10, 10, 2), fixed=True)
    frame = asm.Body("frame", asm.shapes.box(1, 1, 1), position=(50, 0, 0), fixed=True)
    box = asm.Body("box", asm.shapes.box(4, 4, 2), position=(0, 0, 6))
    height = asm.Planar(frame.frame(), box.frame(), "height", offset=6.0)
    goal = np.array([0.3, 0.2, 5.0])
    scene = asm.Assembly([floor, frame, box])
    scene.constrain(height, asm.Clearance())
    scene.minimize(asm.PointDistance(box.point(1, 1, 0), goal))
    solution = scene.solve()
    for offset in (1.5, 0.5):
        height.offset = offset
        failed = scene.solve(solution)
        assert not failed.success
        off = failed.pose(box).apply(np.array([1.0, 1.0, 0.0])) - goal
        assert failed.objective == pytest.approx(float(off @ off), rel=1e-9)


def test_of_bodies_that_other_constraints_hold_no_contact_pushes(monkeypatch):
    """Where no motion is left, forces of contacts are not asked for: those of no equations would be any numbers."""

    def with_rows(matrix, goal, solve=resting_module.nnls):
        assert len(goal)
        return solve(matrix, goal)

    monkeypatch.setattr(resting_module, "nnls", with_rows)
    table = asm.Body("table", asm.shapes.box(80, 60, 10), fixed=True)
    slab = asm.Body("slab", asm.shapes.box(20, 20, 4), (0, 0, 7))
    # A slide that is drawn to its limit, along the table, while two joints hold the rest.
    axis = asm.Prismatic(table.frame((0, 0, 7), (1, 0, 0)), slab.frame((0, 0, 0), (1, 0, 0)), limits=(None, 0.0))
    scene = asm.Assembly([table, slab])
    scene.constrain(axis, asm.Clearance())
    scene.minimize(asm.PointDistance(slab.point(0, 0, 0), (3.0, 0.0, 5.0)))
    solution = scene.solve()
    assert solution.success and np.abs(solution.q - scene.q).max() < 1e-12
    assert solution.objective == pytest.approx(13.0, rel=1e-12)
