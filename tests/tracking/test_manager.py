"""The manager against closed forms of wires: what it lists, what it says of pairs, and the events between."""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.manager.events import EventKind, EventReason, PairState
from benchmarks.center_lines import ball_wire, paper_clip_wire, torus_wire
from benchmarks.wire_oracle import WireOracle

BALL = asm.shapes.sphere(1.0)
# Faces, whose trees are found once.
SMALL, LARGE = asm.Face(asm.shapes.torus(1.0, 0.1)), asm.Face(asm.shapes.torus(4.0, 0.1))
CLIP = asm.Face(asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5))


def row(*position, turn=None):
    """A pose."""
    e = [1.0, 0.0, 0.0, 0.0] if turn is None else turn.as_quat(scalar_first=True)
    return np.array([*position, *e], dtype=float)


def two_balls(**options):
    return asm.Manager([asm.Body("a", BALL), asm.Body("b", BALL, fixed=True)], **options)


def apart(gap):
    """Two balls of radius 1 with this gap."""
    return np.array([row(0, 0, 0), row(2.0 + gap, 0, 0)])


def rings(**options):
    """A ring of radius 1 under the rim of one of radius 4, and the oracle for both."""
    bodies = [asm.Body("small", SMALL), asm.Body("large", LARGE)]
    return asm.Manager(bodies, **options), WireOracle([torus_wire(1.0, 0.1), torus_wire(4.0, 0.1)])


def crossing_at(distance, gap=0.001):
    """Rings in planes above each other, so that they cross twice if 3 < distance < 5."""
    return np.array([row(0, 0, 0), row(0, distance, 0.2 + gap)])


def kinds(events):
    return [(event.kind, event.reason) for event in events]


def motion(start, seed, linear, angular):
    """Poses along a smooth path: a function of time."""
    rng = np.random.default_rng(seed)
    phase, pace = rng.uniform(0.0, 2.0 * np.pi, (2, len(start), 6))

    def at(t):
        wave = np.sin((0.5 + pace / np.pi) * t + phase)
        turned = Rotation.from_rotvec(angular * wave[:, 3:]) * Rotation.from_quat(start[:, 3:], scalar_first=True)
        return np.hstack([start[:, :3] + linear * wave[:, :3], turned.as_quat(scalar_first=True)])

    return at


def matched(contacts, extrema, names):
    """Of every extremum the contact at its points, or None."""
    found = []
    for pair, points in zip(extrema.bodies, extrema.points, strict=True):
        bodies = (names[pair[0]], names[pair[1]])
        near = [c for c in contacts if c.bodies == bodies and np.abs(c.points - points).max() < 1e-7]
        found.append(near[0] if near else None)
    return found


def test_pairs_go_from_far_to_near_to_tracking_and_back():
    manager = two_balls()
    names = ("a", "b")
    assert manager.states == {names: PairState.FAR} and manager.gaps == {names: -np.inf}
    assert manager.update(apart(1.0)) == () and manager.states[names] is PairState.FAR
    assert manager.update(apart(0.3)) == () and manager.states[names] is PairState.NEAR
    (event,) = manager.update(apart(0.03))
    assert (event.kind, event.reason, event.bodies, event.contact) == (EventKind.ADDED, EventReason.CAME_NEAR, names, 1)
    assert event.gap == pytest.approx(0.03, abs=1e-14)
    assert manager.states[names] is PairState.TRACKING
    (contact,) = manager.contacts
    assert contact.bodies == names and contact.number == 1 and contact.gap == pytest.approx(0.03, abs=1e-14)
    assert np.abs(contact.points - [[1.0, 0, 0], [1.03, 0, 0]]).max() < 1e-14
    assert np.abs(contact.normal - [1.0, 0, 0]).max() < 1e-14
    surface = np.array([BALL.evaluate(*contact.parameters[:2]), BALL.evaluate(*contact.parameters[2:]) + [2.03, 0, 0]])
    assert np.abs(contact.points - surface).max() < 1e-14
    assert manager.update(apart(0.02)) == ()
    (event,) = manager.update(apart(1.0))
    assert (event.kind, event.reason) == (EventKind.REMOVED, EventReason.WENT_AWAY)
    assert manager.contacts == () and manager.states[names] is PairState.FAR
    # Numbers are not used twice.
    assert [event.contact for event in manager.update(apart(0.01))] == [2]
    assert [event.contact for event in manager.log] == [1, 1, 2]


def test_a_contact_that_loses_its_extremum_is_handed_back():
    manager, oracle = rings()
    manager.update(crossing_at(4.0))
    assert len(manager.contacts) == 2
    turned = crossing_at(4.0)
    turned[1] = row(-4.0, 0, 0.201)
    events = manager.update(turned)
    assert kinds(events)[:2] == [(EventKind.HANDED_OFF, EventReason.LOST)] * 2
    assert kinds(events)[2:] == [(EventKind.ADDED, EventReason.CAME_NEAR)] * 2
    assert all(matched(manager.contacts, oracle.minima(turned, 0.01), ["small", "large"]))


def test_contacts_within_the_radius_and_near_along_the_surfaces_merge(cases):
    # 0.002 of 11.7, the size of the large ring's box.
    manager, _ = rings(merge_radius=0.02)
    seen = []
    for distance in np.concatenate([np.linspace(4.5, 4.99, cases(40, 100)), np.linspace(4.9901, 4.9999, 20)]):
        seen += kinds(manager.update(crossing_at(distance)))
    assert (EventKind.MERGED, EventReason.SAME_ROOT) in seen
    assert len(manager.contacts) == 1
    # Without such a radius they stay two.
    fine, _ = rings()
    for distance in np.linspace(4.5, 4.99, cases(40, 100)):
        fine.update(crossing_at(distance))
    assert len(fine.contacts) == 2


@pytest.mark.parametrize("merge_radius", [1e-6, 0.1])
def test_loops_of_a_thin_clip_stay_two_within_the_radius(merge_radius):
    # Legs of wire of radius 0.5 stand 1.5 apart; a tenth of the size is 3.4. A ball lies across both.
    bodies = [asm.Body("clip", CLIP), asm.Body("ball", asm.shapes.sphere(5.0))]
    manager = asm.Manager(bodies, reach=0.3, merge_radius=merge_radius)
    assert merge_radius < 0.1 or merge_radius * bodies[0].size > 3.0
    oracle = WireOracle([paper_clip_wire(), ball_wire(5.0)])
    for x in np.concatenate([np.linspace(-4.0, 4.0, 33), np.linspace(4.0, -4.0, 5)]):
        q = np.array([row(0, 0, 0), row(x, 5.2, 0.0)])
        manager.update(q)
        expected = oracle.minima(q, 0.3)
        assert all(matched(manager.contacts, expected, ["clip", "ball"])), x


def test_two_contacts_across_a_wire_stay_two():
    # The wire of a ring of radius 6 stands between two legs of a clip: contacts on its opposite sides, 0.2 apart.
    bodies = [asm.Body("ring", asm.shapes.torus(6.0, 0.1)), asm.Body("clip", CLIP)]
    manager = asm.Manager(bodies, reach=0.4, merge_radius=0.1)
    oracle = WireOracle([torus_wire(6.0, 0.1), paper_clip_wire()])
    # Legs at x = -3.5 and x = -2 leave 0.5 between them; in the plane x = -2.75 the ring's wire runs down there.
    turn = Rotation.from_euler("y", 90.0, degrees=True)
    for tilt in np.linspace(0.02, 0.1, 33):
        q = np.array([row(-2.75, 6.0, 0.0, turn=Rotation.from_rotvec([0.0, tilt, 0.0]) * turn), row(0, 0, 0)])
        manager.update(q)
        expected = oracle.minima(q, 0.4)
        assert np.ptp(expected.points[:, 0, 0]) > 0.1
        assert all(matched(manager.contacts, expected, ["ring", "clip"]))


CLIPS = np.array(
    [row(0, 0, 0), row(1.0, 0.5, -24.0, turn=Rotation.from_euler("z", 80.0, degrees=True)), row(3.0, 4.0, -9.0)]
)


@pytest.mark.parametrize("pace", [0.003, 0.03])
def test_what_is_listed_is_what_the_oracle_finds(pace, cases):
    # Wires of radius 0.5 move by up to 2 and turn by up to 0.3, through each other, too.
    reach = 0.5
    oracle = WireOracle([paper_clip_wire()] * 3)
    # Of either pace another one in short runs.
    for seed in (*((5, 0) if pace == 0.03 else (0, 5)), 1, 2, 3, 4)[: cases(1, 6)]:
        manager = asm.Manager([asm.Body(name, CLIP) for name in "abc"], reach=reach)
        poses = motion(CLIPS, seed, 2.0, 0.3)
        compared = missed = 0
        for k in range(300):
            q = poses(pace * k)
            manager.update(q)
            if k % 10:
                continue
            everything = oracle.minima(q, 40.0)
            # Of wires that cross, some pairs are deeper in each other than updates see, or born there.
            sound = (0.0 < everything.gap) & (everything.gap <= reach)
            contacts = manager.contacts
            missed += matched(contacts, everything.take(sound), "abc").count(None)
            listed = [c for c in contacts if -0.2 < c.gap]
            found = matched(listed, everything, "abc")
            assert len({c.number for c in found if c is not None}) == len(listed), (seed, k)
            assert sum(c is not None for c in found) == len(listed), (seed, k)
            compared += int(sound.sum())
        assert compared > 20
        # A minimum that is born in the valley of one that is listed, and deeper, is found by the next update.
        assert missed <= (1 if (pace, seed) == (0.03, 5) else 0)


@pytest.mark.parametrize("seed", range(3))
def test_gaps_are_lower_bounds(seed, cases):
    manager = asm.Manager([asm.Body(name, CLIP) for name in "abc"])
    oracle = WireOracle([paper_clip_wire()] * 3)
    poses = motion(CLIPS + [0, 9.0, 0, 0, 0, 0, 0] * np.array([[0], [0], [1]]), seed, 3.0, 0.3)
    far = 0
    for k in range(60):
        q = poses(0.03 * k)
        manager.update(q)
        if k % cases(3, 1):
            continue
        bounds = np.array(list(manager.gaps.values()))
        exact = oracle.gaps(q)
        # Crossing wires have gaps down to minus their thickness; what is deeper is not seen.
        assert (bounds <= exact + 1e-9)[exact > 0.0].all()
        far += int((bounds[exact > 1.0] > 0.0).sum())
    assert far > 20


def test_the_same_motion_gives_the_same_contacts_to_the_bit():
    poses = motion(CLIPS, 3, 2.0, 0.3)
    runs = []
    for _ in range(2):
        manager = asm.Manager([asm.Body(name, CLIP) for name in "abc"], reach=0.3)
        record = []
        for k in range(100):
            events = manager.update(poses(0.04 * k))
            record.append(
                (events, [(c.number, c.gap, c.parameters.tobytes(), c.points.tobytes()) for c in manager.contacts])
            )
        runs.append(record)
    assert runs[0] == runs[1]
    assert sum(len(events) for events, _ in runs[0]) > 5


def test_poses_of_either_sign_and_of_nearly_unit_length_are_the_same():
    poses = motion(CLIPS, 3, 2.0, 0.3)
    one, other = (asm.Manager([asm.Body(name, CLIP) for name in "abc"], reach=0.3) for _ in range(2))
    for k in range(50):
        q = poses(0.04 * k)
        flipped = q.copy()
        flipped[:, 3:] *= (-1.0) ** k * (1.0 + 1e-3)
        assert kinds(one.update(q)) == kinds(other.update(flipped))
    assert [c.number for c in one.contacts] == [c.number for c in other.contacts]
    # Rounding of the quaternions, times a few.
    assert np.allclose([c.gap for c in one.contacts], [c.gap for c in other.contacts], rtol=0.0, atol=1e-12)


def test_memory_does_not_grow(cases):
    manager = asm.Manager([asm.Body(name, CLIP) for name in "abc"], reach=0.3)
    poses = [motion(CLIPS, 3, 2.0, 0.3)(0.02 * k) for k in range(200)]
    for q in poses:
        manager.update(q)
    tracemalloc.start()
    for q in poses:
        manager.update(q)
    # What other threads of the test runner allocate is not the manager's.
    ours = tracemalloc.Filter(True, str(Path(asm.__file__).parent / "*"))
    used = []
    for _ in range(3):
        for q in cases(1, 4) * poses:
            manager.update(q)
        gc.collect()  # the interpreter keeps some numbers and tuples for later
        snapshot = tracemalloc.take_snapshot().filter_traces([ours])
        used.append(sum(trace.size for trace in snapshot.traces))
    tracemalloc.stop()
    # A row of numbers an update would be 12 kB at least.
    assert used[2] - used[1] < 512
    assert len(manager.log) <= 64


def test_more_places_are_made_when_they_are_wanting():
    small, oracle = rings(slots=1)
    large, _ = rings(slots=16)
    for distance in np.linspace(3.5, 4.5, 21):
        q = crossing_at(distance)
        small.update(q)
        large.update(q)
        expected = oracle.minima(q, 0.01)
        assert len(expected.gap) == 2
        for manager in (small, large):
            assert all(matched(manager.contacts, expected, ["small", "large"]))


def test_the_unit_of_length_does_not_matter(cases):
    poses = motion(CLIPS, 5, 2.0, 0.3)
    mm = asm.Manager([asm.Body(name, CLIP) for name in "abc"], reach=0.3)
    small = asm.Face(asm.shapes.paper_clip(length=0.033, width=0.008, wire_radius=0.0005))
    m = asm.Manager([asm.Body(name, small) for name in "abc"], reach=0.0003)
    for k in range(cases(25, 50)):
        q = poses(0.04 * k)
        mm.update(q)
        q[:, :3] *= 1e-3
        m.update(q)
        pairs = [sorted((c.bodies, c.gap * unit) for c in manager.contacts) for manager, unit in ((mm, 1.0), (m, 1e3))]
        assert [bodies for bodies, _ in pairs[0]] == [bodies for bodies, _ in pairs[1]]
        # Knots and control points of the two clips differ in the last places.
        assert np.allclose([gap for _, gap in pairs[0]], [gap for _, gap in pairs[1]], rtol=0.0, atol=1e-10)


def test_bodies_with_edges():
    manager = asm.Manager([asm.Body("box", asm.shapes.box(2.0, 2.0, 2.0)), asm.Body("ball", BALL)], reach=0.1)
    # Over a face, an edge and a corner.
    for toward, at in (((0, 0, 1), (0.2, 0.3, 1)), ((0, 1, 1), (0.2, 1, 1)), ((1, 1, 1), (1, 1, 1))):
        n = np.array(toward) / np.linalg.norm(toward)
        manager.update(np.array([row(0, 0, 0), row(*(np.array(at) + 1.05 * n))]))
        nearest = min(manager.contacts, key=lambda contact: contact.gap)
        assert nearest.gap == pytest.approx(0.05, abs=1e-12)
        assert np.abs(nearest.points[0] - at).max() < 1e-9


def test_bad_poses_change_nothing():
    manager = two_balls()
    manager.update(apart(0.001))
    before = [(c.number, c.gap) for c in manager.contacts]
    for q in (np.full((2, 7), np.nan), np.zeros((2, 7)), np.zeros((3, 7)), "here", None, [[1, 2], [3]]):
        with pytest.raises((asm.errors.InputError, TypeError), match="^q"):
            manager.update(q)
        assert [(c.number, c.gap) for c in manager.contacts] == before
    # Lists, other types and other orders in memory do as well.
    for q in (apart(0.002).tolist(), np.asfortranarray(apart(0.002)), apart(0.002).astype(np.float32)):
        manager.update(q)
        assert manager.contacts[0].gap == pytest.approx(0.002, abs=1e-6)


def test_what_it_says_of_itself():
    manager = two_balls(reach=0.1)
    assert repr(manager) == "Manager(2 bodies, 1 pairs, reach=0.1)"
    assert [body.name for body in manager.bodies] == ["a", "b"]
    assert (manager.reach, manager.merge_radius) == (0.1, 1e-6)
    manager.update(apart(0.05))
    assert repr(manager.contacts[0]) == "ListedContact('a', 'b', number=1, gap=0.05)"
    assert str(manager.log[0]) == "a and b: contact 1 added at gap 0.05"
