"""Bodies whose surfaces have creases are as if these were edges between faces."""

import numpy as np
import pytest

import assembly as asm
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity import FeatureStatus, closest_features
from assembly.proximity.brep.topology import topology_of


def folded(corners, height=2.0):
    """One wall over a polyline (n, 2)."""
    n = len(corners)
    net = np.stack([np.column_stack([corners, np.full(n, z)]) for z in (0.0, height)], axis=1)
    return Face(NurbsSurface(net, (np.concatenate([[0], np.arange(n), [n - 1]]), [0, 0, 1, 1]), (1, 1)), name="wall")


def walls(corners, height=2.0):
    """The same wall in flat faces."""
    return [
        Face(folded([a, b], height).surface, name=f"wall {k}")
        for k, (a, b) in enumerate(zip(corners, corners[1:], strict=False))
    ]


ROOF = np.array([(0.0, 0.0), (1.0, 1.0), (2.5, 0.0), (3.0, 0.7)])
TUBE = np.array([(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])


@pytest.mark.parametrize("corners", [ROOF, TUBE], ids=["roof", "tube"])
def test_nearest_points_are_those_of_flat_faces(corners):
    rng = np.random.default_rng(11)
    whole, parts = folded(corners), walls(corners)
    edges = 0
    for other in (shapes.sphere(0.3), shapes.box(0.5, 0.4, 0.3), folded(ROOF - 1.0)):
        for _ in range(25):
            turn = rng.normal(size=4)
            q = [*rng.uniform(-3.0, 4.0, 3), *turn / np.linalg.norm(turn)]
            a, b = (closest_features(shape, other, q_b=q) for shape in (whole, parts))
            crosses = {FeatureStatus.CROSSING, FeatureStatus.PENETRATING}
            assert (a.status in crosses) == (b.status in crosses)
            if a.status not in crosses:
                # The same features with the same coordinates, but for rounding.
                assert abs(a.gap) == pytest.approx(abs(b.gap), abs=1e-13)
                assert a.lower <= abs(b.gap)
                edges += a.features[0].kind == "edge"
    assert edges > 10


def test_topology_has_an_edge_for_every_crease():
    topology = topology_of([folded(TUBE)])
    assert len(topology.faces) == 4 and all(face.name == "wall" for face in topology.faces)
    assert sum(edge.convex is True for edge in topology.edges) == 4
    # A ring: its Euler characteristic is zero.
    assert topology.chi == 0
    assert topology_of([folded(ROOF)]).chi == 1


def resting(contact, start):
    """A ball above a roof, drawn to a point nearer to the ridge than its radius."""
    roof = asm.Body("roof", folded(np.array([(2.0, 0.0), (0.0, 1.0), (-2.0, 0.0)])), fixed=True)
    ball = asm.Body("ball", shapes.sphere(0.5), position=start)
    scene = asm.Assembly([roof, ball])
    scene.constrain(contact(roof, ball))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.05, 1.2, 1.0)))
    return scene.solve()


@pytest.mark.parametrize(
    "contact",
    [
        lambda a, b: asm.Contact(a, b),
        lambda a, b: asm.Contact(a, b, unilateral=True),
        lambda a, b: asm.Clearance([a, b]),
    ],
    ids=["contact", "unilateral", "clearance"],
)
def test_a_ball_comes_to_rest_on_a_ridge(contact):
    solution = resting(contact, (0.3, 2.0, 1.2))
    assert solution.success, solution.message
    # On the line from the ridge through the point.
    np.testing.assert_allclose(solution.q[1, :2], [0.5 / np.sqrt(17.0), 1.0 + 2.0 / np.sqrt(17.0)], atol=1e-8)


def rumpled(rng):
    """Four by four cubic patches that meet without smoothness."""
    knots = np.concatenate([[0.0], np.repeat(np.arange(3.0), 3), [2.0]])
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 7), indexing="ij")
    net = np.stack([x, y, rng.uniform(-0.3, 0.3, x.shape)], axis=2)
    return NurbsSurface(net, (knots, knots), (3, 3), rng.uniform(0.5, 2.0, x.shape))


def test_no_sample_is_nearer_than_the_nearest_points():
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 2.0, 81)
    u, v = (x.ravel() for x in np.meshgrid(t, t))
    ball = shapes.sphere(0.2)
    kinds = set()
    for _ in range(12):
        surface = rumpled(rng)
        samples = surface.evaluate(u, v)
        for _ in range(4):
            place = np.array([*rng.uniform(-1.1, 1.1, 2), rng.uniform(0.5, 0.9)])
            pair = closest_features(surface, ball, q_b=[*place, 1.0, 0.0, 0.0, 0.0])
            nearest = np.linalg.norm(samples - place, axis=1).min() - 0.2
            assert pair.status is FeatureStatus.APART
            # Samples are 0.04 apart: a nearest one is farther by the square of that over the distance, at most.
            assert abs(pair.gap) <= nearest + 1e-13 and abs(pair.gap) > nearest - 2e-3
            assert pair.lower <= abs(pair.gap)
            kinds.add(pair.features[0].kind)
    assert {"face", "edge"} <= kinds
