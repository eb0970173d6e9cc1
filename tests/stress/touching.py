"""Two solids in contact and nothing else asked for: ``python -m tests.stress.touching [COUNT [SEED]]``.

Brought to touch from apart, or apart from in each other; turned against each other, or parallel. Says how solves end;
fails where one is SOLVED whose solids do not touch, or are in each other, found afresh.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

import assembly as asm
from assembly.proximity import FeatureStatus, closest_features
from tests.solve.test_contacts_at_kinks import two

# Of faces that lean by less than 1e-9 any point counts as the nearest; what a search without proof may be off.
TOUCHING, UNPROVED = 3e-9, 1e-7


def main(count=100, seed=0):
    """Print how solves end; how many are SOLVED with bodies in each other or apart."""
    wrong = 0
    for name, reach, unilateral in (("apart", (1.8, 2.5), False), ("in each other", (0.3, 1.0), True)):
        for turned in (True, False):
            ends, others, iterations, seconds = Counter(), [], [], []
            for number in range(count):
                a, b = two(np.random.default_rng([seed, number]), reach, turned)
                scene = asm.Assembly([a, b])
                scene.constrain(asm.Contact(a, b, unilateral=unilateral))
                solution = scene.solve()
                ends[solution.status.name] += 1
                iterations.append(solution.iterations)
                seconds.append(solution.seconds)
                if not solution.success:
                    others.append(number)
                    continue
                pair = closest_features(a, b, solution.q[0], solution.q[1])
                most = UNPROVED if pair.status is FeatureStatus.UNPROVEN else TOUCHING
                wrong += pair.gap < -TOUCHING or (not unilateral and pair.gap > most)
            told = ", ".join(f"{many} {end}" for end, many in ends.most_common())
            print(f"{name}, {'turned' if turned else 'parallel'}: {told}; not solved: {others}")
            took = 1e3 * np.percentile(seconds, [50, 99])
            print(
                f"  {np.median(iterations):g} iterations, {took[0]:.3g} ms at the median, {took[1]:.3g} ms at 99 of 100"
            )
    print(f"{wrong} SOLVED that are wrong")
    return wrong


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
