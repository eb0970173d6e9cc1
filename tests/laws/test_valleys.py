"""Laws of valleys: the bottom across them against closed forms of a ring over a plate, and where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store, rows_of
from assembly.constraints.program.records import MANAGER_RECORD
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, SPANS_U, SPANS_V, surface_point
from assembly.kinematics.motion import RelativePose
from assembly.proximity.brep.borders import feature_at
from assembly.proximity.brep.records import shell_at
from assembly.proximity.features.holding import HELD_F, HELD_G
from assembly.proximity.manager.continua import hold_continua
from assembly.proximity.manager.extrema import (
    EXTREMUM,
    LISTED,
    NEW,
    ROOT,
    USELESS,
    extremum_at,
)
from assembly.proximity.manager.near_singular import ARRIVED, across_near_singular, into_near_singular
from assembly.proximity.manager.near_singular_points import is_next_in_near_singular, sunk
from assembly.proximity.manager.records import pair_in
from tests.laws.scenes import list_of, posed

MAJOR, MINOR = 0.7, 0.1
WIDE = (np.inf, np.inf, np.inf, np.inf)


def packed_faces(shape):
    """A slab and a shape in one table: table, pool, surface of the slab's top, surfaces of the other, the scale."""
    scene = asm.Assembly(
        [asm.Body("slab", asm.shapes.box(4.0, 4.0, 0.5), fixed=True), asm.Body("other", shape, (0.0, 0.0, 1.0))]
    )
    scene.constrain(asm.Clearance())
    packed = scene.packed()
    table = packed.table
    f, g = pair_in(table, table[MANAGER_RECORD], 0).shell_f, pair_in(table, table[MANAGER_RECORD], 0).shell_g
    names = [face.name for face in scene.bodies[0].faces]
    others = [feature_at(table, g, k) for k in range(shell_at(table, g).faces)]
    return table, packed.pool, feature_at(table, f, names.index("top")), others, packed.scale


def tilted(rng, tilt, scale):
    """A turn of a shape by `tilt` about a level axis and by any angle about its own, and a place above the slab."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    turn = Rotation.from_rotvec(tilt * np.array([np.cos(angle), np.sin(angle), 0.0]))
    turn = (turn * Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)])).as_matrix()
    return turn, np.array([*rng.uniform(-0.5, 0.5, 2), 0.5]) / scale


def lowest_across(turn, shift, u, scale):
    """The least height of the ring's circle at u, and the direction of its center line there, of length one."""
    outward = turn @ [np.cos(u), np.sin(u), 0.0]
    low = shift[2] + (MAJOR * outward[2] - MINOR * np.hypot(outward[2], turn[2, 2])) / scale
    return low, turn @ [-np.sin(u), np.cos(u), 0.0]


def lowest_start(table, pool, surface, turn, shift):
    """Parameters of a slab's foot and of the lowest point of a net on a surface, off its ends."""
    ends = [
        (pool[table[surface + breaks]], pool[table[surface + breaks] + table[surface + spans]])
        for breaks, spans in ((BREAKS_U, SPANS_U), (BREAKS_V, SPANS_V))
    ]
    net = [(u, v) for u in np.linspace(*ends[0], 41)[1:-1] for v in np.linspace(*ends[1], 41)[1:-1]]
    points = [turn @ np.array(surface_point(table, pool, surface, u, v)[0]) + shift for u, v in net]
    best = int(np.argmin([p[2] for p in points]))
    return (*points[best][:2], *net[best])


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-6, 1e-3, 0.1])
def test_the_bottom_is_the_lowest_point_across_a_ring(tilt):
    table, pool, top, (ring,), scale = packed_faces(asm.shapes.torus(MAJOR, MINOR))
    rng = np.random.default_rng([5, int(1e9 * tilt)])
    surface = asm.shapes.torus(MAJOR, MINOR)
    for _ in range(40):
        turn, shift = tilted(rng, tilt, scale)
        # The parameters of the ring's surface are those of rational arcs: the angle is that of its point.
        (u0, u1), (v0, v1) = surface.domain
        start = (0.0, 0.0, rng.uniform(u0, u1), v0 + (0.75 + rng.uniform(-0.03, 0.03)) * (v1 - v0))
        s = surface.evaluate(*start[2:])
        start_angle = np.arctan2(s[1], s[0]) % (2.0 * np.pi)
        matrix = tuple(turn.ravel())
        found, x, on_f, along = into_near_singular(
            Store(table, pool), top, ring, RelativePose(matrix, tuple(shift)), start, WIDE
        )
        assert found and not on_f
        p = surface.evaluate(x[2], x[3])
        u = np.arctan2(p[1], p[0])
        low, direction = lowest_across(turn, shift, u, scale)
        # Newton's method ends with a step below ARRIVED, whose square is what is left of the height. The direction
        # across is off the circle's by no more than the tilt, which leaves a slope of tilt^2 on it.
        assert (turn @ p / scale + shift)[2] == pytest.approx(low, abs=ARRIVED**2 + 1e-15 + MINOR * tilt**4)
        # Along the ring, the way in which its parameter grows; the bottom leans by the tilt, and the direction is
        # off by half of that.
        assert np.dot(along, direction) > np.cos(1.5 * tilt) - 1e-9
        # It stays where it is along the ring, and the slab's point is below it.
        assert u % (2.0 * np.pi) == pytest.approx(start_angle, abs=1e-9 + tilt)
        assert x[:2] == pytest.approx((turn @ p + scale * shift)[:2], abs=1e-9)


def test_a_patch_is_not_left():
    table, pool, top, (ring,), scale = packed_faces(asm.shapes.torus(MAJOR, MINOR))
    (_u0, u1), (v0, v1) = asm.shapes.torus(MAJOR, MINOR).domain
    turn, shift = np.eye(3), (0.0, 0.0, 0.5 / scale)
    off = 0.05 * (v1 - v0)
    start = (0.0, 0.0, 0.3 * u1, v0 + 0.75 * (v1 - v0) + off)
    for part, inside in ((0.5, False), (2.0, True)):
        half = (np.inf, np.inf, np.inf, part * off)
        assert (
            into_near_singular(Store(table, pool), top, ring, RelativePose(tuple(turn.ravel()), shift), start, half)[0]
            == inside
        )


@pytest.mark.parametrize(
    "shape",
    [asm.shapes.sphere(0.5), asm.shapes.box(0.5, 0.4, 0.3), asm.shapes.ellipsoid(0.5, 0.4, 0.3)],
    ids=["ball", "box", "ellipsoid"],
)
def test_no_valley_where_nothing_or_everything_is_level(shape, cases):
    table, pool, top, others, scale = packed_faces(shape)
    rng = np.random.default_rng(4)
    for _ in range(cases(7, 20)):
        turn, shift = tilted(rng, 0.1, scale)
        for other in others:
            x = lowest_start(table, pool, other, turn, shift)
            assert not across_near_singular(
                Store(table, pool), top, other, RelativePose(tuple(turn.ravel()), tuple(shift)), x
            ).found


def ring_on_a_slab(slab=None):
    """Table and pool of the two, the scale, their shells, which face is the slab's top."""
    scene = asm.Assembly(
        [
            asm.Body("slab", slab or asm.shapes.box(4.0, 4.0, 0.5), fixed=True),
            asm.Body("ring", asm.shapes.torus(MAJOR, MINOR), (0.0, 0.0, 0.35)),
        ]
    )
    scene.constrain(asm.Clearance())
    packed = scene.packed()
    pair = pair_in(packed.table, packed.table[MANAGER_RECORD], 0)
    shells = (pair.shell_f, pair.shell_g)
    return packed.table, packed.pool, packed.scale, shells, [face.name for face in scene.bodies[0].faces].index("top")


def test_a_point_that_is_held_goes_back_to_the_bottom():
    table, pool, scale, shells, top = ring_on_a_slab()
    surface = asm.shapes.torus(MAJOR, MINOR)
    (_, u1), (v0, v1) = surface.domain
    rng = np.random.default_rng(8)
    for tilt in (0.0, 1e-6, 1e-3):
        turn, shift = tilted(rng, tilt, scale)
        pair = posed(Store(table, pool), tuple(turn.ravel()), tuple(shift), shells=tuple(shells))
        start = (0.0, 0.0, rng.uniform(0.0, u1), v0 + (0.75 + rng.uniform(-0.03, 0.03)) * (v1 - v0))
        x = sunk(pair, (top, 0), HELD_G, start)
        p = surface.evaluate(x[2], x[3])
        low, _ = lowest_across(turn, shift, np.arctan2(p[1], p[0]), scale)
        assert (turn @ p / scale + shift)[2] == pytest.approx(low, abs=ARRIVED**2 + 1e-15 + MINOR * tilt**4)


def test_a_point_that_is_held_stays_where_its_bottom_is_over_a_hole():
    table, pool, scale, shells, top = ring_on_a_slab(asm.shapes.plate(4.0, 4.0, 0.5, [(MAJOR, 0.0, 0.2)]))
    _, (v0, v1) = asm.shapes.torus(MAJOR, MINOR).domain
    pair = posed(Store(table, pool), tuple(np.eye(3).ravel()), (0.0, 0.0, 0.35 / scale), shells=tuple(shells))
    start = (MAJOR, 0.0, 0.0, v0 + 0.77 * (v1 - v0))
    # Of the slab nothing is below it; of the ring there is.
    assert sunk(pair, (top, 0), HELD_F, start) == start
    assert sunk(pair, (top, 0), HELD_G, start)[3] == pytest.approx(v0 + 0.75 * (v1 - v0), abs=1e-9)


def test_few_of_a_continuum_are_held():
    table, pool, scale, shells, top = ring_on_a_slab()
    (_, u1), (v0, v1) = asm.shapes.torus(MAJOR, MINOR).domain
    turn, shift = tuple(np.eye(3).ravel()), (0.0, 0.0, 0.35 / scale)
    looked_into = posed(Store(table, pool), turn, shift, shells=tuple(shells))
    # Eighths of the ring: two new ones a step apart, what is listed, what is of no use, an isolated one.
    states = [(0.0, NEW, 0.0), (0.05, NEW, 0.0), (2.0, LISTED, 0.0), (4.0, USELESS, 0.0), (4.0, NEW, 0.0)]
    states += [(6.0, NEW, 0.3), (6.05, NEW, 0.0)]
    found = np.zeros((len(states), ROOT))
    for root, (eighth, _origin, _fold) in zip(found, states, strict=True):
        start = (0.0, 0.0, eighth / 8.0 * u1, v0 + 0.75 * (v1 - v0))
        _found, root[:4], _on_f, _along = into_near_singular(
            Store(table, pool),
            feature_at(table, shells[0], top),
            feature_at(table, shells[1], 0),
            RelativePose(turn, shift),
            start,
            WIDE,
        )
    states = np.array(states)
    listed = rows_of(EXTREMUM, found)
    listed.code_f, listed.origin, listed.fold = top, states[:, 1], states[:, 2]
    before = found[[0, 2, 3, 4, 5], :4].copy()
    # What is a step from one that is held, or from the isolated one, is left out.
    extrema = list_of(found, len(states))
    hold_continua(looked_into, extrema)
    assert extrema.count[0] == 5
    np.testing.assert_array_equal(found[:5, :4], before)
    assert listed.corner[:5].tolist() == [HELD_G, HELD_G, 0.0, HELD_G, 0.0]
    assert listed.origin[:5].tolist() == [NEW, LISTED, USELESS, NEW, NEW]


def test_what_lies_beside_a_point_is_in_another_valley():
    table, pool, scale, shells, top = ring_on_a_slab()
    (_, u1), (v0, v1) = asm.shapes.torus(MAJOR, MINOR).domain
    turn, shift = tuple(np.eye(3).ravel()), (0.0, 0.0, 0.35 / scale)
    surfaces = feature_at(table, shells[0], top), feature_at(table, shells[1], 0)
    start = (0.0, 0.0, 0.1 * u1, v0 + 0.75 * (v1 - v0))
    _found, x, _on_f, along = into_near_singular(Store(table, pool), *surfaces, RelativePose(turn, shift), start, WIDE)
    roots = np.zeros((1, ROOT))
    root = extremum_at(roots, 0)
    root.parameters, root.code_f, root.origin, root.corner = x, top, NEW, HELD_G
    pair = posed(Store(table, pool), turn, shift, shells=tuple(shells))
    # The slab's parameters are lengths. More beside than along is another valley; a turn by 60 degrees is far, too.
    across = np.cross([0.0, 0.0, 1.0], along)
    turned = 0.4 * np.array(along) + np.sqrt(0.84) * across
    for way, direction, other in (
        (0.3 * np.array(along), along, False),
        (0.3 * across, along, True),
        (0.3 * np.array(along) + 0.2 * across, along, False),
        (0.3 * turned, tuple(turned), True),
    ):
        there = (x[0] + way[0], x[1] + way[1], x[2], x[3])
        assert is_next_in_near_singular(pair, (top, 0), surfaces, there, direction, list_of(roots, 1), 1) == other
