"""Rows of edges that lie on faces: few of them, spread over rims, and as good as all for plates that tilt a little."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from tests.proximity.manager.test_contact_place import prism

HALF, THICK = np.array([40.0, 20.0]), 10.0
LOWER, UPPER = [(-25.0, 0.0, 4.5), (20.0, 6.0, 6.0)], [(-12.0, 3.0, 5.0), (2.0, -5.0, 3.0)]
# Half of the 40 degrees or so that an edge turns from one of its points to the next: their cosine is 0.75.
HALF_STEP = 0.5 * np.arccos(0.75)


def plates(turn=(0.0, 0.0, 0.0), lift=0.0):
    """Plates whose holes are over whole faces of each other, flush but for a turn of the upper one and a lift."""
    turn = Rotation.from_rotvec(turn)
    lower = asm.Body("lower", asm.shapes.plate(*2.0 * HALF, THICK, LOWER), fixed=True)
    upper = asm.Body(
        "upper", asm.shapes.plate(*2.0 * HALF, THICK, UPPER), (3.0, 2.0, THICK + lift), turn.as_quat(scalar_first=True)
    )
    scene = asm.Assembly([lower, upper])
    scene.constrain(asm.Clearance())
    return scene.solve(max_iterations=0)


def kinds(contact):
    return {name.split(" ")[0].strip("'") for name in contact.features}


def test_flush_plates_have_few_rows():
    contacts = plates().contacts.values()
    on_rims = [c for c in contacts if kinds(c) == {"edge", "face"}]
    # Four rims that lie on faces: 360 / 40 points each, and at least one for each half turn of 80 degrees.
    assert 4 * 5 <= len(on_rims) <= 4 * 9
    assert all("hole" in feature for c in on_rims for feature in c.features if feature.startswith("edge"))
    # Corners of one over the other, and edges that cross: two of each, no more.
    assert len(contacts) - len(on_rims) <= 8
    assert max(abs(c.gap) for c in contacts) < 1e-12


def test_points_of_a_rim_are_spread():
    by_rim = {}
    for contact in plates().contacts.values():
        if kinds(contact) == {"edge", "face"}:
            by_rim.setdefault(contact.features, []).append(contact.points[0, :2])
    assert len(by_rim) == 4
    for points in by_rim.values():
        # The middle of the circle through three of them.
        (a, b, c) = points[:3]
        center = np.linalg.solve(2.0 * np.array([b - a, c - a]), [b @ b - a @ a, c @ c - a @ a])
        angles = np.sort([np.arctan2(*(p - center)[::-1]) for p in points])
        around = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
        assert around.min() > 2.0 * HALF_STEP - 1e-9
        assert around.max() < 2.0 * 2.0 * HALF_STEP + 1e-9


def least_gap(pose):
    """The least distance along the plates' normals of rims and corners of one from the face of the other one."""
    turn, place = Rotation.from_quat(pose[3:], scalar_first=True), pose[:3]
    angle = np.linspace(0.0, 2.0 * np.pi, 3000, endpoint=False)
    corners = HALF * [(-1, -1), (1, -1), (1, 1), (-1, 1)]

    def over(points, holes):
        """Which points in the plane are over a plate's face."""
        inside = (np.abs(points) <= HALF).all(axis=1)
        return inside & np.all([np.hypot(*(points - h[:2]).T) >= h[2] for h in holes], axis=0)

    def outline(holes):
        rims = [np.array(h[:2]) + h[2] * np.column_stack([np.cos(angle), np.sin(angle)]) for h in holes]
        part = np.linspace(0.0, 1.0, 2000, endpoint=False)[:, None]
        edges = [a + part * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        return np.concatenate([*edges, *rims])

    low = np.inf
    up = np.column_stack([outline(UPPER), np.full(len(outline(UPPER)), -0.5 * THICK)])
    up = turn.apply(up) + place
    is_over = over(up[:, :2], LOWER)
    low = min(low, (up[is_over, 2] - 0.5 * THICK).min())
    down = np.column_stack([outline(LOWER), np.full(len(outline(LOWER)), 0.5 * THICK)])
    down = turn.inv().apply(down - place)
    is_under = over(down[:, :2], UPPER)
    return min(low, (-0.5 * THICK - down[is_under, 2]).min())


def test_rows_of_tilted_plates_miss_next_to_nothing(cases):
    """No sample of a rim or corner is lower than the lowest row by more than a rim is between two of its points."""
    rng = np.random.default_rng(1)
    radius = max(h[2] for h in LOWER + UPPER)
    for _ in range(cases(5, 300)):
        tilt, angle = 10.0 ** rng.uniform(-9.0, -3.0), rng.uniform(0.0, 2.0 * np.pi)
        # Lifted, so that nothing is in the other one.
        solution = plates(tilt * np.array([np.cos(angle), np.sin(angle), 0.0]), 60.0 * tilt)
        row, low = min(c.gap for c in solution.contacts.values()), least_gap(solution.q[1])
        bound = radius * (1.0 - np.cos(HALF_STEP)) * np.sin(tilt)
        # Samples of edges miss where these cross by half their spacing; coordinates of some tens are rounded.
        assert -1e-12 - 0.03 * tilt < row - low < bound + 1e-12


def convex_polygon(rng, size):
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, int(rng.integers(3, 8))))
    while np.diff(np.append(angle, angle[0] + 2.0 * np.pi)).max() > 2.5:
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, 6))
    return size * np.column_stack([np.cos(angle), np.sin(angle)])


def crossings(one, other):
    """Where sides of two polygons cross, and the sine of the angle at which they do."""
    found = []
    for k in range(len(one)):
        for l in range(len(other)):
            a, b = one[k], one[(k + 1) % len(one)] - one[k]
            c, d = other[l], other[(l + 1) % len(other)] - other[l]
            determinant = b[0] * d[1] - b[1] * d[0]
            s, t = np.linalg.solve(np.column_stack([b, -d]), c - a)
            if 0.0 < s < 1.0 and 0.0 < t < 1.0:
                found.append((*(a + s * b), abs(determinant) / np.linalg.norm(b) / np.linalg.norm(d)))
    return np.array(found).reshape(-1, 3)


def inside(polygon, points):
    """Which points are within a convex polygon, counterclockwise."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    off = points[:, None] - polygon
    return ((sides[:, 0] * off[..., 1] - sides[:, 1] * off[..., 0]) > 0.0).all(axis=1)


@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_edges_of_polygons_cross_where_their_sides_do(gap, cases):
    rng = np.random.default_rng(2)
    for _ in range(cases(3, 200)):
        one, other = convex_polygon(rng, 10.0), convex_polygon(rng, 8.0) + rng.uniform(-4.0, 4.0, 2)
        bodies = [
            asm.Body("one", prism([tuple(p) for p in one], 2.0), fixed=True),
            asm.Body("other", prism([tuple(p) for p in other], 2.0), (0.0, 0.0, 2.0 + gap)),
        ]
        scene = asm.Assembly(bodies)
        scene.constrain(asm.Clearance())
        contacts = list(scene.solve(max_iterations=0).contacts.values())
        told = np.array([c.points[0, :2] for c in contacts if kinds(c) == {"edge"}]).reshape(-1, 2)
        known = crossings(one, other)
        # Corners of sides that are all but parallel are as near to others as rounding.
        for x, y, sine in known:
            if sine > 0.05:
                assert np.linalg.norm(told - (x, y), axis=1).min(initial=np.inf) < 1e-7, (x, y, sine)
        for point in told:
            assert np.linalg.norm(known[:, :2] - point, axis=1).min(initial=np.inf) < 1e-6
        # And so are corners of each over the other.
        corners = np.concatenate([one[inside(other, one)], other[inside(one, other)]])
        vertices = np.array([c.points[0, :2] for c in contacts if "vertex" in kinds(c)]).reshape(-1, 2)
        for corner in corners:
            assert np.linalg.norm(vertices - corner, axis=1).min(initial=np.inf) < 1e-9
        assert all(abs(c.gap - gap) < 1e-12 for c in contacts)
        assert len(told) == len({tuple(np.round(p, 6)) for p in told})


def test_no_middle_of_a_straight_edge_is_a_row():
    """A box on a plate: its four corners, and no point of its edges between."""
    plate = asm.Body("plate", asm.shapes.box(10.0, 10.0, 1.0), fixed=True)
    box = asm.Body("box", asm.shapes.box(2.0, 1.5, 1.0), (0.3, 0.2, 1.0))
    scene = asm.Assembly([plate, box])
    scene.constrain(asm.Clearance())
    contacts = scene.solve(max_iterations=0).contacts.values()
    assert len(contacts) == 4 and all(kinds(c) == {"face", "vertex"} for c in contacts)
