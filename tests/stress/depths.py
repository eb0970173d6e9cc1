"""Pairs of solids apart and in each other, judged by Coal (extra `bench`): ``python -m tests.stress.depths``.

    python -m tests.stress.depths [COUNT [SEED]]

Shapes of `tests.stress.solids`, three in ten of them upright at tenths: flush. Says what `closest_features` tells of
pairs that are apart and of those that cross, how deep it says these are in parts of Coal's least depth, and how long it
takes; fails where pairs apart are told to cross, or pairs that cross to be apart.
"""

from __future__ import annotations

import sys
from collections import Counter
from time import perf_counter

import coal
import numpy as np
from scipy.spatial.transform import Rotation

from assembly.proximity import closest_features
from tests.stress.solids import SHAPES, TOUCHING, distance

TENTHS = 0.3


def pose_of(rng):
    """Where the second solid stands."""
    place, turn = rng.uniform(-1.0, 1.0, 3), Rotation.random(random_state=int(rng.integers(1 << 30)))
    if rng.random() < TENTHS:
        place, turn = np.round(place, 1), Rotation.identity()
    return place, turn


def main(count=1500, seed=3):
    """Print what was told; how many pairs were told wrong."""
    rng = np.random.default_rng(seed)
    told, wrong, depths, seconds = Counter(), 0, [], []
    first = coal.Transform3s(np.eye(3), np.zeros(3))
    for number in range(count):
        a, b = (list(SHAPES)[k] for k in rng.integers(0, len(SHAPES), 2))
        place, turn = pose_of(rng)
        q = np.r_[place, turn.as_quat(scalar_first=True)]
        begin = perf_counter()
        pair = closest_features(SHAPES[a][0], SHAPES[b][0], q_b=q)
        seconds.append(perf_counter() - begin)
        gap = distance((SHAPES[a][1], first), (SHAPES[b][1], coal.Transform3s(turn.as_matrix(), place)))
        kind = "apart" if gap > TOUCHING else "cross" if gap < -TOUCHING else "touch"
        told[f"{kind}: {pair.status.name}"] += 1
        is_wrong = kind == "apart" and (
            abs(pair.gap - gap) > TOUCHING or pair.status.name in ("CROSSING", "PENETRATING")
        )
        is_wrong = is_wrong or (kind == "cross" and (pair.status.name == "APART" or not pair.gap < 0.0))
        wrong += is_wrong
        if is_wrong:
            print(f"pair {number}, {a} and {b}: {pair.status.name}, {pair.gap:.3g}, by Coal {gap:.3g}", flush=True)
        elif kind == "cross":
            depths.append(pair.gap / gap)
    print(", ".join(f"{many} {what}" for what, many in told.most_common()))
    parts = np.array(depths)
    near, far = np.sum(parts <= 1.01), np.sum(parts > 1.5)
    print(f"of {len(parts)} depths {near} are at most 1.01 of the least one, {far} over 1.5 of it")
    median, late = 1e3 * np.quantile(seconds[1:], [0.5, 0.99])
    print(f"{median:.2f} ms at the median, {late:.1f} ms at 99 of 100")
    return wrong


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
