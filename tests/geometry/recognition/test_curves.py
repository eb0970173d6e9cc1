"""Curves that are lines or circles: arcs of several spans, rewritten, near misses, and what their deviations say."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry.recognition.curves import Circle, Line, curve_form
from assembly.geometry.splines import bezier
from tests.geometry.recognition.constructions import Placement, arc


def pieces_of(net, degree):
    """Homogeneous points (spans * degree + 1, 3) of the plane z = 0 as Bezier pieces of space."""
    space = np.column_stack([net[:, :2], np.zeros(len(net)), net[:, 2]])
    return np.stack([space[k : k + degree + 1] for k in range(0, len(net) - 1, degree)])


def placed(pieces, where):
    w = pieces[..., 3:]
    return np.concatenate([where.scale * pieces[..., :3] @ where.rotation.T + where.translation * w, w], axis=-1)


def samples(pieces):
    values = bezier.bernstein(pieces.shape[1] - 1, np.linspace(0.0, 1.0, 51)) @ pieces
    return (values[..., :3] / values[..., 3:]).reshape(-1, 3)


@pytest.mark.parametrize("far", [0.0, 1.0, 1e3])
def test_arcs_in_space(far, cases):
    rng = np.random.default_rng(int(far))
    for _ in range(cases(30, 1000)):
        radius, angle = 10.0 ** rng.uniform(-3, 3), rng.uniform(0.02, 2 * np.pi)
        net = arc(angle, int(np.ceil(angle / 2)) + int(rng.integers(2)))[0] * [radius, radius, 1.0]
        pieces = pieces_of(net, 2)
        degree = 2 + int(rng.integers(3))
        pieces = bezier.elevation(2, degree) @ pieces
        pieces = pieces * rng.uniform(0.7, 1.4) ** np.arange(degree + 1)[:, None]
        where = Placement(rng, radius, far)
        pieces = placed(pieces, where)
        found = curve_form([pieces[:1], pieces[1:]] if len(pieces) > 1 else [pieces])
        assert isinstance(found, Circle)
        points = samples(pieces)
        largest = np.abs(points).max()
        off = points - found.center
        z = off @ found.axis
        apart = np.hypot(np.linalg.norm(off - z[:, None] * found.axis, axis=1) - found.radius, z)
        assert apart.max() <= found.deviation + 1e-14 * largest
        size = where.scale * radius
        # What an arc tells of its center goes by the square of its angle.
        slack = (1e-13 * size + 1e-14 * largest) / min(angle, 1.0) ** 2
        assert abs(found.radius - size) < 30.0 * slack
        np.testing.assert_allclose(found.center, where.point([0, 0, 0]), atol=30.0 * slack)


def test_lines_and_what_is_neither():
    rng = np.random.default_rng(1)
    ends = rng.standard_normal((2, 3))
    along = ends[0] + np.array([0.0, 0.2, 0.9, 1.0])[:, None] * (ends[1] - ends[0])
    w = rng.uniform(0.5, 2.0, (4, 1))
    found = curve_form([np.concatenate([along * w, w], axis=1)[None]])
    assert isinstance(found, Line) and found.deviation < 1e-13
    assert np.linalg.norm(np.cross(found.direction, ends[1] - ends[0])) < 1e-14
    # A circle that is an ellipse by 1e-9, and one that is out of its plane by as much.
    pieces = pieces_of(arc(2.0, 2)[0], 2)
    for change in ([1.0 + 1e-9, 1.0, 1.0, 1.0], None):
        near = pieces * change if change else pieces + [0.0, 0.0, 1e-9, 0.0] * (np.arange(3)[:, None] == 1)
        assert curve_form([near]) is None
        wide = curve_form([near], 1e-6)
        assert isinstance(wide, Circle) and 1e-11 < wide.deviation < 1e-8
    assert curve_form([np.ones((1, 3, 4))]) is None
