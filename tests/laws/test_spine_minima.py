"""Minima of the distance of two spines over a thin box, by feet (`proximity/manager/centerlines/minima.py`), against
samples.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from assembly.geometry.vec import dot
from assembly.proximity.manager.centerlines.box import FreeEnds, Lengths, difference_at
from assembly.proximity.manager.centerlines.minima import MINIMA, near_singular_minima
from assembly.proximity.manager.parameters import THIN
from assembly.proximity.manager.wires import centerline_part_at
from benchmarks.motions import SHAPES
from benchmarks.watching import Watch
from tests.laws.test_spines import Two

CLOSED = (False, False, False, False)


def slopes(two, pose, s, t):
    """F_s, F_t, F_ss, F_tt, of numbers or of arrays of them."""
    d, f, c, g, e = difference_at(two.parts(pose), s, t)
    return -dot(d, f), dot(d, g), 1.0 - dot(d, c), 1.0 + dot(d, e)


def thin(two, width):
    """The box's middle, and half widths over which no tangent turns by more than half of `width`, nor farther."""
    halves = []
    for at, low, high in ((two.o, *two.box[:2]), (two.p, *two.box[2:])):
        part = centerline_part_at(two.pool, at)
        bend = part.bend
        most = min(0.5 * width / bend, part.half) if bend > 0.0 else 0.02
        halves.append((0.5 * (low + high), min(most, 0.02)))
    return halves


def minima_by_samples(two, box, side, open_ends, count=120):
    """Minima of F over a box, by its slope at feet: these are brackets of many places, and bisection.

    `side` 0: feet on g of places on f. A border counts where it is a free end.
    """
    own, across = (box[:2], box[2:]) if side == 0 else (box[2:], box[:2])
    ends = open_ends if side == 0 else (*open_ends[2:], *open_ends[:2])
    low = across[0] if ends[2] else across[0] - 0.5 * (across[1] - across[0])
    high = across[1] if ends[3] else across[1] + 0.5 * (across[1] - across[0])

    pose = two.pose()

    def at(x, y):
        values = slopes(two, pose, *((x, y) if side == 0 else (y, x)))
        return (values[0], values[1]) if side == 0 else (values[1], values[0])

    def foot(x):
        if at(x, low)[1] >= 0.0:
            return low
        return high if at(x, high)[1] <= 0.0 else brentq(lambda y: at(x, y)[1], low, high, xtol=1e-15)

    def feet(x):
        """Feet of all places at once, by bisection."""
        below, above = np.full_like(x, low), np.full_like(x, high)
        first, last = at(x, below)[1] >= 0.0, at(x, above)[1] <= 0.0
        for _ in range(60):
            middle = 0.5 * (below + above)
            rising = at(x, middle)[1] >= 0.0
            below, above = np.where(rising, below, middle), np.where(rising, middle, above)
        return np.where(first, low, np.where(last, high, 0.5 * (below + above)))

    def is_one(x):
        y = foot(x)
        on_piece = (y > low or ends[2]) and (y < high or ends[3])
        return on_piece and across[0] - 1e-9 <= y <= across[1] + 1e-9

    places = np.linspace(*own, count)
    slope = at(places, feet(places))[0]
    found = []
    if ends[0] and slope[0] > 0.0 and is_one(places[0]):
        found.append(places[0])
    for k in np.flatnonzero((slope[:-1] < 0.0) & (slope[1:] > 0.0)):
        x = root_between(lambda x: at(x, foot(x))[0], places[k], places[k + 1])
        if is_one(x):
            found.append(x)
    if ends[1] and slope[-1] < 0.0 and is_one(places[-1]):
        found.append(places[-1])
    turns = int((np.diff(np.sign(slope)) != 0).sum())
    return [(x, foot(x)) if side == 0 else (foot(x), x) for x in found], slope, turns


def root_between(slope, low, high):
    """A root of a function that changes its sign, or, where that is rounding alone, the end at which it is smaller."""
    # numpy may round a sine otherwise in a row of many than alone.
    values = slope(low), slope(high)
    if values[0] * values[1] >= 0.0:
        return low if abs(values[0]) <= abs(values[1]) else high
    return brentq(slope, low, high, xtol=1e-14)


def side_of(two, box):
    """Which spine is followed: that across which F is curved the most."""
    _, _, ss, tt = slopes(two, two.pose(), 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]))
    return (0 if tt >= ss else 1), max(ss, tt)


def compare(two, box, open_ends):
    """Whether what `valley_minima` finds are the minima of samples; how many there are, and how often slopes turn."""
    side, curved = side_of(two, box)
    if curved < 0.05:
        return None
    expected, slope, turns = minima_by_samples(two, box, side, open_ends)
    signs = np.sign(slope[np.abs(slope) > 1e-11])
    if signs.size < 2 or (np.diff(signs) != 0).sum() != turns:
        # Of a level valley rounding tells where it has minima.
        return None
    places = np.empty((MINIMA, 2))
    count, _level, certain = near_singular_minima(two.parts(), Lengths(*box), FreeEnds(*open_ends), places)
    assert certain
    found = places[:count]
    # Slopes of 1e-15 place a minimum by as much over the curvature of the valley, which may be 1e-4 here.
    assert len(found) == len(expected)
    for place in expected:
        assert min(np.abs(np.array(place) - one).max() for one in found) < 1e-9
    return count, turns


def test_minima_of_thin_boxes_are_those_of_samples(cases):
    rng = np.random.default_rng(11)
    seen = np.zeros(3, dtype=int)
    count = cases(80, 250)
    for _ in range(count):
        two = Two(rng)
        (s, h), (t, k) = thin(two, THIN)
        box = (s - h, s + h, t - k, t + k)
        # Slopes near zero somewhere in the box: else nearly all have no minimum.
        at = rng.uniform(box[0], box[1]), rng.uniform(box[2], box[3])
        d, f, _, g, _ = (np.array(row) for row in difference_at(two.parts(), *at))
        normal = np.cross(f, g)
        if np.linalg.norm(normal) < 1e-6:
            continue
        normal /= np.linalg.norm(normal)
        two.shift = two.shift - d + (d @ normal) * normal
        result = compare(two, box, tuple(rng.random(4) < 0.3))
        if result is not None:
            seen[result[0]] += 1
    assert seen[0] > count / 50 and seen[1] > count / 2.5 and seen[2] > count / 8.4


def test_minima_beside_a_turn_of_the_slope_are_found(cases):
    # The valley's slope is of one sign at both ends of the box, and of the other one in between.
    rng = np.random.default_rng(5)
    dips, wanted = 0, cases(4, 10)
    for _ in range(4000):
        two = Two(rng)
        (s, h), (t, k) = thin(two, THIN)
        box = (s - h, s + h, t - 3.0 * k, t + 3.0 * k)
        side, curved = side_of(two, box)
        if side == 1 or curved < 0.2:
            continue
        # Where phi'' vanishes beside the box's middle phi' turns: F_ss F_tt = F_st^2 by the distance of the spines.
        d, f, c, g, e = (np.array(row) for row in difference_at(two.parts(), s, t))
        normal = np.cross(f, g)
        cc, ee = c @ normal, e @ normal
        # (1 - x c.n) (1 + x e.n) = (f.g)^2 for d = x n.
        n2 = normal @ normal
        roots = np.roots([-cc * ee, ee - cc, n2]) if abs(cc * ee) > 1e-9 else [n2 / (cc - ee)] if cc != ee else []
        roots = [x.real for x in np.atleast_1d(roots) if abs(np.imag(x)) < 1e-12 and 0.01 < abs(x.real) < 5.0]
        if not roots or n2 < 1e-4:
            continue
        two.shift = two.shift - d + roots[0] * normal
        side, curved = side_of(two, box)
        if side == 1 or curved < 0.2:
            continue
        slope = minima_by_samples(two, box, 0, CLOSED, 41)[1]
        turn = 1 if slope[20] < min(slope[0], slope[-1]) else -1
        inner = slope[5:36]
        at = inner.min() if turn == 1 else inner.max()
        rest = min(turn * slope[0], turn * slope[-1]) - turn * at
        if rest < 1e-8:
            continue
        # Zero goes through between the turn and the ends.
        two.shift = two.shift + (at + turn * 0.3 * rest) * f
        slope = minima_by_samples(two, box, 0, CLOSED, 41)[1]
        if not (slope[0] * slope[-1] > 0.0 and (slope * slope[0] < 0.0).any()):
            continue
        result = compare(two, box, CLOSED)
        dips += result is not None and result[1] == 2
        if dips == wanted:
            break
    assert dips == wanted


def test_an_end_beside_which_the_distance_has_no_minimum_across_is_no_contact():
    # Beyond the center of the other wire's curvature, where feet are the farthest points: once a row of contacts.
    q = np.array(
        [
            [-0.259704439723237, -0.7599250173769264, -0.8569864787236098]
            + [-0.4331711270339335, 0.541402547391123, -0.6458509277965123, -0.31956632401887863],
            [0.16734157001966296, 0.2871241846521882, -0.7556768847928873]
            + [0.08058989639436902, -0.7585492877843181, 0.3821258585107713, 0.5216206234980122],
        ]
    )
    gaps = np.sort(Watch([SHAPES[name][1] for name in ("hook", "ring")]).look(q).gap)
    # As the independent judge of `benchmarks/wire_oracle.py` finds them.
    assert gaps == pytest.approx([0.079445018482, 0.116640489470], abs=1e-11)
