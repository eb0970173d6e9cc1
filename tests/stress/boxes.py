"""Boxes and plates drawn together under a clearance: ``python -m tests.stress.boxes [COUNT [SEED ...]]``.

Three boxes, two with a plate, four boxes. Says how solves end; fails where one is SOLVED with boxes in each other.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

from tests.solve.test_flat_contacts import BOX, PLATE
from tests.solve.test_solids_at_rest import drawn_together, least

KINDS = {"three boxes": [BOX] * 3, "two and a plate": [BOX, PLATE, BOX], "four boxes": [BOX] * 4}
# Gaps of 1e-12 of a scene's size, and rounding.
TOUCHING = 1e-11


def main(count=40, *seeds):
    """Print how solves end; how many are SOLVED with bodies in each other."""
    wrong = 0
    for name, sides in KINDS.items():
        for seed in seeds or (5, 6):
            ends, others = Counter(), []
            for number in range(count):
                solution = drawn_together(np.random.default_rng([seed, number]), sides).solve()
                ends[solution.status.name] += 1
                wrong += solution.success and least(solution.q, sides) < -TOUCHING
                if not solution.success:
                    others.append(number)
            told = ", ".join(f"{many} {end}" for end, many in ends.most_common())
            print(f"{name}, seed {seed}: {told}; not solved: {others}", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
