"""Measures as functions of numbers of a scene: values, exact derivatives, and what optimizers make of them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

import assembly as asm
from assembly.errors import InputError

R, L, ANGLE = 2.0, 5.0, 0.7


@pytest.fixture
def crank():
    """Slider-crank; its stroke, and radius, length and angle."""
    ground, wheel, rod = asm.Body("ground", fixed=True), asm.Body("wheel"), asm.Body("rod", position=(1.5, 1.3, 0))
    piston = asm.Body("piston", position=(6, 0, 0))
    hinge = asm.Revolute(ground, wheel, "hinge", angle=ANGLE)
    pin = asm.Revolute(wheel.frame(at=(R, 0, 0)), rod, "pin")
    wrist = asm.Revolute(rod.frame(at=(L, 0, 0)), piston, "wrist")
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), piston.frame(z=(1, 0, 0)), "guide")
    scene = asm.Assembly([ground, wheel, rod, piston])
    scene.constrain(hinge, pin, wrist, guide)
    radius = asm.Parameter(pin.frame_a, "origin", "x", name="radius")
    length = asm.Parameter(wrist.frame_a, "origin", "x", name="length")
    return scene, asm.Measure(guide), radius, length, asm.Parameter(hinge, "angle", name="angle")


def stroke(radius, length, angle):
    return radius * np.cos(angle) + np.sqrt(length**2 - (radius * np.sin(angle)) ** 2)


def slopes(radius, length, angle):
    sine, cosine = np.sin(angle), np.cos(angle)
    along = np.sqrt(length**2 - (radius * sine) ** 2)
    return np.array(
        [cosine - radius * sine**2 / along, length / along, -radius * sine * (1.0 + radius * cosine / along)]
    )


def test_values_and_derivatives_are_those_of_the_closed_form(crank):
    scene, travel, *parameters = crank
    f = asm.Response(scene, travel, parameters)
    rng = np.random.default_rng(4)
    for _ in range(20):
        values = [R, L, ANGLE] * rng.uniform(0.9, 1.1, 3)
        found, rates = f.both(values)
        # Rows hold to 1e-12 of the size, some 6.
        assert found == pytest.approx(stroke(*values), abs=1e-11)
        np.testing.assert_allclose(rates, slopes(*values), rtol=0, atol=1e-10)
        assert f(values) == found and (f.jacobian(values) == rates).all()
    # The scene is as it was.
    assert [p.value for p in parameters] == [R, L, ANGLE]
    assert f.values.tolist() == [R, L, ANGLE]


def test_several_measures(crank):
    scene, travel, radius, length, _ = crank
    rod = scene.bodies[2]
    f = asm.Response(scene, [travel, asm.Measure(rod, "y")], [radius, length])
    found, rates = f.both([R, L])
    assert found == pytest.approx([stroke(R, L, ANGLE), R * np.sin(ANGLE)], abs=1e-12)
    np.testing.assert_allclose(rates, [slopes(R, L, ANGLE)[:2], [np.sin(ANGLE), 0.0]], rtol=0, atol=1e-11)


def test_a_value_does_not_depend_on_the_calls_before(crank):
    scene, travel, radius, length, _ = crank
    f = asm.Response(scene, travel, [radius, length])
    first = f([1.9, 5.2])
    for values in ([2.5, 4.0], [1.0, 6.0]):
        f(values)
    assert f([1.9, 5.2]) == first


def test_a_response_that_follows_stays_on_its_branch(crank):
    """The crank driven through a turn in steps, from the last solution each; and far at once from the first one."""
    scene, travel, _, _, angle = crank
    f = asm.Response(scene, travel, angle, follow=True)
    for value in np.linspace(ANGLE, ANGLE + 2.0 * np.pi, 90):
        assert f([value]) == pytest.approx(stroke(R, L, value), abs=1e-11)
    assert f.solution.success


def test_what_optimizers_make_of_it(crank):
    """Both lengths from two strokes, by scipy; and the largest stroke for a sum of lengths."""
    scene, travel, radius, length, _ = crank
    rod = scene.bodies[2]
    f = asm.Response(scene, [travel, asm.Measure(rod, "y")], [radius, length])
    goal = np.array([stroke(1.7, 5.6, ANGLE), 1.7 * np.sin(ANGLE)])
    found = least_squares(lambda v: f(v) - goal, [R, L], jac=f.jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(found.x, [1.7, 5.6], rtol=0, atol=1e-10)
    assert found.nfev <= 10
    g = asm.Response(scene, travel, [radius, length])
    best = minimize(
        lambda v: -g(v), [R, L], jac=lambda v: -g.jacobian(v), method="SLSQP", bounds=[(0.5, 3.0), (4.0, 6.0)],
        constraints={"type": "eq", "fun": lambda v: v.sum() - 7.0, "jac": lambda v: np.ones((1, 2))},
    )  # fmt: skip
    # A unit of length lengthens the stroke more than one of radius all the way.
    np.testing.assert_allclose(best.x, [1.0, 6.0], rtol=0, atol=1e-8)


def test_a_function_of_casadi_has_the_exact_jacobian(crank):
    scene, travel, *parameters = crank
    rod = asm.Measure(scene.bodies[2], "y")
    function = asm.Response(scene, [travel, rod], parameters).casadi("crank")
    values = [1.9, 5.2, 0.8]
    np.testing.assert_allclose(
        function(values).full().ravel(), [stroke(*values), 1.9 * np.sin(0.8)], rtol=0, atol=1e-11
    )
    x = ca.MX.sym("x", 3)
    rates = ca.Function("rates", [x], [ca.jacobian(function(x), x)])
    expected = [slopes(*values), [np.sin(0.8), 0.0, 1.9 * np.cos(0.8)]]
    np.testing.assert_allclose(rates(values).full(), expected, rtol=0, atol=1e-10)
    # Backward through it, of one measure alone.
    one = asm.Response(scene, travel, parameters).casadi()
    gradient = ca.Function("gradient", [x], [ca.gradient(ca.sin(one(x)), x)])
    expected = np.cos(stroke(*values)) * slopes(*values)
    np.testing.assert_allclose(gradient(values).full().ravel(), expected, rtol=0, atol=1e-10)
    with pytest.raises(InputError, match="name is 'a b'; expected letters"):
        asm.Response(scene, travel, parameters).casadi("a b")


def test_ipopt_finds_lengths_by_a_function_of_casadi(crank):
    """Both lengths from two strokes, with a constraint on one of them; a start whose steps leave what can be solved."""
    scene, travel, radius, length, _ = crank
    rod = asm.Measure(scene.bodies[2], "y")
    function = asm.Response(scene, [travel, rod], [radius, length]).casadi()
    x = ca.MX.sym("x", 2)
    off = function(x) - ca.DM([stroke(1.7, 5.6, ANGLE), 1.7 * np.sin(ANGLE)])
    problem = {"x": x, "f": ca.dot(off, off), "g": x[1] - 2.0 * x[0]}
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-12}}
    options["ipopt"]["hessian_approximation"] = "limited-memory"
    solver = ca.nlpsol("solver", "ipopt", problem, options)
    found = solver(x0=[R, L], lbx=[0.5, 1.0], ubx=[3.0, 9.0], lbg=0.5, ubg=10.0)
    assert solver.stats()["success"]
    np.testing.assert_allclose(found["x"].full().ravel(), [1.7, 5.6], rtol=0, atol=1e-6)


def test_an_explicit_component_of_openmdao(crank):
    """The longest stroke for a sum of lengths, as above, with the component's partial derivatives checked."""
    om = pytest.importorskip("openmdao.api", reason="OpenMDAO is not installed; it is in the extra `test`")
    scene, travel, radius, length, _ = crank
    response = asm.Response(scene, travel, [radius, length])

    class Mechanism(om.ExplicitComponent):
        def setup(self):
            self.add_input("values", val=response.values)
            self.add_output("stroke")

        def setup_partials(self):
            self.declare_partials("stroke", "values")

        def compute(self, inputs, outputs):
            outputs["stroke"] = response(inputs["values"])

        def compute_partials(self, inputs, partials):
            partials["stroke", "values"] = response.jacobian(inputs["values"])

    problem = om.Problem(reports=False)
    problem.model.add_subsystem("mechanism", Mechanism(), promotes=["*"])
    problem.model.add_subsystem("total", om.ExecComp("total = sum(values)", values=response.values), promotes=["*"])
    problem.model.add_design_var("values", lower=[0.5, 4.0], upper=[3.0, 6.0])
    problem.model.add_objective("stroke", scaler=-1.0)
    problem.model.add_constraint("total", equals=7.0)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-12, disp=False)
    problem.setup()
    problem.run_model()
    told = problem.check_partials(out_stream=None)["mechanism"]["stroke", "values"]
    # Differences of the first order, in steps of 1e-6.
    np.testing.assert_allclose(told["J_fwd"], told["J_fd"], rtol=0, atol=1e-5)
    np.testing.assert_allclose(told["J_fwd"][0], slopes(R, L, ANGLE)[:2], rtol=0, atol=1e-10)
    problem.run_driver()
    np.testing.assert_allclose(problem.get_val("values"), [1.0, 6.0], rtol=0, atol=1e-8)


def test_what_has_no_solution_raises_or_costs_a_penalty(crank):
    scene, travel, radius, length, _ = crank
    f = asm.Response(scene, travel, [radius, length])
    with pytest.raises(asm.ResponseError, match="no solution with radius = 9, length = 1; INFEASIBLE"):
        f([9.0, 1.0])
    assert (radius.value, length.value) == (R, L)
    g = asm.Response(scene, travel, [radius, length], penalty=1e3)
    found, rates = g.both([9.0, 1.0])
    assert (found, rates.tolist(), g.failures) == (1e3, [0.0, 0.0], 1)
    # And it goes on as if nothing had been.
    assert g([R, L]) == f([R, L])


def test_a_free_motion_has_no_derivative(crank):
    scene, travel, radius, _, _ = crank
    scene.constraints[0].angle = None
    with pytest.raises(
        asm.ResponseError, match=r"measures \['guide.slide'\] change with a motion that the scene leaves"
    ):
        asm.Response(scene, travel, radius).jacobian([R])


def test_bad_arguments(crank):
    scene, travel, radius, length, _ = crank
    f = asm.Response(scene, travel, [radius, length])
    for values in ([1.0], [1.0, np.nan], "ab", [[1.0, 2.0]]):
        with pytest.raises(InputError, match="expected 2 finite numbers: radius, length"):
            f(values)
    with pytest.raises(TypeError, match=r"of\[0\] is 3; expected a Measure"):
        asm.Response(scene, [3], radius)
    with pytest.raises(InputError, match="follow is 1; expected True or False"):
        asm.Response(scene, travel, radius, follow=1)
    length.value = 0.5
    with pytest.raises(asm.ResponseError, match="no solution with radius = 2"):
        asm.Response(scene, travel, radius)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_limits_that_pass_each_other_are_set_and_set_back(order):
    """In one order the lower limit would pass the upper one on the way there, in the other on the way back."""
    ground, block = asm.Body("ground", fixed=True), asm.Body("block")
    scene = asm.Assembly([ground, block])
    slide = asm.Prismatic(ground, block, "slide", limits=(-1.0, 0.5))
    scene.constrain(slide)
    scene.minimize(asm.PointDistance(block.point(0, 0, 0), (0.0, 0.0, 9.0)))
    f = asm.Response(scene, asm.Measure(slide), [asm.Parameter(slide, "limits", k) for k in order])
    values = np.array([1.0, 2.0])[list(order)]
    # Rows are held to 1e-10 of the scene's size.
    assert np.isclose(f(values), 2.0, rtol=0, atol=1e-9)
    assert slide.limits == (-1.0, 0.5)
    with pytest.raises(asm.errors.InputError, match="expected lower <= upper"):
        f(values[::-1])
    assert slide.limits == (-1.0, 0.5)


def test_values_that_the_scene_cannot_have_cost_the_penalty_as_well(crank):
    scene, travel, radius, length, angle = crank
    angle._number.owner.limits = (0.0, 1.0)
    f = asm.Response(scene, travel, angle, penalty=99.0)
    found, rates = f.both([1.5])
    assert found == 99.0 and not rates.any() and f.failures == 1 and angle.value == 0.7
    with pytest.raises(asm.errors.InputError, match="expected a value within the limits"):
        asm.Response(scene, travel, angle)([1.5])
    with pytest.raises(TypeError, match="scene is 3; expected an Assembly"):
        asm.Response(3, travel, angle)
    with pytest.raises(TypeError, match="scene is 3; expected an Assembly"):
        asm.sensitivity(3, scene.solve(), travel, angle)
    with pytest.raises(TypeError, match="limits is 5; expected a mapping"):
        asm.tolerances(scene, scene.solve(), travel, {angle: asm.Normal(0.1)}, samples=1, limits=5)
