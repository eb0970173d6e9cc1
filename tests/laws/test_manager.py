"""The laws of the global manager: of two bodies that move every contact that is near is listed, and once.

Motions are random and do not cross; the judges find all extrema of the distance by other means: of wires from
polynomials (`benchmarks.wire_oracle`), of a wire and an ellipsoid from dense samples (`ellipsoid_witness`).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.parameters import TAKE
from benchmarks.center_lines import paper_clip_wire
from benchmarks.motions import FLAT, PAIRS, SAME, SHAPES, Errors, compared, wander
from benchmarks.watching import Watch
from benchmarks.wire_oracle import WireOracle
from tests.laws.ellipsoid_witness import minima

HERE = [0.0, 0, 0, 1, 0, 0, 0]
SEMI_AXES = np.array([0.7, 0.4, 0.3])
MOTIONS = 7
# Clips seen from another one through which they are threaded. All but parallel, and near in three places:
PARALLEL = (
    [7.17912179, 1.00195669, -0.88217643, 0.38502161, -0.03238754, -0.15115273, 0.90986936],
    [7.0806144, 1.05388361, -0.98058369, 0.38418968, -0.02835516, -0.15081509, 0.91041149],
)
# Touching, nearly along a line; 0.1 mm farther a second contact is born beside that one, where the wires cross already.
FOLD = (
    [-12.658153294, 3.487747855, -24.243562523, 0.409546902, 0.431255292, 0.075415521, 0.800376604],
    [-12.642721396, 3.481855649, -24.264572723, 0.409023471, 0.430638004, 0.0750036, 0.801015087],
    [-12.595296238, 3.463942266, -24.328661362, 0.407620658, 0.428730289, 0.073853356, 0.802858282],
)

# Rings before which so many patches lie that a look takes in fewer of them; the contact is none of these.
CROWDED = (
    ("torus", "torus", 0.0491253785, [
        [-0.4081011206105496, -0.27450016466535265, -0.5626423656049672]
        + [-0.08106598418437047, 0.2575905890504896, 0.9075526457720017, -0.3215953821078297],
        [-0.474758158827904, -0.6053765075206227, -1.2807206482121916]
        + [-0.6712744819384387, -0.1885489482677121, -0.3993333099131176, -0.5952921733058939],
    ]),
    ("wide torus", "torus", 0.0438119365, [
        [-0.2674288856749793, 0.46417993246699396, -0.09472510324876687]
        + [-0.5094093419742862, -0.009940766586675361, 0.2684023446195836, -0.8175350052882777],
        [0.2374794230617538, 1.1125705870888798, -0.6939004356280962]
        + [0.9099106849062067, 0.2906286412684434, -0.26792240551170865, 0.1257581925474283],
    ]),
)  # fmt: skip

# Two poses of a motion of rings, 0.2 apart where a ring is 2.8 wide.
FAR_SIDES = [
    [
        [-0.10793648797271131, -0.9388992669225116, -0.44405320151925004]
        + [-0.8774459173857893, -0.4601478025256392, -0.09704013692902871, -0.09452975044202408],
        [0.29057296112294567, -1.6825421882251672, -1.2913125295599188]
        + [0.2564738094629434, -0.3652913578150062, -0.5008080606230915, 0.7416027881421247],
    ],
    [
        [-0.10793648797271131, -0.9388992669225116, -0.44405320151925004]
        + [-0.8774459173857893, -0.4601478025256392, -0.09704013692902871, -0.09452975044202408],
        [0.1809258969371743, -1.5675913653071303, -1.4150385124935199]
        + [0.2567209089258482, -0.33662413837334626, -0.5265388219434951, 0.7372485560318481],
    ],
]


@pytest.fixture(scope="module")
def clips():
    """Two clips under watch, and who judges them."""
    return Watch([SHAPES["clip"][1]] * 2), WireOracle([paper_clip_wire()] * 2)


@pytest.mark.parametrize(("f", "g"), PAIRS)
def test_no_contact_is_missed_doubled_or_made_up(f, g, cases):
    rng = np.random.default_rng([17, PAIRS.index((f, g))])
    errors, motions = Errors.none(), 0
    # More of them where few came near.
    while motions < cases(1, MOTIONS) or (motions < MOTIONS and errors.contacts <= motions):
        wander(rng, f, g, int(rng.integers(20, cases(26, 50))), errors)
        motions += 1
    assert (len(errors.missed), len(errors.doubled), len(errors.strange)) == (0, 0, 0)
    # Motions that came near, and were compared.
    assert errors.poses > 20 * motions - 5 and errors.contacts > motions


@pytest.mark.parametrize(("f", "g", "gap", "q"), CROWDED)
def test_what_is_nearer_than_a_motion_bound_is_listed(f, g, gap, q):
    wires, surfaces, _ = zip(SHAPES[f], SHAPES[g], strict=True)
    rings = Watch(surfaces)
    listed = rings.look(np.array(q))
    assert WireOracle(wires).minima(np.array(q), 0.1).gap == pytest.approx([gap], abs=1e-9)
    # Near enough for a place, but for the crowd; then the look says that it took in less.
    reach = rings.memory[manager_records.MEMORY_HEADER + manager_records.QUERY_MARGIN]
    assert TAKE * reach * rings.scale > gap
    assert listed.gap == pytest.approx([gap], abs=1e-9) or listed.take[0] <= gap


def test_a_contact_does_not_go_to_the_far_sides():
    names = "wide torus", "torus"
    watch, oracle = Watch([SHAPES[name][1] for name in names]), WireOracle([SHAPES[name][0] for name in names])
    (before,) = watch.look(np.array(FAR_SIDES[0])).gap
    # From where it was Newton's method goes through both wires, 1.4 deep.
    found = watch.look(np.array(FAR_SIDES[1]))
    assert before > 0.0 and found.gap.size <= 1
    assert (np.abs(found.gap - oracle.extrema(np.array(FAR_SIDES[1])).gap.min()) < 1e-12).all()
    assert found.gap.min(initial=np.inf) > 0.1


@pytest.mark.parametrize("place", PARALLEL)
def test_wires_that_are_all_but_parallel(clips, place):
    watch, oracle = clips
    watch.forget()
    q = np.array([HERE, place])
    listed, extrema = watch.look(q), oracle.extrema(q)
    assert (extrema.gap[extrema.index == 0] < 0.02).sum() == 3
    due, *errors = compared(listed, extrema, SAME * 80.0, FLAT / 80.0)
    assert due >= 3 and errors == [0, 0, 0]


def test_a_contact_that_is_born_beside_another_one(clips):
    # No distance tells of it: bodies that touch nearly along a line are looked at as long as they do.
    watch, oracle = clips
    watch.forget()
    for k, place in enumerate(FOLD):
        q = np.array([HERE, place])
        listed = watch.look(q, everything=k == 0)
    found = oracle.minima(q, -1e-6)
    assert found.gap.size == 1
    assert listed.looked.all() and listed.gap.min() == pytest.approx(found.gap[0], abs=1e-12)


@pytest.mark.parametrize("name", ["torus", "hook", "rod"])
def test_a_wire_about_an_ellipsoid(name, cases):
    rng = np.random.default_rng(23)
    wire, surface, _ = SHAPES[name]
    watch, due = Watch([surface, asm.shapes.ellipsoid(*SEMI_AXES)]), 0
    motions = cases(1, MOTIONS)
    for _ in range(motions):
        watch.forget()
        for q in around(rng, wire, cases(12, 30)):
            listed = watch.look(q)
            gaps, points = minima(wire, q[0], SEMI_AXES, q[1])
            # Feet are found to 1e-10; near a fold of both shapes less is known of where they are.
            near = np.linalg.norm(listed.points[:, None] - points[None], axis=3).max(axis=2) < 1e-5
            inside = gaps < listed.take[0] - 1e-9
            due += int(inside.sum())
            assert near[:, inside].sum(axis=0).tolist() == [1] * int(inside.sum())
            assert near.any(axis=1).all()
    assert due > 3 * motions


def around(rng, wire, steps):
    """Poses of a wire and an ellipsoid: it moves about the wire, near it, and does not enter it."""
    q, poses, way = np.array([HERE, [9.0, *HERE[1:]]]), [], rng.normal(size=6)

    def gap(q):
        try:
            return minima(wire, q[0], SEMI_AXES, q[1], samples=100)[0].min(initial=np.inf)
        except ValueError:
            return -1.0

    while not 0.0 < gap(q) < 0.1:
        e = rng.normal(size=(2, 4))
        q[:, 3:] = e / np.linalg.norm(e, axis=1, keepdims=True)
        q[1, :3] = rng.uniform(-2.5, 2.5, 3)
    while len(poses) < steps:
        way = 0.8 * way + 0.6 * rng.normal(size=6)
        trial = q.copy()
        trial[1, :3] += 0.01 * way[:3]
        turn = Rotation.from_rotvec(0.015 * way[3:]) * Rotation.from_quat(q[1, 3:], scalar_first=True)
        trial[1, 3:] = turn.as_quat(scalar_first=True)
        if 0.0 < gap(trial) < 0.3:
            q = trial
            poses.append(q)
        else:
            way = -way
    return poses
