"""Whatever is given to a maker: it works, or it raises what is raised on purpose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import assembly as asm
from assembly.errors import AssemblyError, InputError

numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-(10**30), 10**30),
    st.sampled_from([0, 1, -1, 2, 1e-320, 1e308, 0.5, True]),
)
junk = st.one_of(
    numbers,
    st.none(),
    st.text(max_size=4),
    st.lists(numbers, max_size=8),
    st.lists(st.lists(numbers, min_size=1, max_size=4), max_size=6),
    st.lists(st.lists(st.lists(numbers, min_size=3, max_size=3), min_size=2, max_size=4), min_size=2, max_size=4),
    st.just(object()),
    st.just(1 + 2j),
    st.just(np.array(["a"])),
    st.just({}),
)

BALL = asm.shapes.sphere(1.0)
A, B = asm.Body("a", BALL, fixed=True), asm.Body("b", BALL, (3.0, 0.0, 0.0))
CLIP = ("length", "width", "wire_radius")
OPTIONS = ("tolerance", "stationarity", "max_iterations", "penalty", "radius", "verbose")
MAKERS = {
    "NurbsCurve": (asm.NurbsCurve, 4),
    "bezier": (asm.NurbsCurve.bezier, 2),
    "polyline": (asm.NurbsCurve.polyline, 1),
    "NurbsSurface": (asm.NurbsSurface, 4),
    "Face": (asm.Face, 3),
    "face of a ball": (lambda *loops: asm.Face(BALL, *loops), 2),
    "Body": (asm.Body, 4),
    "Pose": (asm.Pose, 2),
    "from_axis_angle": (asm.Pose.from_axis_angle, 3),
    "sphere": (asm.shapes.sphere, 1),
    "torus": (asm.shapes.torus, 2),
    "cone": (asm.shapes.cone, 3),
    "box": (asm.shapes.box, 3),
    "paper clip": (
        lambda *x: asm.shapes.paper_clip(**dict(zip(("length", "width", "wire_radius"), x, strict=False))),
        3,
    ),
    "point": (A.point, 3),
    "frame": (A.frame, 3),
    "Contact": (asm.Contact, 2),
    "contact of bodies": (lambda *x: asm.Contact(A, B, *x), 2),
    "Clearance": (asm.Clearance, 2),
    "Revolute": (asm.Revolute, 3),
    "angle": (lambda x: asm.Revolute(A, B, angle=x), 1),
    "Distance": (lambda x: asm.Distance(A.point(0, 0, 0), B.point(0, 0, 0), x), 1),
    "PointDistance": (lambda *x: asm.PointDistance(B.point(0, 0, 0), *x), 2),
    "Posture": (asm.Posture, 2),
    "Assembly": (asm.Assembly, 1),
}


def finite(made):
    """No NaN leaks out of what was made."""
    for name in ("control_points", "knots", "weights", "q", "position", "quaternion", "matrix"):
        value = getattr(made, name, None)
        if isinstance(value, np.ndarray):
            assert np.isfinite(value).all(), name


# Examples of a maker, of which there are many: 20, in a long run 60.
MOST = settings.default.max_examples * 2 // 5


@pytest.mark.parametrize("name", MAKERS)
@settings(max_examples=MOST, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(data=st.data())
def test_makers(name, data):
    make, count = MAKERS[name]
    given_ = [data.draw(junk) for _ in range(data.draw(st.integers(min(1, count), count)))]
    try:
        finite(make(*given_))
    except (AssemblyError, TypeError):
        pass


SHAPES = {
    "plane": (asm.shapes.plane, 2),
    "sphere": (asm.shapes.sphere, 1),
    "ellipsoid": (asm.shapes.ellipsoid, 3),
    "cylinder": (asm.shapes.cylinder, 2),
    "cone": (asm.shapes.cone, 2),
    "frustum": (lambda radius, height, top: asm.shapes.cone(radius, height, top), 3),
    "torus": (asm.shapes.torus, 2),
    "box": (asm.shapes.box, 3),
    "plate": (asm.shapes.plate, 3),
    "solid cylinder": (asm.shapes.solid_cylinder, 2),
    "paper clip": (lambda *x: asm.shapes.paper_clip(**dict(zip(CLIP, x, strict=True))), 3),
    "heart": (asm.curves.heart, 1),
    "helix": (asm.curves.helix, 1),
    "ellipse": (lambda *x: asm.curves.ellipse(x), 2),
}


@pytest.mark.parametrize("huge", [1e-320, 1e-101, 1e101, 1.7e308])
@pytest.mark.parametrize("name", SHAPES)
def test_lengths_without_a_volume(name, huge):
    """Of which a product of three is none."""
    make, count = SHAPES[name]
    for k in range(count):
        with pytest.raises(InputError, match="expected a length from 1e-100 to"):
            make(*(huge if j == k else 1.0 + 0.1 * j for j in range(count)))


@settings(max_examples=100)
@given(value=junk, option=st.sampled_from(OPTIONS))
def test_options(value, option):
    scene = asm.Assembly([A, B])
    scene.constrain(asm.Contact(A, B))
    try:
        solution = scene.solve(**{option: value})
    except (AssemblyError, TypeError):
        return
    assert np.isfinite(solution.q).all()


@settings(max_examples=100)
@given(q=junk)
def test_starts(q):
    scene = asm.Assembly([A, B])
    scene.constrain(asm.Contact(A, B))
    try:
        solution = scene.solve(q)
    except (AssemblyError, TypeError):
        return
    assert np.isfinite(solution.q).all()
