"""Faces that lie along each other and come to lean are followed to where they are nearest, without a search."""

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.shapes import solids
from assembly.proximity import FeatureStatus, FeatureTracker, closest_features

HALF = np.sqrt(0.5)
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
# Two solids and a pose at which faces of them are parallel, flat ones or a wall along its length.
CASES = {
    "boxes": (shapes.box(1.0, 0.9, 1.0), shapes.box(0.8, 0.7, 0.8), [0.1, -2.0, -0.1, 1, 0, 0, 0]),
    "boxes in each other": (shapes.box(1.0, 0.9, 1.0), shapes.box(0.8, 0.7, 0.8), [0.1, -0.79, -0.1, 1, 0, 0, 0]),
    "a cap on a plate": (shapes.box(2.0, 2.0, 0.3), solids.solid_cylinder(0.4, 1.0), [0.3, 0.2, 0.7, 1, 0, 0, 0]),
    "a wall on a plate": (
        shapes.box(3.0, 3.0, 0.3),
        solids.solid_cylinder(0.4, 1.0),
        [0.3, 0.2, 0.9, HALF, HALF, 0, 0],
    ),
    "a plate on a wall": (solids.solid_cylinder(0.4, 3.0), shapes.box(0.3, 2.0, 1.0), [0.7, 0.2, 1.0, 1, 0, 0, 0]),
    "two walls": (solids.solid_cylinder(0.4, 3.0), solids.solid_cylinder(0.3, 1.0), [0.9, 0.0, 1.0, 1, 0, 0, 0]),
}


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("name", CASES)
def test_a_pair_follows_the_slope(name, scale, cases):
    a, b, place = CASES[name]
    a, b = ([type(f)(f.surface.transformed(scale=scale), **loops(f, scale)) for f in part] for part in (a, b))
    place = np.array(place, dtype=float)
    place[:3] *= scale
    rng = np.random.default_rng(8)
    followed = 0
    for angle in (1e-8, 1e-5, 1e-3, 0.03):
        for _ in range(cases(1, 4)):
            tracker = FeatureTracker(a, b)
            level = tracker.step(IDENTITY, place)
            of_faces = all(feature.kind == "face" for feature in level.features)
            axis = rng.normal(size=3)
            axis *= np.sin(0.5 * angle) / np.linalg.norm(axis)
            w, u = place[3], place[4:]
            c = np.cos(0.5 * angle)
            turned = [c * w - axis @ u, *(c * u + w * axis + np.cross(axis, u))]
            leaning = np.array([*place[:3], *turned])
            pair = tracker.step(IDENTITY, leaning)
            # From a point of an edge the nearest one may be on the far side of a rim, for a search to find.
            assert not of_faces or level.gap < 0.0 or pair.status is FeatureStatus.TRACKED
            followed += of_faces
            known = closest_features(a, b, q_b=leaning)
            # Another corner would be off by the slope times the way between them.
            if known.gap > 0.0:
                assert pair.gap == pytest.approx(known.gap, abs=1e-12 * scale)
            else:
                # Two edges may be less deep in each other than the corner is in the face.
                assert -0.05 * scale < pair.gap <= known.gap + 1e-12 * scale
    # A level pair that is found may be one of faces or of their edges; of boxes it is one of faces.
    assert followed > 0 or name != "boxes"


def loops(face, scale):
    return {"reversed": face.reversed, "name": face.name} | (
        {} if face.outer is None else {"outer": face.outer.curves, "holes": [hole.curves for hole in face.holes]}
    )


@pytest.mark.parametrize("height", [0.4, 0.0, -0.1])
def test_flush_boxes_are_followed(height):
    # Their faces are as near everywhere: a continuum, which is followed as any pair is, apart and in each other.
    box = shapes.box(1.0, 0.8, 0.6)
    tracker = FeatureTracker(box, box)
    for k in range(20):
        pair = tracker.step(None, (0.01 * k, -0.005 * k, 0.6 + height, 1.0, 0.0, 0.0, 0.0))
        assert pair.gap == pytest.approx(height, abs=1e-14)
    assert tracker.searches == 1
