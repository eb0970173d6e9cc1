"""Newton's method in a box: on functions whose minima are known, and on those that are hard for it."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np
import pytest

from assembly._newton import bracketed_newton, damped_newton
from assembly.geometry.nearest_place import Interval, held_in, move_along, sight_of, step_along

Value = namedtuple("Value", "slope curvature x")
RISING = {
    "a line": (lambda x: x, lambda x: 1.0),
    "a cubic": (lambda x: x**3 + 0.1 * x, lambda x: 3.0 * x * x + 0.1),
    "a root of order five": (lambda x: x**5, lambda x: 5.0 * x**4),
    "far from straight": (lambda x: math.atan(1e3 * x), lambda x: 1e3 / (1.0 + 1e6 * x * x)),
    # Newton's method goes to and fro between x and -x.
    "a square root": (lambda x: math.copysign(math.sqrt(abs(x)), x), lambda x: 0.5 / math.sqrt(max(abs(x), 1e-300))),
    "no derivative": (lambda x: math.sinh(x), lambda x: 0.0),
    "a derivative of the wrong sign": (lambda x: math.sinh(x), lambda x: -1.0),
    "a jump": (lambda x: -1.0 if x < 0.0 else 1.0, lambda x: 0.0),
}


def rising(function, seen):
    value, rate = function

    def evaluate(root, x):
        seen.append(x)
        return Value(value(x - root), rate(x - root), x)

    return evaluate


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("name", RISING)
def test_a_root_between_two_ends_is_found_to_rounding(name, inside):
    rng = np.random.default_rng(1)
    for _ in range(40):
        seen = []
        root, low, high = (float(x) for x in rng.uniform(-1.0, 1.0) + np.array([0.0, *(rng.uniform(0.01, 3.0, 2))]))
        low = 2.0 * root - low
        x, at = bracketed_newton(rising(RISING[name], seen), inside=inside)(root, low, high, rng.uniform(low, high))
        # What is returned was evaluated where it is said to be.
        assert at.x == x
        # A root of order five is a root to rounding in a fifth of the digits.
        slack = 1e-3 if name == "a root of order five" else 1e-15
        assert abs(x - root) <= slack * max(abs(root), high - low)
        assert all(low <= y <= high for y in seen)
        assert len(seen) <= 81


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_function_of_one_sign_has_its_minimum_at_an_end(side):
    rng = np.random.default_rng(2)
    for name in RISING:
        start = rng.uniform(0.0, 2.0)
        x, at = bracketed_newton(rising(RISING[name], []), inside=False)(1.0 + side * 1.5, 0.0, 2.0, start)
        # By bisection it comes as near to the end as a double can.
        assert x == pytest.approx(1.0 + side, abs=1e-15) and at.slope * side < 0.0, name


def test_an_end_is_gone_to_where_the_root_may_be_there_only():
    for name in ("a line", "a cubic"):
        seen = []
        x, _at = bracketed_newton(rising(RISING[name], seen), inside=False)(3.0, 0.0, 2.0, 0.7)
        assert x == 2.0 and len(seen) <= 4
    seen = []
    bracketed_newton(rising(RISING["far from straight"], seen), inside=True)(0.7, 0.0, 2.0, 1.3)
    assert 0.0 < min(seen) and max(seen) < 2.0


def test_a_start_at_the_root_is_all_that_is_evaluated():
    seen = []
    assert bracketed_newton(rising(RISING["no derivative"], seen), inside=True)(0.5, 0.0, 2.0, 0.5)[0] == 0.5
    assert seen == [0.5]


def test_a_root_at_an_end_is_found():
    for inside in (True, False):
        for root in (0.0, 2.0):
            x, _at = bracketed_newton(rising(RISING["a cubic"], []), inside=inside)(root, 0.0, 2.0, 1.3)
            assert x == pytest.approx(root, abs=1e-15)


def test_newton_steps_are_few():
    seen = []
    bracketed_newton(rising(RISING["a cubic"], seen), inside=True)(0.3, -1.0, 2.0, 0.9)
    assert len(seen) <= 10


def test_coarse_roots_take_fewer_places():
    counts = []
    for resolution in (1e-15, 1e-3):
        seen = []
        x, _at = bracketed_newton(rising(RISING["no derivative"], seen), inside=True, resolution=resolution)(
            0.3, -1.0, 2.0, 0.9
        )
        assert abs(x - 0.3) <= 3.0 * resolution
        counts.append(len(seen))
    assert counts[1] < counts[0] / 3


def test_a_step_is_measured_by_the_interval_too():
    seen = []
    bracketed_newton(rising(RISING["no derivative"], seen), inside=True, resolution=1e-3)(0.0, -1.0, 2.0, 0.9)
    assert len(seen) <= 12


def test_neighboring_doubles_have_none_between():
    for root in (1.0, 520.3, 537.6, 1e3):
        seen = []
        bracketed_newton(rising(RISING["a jump"], seen), inside=True)(root, root - 1.0, root + 2.0, root + 0.7)
        assert len(seen) <= 60


def test_a_sight_has_the_derivatives_of_its_merit():
    curve, h = Curve(np.array([0.3, 0.8]), None, circle), 1e-4
    before, at, after = (see(curve, 0.4 + k * h) for k in (-1, 0, 1))
    assert at.slope == pytest.approx((after.merit - before.merit) / (2.0 * h), abs=1e-8)
    assert at.curvature == pytest.approx((after.merit - 2.0 * at.merit + before.merit) / h**2, abs=1e-7)


def test_what_is_not_a_number_ends():
    seen = []
    bracketed_newton(rising((lambda x: math.nan, lambda x: math.nan), seen), inside=True)(0.3, -1.0, 2.0, 0.9)
    assert len(seen) <= 81


Known = namedtuple("Known", "merit gradient hessian")
Box = namedtuple("Box", "function low high")


def look(box, x):
    return Known(*box.function(np.array(x)))


def newton_step(box, x, at):
    """Held are coordinates at ends that the slope or the step leads out of; the Hessian is raised until positive."""
    x, slope, step = np.array(x), at.gradient.copy(), -at.gradient
    low, high = x <= box.low, x >= box.high
    held = np.zeros(len(x), dtype=bool)
    while (more := ~held & ((low & (step <= 0.0)) | (high & (step >= 0.0)))).any():
        held |= more
        slope[held] = 0.0
        values, vectors = np.linalg.eigh(np.where(held[:, None] | held[None], np.eye(len(x)), at.hessian))
        step = -vectors @ ((vectors.T @ slope) / np.maximum(abs(values), 1e-8))
        step[held] = 0.0
    if not held.any():
        values, vectors = np.linalg.eigh(at.hessian)
        step = -vectors @ ((vectors.T @ slope) / np.maximum(abs(values), 1e-8))
    return tuple(step.tolist()), bool(slope @ step > -1e-15 * abs(at.merit))


def move(box, x, part, step):
    return tuple(np.clip(np.array(x) + part * np.array(step), box.low, box.high).tolist())


descend = damped_newton(look, newton_step, move, steps=60)


def bowl(rng, n, flat):
    """A quadratic, its least eigenvalue `flat`, and a quartic, about a point that may be outside of the unit cube."""
    q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    matrix = (q * np.append(rng.uniform(0.1, 10.0, n - 1), flat)) @ q.T
    center, a = rng.uniform(-0.5, 1.5, n), rng.uniform(0.0, 5.0)

    def function(x):
        d = x - center
        square = d @ d
        return (
            1.0 + 0.5 * d @ matrix @ d + a * square * square,
            matrix @ d + 4.0 * a * square * d,
            matrix + 4.0 * a * square * np.eye(n) + 8.0 * a * np.outer(d, d),
        )

    return function


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("flat", [1.0, 1e-3, -2.0])
def test_a_local_minimum_in_a_box_is_found(n, flat):
    rng = np.random.default_rng(n)
    for _ in range(25):
        box = Box(bowl(rng, n, flat), np.zeros(n), np.ones(n))
        x = np.array(descend(box, tuple(rng.uniform(0.0, 1.0, n).tolist()))[2])
        slope = box.function(x)[1]
        off = np.where(x <= 0.0, np.minimum(slope, 0.0), np.where(x >= 1.0, np.maximum(slope, 0.0), slope))
        assert np.abs(off).max() <= 1e-7, (x, slope)


def test_the_merit_falls_from_place_to_place():
    def steep(x):
        r = np.sqrt(1.0 + x @ x)
        return r, x / r, np.eye(len(x)) / r - np.outer(x, x) / r**3

    seen = []

    def noted(box, x):
        seen.append(look(box, x).merit)
        return look(box, x)

    # A whole step of Newton's method leads from x to about -x^3.
    start = (3.0, -2.0)
    x, at, _last = damped_newton(noted, newton_step, move, steps=60)(Box(steep, -1e3, 1e3), start)
    assert seen[1] > seen[0]
    assert at.merit == min(seen) == pytest.approx(1.0, abs=1e-15)
    assert np.abs(x).max() <= 1e-7


def scripted(merits, promise=0.0, **options):
    """What a descent along a line does whose merits are told one after the other."""
    places = []

    def evaluate(_problem, x):
        places.append(x)
        return Known(merits[len(places) - 1], None, None)

    def step(_problem, x, at):
        return 1.0, at.merit == promise

    found = damped_newton(evaluate, step, lambda _p, x, part, step: x + part * step, **options)(None, 0.0)
    return found[0], found[1].merit, places, found[2]


def test_a_step_that_does_not_lower_the_merit_is_cut_to_a_quarter():
    assert scripted([5.0, 6.0, 7.0, 4.0, 0.0], steps=9)[:3] == (1.0625, 0.0, [0.0, 1.0, 0.25, 0.0625, 1.0625])


def test_how_often_a_step_is_cut_and_how_many_places_there_are():
    rising = [5.0] + [6.0 + k for k in range(30)]
    assert scripted(rising, steps=30, shortenings=0)[2] == [0.0, 1.0]
    assert scripted(rising, steps=30, shortenings=2)[2] == [0.0, 1.0, 0.25, 0.0625]
    assert scripted([5.0, 4.0, 3.0, 2.0, 1.0], steps=3)[2] == [0.0, 1.0, 2.0]
    # In a row, that is.
    assert scripted([5.0, 6.0, 4.0, 6.0, 3.0, 0.0], steps=9, shortenings=1)[:2] == (1.5, 0.0)


def test_the_last_step_is_taken_unless_the_merit_spoke_against_it():
    assert scripted([5.0, 4.0, 0.0], steps=9)[0::3] == (2.0, 3.0)
    assert scripted([5.0, 4.0, 3.0], steps=3)[0::3] == (2.0, 3.0)
    # Cut, but not to where it leads down; a fall by rounding, which may be anywhere.
    assert scripted([5.0, 4.0, 6.0, 6.0], steps=9, shortenings=1)[0::3] == (1.0, 1.0)
    assert scripted([5.0, 4.0, 6.0, 6.0], steps=4)[0::3] == (1.0, 1.0)
    assert scripted([5.0, 5.0 - 1e-15], steps=9)[0::3] == (1.0, 1.0)
    assert scripted([5.0, 5.0 - 1e-15], 5.0 - 1e-15, steps=9)[0::3] == (1.0, 2.0)


def test_a_step_that_leads_nowhere_ends():
    stays = []

    def evaluate(_problem, x):
        stays.append(x)
        return Known(5.0, None, None)

    damped_newton(evaluate, lambda *_: (1.0, False), lambda _p, x, part, step: x, steps=60)(None, 0.0)
    assert stays == [0.0]


def test_a_merit_that_falls_by_rounding_or_not_enough_ends():
    assert scripted([5.0, 5.0 - 1e-15, 4.0], steps=9)[:3] == (1.0, 5.0 - 1e-15, [0.0, 1.0])
    # It may be as large on the other side of a minimum.
    assert scripted([5.0, 5.0, 4.0, 0.0], steps=9)[2] == [0.0, 1.0, 0.25, 1.25]
    assert scripted([5.0, 4.6, 1.0], steps=9, shortenings=0, fall=0.9)[:3] == (0.0, 5.0, [0.0, 1.0])
    assert scripted([5.0, 4.4, 0.0], steps=9, shortenings=0, fall=0.9)[0] == 2.0


def test_a_merit_that_is_not_a_number_is_never_better():
    assert scripted([5.0, math.nan, 4.0, 0.0], steps=9)[:2] == (1.25, 0.0)
    assert math.isnan(scripted([math.nan] * 30, steps=20)[1])


Curve = namedtuple("Curve", "p interval jet")


def see(curve, t):
    c, first, second = (np.append(x, 0.0) for x in curve.jet(t))
    return sight_of(c - np.append(curve.p, 0.0), first, second)


def circle(t):
    c, s = math.cos(t), math.sin(t)
    return np.array([c, s]), np.array([-s, c]), np.array([-c, -s])


# Where a curve counts as straight steps are short: a circle far from its point is.
nearest = damped_newton(see, step_along, move_along, steps=200)


def nearest_place(curve, t):
    return nearest(curve, t)[2]


def test_the_nearest_point_of_a_closed_curve_is_found_from_anywhere():
    rng = np.random.default_rng(5)
    turn = Interval(-math.pi, math.pi, True)
    for radius in (0.05, 0.6, 1.0, 3.0):
        for _ in range(40):
            angle, start = rng.uniform(-math.pi, math.pi, 2)
            t = nearest_place(Curve(radius * circle(angle)[0], turn, circle), start)
            off = math.remainder(t - angle, 2.0 * math.pi)
            assert abs(off) <= 1e-13 / min(radius, 1.0) and -math.pi <= t <= math.pi


def test_the_nearest_point_of_an_arc_may_be_an_end():
    arc = Interval(0.2, 1.2, False)
    for angle, end in ((-0.5, 0.2), (1.9, 1.2), (0.7, 0.7)):
        for start in (0.2, 0.5, 1.2):
            t = nearest_place(Curve(2.0 * circle(angle)[0], arc, circle), start)
            assert t == pytest.approx(end, abs=1e-14)


def test_a_step_is_no_longer_than_the_interval():
    seen = []

    def noted(t):
        seen.append(t)
        return circle(t)

    # As if the curve were straight it leads a million times around, to the end that is farther away.
    curve = Curve(1e6 * circle(math.pi)[0], Interval(0.0, 5.9, False), noted)
    assert nearest_place(curve, 0.5) == pytest.approx(math.pi, abs=1e-13)
    assert len(seen) <= 9


def test_where_a_curve_stands_still_nothing_moves():
    still = Curve(np.ones(2), Interval(0.0, 1.0, False), lambda t: (np.zeros(2), np.zeros(2), np.zeros(2)))
    assert nearest_place(still, 0.4) == 0.4


def test_rounding_where_a_curve_stands_still_leads_nowhere():
    # To a cusp at t = 0 comes what rounding leaves of the derivatives, of which the quotient is a long step.
    noise = np.array([3e-14, 1e-14]), np.array([1e-12, 2e-12])
    cusp = Curve(np.ones(2), Interval(0.0, 1.0, False), lambda t: (np.array([3.0, 2.0]), *noise))
    assert nearest_place(cusp, 0.4) == 0.4


def test_parameters_are_wrapped_or_held():
    closed, arc = Interval(1.0, 3.0, True), Interval(1.0, 3.0, False)
    assert [held_in(closed, x) for x in (0.5, 1.0, 2.0, 3.0, 3.5, 8.5)] == [2.5, 1.0, 2.0, 3.0, 1.5, 2.5]
    assert [held_in(arc, x) for x in (0.5, 1.0, 2.0, 3.0, 3.5)] == [1.0, 1.0, 2.0, 3.0, 3.0]
