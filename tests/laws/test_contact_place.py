"""Places of contacts: rows, the objective and its derivatives against differences of pairs solved again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.program import records as layout
from assembly.proximity.features.solid_contact import TRACK
from tests.laws.loop_point import LoopPoint, moved
from tests.laws.scenes import dome, placed
from tests.laws.test_solve_formulas import slope_of

SURFACES = ("torus", "ellipsoid", "dome")
# The target off the contact, as parts of the domain: a point, both lines, and far beyond a seam.
TARGETS = ((0.04, -0.05), (0.03, None), (None, 0.06), (0.9, 0.04))


@dataclass(frozen=True, eq=False)
class PlaceScene:
    """Two moving bodies, the pair at x (4,), and a place on one of them, as a constraint and as an objective."""

    scene: asm.Assembly
    place: asm.ContactPlace
    x: np.ndarray

    def at(self, q, x=None):
        """A point of the solve with the contact tracked from x."""
        tracked = np.zeros((int(self.scene.packed().table[layout.TRACKED]), TRACK))
        tracked[0, :4] = self.x if x is None else x
        return LoopPoint(self.scene, q, tracked)

    def errors(self, x):
        """The rows by hand: differences the shorter way around, by the surface's stretch, over the scene's size."""
        surface, o = self.place.face.surface, 2 * self.place.side
        d = np.zeros(2)
        for k, (value, goal) in enumerate(zip(x[o : o + 2], self.place.target, strict=True)):
            if goal is not None:
                turns = (np.arange(-3, 4) if surface.closed[k] else np.zeros(1)) * np.ptp(surface.domain[k])
                ways = value - goal + turns
                d[k] = ways[np.argmin(np.abs(ways))]
        return self.place.stretch @ d / self.scene.packed().scale


def place_scene(seed, kind, side, off, gap=0.0, pole=None, pole_of="own"):
    """A surface and an ellipsoid, the contact inside both, or so near to a pole of one of them."""
    rng = np.random.default_rng(seed)
    surfaces = {
        "torus": lambda: asm.shapes.torus(rng.uniform(1.8, 2.4), rng.uniform(0.6, 0.9)),
        "ellipsoid": lambda: asm.shapes.ellipsoid(*rng.uniform(1.0, 2.0, 3)),
        "dome": lambda: dome(rng),
    }
    own, other = surfaces[kind](), asm.shapes.ellipsoid(*rng.uniform(0.5, 1.0, 3))
    places = []
    for surface in (own, other):
        # In the middle of spans: third derivatives jump at knots. Of a torus the outer side.
        inside = []
        for k, breaks in enumerate(surface.breaks()):
            middle = 0 if surface is own and kind == "torus" and k == 1 else (breaks.size - 1) // 2
            inside.append(breaks[middle] + rng.uniform(0.3, 0.7) * (breaks[middle + 1] - breaks[middle]))
        places.append(np.array(inside))
    if pole is not None:
        k = 0 if pole_of == "own" else 1
        places[k][1] = (own, other)[k].domain[1][0] + pole * np.ptp((own, other)[k].domain[1])
    spans = np.ptp(own.domain, axis=1)
    target = [None if part is None else float(places[0][k] + part * spans[k]) for k, part in enumerate(off)]
    faces = [asm.Face(own), asm.Face(other)]
    if side == "b":
        faces, places = faces[::-1], places[::-1]
    q_f = np.concatenate([rng.normal(size=3), rng.normal(size=4)])
    q_f[3:] /= np.linalg.norm(q_f[3:])
    q_g = placed(faces[0], places[0], q_f, faces[1], places[1], gap, rng.uniform(0.0, 6.3))
    bodies = [asm.Body(n, f, q[:3], q[3:]) for n, f, q in zip("fg", faces, (q_f, q_g), strict=True)]
    scene = asm.Assembly(bodies)
    contact = asm.Contact(*bodies, "contact")
    place = asm.ContactPlace(contact, side, target, 1.7)
    scene.constrain(contact, place)
    scene.minimize(place)
    return PlaceScene(scene, place, np.concatenate(places))


CASES = [
    (k, kind, "ab"[(k + j) % 2], off, (0.05, 0.0)[k % 2])
    for j, kind in enumerate(SURFACES)
    for k, off in enumerate(TARGETS)
]
CASES = [case for case in CASES if not (case[1] == "dome" and case[3] == TARGETS[3])]


def along(made, point, seed, count=2):
    """Random unit ways of all unknowns, and the point of the solve so many steps along one."""
    ways = np.random.default_rng(seed).normal(size=(count, 12))

    def there(way, t):
        # Twice: after a last small step a pair's curvatures are those before it.
        q = moved(made.scene, made.scene.q, t * way)
        return made.at(q, made.at(q, point.tracked[0, :4]).tracked[0, :4])

    return ways / np.linalg.norm(ways, axis=1, keepdims=True), there


@pytest.mark.parametrize("case", CASES, ids=str)
def test_derivatives(case):
    """Slopes along ways, and the slopes of these, which are the Hessian's quadratic form."""
    made = place_scene(*case)
    point, rows = made.at(made.scene.q), made.place.rows
    errors = made.errors(point.tracked[0])
    np.testing.assert_allclose(point.residual[1:], errors, rtol=0, atol=1e-14)
    assert np.abs(errors).max() > 1e-3
    jacobian = point.jacobian()
    assert np.linalg.matrix_rank(jacobian, 1e-3) == 1 + rows
    value, gradient, hessian = point.goal()
    # Alone in its objective, it counts one of its own weight.
    np.testing.assert_allclose(value, errors @ errors, rtol=1e-13)
    uv = made.x[2 * made.place.side :][:2]
    np.testing.assert_allclose(value * made.scene.packed().unit, 1.7 * made.place.distance(*uv) ** 2, rtol=1e-11)
    y = np.concatenate([[0.0], [0.7, -0.4][:rows]])
    curvature = point.row_terms(y)
    ways, there = along(made, point, 7)
    for way in ways:

        def figures(t, way=way):
            here = there(way, t)
            value, slopes, _ = here.goal()
            return np.array([*here.residual[1:], value, slopes @ way, y @ here.jacobian() @ way])

        # Steps of 1e-3 to the sixth times a seventh derivative of some 1e6; pairs are exact to 1e-14, over the step.
        expected = slope_of(figures, 1e-3)
        found = [*(jacobian[1:] @ way), gradient @ way, way @ hessian @ way, way @ curvature @ way]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("pole_of", ["own", "other"])
@pytest.mark.parametrize("near", [1e-2, 1e-4])
def test_derivatives_near_a_pole(near, pole_of):
    """The contact is so near to a pole of its face, or of the other one: coordinates turn fast there, or not at all."""
    made = place_scene(3, "ellipsoid", "a", (0.02, 0.1), pole=near, pole_of=pole_of)
    point = made.at(made.scene.q)
    _, gradient, hessian = point.goal()
    ways, there = along(made, point, 8, 1)
    (way,) = ways

    def figures(t):
        value, slopes, _ = there(way, t).goal()
        return np.array([value, slopes @ way])

    expected = slope_of(figures, 1e-2 * near if pole_of == "own" else 1e-3)
    # An azimuth turns by one over the distance from its pole, and its rounding with it.
    np.testing.assert_allclose(gradient @ way, expected[0], rtol=1e-7, atol=0)
    np.testing.assert_allclose(way @ hessian @ way, expected[1], rtol=1e-5, atol=0)


@pytest.mark.parametrize("pole_of", ["own", "other"])
def test_at_a_pole_all_is_finite(pole_of):
    made = place_scene(3, "ellipsoid", "a", (0.02, 0.1), pole=0.0, pole_of=pole_of)
    value, gradient, hessian = made.at(made.scene.q).goal()
    assert np.isfinite(value) and np.isfinite(gradient).all() and np.isfinite(hessian).all()
