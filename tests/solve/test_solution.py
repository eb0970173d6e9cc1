"""What a solution says: values, conflicts, honest figures, and what is printed."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.solve import result as result_module
from assembly.solve.result import Iteration
from tests.solve.dense.test_jacobian import everything
from tests.solve.mechanisms import bricard, planar_four_bar


def triangle(third=3.0):
    a, b, c = asm.Body("a", fixed=True), asm.Body("b", position=(1, 0.1, 0)), asm.Body("c", position=(0.5, 1, 0.2))
    scene = asm.Assembly([a, b, c])
    scene.constrain(
        asm.Distance(a, b, 1.0, "ab"),
        asm.Parallel(a, c, "level"),
        asm.Distance(b, c, 1.0, "bc"),
        asm.Distance(c, a, third, "ca"),
    )
    return scene


def finite(solution):
    return np.isfinite([solution.feasibility, solution.stationarity, solution.objective]).all()


def test_values_are_those_that_are_driven():
    rng = np.random.default_rng(0)
    ground, body = asm.Body("ground", fixed=True), asm.Body("body")
    scene = asm.Assembly([ground, body])

    def frames():
        return tuple(side.frame(rng.normal(size=3), rng.normal(size=3)) for side in (ground, body))

    scene.constrain(asm.Cylindrical(*frames(), "sleeve", angle=0.7, slide=-1.25))
    solution = scene.solve()
    assert solution.success
    assert solution.values == pytest.approx({"sleeve.angle": 0.7, "sleeve.slide": -1.25}, abs=1e-12)


def test_values_of_what_is_free_are_measured():
    ground, body = asm.Body("ground", fixed=True), asm.Body("body", position=(2, 1, -3), quaternion=(0.6, 0, 0, 0.8))
    scene = asm.Assembly([ground, body])
    scene.constrain(
        asm.Planar(ground, body, "plane", offset=-3.0), asm.Distance(ground, body, None, "rope", limits=(0, 5))
    )
    solution = scene.solve()
    angle = 2.0 * np.arctan2(0.8, 0.6)
    expected = {"plane.x": 2.0, "plane.y": 1.0, "plane.angle": angle, "rope.distance": np.sqrt(14.0)}
    assert solution.values == pytest.approx(expected, abs=1e-12)


def test_values_go_on_past_whole_turns():
    scene = planar_four_bar()
    crank = scene.constraints[0]
    start = crank.angle = scene.solve().values["joint 1.angle"]
    solution = scene.solve()
    for degrees in range(0, 721, 15):
        crank.angle = start + np.radians(degrees)
        solution = scene.solve(solution)
        assert solution.success
        assert solution.values["joint 1.angle"] == pytest.approx(crank.angle, abs=1e-12)
    np.testing.assert_allclose(solution.pose("link 1").matrix, np.eye(4), rtol=0, atol=1e-9)


def test_an_infeasible_solve_names_what_contradicts():
    solution = triangle().solve()
    assert solution.status is asm.Status.INFEASIBLE and finite(solution)
    assert solution.conflicting_sets == [("ab", "bc", "ca")] and solution.conflicting == ["ab", "bc", "ca"]
    assert "; conflicting: 'ab', 'bc', 'ca'" in solution.message
    # The pose is of least violation: 1 is missing, a third at each, and the bodies lie in one line.
    assert solution.violations == pytest.approx({"ab": 1 / 3, "bc": 1 / 3, "ca": 1 / 3, "level": 0.0}, abs=1e-6)


def test_a_conflict_is_of_the_values_that_were_solved():
    scene = triangle()
    solution = scene.solve()
    scene.constraints[3].value = 1.9
    fine = scene.solve()
    assert fine.success and fine.conflicting == [] and "conflicting" not in fine.message
    assert solution.conflicting == ["ab", "bc", "ca"]
    # And rows that came or went since do not matter.
    later = triangle()
    bad = later.solve()
    later.constraints[1].angle = 0.3
    assert bad.conflicting == ["ab", "bc", "ca"]


def test_other_endings_do_not_look_for_conflicts(monkeypatch):
    monkeypatch.setattr("assembly.solve.diagnosis.conflicts.conflicts_at", None)
    solution = triangle(1.5).solve(max_iterations=1)
    assert solution.status is asm.Status.ITERATION_LIMIT and solution.conflicting == []


@pytest.mark.parametrize("seed", range(20))
def test_random_contradictions_are_no_successes(seed):
    # A tree of distances that holds, and a triangle somewhere in it that cannot.
    rng = np.random.default_rng(seed)
    count = 8
    bodies = [asm.Body(f"body {k}", position=rng.normal(size=3), fixed=k == 0) for k in range(count)]
    scene = asm.Assembly(bodies)
    for k in range(1, count):
        other = int(rng.integers(k))
        scene.constrain(asm.Distance(bodies[other], bodies[k], rng.uniform(0.5, 2.0), f"rod {other}-{k}"))
    i, j, k = rng.choice(count, 3, replace=False)
    sides = rng.uniform(0.5, 1.0, 2)
    scene.constrain(asm.Distance(bodies[i].point(0.1, 0, 0), bodies[j], 1.3 * sides.sum() + 0.7, "long"))
    extra = asm.Assembly(bodies)
    extra.constrain(*scene.constraints)
    extra.constrain(
        asm.Distance(bodies[i].point(0.1, 0, 0), bodies[k], sides[0], "short"),
        asm.Distance(bodies[k], bodies[j], sides[1], "other short"),
    )
    solution = extra.solve()
    assert solution.status is asm.Status.INFEASIBLE and finite(solution)
    assert solution.conflicting_sets == [("long", "short", "other short")]


def test_a_plain_solve_pays_for_nothing(monkeypatch):
    scene = planar_four_bar()
    scene.solve()
    for name in ("rows_at", "gradient_at"):
        monkeypatch.setattr(
            f"assembly.solve.dense.jacobian.{name}" if name == "rows_at" else f"assembly.solve.diagnosis.lost.{name}",
            None,
        )
    monkeypatch.setattr(result_module, "measure", None)
    solution = scene.solve()
    assert solution.success and solution.violations and solution.multipliers and solution.history.size
    assert repr(solution) and solution.message


def test_print_is_a_short_table():
    text = str(bricard().solve())
    assert text.startswith("SOLVED: every constraint holds and the objective, if there is one, is at a local minimum\n")
    assert "   1 degree of freedom\n" in text and " iterations   " in text
    assert text.count(" violation ") == 5 and "ground  " in text and "fixed" in text
    assert "0 degrees of freedom" in str(driven_four_bar().solve())


def driven_four_bar():
    scene = planar_four_bar()
    scene.constraints[0].angle = 0.1
    return scene


def test_verbose_prints_the_iterations(capsys):
    scene = driven_four_bar()
    quiet = scene.solve()
    assert capsys.readouterr().out == ""
    loud = scene.solve(verbose=1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == list(Iteration.COLUMNS) and len(lines) == loud.iterations + 2
    printed = np.array([[float(word) for word in line.split()] for line in lines[1:]])
    np.testing.assert_array_equal(printed[:, 0], np.arange(loud.iterations + 1))
    np.testing.assert_allclose(printed[:, 1:], loud.history, rtol=1e-6)
    np.testing.assert_array_equal(loud.q, quiet.q)
    for bad in (2, -1, 0.5, True):
        with pytest.raises(InputError, match="verbose is"):
            scene.solve(verbose=bad)


def test_figures_of_a_lost_contact_are_finite():
    # The pair is said to be at the cone's apex, where a surface has no tangent plane.
    floor, cone = asm.Body("floor", asm.shapes.plane(4, 4), fixed=True), asm.shapes.cone(1, 2)
    top = asm.Body("top", cone, (0.3, 0.2, 1.5))
    scene = asm.Assembly([floor, top])
    scene.constrain(asm.Contact(floor, top, "touch"), asm.Parallel(floor, top, "level"))
    scene.minimize(asm.PointDistance(top.point(0, 0, 0), (0.3, 0.2, 4.5), weight=2.0))
    apex = [0.3, 0.2, 1.0, cone.domain[1][1]]
    solution = scene.solve(starts={"touch": apex})
    assert solution.status is asm.Status.CONTACT_LOST and not solution.success
    assert finite(solution) and len(solution.history) == 0
    # The distance of the points that were left, and the other constraint as it is.
    points = solution.contacts["touch"].points
    apart = np.linalg.norm(points[1] - points[0])
    assert solution.violations == pytest.approx({"touch": apart, "level": 0.0}, abs=1e-12) and apart > 0.1
    assert solution.feasibility == pytest.approx(apart, abs=1e-12)
    # 2 weight 3 over the unit of the objective, its weight times the squared size, in scaled lengths.
    size = scene.packed().scale
    assert solution.stationarity == pytest.approx(2.0 * 3.0 / size, abs=1e-12)
    assert "'touch': a contact has no extremal pair" in str(solution) and "of freedom" not in str(solution)
    with pytest.raises(InputError, match="'touch' without an extremal pair"):
        _ = solution.mobility


@pytest.mark.parametrize("seed", range(10))
def test_figures_of_any_ending_are_finite(seed):
    scene = everything(np.random.default_rng(seed))
    for options in ({"max_iterations": 0}, {"max_iterations": 3}, {"max_iterations": 60}):
        solution = scene.solve(**options)
        assert finite(solution)
        assert np.isfinite(list(solution.violations.values())).all()
        assert solution.feasibility == pytest.approx(max(solution.violations.values()), rel=1e-12)


def test_an_expression_without_a_value_is_an_infinite_violation():
    ca = pytest.importorskip("casadi")
    body = asm.Body("body", position=(-1, 0, 0))
    scene = asm.Assembly([body])
    q = ca.SX.sym("q", 7)
    scene.constrain(asm.Expression(ca.Function("root", [q], [ca.sqrt(-1 - q[0] ** 2)]), [body]))
    solution = scene.solve()
    assert not solution.success and solution.feasibility == np.inf
    assert "root body" in solution.message


def test_contacts_that_contradict_are_named():
    def ball(name, position, **settings):
        return asm.Body(name, asm.shapes.sphere(1.0), position, **settings)

    bodies = [
        ball("left", (0, 0, 0), fixed=True),
        ball("right", (6, 0, 0), fixed=True),
        ball("between", (2.9, 0.3, 0.4)),
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(
        asm.Contact(bodies[0], bodies[2], "left"),
        asm.Parallel(bodies[0], bodies[2], "level"),
        asm.Contact(bodies[1], bodies[2], "right"),
    )
    solution = scene.solve()
    assert solution.status is asm.Status.INFEASIBLE and solution.conflicting_sets == [("left", "right")]


def test_a_stuck_solve_is_one_from_another_start():
    # Scattered bars that got stuck: the linkage closes from elsewhere.
    restarted = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        scene = bricard()
        for body in scene.bodies[1:]:
            e = rng.normal(size=4)
            body.pose = asm.Pose(rng.uniform(-3, 3, 3), e / np.linalg.norm(e))
        solution = scene.solve()
        assert solution.success and solution.conflicting == []
        assert ("found from another start" in solution.message) == solution.restarted
        restarted += solution.restarted
    assert restarted > 0


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_messages_do_not_depend_on_the_unit_of_length(unit):
    ground, crank = asm.Body("g", fixed=True), asm.Body("c", position=(unit, 0.0, 0.0))
    scene = asm.Assembly([ground, crank])
    axes = [body.frame((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)) for body in (ground, crank)]
    # Two angles of the same axes that contradict each other by 2e-4 rad.
    scene.constrain(*(asm.Angle(*axes, 1.0 + 2e-4 * k, f"angle {k}") for k in range(2)))
    scene.constrain(asm.Distance(ground.point(0, 0, 0), crank.point(0, 0, 0), unit))
    solution = scene.solve()
    assert "violated: 'angle 0' (0.0001), 'angle 1' (0.0001); conflicting: 'angle 0', 'angle 1'" in solution.message
    assert "conflicting: 'angle 0', 'angle 1'" in str(scene.mobility(solution))


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_an_angle_of_a_joint_that_has_lengths_is_told_in_any_unit(unit):
    ground, part = asm.Body("g", fixed=True), asm.Body("p", position=(unit, 0.0, 0.0))
    scene = asm.Assembly([ground, part])
    turned = ground.frame((0.0, 0.0, 0.0), (2e-4, 0.0, 1.0))
    scene.constrain(asm.Fixed(ground, part, "one"), asm.Fixed(turned, part, "other"))
    # Another body makes the scene's size that of the unit.
    scene.constrain(asm.Distance(ground.point(unit, 0, 0), part.point(0, 0, 0), unit, "far"))
    solution = scene.solve()
    assert not solution.success
    assert "'one' (" in solution.message and "'other' (" in solution.message


@pytest.mark.parametrize("pitch", [1e12, 1e16, 1e18])
def test_a_violation_is_no_rounding_however_large_the_numbers(pitch):
    ground, nut = asm.Body("ground", fixed=True), asm.Body("nut", position=(0.0, 0.0, 0.3))
    scene = asm.Assembly([ground, nut])
    scene.constrain(asm.Screw(ground, nut, pitch, angle=0.5))
    solution = scene.solve()
    # A millionth at most; it was half a radian.
    assert not solution.success or solution.feasibility <= 1e-6
