"""Certificates against samples: ``python -m tests.laws.certificates [COUNT [SEED]]``, so many queries of each sort."""

from __future__ import annotations

import sys
from itertools import combinations_with_replacement

import numpy as np

from assembly.proximity import is_separated, minimum_distance
from tests.laws.curve_queries import CURVES, least_distances, random_curve, random_point

# Rounding of the oracle's own sums.
ROUNDING = 4e-15
TOLERANCE = 1e-10
# Parts of the distance that are asked for as clearances.
PARTS = (0.0, 0.5, 0.95, 1.05, 2.0)
PAIRS = tuple(combinations_with_replacement(CURVES, 2))


def bounds_fault(answer, known, rounding):
    """What is wrong with the bounds of an answer where a distance is known; None if nothing is."""
    if not 0.0 <= answer.lower <= answer.upper:
        return f"bounds {answer.lower!r}, {answer.upper!r}"
    if answer.lower > known + rounding:
        return f"lower bound {answer.lower!r} above a distance {known!r}"
    apart = np.linalg.norm(answer.points[0] - answer.points[1])
    if apart > answer.upper + rounding:
        return f"points {apart!r} apart, upper bound {answer.upper!r}"
    return None


def fault(answer, a, b, known):
    """What is wrong with an answer where a distance is known that is nearly the least one; None if it is right."""
    if wrong := bounds_fault(answer, known, ROUNDING):
        return wrong
    if not answer.converged or answer.upper > known + TOLERANCE:
        return f"{answer.status}: upper bound {answer.upper!r} with {known!r} known"
    for curve, t, point in zip((a, b), answer.parameters, answer.points, strict=False):
        place, rate = curve.evaluate(t, 1)
        # The parameter is rounded once more, which moves the point by that much times its speed.
        if np.abs(place - point).max() > 2e-14 * (1.0 + np.linalg.norm(rate)):
            return f"the point {point!r} is not at the parameter {t!r}"
    for part in PARTS:
        clearance = float(part * known)
        if is_separated(a, b, clearance, TOLERANCE):
            if clearance > known + ROUNDING:
                return f"said to be separated by {clearance!r} with {known!r} known"
        elif clearance < answer.lower - TOLERANCE:
            return f"not separated by {clearance!r}, less than the lower bound {answer.lower!r}"
    return None


def faults(pairs, samples):
    """(what is wrong, a, b) of queries of equal kinds."""
    known = least_distances(pairs, samples)
    answers = [minimum_distance(a, b, TOLERANCE) for a, b in pairs]
    found = [(fault(answer, *pair, d), *pair) for answer, pair, d in zip(answers, pairs, known, strict=True)]
    return [row for row in found if row[0]]


def point_queries(rng, kind, dimension, count):
    """Pairs of a curve and a point, twenty points a curve."""
    pairs = []
    for _ in range(count // 20 + 1):
        curve = random_curve(rng, kind, dimension)
        pairs += [(curve, random_point(rng, curve)) for _ in range(20)]
    return pairs[:count]


def curve_queries(rng, kinds, dimension, count):
    """Pairs of two curves."""
    return [tuple(random_curve(rng, kind, dimension) for kind in kinds) for _ in range(count)]


def main(count, seed=0):
    """Print what is found; the number of faults."""
    total = 0
    for dimension in (2, 3):
        for sort, kinds in (("point and curve", tuple(CURVES)), ("curve and curve", PAIRS)):
            done, found = 0, []
            rng = np.random.default_rng([seed, dimension])
            while done < count:
                for kind in kinds:
                    batch = (
                        point_queries(rng, kind, dimension, 100)
                        if isinstance(kind, str)
                        else curve_queries(rng, kind, dimension, 25)
                    )
                    found += faults(batch, 33 if isinstance(kind, str) else 25)
                    done += len(batch)
            print(f"{dimension}-D, {sort}: {len(found)} faults in {done} queries", found[:2], flush=True)
            total += len(found)
    return total


if __name__ == "__main__":
    sys.exit(main(*(map(int, sys.argv[1:]) if len(sys.argv) > 1 else (100_000,))) > 0)
