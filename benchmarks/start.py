"""How long a script waits before its first line of work: imports and first solves, each in a fresh interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from benchmarks.figures import figure
from benchmarks.timing import compare

ABOUT = """\
Whole processes, from their start to their end. The first solve is that of three linked wires; "first ever" compiles
all kernels of it, as the first run after an installation does, and says so on standard error."""
IMPORTS = {
    "bare interpreter": "pass",
    "import assembly": "import assembly",
    "surfaces, kernels included": "import assembly; assembly.NurbsSurface",
    "numba": "import numba",
    "casadi": "import casadi",
    "meshcat": "import meshcat",
}
SOLVE = """\
import assembly as asm
wire = asm.shapes.torus(1.0, 0.12)
first = asm.Body("first", wire, fixed=True)
second = asm.Body("second", wire, position=(0.9, 0.1, 0.0), quaternion=(0.7, 0.7, 0.1, 0.0))
third = asm.Body("third", wire, position=(0.5, 0.6, 0.5), quaternion=(0.8, 0.1, 0.6, 0.0))
scene = asm.Assembly([first, second, third])
scene.constrain(asm.Contact(first, second), asm.Contact(second, third), asm.Contact(first, third))
scene.minimize(asm.PointDistance(third.point(1.0, 0.0, 0.0), target=(1.5, 0.7, 0.2)))
assert scene.solve().success
"""


def start(code: str, environment: Mapping[str, str] | None = None) -> str:
    """Run code in a fresh interpreter; what it says on standard error.

    It may keep its byte code, as packages that are installed do.
    """
    variables = {**os.environ, **(environment or {})}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run([sys.executable, "-c", code], check=True, env=variables, stderr=subprocess.PIPE, text=True)
    return done.stderr


def run(quick: bool) -> dict[str, Any]:
    """One row an import; times are of the whole process, so subtract the bare interpreter's."""
    # A quick run leaves out what others take, and the surfaces, which the first solve needs as well.
    calls = {who: lambda code=code: start(code) for who, code in list(IMPORTS.items())[: 2 if quick else None]}
    repeats = 2 if quick else 11
    rows = compare(calls, repeats=repeats, duration=1e-3)
    # The first call is kept apart, and so is what it may compile.
    (solve,) = compare({"first solve": lambda: start(SOLVE)}, repeats=2 if quick else 7, duration=1e-3)
    seconds = {row["who"]: row["seconds"] for row in rows}
    figures = [
        figure("`import assembly`", "seconds", seconds["import assembly"] - seconds["bare interpreter"]),
        figure("first solve done, kernels cached", "seconds", solve["seconds"], reach=1.0),
    ]
    if not quick:
        with TemporaryDirectory() as folder:
            begin = perf_counter()
            said = start(SOLVE, {"NUMBA_CACHE_DIR": folder})
            spent = perf_counter() - begin
        figures.append(figure("first solve done, first ever", "seconds", spent, reach=15.0))
        figures.append(figure("of one first run, says that it compiles", "count", int("compil" in said), of=1, reach=1))
    return {"about": ABOUT, "rows": rows, "figures": figures}
