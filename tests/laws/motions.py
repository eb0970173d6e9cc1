"""Lists of contacts along random motions against all extrema: ``python -m tests.laws.motions [COUNT [SEED]]``.

So many motions of each pair of wires, forty poses each; `tests/laws/test_manager.py` has a few.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.motions import PAIRS, Errors, wander

STEPS = 40


def main(count, seed=0):
    """Print what is found; the number of contacts that are missed, doubled or made up."""
    total = 0
    for number, (f, g) in enumerate(PAIRS):
        errors = Errors.none()
        for motion in range(count):
            wander(np.random.default_rng([seed, number, motion]), f, g, STEPS, errors)
        faults = {"missed": errors.missed, "doubled": errors.doubled, "made up": errors.strange}
        told = ", ".join(f"{len(poses)} {name}" for name, poses in faults.items())
        print(f"{f} and {g}: {errors.contacts} contacts in {errors.poses} poses, {told}", flush=True)
        for name, poses in faults.items():
            for q in poses[:2]:
                print(f"    {name}: {q.tolist()}", flush=True)
            total += len(poses)
    return total


if __name__ == "__main__":
    sys.exit(main(*(map(int, sys.argv[1:]) if len(sys.argv) > 1 else (125,))) > 0)
