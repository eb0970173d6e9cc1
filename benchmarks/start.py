"""How long a script waits before its first line of work: imports, each in a fresh interpreter."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

from benchmarks.timing import compare

IMPORTS = {
    "bare interpreter": "pass",
    "import assembly": "import assembly",
    "surfaces, kernels included": "import assembly; assembly.NurbsSurface",
    "numba": "import numba",
    "casadi": "import casadi",
    "meshcat": "import meshcat",
}


def run(quick: bool) -> dict[str, Any]:
    """One row an import; times are of the whole process, so subtract the bare interpreter's."""

    def start(code: str) -> None:
        subprocess.run([sys.executable, "-c", code], check=True)

    calls = {who: lambda code=code: start(code) for who, code in IMPORTS.items()}
    return {"rows": compare(calls, repeats=2 if quick else 11, duration=1e-3)}
