"""How long a script waits before its first line of work: imports and first solves, each in a fresh interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from tempfile import TemporaryDirectory
from time import time
from typing import Any

from benchmarks.figures import figure
from benchmarks.timing import compare

ABOUT = """\
Imports are whole processes, from their start to their end; first solves count from the start of the process to the end
of the solve, the least of some runs. "Installed" is a user's first run after an installation that compiled the kernels,
"nothing compiled" after one that did not: it compiles what the scene needs, and says so on standard error."""
# As if no installation had compiled kernels.
NOTHING_INSTALLED = "from assembly._kernel import folders\nfolders._installed = lambda: []\n"
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
FOUR_BAR = """\
import assembly as asm
ground = asm.Body("ground", fixed=True)
crank, rod, rocker = asm.Body("crank"), asm.Body("rod"), asm.Body("rocker")
linkage = asm.Assembly([ground, crank, rod, rocker])
linkage.constrain(
    asm.Revolute(ground.frame(), crank.frame(), "drive", angle=0.5),
    asm.Revolute(crank.frame(at=(2, 0, 0)), rod.frame(), "elbow"),
    asm.Revolute(rod.frame(at=(5, 0, 0)), rocker.frame(at=(4, 0, 0)), "wrist"),
    asm.Revolute(ground.frame(at=(6, 0, 0)), rocker.frame(), "swing"),
)
assert linkage.solve().success
"""


def start(code: str, environment: Mapping[str, str] | None = None) -> tuple[str, str]:
    """Run code in a fresh interpreter; what it prints, and what it says on standard error.

    It may keep its byte code, as packages that are installed do.
    """
    variables = {**os.environ, **(environment or {})}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run([sys.executable, "-c", code], check=True, env=variables, capture_output=True, text=True)
    return done.stdout, done.stderr


def until_solved(code: str, environment: Mapping[str, str] | None = None) -> tuple[float, str]:
    """Seconds from the start of a fresh interpreter to the end of a solve, and what it says on standard error."""
    begin = time()
    printed, said = start(code + "from time import time\nprint(time())", environment)
    return float(printed) - begin, said


def run(quick: bool) -> dict[str, Any]:
    """One row an import; times are of the whole process, so subtract the bare interpreter's."""
    # A quick run leaves out what others take.
    calls = {who: lambda code=code: start(code) for who, code in list(IMPORTS.items())[: 2 if quick else None]}
    rows = compare(calls, repeats=2 if quick else 11, duration=1e-3)
    seconds = {row["who"]: row["seconds"] for row in rows}
    until_solved(SOLVE)  # compiles what is missing
    cached = min(until_solved(SOLVE)[0] for _ in range(1 if quick else 20))
    figures = [
        figure("`import assembly`", "seconds", seconds["import assembly"] - seconds["bare interpreter"]),
        figure("three wires solved, kernels cached", "seconds", cached, reach=0.42),
    ]
    if not quick:
        with TemporaryDirectory() as folder:
            installed = min(until_solved(SOLVE, {"NUMBA_CACHE_DIR": folder})[0] for _ in range(5))
        figures.append(figure("three wires solved, kernels installed", "seconds", installed, reach=1.5))
        said = [_first_ever(figures, "three wires", SOLVE, 15.0), _first_ever(figures, "a four-bar", FOUR_BAR, 36.0)]
        told = sum("compil" in text for text in said)
        figures.append(figure("of two first runs, say that they compile", "count", told, of=2, reach=2))
    return {"about": ABOUT, "rows": rows, "figures": figures}


def _first_ever(figures: list[dict[str, Any]], what: str, code: str, reach: float) -> str:
    """Solve with an empty cache: one more figure, and what was said."""
    with TemporaryDirectory() as folder:
        spent, said = until_solved(NOTHING_INSTALLED + code, {"NUMBA_CACHE_DIR": folder})
    figures.append(figure(f"{what} solved, nothing compiled", "seconds", spent, reach=reach))
    return said
