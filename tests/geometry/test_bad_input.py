from __future__ import annotations

import numpy as np
import pytest

from assembly import errors
from assembly.geometry import shapes
from assembly.geometry.shapes.path import Path
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

LINE = [[0.0, 0.0], [1.0, 0.0]]
PATCH = np.zeros((2, 2, 3)) + np.arange(2.0)[:, None, None] + np.arange(2.0)[:, None] * [0.0, 1.0, 2.0]
K = [0.0, 0.0, 1.0, 1.0]
GOOD_CURVE = NurbsCurve(LINE, K, 1)
GOOD = NurbsSurface(PATCH, (K, K), (1, 1))
RING = Path().line(5.0)
HIDDEN = np.ma.array(LINE, mask=[[True, False], [False, False]])
MANY = np.random.default_rng(0).normal(size=(20, 2))

CASES = {
    "curve text": (lambda: NurbsCurve("abc", K, 1), "control_points is 'abc'; expected real numbers"),
    "curve ragged": (lambda: NurbsCurve([[0, 0], [1]], K, 1), "control_points is"),
    "curve complex": (lambda: NurbsCurve([[1j, 0], [1, 1]], K, 1), "control_points is"),
    "curve 1-D": (lambda: NurbsCurve([0, 1], K, 1), r"control_points has shape \(2,\); expected \(n, d\)"),
    "curve 4-D": (lambda: NurbsCurve(np.zeros((2, 4)), K, 1), r"shape \(2, 4\); expected \(n, 2\) or \(n, 3\)"),
    "curve empty": (lambda: NurbsCurve(np.zeros((0, 2)), K, 1), "control_points has shape"),
    "curve nan": (lambda: NurbsCurve([[0, np.nan], [1, 1]], K, 1), r"control_points\[0, 1\] is nan"),
    "curve inf": (lambda: NurbsCurve([[0, 0], [np.inf, 1]], K, 1), r"control_points\[1, 0\] is inf"),
    "degree text": (lambda: NurbsCurve(LINE, K, "1"), "degree is '1'; expected an integer"),
    "degree float": (lambda: NurbsCurve(LINE, K, 1.0), "degree is 1.0; expected an integer"),
    "degree zero": (lambda: NurbsCurve(LINE, K, 0), "degree is 0; expected an integer from 1 to 50"),
    "degree high": (lambda: NurbsCurve(MANY, np.arange(72), 51), "degree is 51; expected an integer from 1 to 50"),
    "degree of few points": (lambda: NurbsCurve(LINE, K, 2), "degree is 2; expected at most 1 with 2 control points"),
    "knots count": (lambda: NurbsCurve(LINE, [0, 0, 1], 1), "knots has 3 values; expected 4"),
    "knots shape": (lambda: NurbsCurve(LINE, [K], 1), r"knots has shape \(1, 4\); expected \(n,\)"),
    "knots nan": (lambda: NurbsCurve(LINE, [0, 0, np.nan, 1], 1), r"knots\[2\] is nan"),
    "knots decreasing": (lambda: NurbsCurve(LINE, [0, 1, 0.5, 2], 1), "knots decreases from 1 to 0.5 at index 2"),
    "knots empty domain": (lambda: NurbsCurve(LINE, [0, 1, 1, 2], 1), r"empty domain \[1, 1\]"),
    "knots tear": (
        lambda: NurbsCurve(MANY[:4], [0, 0, 1, 1, 2, 2], 1),
        "knots holds 1 2 times; expected at most 1",
    ),
    "knots tear at the end": (lambda: NurbsCurve(MANY[:3], [0, 0, 0, 1, 1], 1), "knots holds 0 3 times"),
    "knots sliver": (lambda: NurbsCurve(MANY[:3], [0, 0, 1e-20, 1, 1], 1), "knots has a span of 1e-20"),
    "weights shape": (lambda: NurbsCurve(LINE, K, 1, [1]), r"weights has shape \(1,\); expected \(2,\)"),
    "weights zero": (lambda: NurbsCurve(LINE, K, 1, [1, 0]), r"weights\[1\] is 0; expected positive"),
    "weights nan": (lambda: NurbsCurve(LINE, K, 1, [1, np.nan]), r"weights\[1\] is nan"),
    "t text": (lambda: GOOD_CURVE.evaluate("here"), "t is 'here'; expected real numbers"),
    "curve masked": (lambda: NurbsCurve(HIDDEN, K, 1), "control_points has masked values; expected real numbers"),
    "t masked": (lambda: GOOD_CURVE.evaluate(HIDDEN[0]), "t has masked values; expected real numbers"),
    "t complex": (lambda: GOOD_CURVE.evaluate(1j), "t is 1j"),
    "t outside": (lambda: GOOD_CURVE.evaluate([0.5, 1.5]), r"t is 1.5; expected a parameter in the domain \[0, 1\]"),
    "order": (lambda: GOOD_CURVE.evaluate(0.5, 3), "order is 3; expected an integer from 0 to 2"),
    "insert outside": (lambda: GOOD_CURVE.insert_knot(2.0), r"value is 2; expected a knot in the domain \[0, 1\]"),
    "insert nan": (lambda: GOOD_CURVE.insert_knot(np.nan), "value is nan"),
    "insert times": (lambda: GOOD_CURVE.insert_knot(0.5, 0), "times is 0"),
    "insert too often": (lambda: GOOD_CURVE.insert_knot(0.5, 2), "times is 2"),
    "elevate down": (lambda: GOOD.elevate((0, 1)), r"degree\[0\] is 0; expected an integer from 1 to 15"),
    "surface shape": (lambda: NurbsSurface(LINE, (K, K), (1, 1)), r"control_points has shape \(2, 2\); expected \(n_u"),
    "surface plane": (lambda: NurbsSurface(PATCH[..., :2], (K, K), (1, 1)), "control_points has shape"),
    "surface nan": (lambda: NurbsSurface(PATCH * np.nan, (K, K), (1, 1)), r"control_points\[0, 0, 0\] is nan"),
    "surface degree": (lambda: NurbsSurface(PATCH, (K, K), 1), "degree is 1; expected a pair"),
    "surface degrees": (lambda: NurbsSurface(PATCH, (K, K), (1, 2)), r"degree\[1\] is 2; expected at most 1"),
    "surface knots": (lambda: NurbsSurface(PATCH, K, (1, 1)), "knots is .*; expected a pair"),
    "surface knots v": (lambda: NurbsSurface(PATCH, (K, [0, 0, 1]), (1, 1)), r"knots\[1\] has 3 values"),
    "surface weights": (lambda: NurbsSurface(PATCH, (K, K), (1, 1), np.ones(4)), "weights has shape"),
    "surface weight": (lambda: NurbsSurface(PATCH, (K, K), (1, 1), -np.ones((2, 2))), r"weights\[0, 0\] is -1"),
    "surface u": (lambda: GOOD.evaluate(-0.1, 0.5), "^u is -0.1"),
    "surface v": (lambda: GOOD.evaluate(0.1, [[0.5], [7.0]]), "^v is 7"),
    "surface order": (lambda: GOOD.evaluate(0.1, 0.5, -1), "order is -1"),
    "surface direction": (lambda: GOOD.insert_knot(2, 0.5), "direction is 2; expected an integer from 0 to 1"),
    "rotation shape": (lambda: GOOD.transformed(np.eye(4)), r"rotation has shape \(4, 4\)"),
    "rotation mirror": (lambda: GOOD.transformed(np.diag([1, 1, -1])), "expected a proper rotation"),
    "rotation stretch": (lambda: GOOD.transformed(1.1 * np.eye(3)), "expected a proper rotation"),
    "translation": (lambda: GOOD.transformed(translation=(1, 2)), r"translation has shape \(2,\)"),
    "scale": (lambda: GOOD.transformed(scale=0.0), "scale is 0"),
    "scale nan": (lambda: GOOD.transformed(scale=np.nan), "scale is nan"),
    "overflow": (lambda: NurbsSurface(PATCH, (np.array(K) * 1e-320, K), (1, 1)).evaluate(0.0, 0.5), "knots span"),
    "sphere": (lambda: shapes.sphere(-1.0), "radius is -1; expected a positive number"),
    "sphere text": (lambda: shapes.sphere("big"), "radius is 'big'"),
    "sphere inf": (lambda: shapes.sphere(np.inf), "radius is inf"),
    "plane": (lambda: shapes.plane(1.0, 0.0), "height is 0"),
    "ellipsoid": (lambda: shapes.ellipsoid(1.0, np.nan, 1.0), "b is nan"),
    "cylinder": (lambda: shapes.cylinder(1.0, -2.0), "height is -2"),
    "cone": (lambda: shapes.cone(0.0, 1.0), "radius is 0"),
    "cone top": (lambda: shapes.cone(1.0, 1.0, -0.5), "top_radius is -0.5; expected zero or a positive"),
    "torus": (lambda: shapes.torus(1.0, 1.0), "minor_radius is 1; expected less than major_radius, 1"),
    "box": (lambda: shapes.box(1.0, 2.0, None), "z is None"),
    "pipe radius": (lambda: shapes.pipe(RING, 0.0), "radius is 0"),
    "pipe empty": (lambda: shapes.pipe(Path(), 1.0), "path has no pieces"),
    "pipe arc": (lambda: shapes.pipe(RING.arc(0.5, 1.0, (1, 0, 0)), 0.5), "path has an arc of radius 0.5"),
    "path start": (lambda: Path((0, 0)), r"start has shape \(2,\)"),
    "path direction": (lambda: Path((0, 0, 0), (0, 0, 0)), "direction is .*; expected a vector with a direction"),
    "path line": (lambda: Path().line(0.0), "length is 0"),
    "path angle": (lambda: RING.arc(1.0, 7.0, (1, 0, 0)), "angle is 7; expected at most a full turn"),
    "path angle sign": (lambda: RING.arc(1.0, -1.0, (1, 0, 0)), "angle is -1"),
    "path radius": (lambda: RING.arc(0.0, 1.0, (1, 0, 0)), "radius is 0"),
    "path toward": (lambda: RING.arc(1.0, 1.0, (0, 0, 2)), "toward is .*, along the path"),
    "clip wire": (lambda: shapes.paper_clip(33, 8, 0.0), "wire_radius is 0"),
    "clip narrow": (lambda: shapes.paper_clip(33, 4.9, 0.5), "width is 4.9; expected more than 5"),
    "clip short": (lambda: shapes.paper_clip(7, 8, 0.5), "length is 7; expected more than 7.25"),
    "clip gap": (lambda: shapes.paper_clip(33, 8, 0.5, gap=0.0), "gap is 0"),
    "clip legs": (lambda: shapes.paper_clip(33, 8, 0.5, legs=(1, 2)), r"legs has shape \(2,\)"),
    "clip long legs": (lambda: shapes.paper_clip(33, 8, 0.5, legs=(1, 30, 1)), r"legs is \(1, 30, 1\)"),
    "clip last leg": (lambda: shapes.paper_clip(33, 8, 0.5, legs=(1, 20, 21)), r"legs is \(1, 20, 21\)"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_named_with_what_came_and_what_was_expected(case):
    call, text = CASES[case]
    with pytest.raises(errors.InputError, match=text) as caught:
        call()
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, errors.AssemblyError)


@pytest.mark.parametrize(
    "call",
    [
        lambda: NurbsCurve(LINE, K, 1, name=3),
        lambda: NurbsSurface(PATCH, (K, K), (1, 1), name=b"x"),
        lambda: shapes.pipe("a line", 1.0),
    ],
)
def test_a_wrong_kind_of_object_is_a_type_error(call):
    with pytest.raises(TypeError, match="expected"):
        call()


def test_a_closed_path_that_twists_its_cross_section_is_refused():
    # Straight along each direction in turn, with quarter turns of radius 1 between them. The way x, y, z, x
    # alone turns the cross section by the area of an eighth of the unit sphere, a quarter turn.
    x, y, z = np.eye(3)
    legs = [(x, 1.0), (y, 1.0), (z, 1.0), (x, 1.0), (-y, 1.0), (-x, 4.0), (-z, 1.0)]
    path = Path((0, 0, 0), x)
    for k, (_, length) in enumerate(legs):
        path = path.line(length).arc(1.0, np.pi / 2, legs[(k + 1) % len(legs)][0])
    assert path.closed
    with pytest.raises(errors.InputError, match="twisted"):
        shapes.pipe(path, 0.2)
