"""CadQuery's assembly solver on boxes that stand on one another: a process of its own, as it brings an OCCT of its own.

Reads starts from standard input, a list of chains of [position, axis, degrees] a box, and writes for each the seconds
of `Assembly.solve` and the largest distance between faces that should meet. Knows nothing of this library, so that it
can run under another interpreter.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from time import perf_counter
from typing import Any


def chain(cadquery: Any, poses: list[Any]) -> tuple[float, float]:
    """Seconds and the largest distance of two centers of faces."""
    made = cadquery.Assembly()
    for k, (position, axis, degrees) in enumerate(poses):
        place = cadquery.Location(cadquery.Vector(*position), cadquery.Vector(*axis), degrees)
        made.add(cadquery.Workplane().box(1, 1, 1), name=f"b{k}", loc=place)
    made.constrain("b0", "Fixed")
    for k in range(1, len(poses)):
        made.constrain(f"b{k - 1}@faces@>Z", f"b{k}@faces@<Z", "Plane")
    begin = perf_counter()
    made.solve()
    seconds = perf_counter() - begin
    apart = 0.0
    for k in range(1, len(poses)):
        ends = []
        for name, z in ((f"b{k - 1}", 0.5), (f"b{k}", -0.5)):
            location = made.objects[name].loc
            ends.append((location * cadquery.Location(cadquery.Vector(0, 0, z))).toTuple()[0])
        apart = max(apart, sum((a - b) ** 2 for a, b in zip(*ends, strict=True)) ** 0.5)
    return seconds, apart


def main() -> int:
    try:
        cadquery = import_module("cadquery")
    except ImportError:
        print(json.dumps(None))
        return 0
    chains = json.load(sys.stdin)
    # What is loaded at the first solve is not timed.
    chain(cadquery, chains[0])
    print(json.dumps({"version": cadquery.__version__, "chains": [chain(cadquery, poses) for poses in chains]}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
