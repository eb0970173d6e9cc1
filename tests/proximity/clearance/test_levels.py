"""Levels of a cone: no point of a face is beyond the bound of the face, and what fills a seat is told exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.levels import Level
from tests.proximity.clearance.scenes import direction, faces_of
from tests.proximity.clearance.splines import shapes
from tests.proximity.clearance.turned import plug, seat

SHAPES = shapes()
SLOPE = np.tan(0.5)


def points_on(rng, face, count=300):
    """Random points of a face."""
    u, v = (rng.uniform(*ends, count) for ends in face.surface.domain)
    within = face.contains(u, v) if face.boundary else np.ones(count, dtype=bool)
    return face.surface.evaluate(u[within], v[within])


@pytest.mark.parametrize("name", ["pin", "plate", "ball", "torus", "sheet", "cone", "box", "plug", "seat"])
def test_no_point_is_beyond_the_bounds(name, cases):
    rng, solids = np.random.default_rng(0), {"plug": plug(SLOPE, 1.2, 2.5), "seat": seat(SLOPE, 1.0, 2.0, 3.0)}
    faces = faces_of(solids.get(name) or SHAPES[name])
    samples = [points_on(rng, face) for face in solid_of(faces).faces]
    for k in range(cases(24, 240)):
        # Along the axis of what has one, too, where flat faces are across it; cones, and planes.
        axis = direction(rng) if k % 2 else np.array([0.0, 0.0, 1.0 - 2.0 * (k % 4 == 0)])
        level = Level(rng.normal(size=3), axis, -0.5 * np.pi if k % 3 == 0 else rng.uniform(0.02, 1.5))
        turn, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
        for one, (m, t) in ((level, (np.eye(3), np.zeros(3))), (level.seen_from(turn, shift), (turn, shift))):
            least, most = one.least_of_faces(faces), one.most_of_faces(faces)
            for points, low, high in zip(samples, least, most, strict=True):
                values = level.of_points(points @ m.T + t)
                assert low - 1e-13 <= values.min(initial=np.inf) and values.max(initial=-np.inf) <= high + 1e-13


def test_of_a_seat_and_its_plug_all_is_told():
    """All of the block is outside of its seat's cone, and all of the plug within, to rounding."""
    level = Level(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.5)
    least = level.least_of_faces(seat(SLOPE, 1.0, 2.0, 3.0), 3)
    assert least[[0, 2, 3]] == pytest.approx(0.0, abs=1e-13) and least[1] > 1.0
    most = level.seen_from(np.eye(3), np.array([0.0, 0.0, 0.01])).most_of_faces(plug(SLOPE, 1.2, 2.5))
    # Lifted along the axis it is off by the sine of the half angle; the ends are within by their rims.
    assert most == pytest.approx(-0.01 * np.sin(0.5), abs=1e-13)
    # A cone that leans about its apex goes out by its longest side.
    tilt = Rotation.from_rotvec([1e-3, 0.0, 0.0]).as_matrix()
    assert level.seen_from(tilt, np.zeros(3)).most_of_faces(plug(SLOPE, 1.2, 2.5))[1] == pytest.approx(
        2.5 / np.cos(0.5) * np.sin(1e-3), rel=1e-9
    )
