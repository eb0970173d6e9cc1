"""The loop without second derivatives of rows, for `contact_errors`.

``python -m benchmarks.first_order COUNT TOLERANCE...`` prints them. Nobody who solves can turn them off. Here the bound
below which multipliers are too weak for their rows' curvature to matter is made infinite before the loop is compiled,
into a cache of its own. What is left are the gradients of rows and the exact Hessian of the objective.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["lines_without_curvature"]


def lines_without_curvature(count: int, tolerances: Sequence[float]) -> list[list[list[float]]]:
    """Of every tolerance, (error, seconds) of every start: `contact_errors` in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        found = subprocess.run(
            [sys.executable, "-m", "benchmarks.first_order", str(count), *map(str, tolerances)],
            env={**os.environ, "NUMBA_CACHE_DIR": folder},
            cwd=Path(__file__).resolve().parent.parent,
            capture_output=True,
            text=True,
            check=False,
        )
    if found.returncode:
        raise RuntimeError(f"the process ended with {found.returncode}:\n{found.stderr}")
    rows: list[list[list[float]]] = json.loads(found.stdout.splitlines()[-1])
    return rows


def main(arguments: Sequence[str]) -> int:
    from assembly.solve.loop import parameters

    # Before what takes its value from there is imported.
    parameters.WEAK = math.inf
    from benchmarks.contact_errors import Case, ours
    from benchmarks.scenes import linked_wires

    count = int(arguments[0])
    wires = linked_wires(count, grasped=False)
    # What all are held against moves no more, whatever it was found with.
    cases = [Case(wires, k) for k in range(count)]
    rows: list[Any] = [[ours(case, float(tolerance)) for case in cases] for tolerance in arguments[1:]]
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
